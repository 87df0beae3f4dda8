#include "posix_pack.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "controller.h"
#include "packs.h"

static uint8_t *read_whole(const char *file, uint32_t *length)
{
    FILE *in = fopen(file, "rb");
    uint8_t *bytes = 0;
    long size = -1;
    if (in && fseek(in, 0, SEEK_END) == 0) size = ftell(in);
    if (in && size > 0 && fseek(in, 0, SEEK_SET) == 0 && (bytes = malloc((size_t)size)) != 0) {
        *length = (uint32_t)fread(bytes, 1, (size_t)size, in);
    }
    if (in) fclose(in);
    return bytes;
}

int play_pack(const char *file, const char *name, void (*sample)(void))
{
    dw_pack pack;
    dw_pack_entry entry;
    uint32_t length = 0;
    uint8_t *bytes = read_whole(file, &length);
    const char *why = 0;
    dw_init();
    if (!bytes || !dw_pack_open(&pack, bytes, length) || !dw_pack_whole(&pack)) why = "is no whole pack";
    else if (!dw_pack_find(&pack, name, (uint32_t)strlen(name), &entry)) why = "has no icon of this name";
    else if (!dw_pack_play(&pack, &entry)) why = "is for another grid";
    while (!why && dw_pack_poll()) sample();
    if (!why && !dw_pack_played()) why = "holds what this controller refuses";
    if (why) fprintf(stderr, "%s %s: the pack %s\n", file, name, why);
    free(bytes);
    return !why;
}

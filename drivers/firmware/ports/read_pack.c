/* Says what packs hold, entry by entry and frame by frame. For tests and the curious.
 *
 *     read_pack FILE...       each is read whole; ends with 0 when all of them are packs, 1 when one is not or is damaged
 */
#include <stdio.h>
#include <stdlib.h>

#include "dotwave_pack.h"

static int frames(const dw_pack *pack, const dw_pack_entry *entry)
{
    dw_pack_frame frame;
    dw_pack_part part;
    int whole = 1;
    for (uint32_t i = 0; dw_pack_frame_at(pack, entry, i, &frame); i++) {
        uint32_t parts = 0, pieces = 0, sum = 0;
        for (uint32_t row = 0; row < pack->rows; row++)
            for (uint32_t k = 0; dw_pack_part_at(pack, &frame, row, k, &part, &whole); k++) {
                parts++;
                pieces += part.pieces;
                for (uint32_t b = 0; b < part.pieces * part.size; b++) sum += part.first[b];
                if (part.place != DW_PACK_LINKS) sum += dw_pack_channel(pack, row, part.place);
            }
        printf("  %lu %lu %lu %lu %lu\n", (unsigned long)frame.settled, (unsigned long)frame.samples, (unsigned long)parts,
               (unsigned long)pieces, (unsigned long)sum);
    }
    return whole;
}

static int entries(const dw_pack *pack)
{
    dw_pack_entry entry, found;
    int whole = 1;
    for (uint32_t i = 0; i < pack->entries; i++) {
        if (!dw_pack_at(pack, i, &entry)) return 0;
        whole &= dw_pack_find(pack, (const char *)entry.name, entry.name_length, &found);
        printf("%.*s|%.*s|%lx|", (int)entry.name_length, (const char *)entry.name, (int)entry.spoken_length,
               (const char *)entry.spoken, (unsigned long)entry.code_point);
        for (uint32_t k = 0; k < (uint32_t)pack->rows * pack->cols; k++) printf("%u ", entry.pattern[k]);
        printf("\n");
        whole &= frames(pack, &entry);
    }
    return whole;
}

static int read_one(const char *name)
{
    FILE *in = fopen(name, "rb");
    uint8_t *bytes = 0;
    long length = -1;
    dw_pack pack;
    int whole = 0;
    if (!in) return 0;
    if (fseek(in, 0, SEEK_END) == 0) length = ftell(in);
    /* No byte more than there is, so that a sanitizer sees the first that is read beyond. */
    if (length > 0 && fseek(in, 0, SEEK_SET) == 0) bytes = malloc((size_t)length);
    if (bytes && fread(bytes, 1, (size_t)length, in) == (size_t)length)
        whole = dw_pack_open(&pack, bytes, (uint32_t)length) && entries(&pack) && dw_pack_whole(&pack);
    free(bytes);
    fclose(in);
    return whole;
}

int main(int argc, char **argv)
{
    int whole = 1;
    for (int i = 1; i < argc; i++) whole &= read_one(argv[i]);
    return !whole;
}

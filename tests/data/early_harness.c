/* A controller's receiving end: reads the wire from stdin, a line of bytes with a zero after every packet. After each
 * ordered packet it writes u32 awaited, u32 kept, u8 whether it was thrown away, and u32 count of packets carried out
 * with the CRC of each payload. MARK packets are carried out; STOP clears. */
#include <stdio.h>
#include <stdlib.h>

#include "dotwave_early.h"

static void put(uint32_t value)
{
    uint8_t bytes[4];
    dw_put32(bytes, value);
    fwrite(bytes, 1, 4, stdout);
}

int main(void)
{
    /* On the heap, so that the sanitizer sees every byte past the end. */
    dw_decoder *in = calloc(1, sizeof *in);
    dw_early *early = calloc(1, sizeof *early);
    uint32_t next = 1, done[DW_EARLY + 1];
    int byte;
    if (!in || !early) return 4;
    while ((byte = getchar()) != EOF) {
        dw_packet packet;
        uint32_t count = 0;
        int thrown = 0;
        if (!dw_feed(in, (uint8_t)byte)) continue;
        packet = in->packet;
        if (packet.kind == DW_STOP) {
            dw_early_clear(early);
            continue;
        }
        if (packet.number == next) {
            do {
                done[count++] = dw_crc32(packet.payload, packet.length);
                next++;
            } while (dw_early_take(early, next, &packet));
        } else if (packet.number > next) {
            thrown = !dw_early_keep(early, &packet, next);
        }
        put(next);
        put(dw_early_kept(early, next));
        putchar(thrown);
        put(count);
        for (uint32_t i = 0; i < count; i++) put(done[i]);
    }
    free(in);
    free(early);
    return 0;
}

/* What dotwave_live.h makes of START, keys and KEYED, for the tests: packets in, numbers and packets out. */
#include <stdio.h>

#include "dotwave_live.h"

static void out32(uint32_t value)
{
    uint8_t bytes[4];
    dw_put32(bytes, value);
    fwrite(bytes, 1, 4, stdout);
}

int main(void)
{
    static dw_decoder in;
    dw_keys keys = {0};
    uint8_t payload[DW_KEYS_MOST], wire[DW_MAX_WIRE];
    int byte, number = 0;
    while ((byte = getchar()) != EOF) {
        if (!dw_feed(&in, (uint8_t)byte)) continue;
        if (in.packet.kind == DW_START) {
            int fits = dw_start_fits(&in.packet);
            out32((uint32_t)fits);
            out32(fits ? dw_enough(&in.packet, 2001u) : 0u);
        } else if (in.packet.kind == DW_HEARTBEAT) {
            /* A key goes down or up; all that waits is told. */
            number++;
            out32((uint32_t)dw_press(&keys, (uint16_t)(number % 2 ? number : (int)DW_KEY_CELL + number), number % 3 != 0));
            fwrite(wire, 1, dw_encode(wire, DW_KEY, 0, payload, dw_keys_payload(&keys, payload)), stdout);
        } else if (in.packet.kind == DW_KEYED) {
            dw_keyed(&keys, &in.packet);
            out32(keys.count);
        } else if (in.packet.kind == DW_HELLO) {
            dw_keys_clear(&keys);
            out32(dw_keys_payload(&keys, payload));
        }
    }
    return 0;
}

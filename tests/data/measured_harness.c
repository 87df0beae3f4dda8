/* A controller that measures: reads a MEASURE as a packet from stdin, a zero behind it, then u32 rows, u32 cols and
 * f32 samples, row by row, of each of which it takes the window; writes the MEASURED on the wire, its constants before. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "dotwave_measured.h"

static void put(uint32_t value)
{
    uint8_t bytes[4];
    dw_put32(bytes, value);
    fwrite(bytes, 1, 4, stdout);
}

static uint32_t get(void)
{
    uint8_t bytes[4];
    if (fread(bytes, 1, 4, stdin) != 4) exit(5);
    return dw_u32(bytes);
}

int main(void)
{
    static dw_decoder in;
    static uint8_t wire[DW_MAX_WIRE];
    dw_measure ask;
    uint32_t rows, cols, count;
    dw_window *windows;
    uint8_t *payload, bytes[4];
    put(DW_MEASURES);
    put(DW_MEASURE_HEAD);
    put(DW_MEASURED_HEAD);
    put(DW_MEASURED_EACH);
    put(DW_MEASURED_MOST);
    do {
        int byte = getchar();
        if (byte == EOF) return 3;
        if (dw_feed(&in, (uint8_t)byte)) break;
    } while (1);
    if (!dw_read_measure(&in.packet, &ask)) return 2;
    rows = get();
    cols = get();
    count = rows * cols;
    /* On the heap and of the exact size, so that the sanitizer sees every byte past it. */
    windows = calloc(count, sizeof *windows);
    payload = calloc(1, DW_MEASURED_HEAD + count * DW_MEASURED_EACH);
    if (!windows || !payload) return 4;
    for (uint32_t k = 0; k < ask.samples; k++)
        for (uint32_t i = 0; i < count; i++) {
            double phase = (double)(dw_turns(&ask, i / cols) * (ask.at + k)) * 6.283185307179586 / 18446744073709551616.0;
            uint32_t bits = get();
            dw_put32(bytes, bits);
            double place = 6.283185307179586 * (k + 0.5) / ask.samples;
            dw_sense(&windows[i], dw_f32(bytes), (float)cos(phase), (float)sin(phase), (float)cos(place), (float)sin(place));
        }
    dw_begin_measured(payload, 7, ask.frame, 0);
    for (uint32_t i = 0; i < count; i++) dw_put_measured(payload, i, dw_fit(&windows[i], dw_turns(&ask, i / cols) != 0));
    fwrite(wire, 1, dw_encode(wire, DW_MEASURED, 0, payload, DW_MEASURED_HEAD + count * DW_MEASURED_EACH), stdout);
    free(windows);
    free(payload);
    return 0;
}

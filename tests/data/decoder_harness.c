/* Reads cases from stdin (u32 length, bytes), feeds each to a fresh decoder with a zero after it, and writes for each
 * the packets found: u8 1, kind, u32 number, u32 length, payload, and the same packet encoded again (u32, bytes);
 * then u8 0 and u32 bad. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "dotwave_decoder.h"

static void put(uint32_t value)
{
    uint8_t bytes[4];
    dw_put32(bytes, value);
    fwrite(bytes, 1, 4, stdout);
}

static void report(const dw_packet *packet)
{
    static uint8_t wire[DW_MAX_WIRE];
    uint32_t length = dw_encode(wire, packet->kind, packet->number, packet->payload, packet->length);
    putchar(1);
    putchar(packet->kind);
    put(packet->number);
    put(packet->length);
    fwrite(packet->payload, 1, packet->length, stdout);
    put(length);
    fwrite(wire, 1, length, stdout);
}

int main(void)
{
    uint8_t size[8], check[8];
    dw_put64(size, 0x8000000180000001u);
    dw_put16(check, 0x8001u);
    if (dw_u64(size) != 0x8000000180000001u || dw_i16(check) != -32767) return 2;
    dw_put32(check, 0x3f800000u);
    if (dw_f32(check) != 1.0f) return 3;
    while (fread(size, 1, 4, stdin) == 4) {
        /* On the heap and of the exact size, so that the sanitizer sees every byte read past it. */
        uint32_t length = dw_u32(size);
        uint8_t *bytes = malloc(length ? length : 1);
        dw_decoder *decoder = calloc(1, sizeof *decoder);
        if (!bytes || !decoder || fread(bytes, 1, length, stdin) != length) return 4;
        for (uint32_t i = 0; i < length; i++)
            if (dw_feed(decoder, bytes[i])) report(&decoder->packet);
        if (dw_feed(decoder, 0)) report(&decoder->packet);
        putchar(0);
        put(decoder->bad);
        free(bytes);
        free(decoder);
    }
    return 0;
}

/* What goes out while a session plays, as bytes: {u64 sample of the session, links of all rows u16 ..., codes i16 ...}. */
#ifndef DOTWAVE_VECTORS_H
#define DOTWAVE_VECTORS_H

#include <string.h>

#include "config.h"
#include "dotwave_decoder.h"
#include "playout.h"

#define VECTOR_BYTES (8u + 2u * DW_ROWS * DW_LINKS + 2u * DW_CHANNELS)

static uint16_t vector_links[DW_ROWS][DW_LINKS];
static uint64_t vector_played;

/* For board_links. */
static inline void vector_keep(uint32_t row, const uint16_t *codes)
{
    memcpy(vector_links[row], codes, sizeof vector_links[row]);
}

/* For board_write; 0 while nothing plays, and with the last zero before it goes on. */
static inline int vector_put(uint8_t *bytes, const int16_t *codes)
{
    uint8_t *p = bytes + 8;
    int moved = dw_out.played != vector_played;
    vector_played = dw_out.played;
    if (!moved || dw_out.state != DW_PLAYING) return 0;
    dw_put64(bytes, dw_out.played - 1u);
    for (uint32_t row = 0; row < DW_ROWS; row++)
        for (uint32_t i = 0; i < DW_LINKS; i++, p += 2) dw_put16(p, vector_links[row][i]);
    for (uint32_t i = 0; i < DW_CHANNELS; i++, p += 2) dw_put16(p, (uint16_t)codes[i]);
    return 1;
}

#endif

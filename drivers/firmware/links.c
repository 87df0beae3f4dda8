#include "links.h"

#include <string.h>

#include "board.h"
#include "whole.h"

#define FINE 32 /* bits of a fraction of a code */

typedef struct {
    int64_t at[DW_LINKS], by[DW_LINKS];
    uint32_t left;
    uint32_t end[DW_LINKS]; /* codes / 2^16 */
    uint16_t told[DW_LINKS];
} row_links;

static row_links rows[DW_ROWS];

static void tell(uint32_t row)
{
    row_links *r = &rows[row];
    uint16_t codes[DW_LINKS];
    for (uint32_t i = 0; i < DW_LINKS; i++)
        codes[i] = (uint16_t)((uint64_t)(r->at[i] + ((int64_t)1 << (FINE - 1))) >> FINE);
    if (memcmp(codes, r->told, sizeof codes) == 0) return;
    memcpy(r->told, codes, sizeof codes);
    board_links(row, codes);
}

static void stand(row_links *r)
{
    for (uint32_t i = 0; i < DW_LINKS; i++) r->at[i] = (int64_t)r->end[i] << (FINE - 16);
    r->left = 0;
}

void dw_links_zero(void)
{
    for (uint32_t row = 0; row < DW_ROWS; row++) {
        memset(rows[row].end, 0, sizeof rows[row].end);
        stand(&rows[row]);
    }
}

void dw_links_init(void)
{
    dw_links_zero();
    for (uint32_t row = 0; row < DW_ROWS; row++) {
        memset(rows[row].told, 0, sizeof rows[row].told);
        board_links(row, rows[row].told);
    }
}

void dw_links_stay(void)
{
    for (uint32_t row = 0; row < DW_ROWS; row++) rows[row].left = 0;
}

void dw_links_glide(uint32_t row, uint32_t ramp, const uint32_t *codes)
{
    row_links *r = &rows[row];
    uint64_t share = dw_share_of(ramp);
    memcpy(r->end, codes, sizeof r->end);
    r->left = ramp;
    if (!ramp) {
        stand(r);
        return;
    }
    for (uint32_t i = 0; i < DW_LINKS; i++)
        r->by[i] = dw_part_of(((int64_t)codes[i] << (FINE - 16)) - r->at[i], share);
}

void dw_links_tell(void)
{
    for (uint32_t row = 0; row < DW_ROWS; row++) tell(row);
}

void dw_links_step(void)
{
    for (uint32_t row = 0; row < DW_ROWS; row++) {
        row_links *r = &rows[row];
        tell(row);
        if (!r->left) continue;
        for (uint32_t i = 0; i < DW_LINKS; i++) r->at[i] += r->by[i];
        if (--r->left == 0) stand(r);
    }
}

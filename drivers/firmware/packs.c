#include "packs.h"

#include <string.h>

#include "board.h"
#include "playout.h"
#include "session.h"

/* What can sound or move at a time: see DW_VOICES; a row's links are one more. */
#define PARTS_MOST (DW_VOICES + DW_ROWS)
#define LINKS_SIZE (14u + 4u * DW_LINKS)
#define ENVELOPE_SIZE 54u

/* A part of the present frame, and how far it is. */
typedef struct {
    const uint8_t *next;
    uint64_t turns;
    uint32_t left, size;
    uint16_t index; /* row or channel */
    uint8_t links;
} cursor;

static dw_pack pack;
static dw_pack_entry entry;
static dw_pack_frame frame;
static cursor cursors[PARTS_MOST];
static uint32_t parts, next_frame;
static uint64_t frame_at;
static uint8_t playing, told, whole;

static int refused(void)
{
    playing = 0;
    dw_hold(DW_STOPPED);
    return 0;
}

static int carried_out(uint8_t kind, const uint8_t *payload, uint32_t length)
{
    dw_packet packet = {kind, 0, payload, length};
    dw_text why;
    why.length = 0;
    return dw_carry_out(&packet, &why) ? 1 : refused();
}

/* The parts of the next frame that has some. */
static int begin_frame(void)
{
    int intact = 1;
    dw_pack_part part;
    frame_at += frame.samples;
    parts = 0;
    if (!dw_pack_frame_at(&pack, &entry, next_frame++, &frame)) return 0;
    for (uint32_t row = 0; row < DW_ROWS; row++)
        for (uint32_t i = 0; dw_pack_part_at(&pack, &frame, row, i, &part, &intact); i++) {
            cursor *c = &cursors[parts];
            if (parts++ == PARTS_MOST) return refused();
            c->next = part.first;
            c->turns = part.turns;
            c->left = part.pieces;
            c->size = part.size;
            c->links = part.place == DW_PACK_LINKS;
            c->index = c->links ? (uint16_t)row : dw_pack_channel(&pack, row, part.place);
        }
    return intact ? 1 : refused();
}

/* The part whose next piece comes first; 0 when none has one within the frame. */
static cursor *earliest(void)
{
    cursor *first = 0;
    for (uint32_t i = 0; i < parts; i++) {
        cursor *c = &cursors[i];
        if (!c->left || dw_u32(c->next) >= frame.samples) continue;
        if (!first || dw_u32(c->next) < dw_u32(first->next)) first = c;
    }
    return first;
}

/* The length of the payload. */
static uint32_t put_points(uint8_t *p, const cursor *c)
{
    uint32_t standing = dw_u32(c->next + 4) == 0, each = c->turns ? 8u : 4u;
    for (uint32_t i = standing ? 3u : 0u; i < 4u; i++, p += 8) {
        const uint8_t *point = c->next + 8u + each * i;
        memcpy(p, point, 4);
        if (c->turns) memcpy(p + 4, point + 4, 4);
        else dw_put32(p + 4, 0);
    }
    return standing ? 30u : ENVELOPE_SIZE;
}

static int tell(cursor *c)
{
    uint8_t p[LINKS_SIZE > ENVELOPE_SIZE ? LINKS_SIZE : ENVELOPE_SIZE];
    uint32_t length = LINKS_SIZE;
    dw_put64(p, frame_at + dw_u32(c->next));
    dw_put16(p + 8, c->index);
    dw_put32(p + 10, dw_u32(c->next + 4));
    if (c->links) {
        memcpy(p + 14, c->next + 8, 4u * DW_LINKS);
    } else {
        dw_put64(p + 14, c->turns);
        length = put_points(p + 22, c);
    }
    c->next += c->size;
    c->left--;
    return carried_out(c->links ? DW_LINKS_TO : DW_ENVELOPE, p, length);
}

static uint64_t samples_of(const dw_pack *of, const dw_pack_entry *in)
{
    uint64_t samples = 0;
    dw_pack_frame one;
    for (uint32_t i = 0; dw_pack_frame_at(of, in, i, &one); i++) samples += one.samples;
    return samples;
}

int dw_pack_play(const dw_pack *of, const dw_pack_entry *in)
{
    uint64_t samples = samples_of(of, in);
    if (of->rows != DW_ROWS || of->cols != DW_COLS || of->channels != DW_CHANNELS || of->rate_hz != DW_RATE_HZ) return 0;
    if (!samples) return 0;
    pack = *of;
    entry = *in;
    frame.samples = next_frame = parts = 0;
    frame_at = 0;
    board_lock();
    dw_heard();
    dw_now.session = 0;
    dw_begin(samples, 1, 0);
    board_unlock();
    playing = 1;
    told = whole = 0;
    return 1;
}

/* One piece, the next frame, or the end; 0 when there is no room for more, or nothing more to tell. */
static int go_on(void)
{
    uint8_t total[8];
    cursor *c;
    if (!playing || told || dw_events_waiting() == DW_EVENT_SLOTS) return 0;
    c = earliest();
    if (c) return tell(c);
    if (begin_frame()) return 1;
    if (!playing) return 0;
    dw_put64(total, dw_out.total);
    told = (uint8_t)carried_out(DW_END, total, sizeof total);
    return 0;
}

int dw_pack_poll(void)
{
    int more = playing;
    /* The interrupt is locked away for one piece at a time. */
    while (more) {
        board_lock();
        dw_heard();
        if (dw_now.session || dw_out.state == DW_STOPPED) playing = 0;
        more = go_on();
        board_unlock();
    }
    board_lock();
    if (playing) dw_start_if_ready();
    if (playing && dw_out.state == DW_DONE) {
        playing = 0;
        whole = 1;
    }
    board_unlock();
    return playing;
}

int dw_pack_played(void)
{
    return whole;
}

void dw_pack_stop(void)
{
    board_lock();
    if (playing) refused();
    board_unlock();
}

#include "controller.h"

#include <string.h>

#include "board.h"
#include "dotwave_decoder.h"
#include "dotwave_early.h"
#include "dotwave_live.h"
#include "playout.h"
#include "session.h"

#define VERSION 6u
#define KEYS_SINCE 4u
#define KEYS_EVERY_US 50000u
#define ACK_EVERY_US 20000u
#define LONGEST_REPLY 256u /* no packet of a controller that does not measure is longer on the line */

static dw_decoder line;
static dw_early early;
static uint8_t version, gap, ack_due;
static uint64_t acked_at, keys_due_at;
static dw_keys keys;

void dw_init(void)
{
    memset(&line, 0, sizeof line);
    dw_early_clear(&early);
    memset(&keys, 0, sizeof keys);
    memset(&dw_now, 0, sizeof dw_now);
    version = 1;
    gap = ack_due = 0;
    acked_at = board_clock_us();
    dw_playout_init();
}

static void reply(uint8_t kind, const uint8_t *payload, uint32_t length)
{
    static uint8_t wire[LONGEST_REPLY];
    uint32_t size = dw_encode(wire, kind, 0, payload, length);
    if (!size || size > LONGEST_REPLY) board_halt();
    else board_send(wire, size);
}

static void put_f32(uint8_t *p, float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    dw_put32(p, bits);
}

static void tell_capabilities(void)
{
    static const char name[] = DW_NAME;
    uint8_t p[45 + 1 + sizeof name];
    uint32_t length = 45;
    dw_put16(p, version);
    dw_put16(p + 2, DW_ROWS);
    dw_put16(p + 4, DW_COLS);
    dw_put16(p + 6, DW_CHANNELS);
    dw_put32(p + 8, DW_RATE_HZ);
    p[12] = 16;
    dw_put32(p + 13, DW_BUFFER_SAMPLES);
    dw_put16(p + 17, DW_EVENT_SLOTS);
    dw_put16(p + 19, DW_MAX_PAYLOAD);
    put_f32(p + 21, DW_FULL_VOLTS);
    put_f32(p + 25, DW_LAM_STEP);
    put_f32(p + 29, DW_LAM_MAX);
    dw_put16(p + 33, DW_WATCHDOG_MS);
    dw_put16(p + 35, DW_RAMP_MS);
    dw_put32(p + 37, dw_now.session);
    dw_put32(p + 41, dw_now.session ? dw_now.next : 0);
    if (version >= 3u) p[length++] = 0;
    memcpy(p + length, name, sizeof name - 1u);
    reply(DW_CAPABILITIES, p, length + (uint32_t)sizeof name - 1u);
}

static void tell_ack(uint64_t now_us)
{
    uint8_t p[62];
    board_lock();
    dw_put32(p, dw_now.session);
    dw_put32(p + 4, dw_now.session ? dw_now.next : 0);
    dw_put64(p + 8, dw_out.played + DW_BUFFER_SAMPLES);
    dw_put32(p + 16, dw_out.events_done + DW_EVENT_SLOTS);
    dw_put64(p + 20, dw_out.received);
    dw_put64(p + 28, dw_out.played);
    p[36] = dw_out.state;
    p[37] = gap;
    dw_put32(p + 38, dw_out.underruns);
    dw_put32(p + 42, line.bad);
    dw_put32(p + 46, (uint32_t)((dw_out.held * 1000u + DW_RATE_HZ / 2u) / DW_RATE_HZ));
    board_unlock();
    dw_put64(p + 50, now_us);
    dw_put32(p + 58, dw_early_kept(&early, dw_now.next));
    reply(DW_ACK, p, version > 1u ? 62u : 58u);
    gap = ack_due = 0;
    acked_at = now_us;
}

static void tell_refused(uint32_t number, const dw_text *why)
{
    uint8_t p[4 + DW_TEXT_MOST];
    dw_put32(p, number);
    memcpy(p + 4, why->bytes, why->length);
    reply(DW_REFUSED, p, 4u + why->length);
}

static void tell_marked(void)
{
    dw_marked marked;
    int more = 1;
    while (more) {
        uint8_t p[20];
        board_lock();
        more = dw_take_marked(&marked);
        board_unlock();
        if (!more) return;
        dw_put32(p, marked.frame);
        dw_put64(p + 4, marked.at);
        dw_put64(p + 12, marked.clock_us);
        reply(DW_MARKED, p, sizeof p);
    }
}

/* Refused: the output ramps to zero, and only a new session helps. */
static void refuse(uint32_t number, const dw_text *why)
{
    dw_hold(DW_STOPPED);
    dw_early_clear(&early);
    tell_refused(number, why);
}

static int tried(const dw_packet *packet)
{
    dw_text why;
    int done;
    why.length = 0;
    board_lock();
    done = packet->kind == DW_START ? dw_begin_session(packet, &why) : dw_carry_out(packet, &why);
    if (!done) refuse(packet->number, &why);
    board_unlock();
    if (done) dw_now.next = packet->number + 1u;
    return done;
}

static void take_start(const dw_packet *packet)
{
    uint32_t session = dw_u32(packet->payload);
    if (!dw_start_fits(packet) || packet->number != 0 || session == 0 || session == dw_now.session) return;
    if (tried(packet)) dw_early_clear(&early);
}

static void take_ordered(const dw_packet *packet)
{
    dw_packet due = *packet;
    if (!dw_now.session || packet->number > dw_now.next) {
        if (!dw_now.session || version < 2u || !dw_early_keep(&early, packet, dw_now.next)) gap = 1;
        return;
    }
    if (packet->number < dw_now.next) return;
    while (tried(&due) && dw_early_take(&early, dw_now.next, &due)) {
    }
}

static void stop(void)
{
    board_lock();
    dw_hold(DW_STOPPED);
    dw_clear();
    board_unlock();
    dw_early_clear(&early);
    dw_now.session = 0;
}

static void take(const dw_packet *packet)
{
    board_lock();
    dw_heard();
    board_unlock();
    switch (packet->kind) {
    case DW_HELLO:
        version = (uint8_t)dw_u16(packet->payload);
        if (dw_u16(packet->payload) > VERSION) version = VERSION;
        if (version < 1u) version = 1;
        dw_keys_clear(&keys);
        tell_capabilities();
        return;
    case DW_KEYED: dw_keyed(&keys, packet); return;
    case DW_STOP: stop(); break;
    case DW_START: take_start(packet); break;
    case DW_STATUS:
    case DW_HEARTBEAT: break;
    case DW_COUPLING: case DW_BIAS: case DW_TONES: case DW_MARK: case DW_SAMPLES: case DW_END: case DW_MEASURE:
    case DW_ENVELOPE: case DW_LINKS_TO: take_ordered(packet); break;
    default: return; /* another controller's */
    }
    ack_due = 1;
}

/* A voice was wanted and none was free: the output is stopped already, and the host is told. */
static void tell_full(void)
{
    dw_text why;
    if (!dw_out.full) return;
    dw_out.full = 0;
    why.length = 0;
    dw_say(&why, "more sounds at a time than there is room for");
    board_lock();
    refuse(dw_now.next, &why);
    board_unlock();
}

void dw_key(uint16_t code, int down)
{
    if (version >= KEYS_SINCE && dw_press(&keys, code, down)) keys_due_at = board_clock_us();
}

static void tell_keys(uint64_t now_us)
{
    uint8_t p[DW_KEYS_MOST];
    uint32_t length = now_us >= keys_due_at ? dw_keys_payload(&keys, p) : 0;
    if (!length) return;
    reply(DW_KEY, p, length);
    keys_due_at = now_us + KEYS_EVERY_US;
}

void dw_poll(void)
{
    int byte;
    uint64_t now_us = board_clock_us();
    tell_marked();
    tell_full();
    for (uint32_t i = 0; i < DW_BYTES_AT_A_TIME && (byte = board_receive()) >= 0; i++)
        if (dw_feed(&line, (uint8_t)byte)) take(&line.packet);
    board_lock();
    dw_start_if_ready();
    board_unlock();
    tell_keys(now_us);
    if (dw_now.session && now_us - acked_at >= ACK_EVERY_US) ack_due = 1;
    if (ack_due) tell_ack(now_us);
}

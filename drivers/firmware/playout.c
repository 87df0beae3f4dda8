#include "playout.h"

#include <string.h>

#include "board.h"
#include "dotwave_decoder.h"
#include "links.h"

#define GAIN_BITS 30

dw_playout dw_out;

static dw_event events[DW_EVENT_SLOTS];
static uint32_t first_event, waiting;
#if DW_BUFFER_SAMPLES
static int16_t store[DW_BUFFER_SAMPLES][DW_CHANNELS];
static uint32_t store_read, store_write;
#endif
static dw_marked marks[DW_MARKS];
static uint32_t marks_read, marks_written;
static uint32_t enough;         /* samples in store to begin with */
static uint32_t silent_for;     /* samples since the host was heard */
static uint32_t gain, faded;    /* how far the ramps up and to zero are, samples */
static int16_t last[DW_CHANNELS], frozen[DW_CHANNELS];
static int32_t errors[DW_CHANNELS][2]; /* of rounding, the latest first */

void dw_playout_init(void)
{
    memset(&dw_out, 0, sizeof dw_out);
    memset(last, 0, sizeof last);
    memset(frozen, 0, sizeof frozen);
    dw_out.alive = 1;
    faded = DW_RAMP_SAMPLES;
    marks_read = marks_written = silent_for = 0;
    dw_links_init();
    dw_clear();
}

static void freeze(void)
{
    if (dw_out.state != DW_PLAYING) return;
    memcpy(frozen, last, sizeof frozen);
    faded = 0;
}

void dw_clear(void)
{
    freeze();
    dw_links_stay();
    dw_voices_clear();
    memset(errors, 0, sizeof errors);
    first_event = waiting = 0;
#if DW_BUFFER_SAMPLES
    store_read = store_write = 0;
#endif
    gain = DW_RAMP_SAMPLES;
    dw_out.total = dw_out.received = dw_out.played = dw_out.held = 0;
    dw_out.events_done = dw_out.underruns = 0;
    dw_out.ended = dw_out.parametric = dw_out.full = 0;
}

void dw_begin(uint64_t total, int parametric, uint32_t begin_with)
{
    dw_clear();
    dw_links_zero();
    enough = begin_with;
    dw_out.total = total;
    dw_out.parametric = (uint8_t)(parametric != 0);
    dw_out.state = DW_FILLING;
}

void dw_heard(void)
{
    dw_out.alive = 1;
    silent_for = 0;
}

void dw_hold(enum dw_state state)
{
    if (dw_out.state == DW_PLAYING) {
        freeze();
        gain = 0;
        dw_out.state = (uint8_t)state;
    } else if (state != DW_HELD) {
        dw_out.state = (uint8_t)state;
    }
}

void dw_end(uint64_t total)
{
    dw_out.total = total;
    dw_out.ended = 1;
    dw_start_if_ready();
}

static int at_zero(void)
{
    static const int16_t zero[DW_CHANNELS] = {0};
    return faded == DW_RAMP_SAMPLES || memcmp(frozen, zero, sizeof frozen) == 0;
}

void dw_start_if_ready(void)
{
    int ready = dw_out.ended || 2u * waiting >= DW_EVENT_SLOTS;
    if ((dw_out.state != DW_FILLING && dw_out.state != DW_HELD) || !dw_out.alive || !at_zero()) return;
    if (!dw_out.parametric && dw_out.received - dw_out.played >= enough) ready = 1;
    if (ready) dw_out.state = DW_PLAYING;
}

dw_event *dw_event_slot(void)
{
    return waiting < DW_EVENT_SLOTS ? &events[(first_event + waiting) % DW_EVENT_SLOTS] : 0;
}

void dw_event_add(void)
{
    waiting++;
    dw_start_if_ready();
}

uint32_t dw_events_waiting(void)
{
    return waiting;
}

uint64_t dw_last_event_at(void)
{
    return waiting ? events[(first_event + waiting - 1u) % DW_EVENT_SLOTS].at : dw_out.played;
}

void dw_push(const uint8_t *codes, uint32_t count)
{
#if DW_BUFFER_SAMPLES
    for (uint32_t i = 0; i < count; i++) {
        for (uint32_t channel = 0; channel < DW_CHANNELS; channel++, codes += 2)
            store[store_write][channel] = dw_i16(codes);
        store_write = store_write + 1u < DW_BUFFER_SAMPLES ? store_write + 1u : 0;
    }
#else
    (void)codes;
#endif
    dw_out.received += count;
    dw_start_if_ready();
}

int dw_take_marked(dw_marked *marked)
{
    if (marks_read == marks_written) return 0;
    *marked = marks[marks_read++ % DW_MARKS];
    return 1;
}

static void tell(const dw_event *event)
{
    dw_marked *mark = &marks[marks_written % DW_MARKS];
    if (marks_written - marks_read >= DW_MARKS) return; /* MARKED may be lost */
    mark->frame = event->what.frame;
    mark->at = event->at;
    mark->clock_us = board_clock_us();
    marks_written++;
}

static int carry_out(const dw_event *e)
{
    switch (e->kind) {
    case DW_COUPLING:
    case DW_LINKS_TO: dw_links_glide(e->index, e->ramp, e->what.links); return 1;
    case DW_BIAS: return dw_bias(e->at, e->index, e->ramp, e->what.bias);
    case DW_TONES: return dw_tones(e->at, e->index, e->ramp, e->what.tones, e->count);
    case DW_ENVELOPE: return dw_envelope(e->at, e->index, e->ramp, e->what.envelope.turns, e->what.envelope.points);
    default: tell(e); return 1;
    }
}

static void happen(void)
{
    while (waiting && events[first_event].at <= dw_out.played) {
        if (!carry_out(&events[first_event])) {
            dw_out.full = 1;
            dw_hold(DW_STOPPED);
            return;
        }
        first_event = first_event + 1u < DW_EVENT_SLOTS ? first_event + 1u : 0;
        waiting--;
        dw_out.events_done++;
    }
}

static int16_t clipped(int64_t code)
{
    return (int16_t)(code > 32767 ? 32767 : code < -32767 ? -32767 : code);
}

/* The nearest code; drives with second-order error feedback, whose noise lies high above what resonates. What is a
 * whole code stays as it is. */
static int16_t rounded(uint32_t channel, int64_t value)
{
    int32_t *e = errors[channel];
    int64_t wanted, code;
    if (value > DW_FULL) value = DW_FULL;
    if (value < -DW_FULL) value = -DW_FULL;
    if ((value & (DW_UNIT - 1)) == 0) e[0] = e[1] = 0;
    wanted = channel < DW_DRIVES ? value - 2 * (int64_t)e[0] + e[1] : value;
    code = wanted + DW_UNIT / 2;
    code = (code - (code & (DW_UNIT - 1))) / DW_UNIT;
    e[1] = e[0];
    e[0] = (int32_t)(code * DW_UNIT - wanted);
    return clipped(code);
}

static int64_t scaled(int64_t value, uint32_t part)
{
    int64_t share = (int64_t)part * (((int64_t)1 << GAIN_BITS) / (int64_t)(DW_RAMP_SAMPLES ? DW_RAMP_SAMPLES : 1u));
    return value * share / ((int64_t)1 << GAIN_BITS);
}

static void play_next(void)
{
    int64_t sum[DW_CHANNELS] = {0};
#if DW_BUFFER_SAMPLES
    if (!dw_out.parametric) {
        for (uint32_t channel = 0; channel < DW_CHANNELS; channel++)
            sum[channel] = (int64_t)store[store_read][channel] * DW_UNIT;
        store_read = store_read + 1u < DW_BUFFER_SAMPLES ? store_read + 1u : 0;
    }
#endif
    dw_voices_step(sum);
    for (uint32_t channel = 0; channel < DW_CHANNELS; channel++)
        last[channel] = rounded(channel, gain < DW_RAMP_SAMPLES ? scaled(sum[channel], gain) : sum[channel]);
    if (gain < DW_RAMP_SAMPLES) gain++;
    dw_out.played++;
}

static void play_ramp(void)
{
    if (faded < DW_RAMP_SAMPLES) faded++;
    for (uint32_t channel = 0; channel < DW_CHANNELS; channel++) {
        int64_t value = scaled((int64_t)frozen[channel] * DW_UNIT, DW_RAMP_SAMPLES - faded);
        last[channel] = (int16_t)((value + (value < 0 ? -DW_UNIT / 2 : DW_UNIT / 2)) / DW_UNIT);
    }
    if (dw_out.state == DW_HELD && dw_out.played) dw_out.held++;
}

static int nothing_left(void)
{
    if (dw_out.parametric) return dw_out.total && dw_out.played >= dw_out.total;
    return dw_out.received == dw_out.played;
}

static void run_dry(void)
{
    if (dw_out.ended && dw_out.played >= dw_out.total) {
        dw_hold(DW_DONE);
    } else {
        dw_out.underruns++;
        dw_hold(DW_HELD);
    }
}

void dw_play(void)
{
    /* The ramp begins so early that its end, not its beginning, falls on the watchdog time. */
    if (dw_out.alive && silent_for >= DW_SILENT_SAMPLES) {
        dw_out.alive = 0;
        dw_hold(DW_HELD);
    }
    if (silent_for < DW_SILENT_SAMPLES) silent_for++;
    if (dw_out.state == DW_PLAYING) happen();
    if (dw_out.state == DW_PLAYING && nothing_left()) run_dry();
    if (dw_out.state == DW_PLAYING) {
        play_next();
        dw_links_step();
    } else {
        play_ramp();
        dw_links_tell();
        dw_start_if_ready();
    }
    board_write(last);
}

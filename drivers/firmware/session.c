#include "session.h"

#include <string.h>

#include "dotwave_live.h"
#include "numbers.h"
#include "playout.h"

dw_session dw_now;

static int refused(dw_text *why, const char *words)
{
    dw_say(why, words);
    return 0;
}

static int refused_numbers(dw_text *why, const char *a, uint64_t b, const char *c, uint64_t d, const char *e)
{
    dw_say(why, a);
    dw_say_number(why, b);
    dw_say(why, c);
    dw_say_number(why, d);
    return refused(why, e);
}

int dw_begin_session(const dw_packet *packet, dw_text *why)
{
    uint32_t rate_hz = dw_u32(packet->payload + 5);
    if (rate_hz != DW_RATE_HZ)
        return refused_numbers(why, "the rate is ", DW_RATE_HZ, " Hz, not ", rate_hz, "");
    dw_begin(dw_u64(packet->payload + 9), packet->payload[4] & DW_PARAMETRIC, dw_enough(packet, DW_BUFFER_SAMPLES));
    dw_now.session = dw_u32(packet->payload);
    dw_now.events = 0;
    return 1;
}

static int take_samples(const dw_packet *packet, dw_text *why)
{
    uint64_t first = dw_u64(packet->payload), received = dw_out.received;
    uint32_t count = dw_u16(packet->payload + 8);
    const uint8_t *codes = packet->payload + 10;
    if (!count || packet->length - 10u != 2u * count * DW_CHANNELS)
        {
        dw_say(why, "samples must be a whole number of ");
        dw_say_number(why, DW_CHANNELS);
        return refused(why, " channels, and their count true");
    }
    if (dw_out.parametric || first != received)
        return refused_numbers(why, "samples from ", received, " on are wanted, not ", first, "");
    if (received + count > dw_out.played + DW_BUFFER_SAMPLES) return refused(why, "more samples than the credit allows");
    for (uint32_t i = 0; i < count * DW_CHANNELS; i++)
        if (dw_i16(codes + 2u * i) == -32768) return refused(why, "sample code -32768 is not used");
    dw_push(codes, count);
    return 1;
}

static int take_end(const dw_packet *packet, dw_text *why)
{
    uint64_t total = dw_u64(packet->payload), announced = dw_out.total ? dw_out.total : total;
    if (total != announced || (!dw_out.parametric && total != dw_out.received)) {
        refused_numbers(why, "the end at sample ", total, ", where ", dw_out.received, " of ");
        dw_say_number(why, announced);
        return refused(why, " are here");
    }
    dw_end(total);
    return 1;
}

/* Each reads what is behind `at` of its kind into the event; 0 when it does not fit the grid. */
static int coupling(const dw_packet *packet, dw_event *event)
{
    const uint8_t *p = packet->payload + 14;
    if (event->index >= DW_ROWS || packet->length != 14u + 2u * DW_LINKS) return 0;
    for (uint32_t i = 0; i < DW_LINKS; i++) {
        uint32_t code = dw_u16(p + 2u * i);
        if ((double)code * (double)DW_LAM_STEP > (double)DW_LAM_MAX * (1 + 1e-6)) return 0;
        event->what.links[i] = code << 16;
    }
    return 1;
}

/* The same, in floats. */
static int links_to(const dw_packet *packet, dw_event *event)
{
    const uint8_t *p = packet->payload + 14;
    if (event->index >= DW_ROWS || packet->length != 14u + 4u * DW_LINKS) return 0;
    for (uint32_t i = 0; i < DW_LINKS; i++) {
        double lam = (double)dw_f32(p + 4u * i), code = lam / (double)DW_LAM_STEP;
        if (!(lam >= 0 && lam <= (double)DW_LAM_MAX * (1 + 1e-6))) return 0;
        event->what.links[i] = code < 65535.0 ? (uint32_t)(code * 65536.0 + 0.5) : 0xffff0000u;
    }
    return 1;
}

static int fits(double volts)
{
    return volts <= (double)DW_FULL_VOLTS && volts >= -(double)DW_FULL_VOLTS;
}

static int bias(const dw_packet *packet, dw_event *event)
{
    float volts = dw_f32(packet->payload + 14);
    if (event->index >= DW_CHANNELS || !dw_finite(volts) || !fits((double)volts)) return 0;
    event->what.bias = dw_units(volts);
    return 1;
}

static int tones(const dw_packet *packet, dw_event *event)
{
    uint32_t count = (packet->length - 14u) / 12u;
    double sum = 0;
    if (event->index >= DW_CHANNELS) return 0;
    for (uint32_t i = 0; i < count; i++) {
        const uint8_t *p = packet->payload + 14 + 12u * i;
        float volts = dw_f32(p), hz = dw_f32(p + 4), phase = dw_f32(p + 8);
        if (!dw_finite(volts) || !dw_finite(hz) || !dw_finite(phase)) return 0;
        sum += (double)(volts < 0 ? -volts : volts);
        if (!fits(sum)) return 0;
        if (i >= DW_TONES_MOST) continue;
        event->what.tones[i].turns = dw_turns_of_hz(hz);
        event->what.tones[i].at = dw_phasor_of(volts, phase);
    }
    event->count = (uint8_t)(count < 255u ? count : 255u);
    return 1;
}

/* One point: it stands there. Four: the Bezier points of a cubic, which stays between them. */
static int envelope(const dw_packet *packet, dw_event *event)
{
    uint32_t count = (packet->length - 22u) / 8u;
    double most = (double)DW_FULL_VOLTS * (double)DW_FULL_VOLTS;
    int fits_ramp = count == 1u ? event->ramp == 0 : count == 4u && event->ramp > 0 && event->ramp <= DW_PIECE_MOST;
    if (event->index >= DW_CHANNELS || !fits_ramp) return 0;
    event->what.envelope.turns = dw_u64(packet->payload + 14);
    for (uint32_t i = 0; i < 4u; i++) {
        const uint8_t *p = packet->payload + 22 + (i < count ? 8u * i : 0);
        float re = dw_f32(p), im = dw_f32(p + 4);
        if (!dw_finite(re) || !dw_finite(im)) return 0;
        if (!((double)re * (double)re + (double)im * (double)im <= most)) return 0;
        event->what.envelope.points[i].re = dw_units(re);
        event->what.envelope.points[i].im = dw_units(im);
    }
    return 1;
}

static int checked(const dw_packet *packet, dw_event *event, dw_text *why)
{
    switch (packet->kind) {
    case DW_COUPLING:
        if (coupling(packet, event)) return 1;
        return refused_numbers(why, "coupling: rows 0..", DW_ROWS - 1u, ", ", DW_LINKS, " links of at most lam_max");
    case DW_LINKS_TO:
        if (links_to(packet, event)) return 1;
        return refused_numbers(why, "links: rows 0..", DW_ROWS - 1u, ", ", DW_LINKS, " links of 0 to lam_max");
    case DW_BIAS:
    case DW_TONES:
        if (packet->kind == DW_BIAS ? bias(packet, event) : tones(packet, event)) {
            if (packet->kind == DW_BIAS || event->count <= DW_TONES_MOST) return 1;
            return refused_numbers(why, "tones: ", event->count, ", where there is room for ", DW_TONES_MOST, "");
        }
        dw_say(why, "channels 0..");
        dw_say_number(why, DW_CHANNELS - 1u);
        return refused(why, ", at most full_volts in all");
    case DW_ENVELOPE:
        if (envelope(packet, event)) return 1;
        refused_numbers(why, "envelope: channels 0..", DW_CHANNELS - 1u, ", 1 point or 4 over 1 to ", DW_PIECE_MOST, " samples");
        return refused(why, ", at most full_volts");
    case DW_MEASURE: return refused(why, "this controller does not measure");
    default: return 1;
    }
}

static int take_event(const dw_packet *packet, dw_text *why)
{
    uint64_t at = dw_u64(packet->payload), last = dw_last_event_at();
    dw_event *event = dw_event_slot();
    if (at < last || at < dw_out.played) {
        dw_say(why, "an event at sample ");
        dw_say_number(why, at);
        return refused(why, " comes too late");
    }
    if (!event) return refused(why, "more events than the credit allows");
    memset(event, 0, sizeof *event);
    event->at = at;
    event->kind = packet->kind;
    if (packet->kind == DW_MARK) {
        event->what.frame = dw_u32(packet->payload + 8);
    } else {
        event->index = dw_u16(packet->payload + 8);
        event->ramp = dw_u32(packet->payload + 10);
    }
    if (!checked(packet, event, why)) return 0;
    dw_now.events++;
    dw_event_add();
    return 1;
}

int dw_carry_out(const dw_packet *packet, dw_text *why)
{
    if (dw_out.state == DW_STOPPED) return refused(why, "stopped after a refusal; begin a new session");
    if (packet->kind == DW_SAMPLES) return take_samples(packet, why);
    if (packet->kind == DW_END) return take_end(packet, why);
    return take_event(packet, why);
}

#include "voices.h"

#include <string.h>

#include "sine_table.h"
#include "whole.h"

#define FINE 30 /* further bits of a polynomial */

enum use { FREE, BIAS, TONE, FADING, ENVELOPE };

/* A cubic and its differences from a sample to the next; modulo 2^64, for only the value itself has to fit. */
typedef struct {
    uint64_t value, first, second, third;
} cubic;

typedef struct {
    cubic re, im;
    uint64_t phase, turns;
    dw_phasor end;
    uint32_t left; /* samples until it stands at `end` */
    uint16_t channel;
    uint8_t use;
} voice;

static voice voices[DW_VOICES];

static int64_t as_signed(uint64_t value)
{
    return value >> 63 ? -(int64_t)(~value) - 1 : (int64_t)value;
}

static int64_t floor_shift(int64_t value, uint32_t bits)
{
    return value >= 0 ? value >> bits : ~(~value >> bits);
}

static uint64_t raised(int64_t value)
{
    return (uint64_t)value << FINE;
}

static int32_t lowered(uint64_t value)
{
    return (int32_t)floor_shift(as_signed(value + ((uint64_t)1 << (FINE - 1))), FINE);
}

/* Bezier points to differences over pieces of `share` / 2^64 of the way. */
static cubic of_points(int32_t p0, int32_t p1, int32_t p2, int32_t p3, uint64_t share)
{
    int64_t one = 3 * ((int64_t)p1 - p0), two = 3 * ((int64_t)p0 - 2 * (int64_t)p1 + p2);
    int64_t three = (int64_t)p3 - 3 * (int64_t)p2 + 3 * (int64_t)p1 - p0;
    uint64_t h1 = (uint64_t)dw_part_of((int64_t)raised(one), share);
    uint64_t h2 = (uint64_t)dw_part_of(dw_part_of((int64_t)raised(two), share), share);
    uint64_t h3 = (uint64_t)dw_part_of(dw_part_of(dw_part_of((int64_t)raised(three), share), share), share);
    cubic c;
    c.value = raised(p0);
    c.first = h1 + h2 + h3;
    c.second = 2u * h2 + 6u * h3;
    c.third = 6u * h3;
    return c;
}

static cubic still(int32_t value)
{
    cubic c = {0, 0, 0, 0};
    c.value = raised(value);
    return c;
}

static void step(cubic *c)
{
    c->value += c->first;
    c->first += c->second;
    c->second += c->third;
}

static int32_t sine(uint32_t turn)
{
    uint32_t into = turn & 0x3fffffffu, index;
    int64_t low, high;
    int32_t wave;
    if (turn & 0x40000000u) into = 0x40000000u - into;
    index = into >> 21;
    low = dw_sine_table[index];
    high = dw_sine_table[index < 512u ? index + 1u : index];
    wave = (int32_t)(low + (((high - low) * (int64_t)(into & 0x1fffffu)) >> 21));
    return turn & 0x80000000u ? -wave : wave;
}

dw_phasor dw_turned(uint64_t phase)
{
    dw_phasor both;
    uint32_t turn = (uint32_t)(phase >> 32);
    both.re = sine(turn + 0x40000000u); /* the cosine is the sine a quarter later */
    both.im = sine(turn);
    return both;
}

void dw_voices_clear(void)
{
    memset(voices, 0, sizeof voices);
}

static voice *found(uint32_t channel, uint8_t use, uint64_t turns)
{
    for (uint32_t i = 0; i < DW_VOICES; i++)
        if (voices[i].use == use && voices[i].channel == channel && voices[i].turns == turns) return &voices[i];
    return 0;
}

static voice *begun(uint64_t now, uint32_t channel, uint8_t use, uint64_t turns)
{
    for (uint32_t i = 0; i < DW_VOICES; i++) {
        voice *v = &voices[i];
        if (v->use != FREE) continue;
        memset(v, 0, sizeof *v);
        v->use = use;
        v->channel = (uint16_t)channel;
        v->turns = turns;
        v->phase = turns * now;
        return v;
    }
    return 0;
}

static void stand(voice *v)
{
    v->left = 0;
    v->re = still(v->end.re);
    v->im = still(v->end.im);
    if (!v->end.re && !v->end.im) v->use = FREE;
}

static void along(voice *v, uint32_t ramp, const dw_phasor p[4])
{
    uint64_t share = dw_share_of(ramp);
    v->end = p[3];
    v->left = ramp;
    if (!ramp) {
        stand(v);
        return;
    }
    v->re = of_points(p[0].re, p[1].re, p[2].re, p[3].re, share);
    v->im = of_points(p[0].im, p[1].im, p[2].im, p[3].im, share);
}

static cubic line(uint64_t from, int32_t to, uint64_t share)
{
    cubic c = {0, 0, 0, 0};
    c.value = from;
    c.first = (uint64_t)dw_part_of((int64_t)raised(to) - as_signed(from), share);
    return c;
}

/* From where it is, straight to `end`. */
static void glide(voice *v, uint32_t ramp, dw_phasor end)
{
    uint64_t share = dw_share_of(ramp);
    v->end = end;
    v->left = ramp;
    if (!ramp) {
        stand(v);
        return;
    }
    v->re = line(v->re.value, end.re, share);
    v->im = line(v->im.value, end.im, share);
}

int dw_bias(uint64_t now, uint32_t channel, uint32_t ramp, int32_t value)
{
    dw_phasor end = {value, 0};
    voice *v = found(channel, BIAS, 0);
    if (!v) v = begun(now, channel, BIAS, 0);
    if (!v) return 0;
    glide(v, ramp, end);
    return 1;
}

int dw_tones(uint64_t now, uint32_t channel, uint32_t ramp, const dw_tone *tones, uint32_t count)
{
    static const dw_phasor silence = {0, 0};
    for (uint32_t i = 0; i < DW_VOICES; i++) {
        voice *v = &voices[i];
        if (v->channel != channel || (v->use != TONE && v->use != FADING)) continue;
        v->use = FADING;
        glide(v, ramp, silence);
    }
    for (uint32_t i = 0; i < count; i++) {
        voice *v = begun(now, channel, TONE, tones[i].turns);
        if (!v) return 0;
        glide(v, ramp, tones[i].at);
    }
    return 1;
}

int dw_envelope(uint64_t now, uint32_t channel, uint32_t ramp, uint64_t turns, const dw_phasor points[4])
{
    voice *v = found(channel, ENVELOPE, turns);
    if (!v) v = begun(now, channel, ENVELOPE, turns);
    if (!v) return 0;
    along(v, ramp, points);
    return 1;
}

void dw_voices_step(int64_t *sum)
{
    for (uint32_t i = 0; i < DW_VOICES; i++) {
        voice *v = &voices[i];
        int32_t re;
        if (v->use == FREE) continue;
        re = lowered(v->re.value);
        if (v->turns) {
            dw_phasor wave = dw_turned(v->phase);
            int64_t turned = (int64_t)re * wave.re - (int64_t)lowered(v->im.value) * wave.im;
            re = (int32_t)floor_shift(turned + ((int64_t)1 << 29), 30);
            v->phase += v->turns;
        }
        sum[v->channel] += re;
        if (v->left) {
            step(&v->re);
            if (v->turns) step(&v->im);
            if (--v->left == 0) stand(v);
        }
    }
}

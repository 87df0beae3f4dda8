/* Reference for measuring (see ../PROTOCOL.md, version 3): reads MEASURE, fits what is sensed, writes MEASURED.
 *
 * C99, no allocation, no library but <string.h>. One dw_window for each actuator that is measured, zero-initialised:
 *
 *     dw_measure ask;
 *     if (dw_read_measure(&in.packet, &ask)) begin(&ask);          // a MEASURE, checked for its length
 *     ...                                                          // for each sample k of the window:
 *     phase = dw_turns(&ask, row) * k;                             // 2^64 is a whole turn
 *     place = (k - ask.at + 0.5) / ask.samples;                    // turns: one from end to end of the window
 *     dw_sense(&window, u, cosine(phase), sine(phase), cosine(place), sine(place));
 *     ...                                                          // after its last sample:
 *     dw_begin_measured(payload, session, ask.frame, first);
 *     dw_put_measured(payload, i, dw_fit(&window, dw_turns(&ask, row) != 0));    // actuator first + i
 *     length = dw_encode(wire, DW_MEASURED, 0, payload, DW_MEASURED_HEAD + count * DW_MEASURED_EACH);
 */
#ifndef DOTWAVE_MEASURED_H
#define DOTWAVE_MEASURED_H

#include <string.h>

#include "dotwave_decoder.h"

#define DW_MEASURES 1u          /* bit of CAPABILITIES.flags */
#define DW_MEASURE_HEAD 16u     /* bytes before the phases */
#define DW_MEASURED_HEAD 10u    /* bytes before the numbers */
#define DW_MEASURED_EACH 24u    /* bytes of an actuator */
#define DW_MEASURED_MOST ((DW_MAX_PAYLOAD - DW_MEASURED_HEAD) / DW_MEASURED_EACH) /* actuators in one packet */

typedef struct {
    uint64_t at;
    uint32_t samples;
    uint32_t frame;
    uint32_t rows;         /* with a phase of their own */
    const uint8_t *turns;  /* in the packet: valid as long as it is */
} dw_measure;

typedef struct {
    float mean, real, imaginary, change_real, change_imaginary, rest;
} dw_fitted;

/* Sums over the samples of a window, weighted: of 1, cos and -sin with each other, and with what is sensed; of what is
 * sensed with itself; and of cos and -sin with what is sensed, by the slope of the weight. */
typedef struct {
    double n, c, s, cc, cs, ss, u, uc, us, uu, tc, ts;
} dw_window;

/* 1 when `packet` is a MEASURE with a phase for at least one row. */
static inline int dw_read_measure(const dw_packet *packet, dw_measure *ask)
{
    if (packet->kind != DW_MEASURE || packet->length < DW_MEASURE_HEAD + 8u) return 0;
    ask->at = dw_u64(packet->payload);
    ask->samples = dw_u32(packet->payload + 8);
    ask->frame = dw_u32(packet->payload + 12);
    ask->rows = (packet->length - DW_MEASURE_HEAD) / 8u;
    ask->turns = packet->payload + DW_MEASURE_HEAD;
    return 1;
}

/* The phase of `row` from a sample to the next; the last one counts for all further rows. */
static inline uint64_t dw_turns(const dw_measure *ask, uint32_t row)
{
    return dw_u64(ask->turns + 8u * (row < ask->rows ? row : ask->rows - 1u));
}

/* One sample: what is sensed, cosine and sine of the drive's phase, and those of its place in the window. */
static inline void dw_sense(dw_window *w, float u, float cosine, float sine, float place_cosine, float place_sine)
{
    double c = cosine, s = -(double)sine, weight = 0.5 - 0.5 * place_cosine, slope = 3.14159265358979 * place_sine;
    w->n += weight;
    w->c += weight * c;
    w->s += weight * s;
    w->cc += weight * c * c;
    w->cs += weight * c * s;
    w->ss += weight * s * s;
    w->u += weight * u;
    w->uc += weight * u * c;
    w->us += weight * u * s;
    w->uu += weight * u * u;
    w->tc += slope * u * c;
    w->ts += slope * u * s;
}

static inline float dw_nan(void)
{
    union { uint32_t bits; float value; } both;
    both.bits = 0x7fc00000u;
    return both.value;
}

/* What fits a window best; without `vibrates`, or where the window is too short to tell, the mean only. */
static inline dw_fitted dw_fit(const dw_window *w, int vibrates)
{
    dw_fitted fit;
    double n = w->n, mean, real, imaginary, rest, cc, cs, ss, uc, us, det;
    fit.mean = fit.real = fit.imaginary = fit.change_real = fit.change_imaginary = fit.rest = dw_nan();
    if (!(n > 0)) return fit;
    fit.mean = (float)(w->u / n);
    rest = (w->uu - w->u * w->u / n) / n;
    fit.rest = (float)(rest > 0 ? rest : 0);
    /* Deviations from the means leave two equations of two unknowns. */
    cc = w->cc - w->c * w->c / n;
    cs = w->cs - w->c * w->s / n;
    ss = w->ss - w->s * w->s / n;
    uc = w->uc - w->u * w->c / n;
    us = w->us - w->u * w->s / n;
    det = cc * ss - cs * cs;
    if (!vibrates || det <= 1e-9 * n * n) return fit;
    real = (uc * ss - us * cs) / det;
    imaginary = (us * cc - uc * cs) / det;
    mean = (w->u - w->c * real - w->s * imaginary) / n;
    rest = (w->uu - mean * w->u - real * w->uc - imaginary * w->us) / n;
    fit.real = (float)real;
    fit.imaginary = (float)imaginary;
    fit.mean = (float)mean;
    fit.change_real = (float)(-2 * w->tc / n);
    fit.change_imaginary = (float)(-2 * w->ts / n);
    fit.rest = (float)(rest > 0 ? rest : 0);
    return fit;
}

static inline void dw_put_f32(uint8_t *p, float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    dw_put32(p, bits);
}

static inline void dw_begin_measured(uint8_t *payload, uint32_t session, uint32_t frame, uint16_t first)
{
    dw_put32(payload, session);
    dw_put32(payload + 4, frame);
    dw_put16(payload + 8, first);
}

/* Actuator `i` of this packet, below DW_MEASURED_MOST. */
static inline void dw_put_measured(uint8_t *payload, uint32_t i, dw_fitted fit)
{
    uint8_t *p = payload + DW_MEASURED_HEAD + i * DW_MEASURED_EACH;
    dw_put_f32(p, fit.mean);
    dw_put_f32(p + 4, fit.real);
    dw_put_f32(p + 8, fit.imaginary);
    dw_put_f32(p + 12, fit.change_real);
    dw_put_f32(p + 16, fit.change_imaginary);
    dw_put_f32(p + 20, fit.rest);
}

#endif

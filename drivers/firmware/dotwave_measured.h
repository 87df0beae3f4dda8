/* Reference for measuring (see ../PROTOCOL.md, version 3): reads MEASURE, fits what is sensed, writes MEASURED.
 *
 * C99, no allocation, no library but <string.h>. One dw_window for each actuator that is measured, zero-initialised:
 *
 *     dw_measure ask;
 *     if (dw_read_measure(&in.packet, &ask)) begin(&ask);          // a MEASURE, checked for its length
 *     ...                                                          // for each sample k of the window:
 *     phase = dw_turns(&ask, row) * k;                             // 2^64 is a whole turn
 *     dw_sense(&window, u, cosine(phase), sine(phase));
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
#define DW_MEASURED_EACH 12u    /* bytes of an actuator */
#define DW_MEASURED_MOST ((DW_MAX_PAYLOAD - DW_MEASURED_HEAD) / DW_MEASURED_EACH) /* actuators in one packet */

typedef struct {
    uint64_t at;
    uint32_t samples;
    uint32_t frame;
    uint32_t rows;         /* with a phase of their own */
    const uint8_t *turns;  /* in the packet: valid as long as it is */
} dw_measure;

typedef struct {
    float mean, real, imaginary;
} dw_fitted;

/* Sums over the samples of a window: of 1, cos and -sin with each other, and with what is sensed. */
typedef struct {
    double c, s, cc, cs, ss, u, uc, us;
    uint32_t count;
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

static inline void dw_sense(dw_window *w, float u, float cosine, float sine)
{
    double c = cosine, s = -(double)sine;
    w->count++;
    w->c += c;
    w->s += s;
    w->cc += c * c;
    w->cs += c * s;
    w->ss += s * s;
    w->u += u;
    w->uc += u * c;
    w->us += u * s;
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
    double n = w->count, cc, cs, ss, uc, us, det;
    fit.mean = fit.real = fit.imaginary = dw_nan();
    if (!w->count) return fit;
    fit.mean = (float)(w->u / n);
    /* Deviations from the means leave two equations of two unknowns. */
    cc = w->cc - w->c * w->c / n;
    cs = w->cs - w->c * w->s / n;
    ss = w->ss - w->s * w->s / n;
    uc = w->uc - w->u * w->c / n;
    us = w->us - w->u * w->s / n;
    det = cc * ss - cs * cs;
    if (!vibrates || det <= 1e-9 * n * n) return fit;
    fit.real = (float)((uc * ss - us * cs) / det);
    fit.imaginary = (float)((us * cc - uc * cs) / det);
    fit.mean = (float)((w->u - w->c * (uc * ss - us * cs) / det - w->s * (us * cc - uc * cs) / det) / n);
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
}

#endif

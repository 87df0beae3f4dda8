/* What sounds: polynomials of the time on carriers, in whole numbers.
 *
 * A bias, a tone that fades and an envelope are all E(t) on a carrier, of which the real part goes out: a bias has a
 * carrier that stands still. E is a cubic of the sample, stepped by differences; the carrier is a phase of 64 bits whose
 * upper bits index a table of the sine. The table is 513 numbers of a quarter, with straight lines between them: it is
 * right to 1.2e-6. E is right to 4e-5 of full scale at the end of 65536 samples, far better on shorter pieces.
 *
 * Values are in steps of a code / 2^14 (DW_UNIT).
 */
#ifndef DOTWAVE_VOICES_H
#define DOTWAVE_VOICES_H

#include <stdint.h>

#include "config.h"

#define DW_UNIT_BITS 14
#define DW_UNIT (1 << DW_UNIT_BITS)
#define DW_FULL (32767 * DW_UNIT)
#define DW_PIECE_MOST 65536u /* samples of an envelope */

typedef struct {
    int32_t re, im;
} dw_phasor;

typedef struct {
    uint64_t turns; /* of the carrier from a sample to the next, in turns / 2^64 */
    dw_phasor at;
} dw_tone;

/* cos + i sin of a phase, in 2^-30; 2^64 is a whole turn. */
dw_phasor dw_turned(uint64_t phase);

void dw_voices_clear(void);

/* From sample `now` on; a ramp of 0 samples is a jump. 0 when no voice is free. */
int dw_bias(uint64_t now, uint32_t channel, uint32_t ramp, int32_t value);
int dw_tones(uint64_t now, uint32_t channel, uint32_t ramp, const dw_tone *tones, uint32_t count);
int dw_envelope(uint64_t now, uint32_t channel, uint32_t ramp, uint64_t turns, const dw_phasor points[4]);

/* Add what sounds at this sample to `sum` (DW_CHANNELS of it), and go on to the next. */
void dw_voices_step(int64_t *sum);

#endif

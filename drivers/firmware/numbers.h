/* What a packet says in floats, as whole numbers. For the main loop: it uses floats. */
#ifndef DOTWAVE_NUMBERS_H
#define DOTWAVE_NUMBERS_H

#include <stdint.h>

#include "voices.h"

int dw_finite(float value);

/* Volts in steps of a code / 2^14; |volts| <= DW_FULL_VOLTS. */
int32_t dw_units(float volts);

/* The phase from a sample to the next of a finite frequency, in turns / 2^64. */
uint64_t dw_turns_of_hz(float hz);

/* A finite phase in radians, in turns / 2^64; right to 1e-4 rad up to 1e9. */
uint64_t dw_turns_of_radians(float radians);

/* volts e^{i phase} in steps. */
dw_phasor dw_phasor_of(float volts, float phase);

#endif

#include "numbers.h"

#include <string.h>

/* A finite float is mantissa * 2^exponent. */
typedef struct {
    uint32_t mantissa;
    int32_t exponent;
    int negative;
} parts;

static parts parts_of(float value)
{
    uint32_t bits;
    parts p;
    memcpy(&bits, &value, sizeof bits);
    p.negative = (int)(bits >> 31);
    p.exponent = (int32_t)((bits >> 23) & 0xffu);
    p.mantissa = bits & 0x7fffffu;
    if (p.exponent) p.mantissa |= 0x800000u;
    else p.exponent = 1;
    p.exponent -= 150;
    return p;
}

int dw_finite(float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    return (bits & 0x7f800000u) != 0x7f800000u;
}

int32_t dw_units(float volts)
{
    double units = (double)volts / (double)DW_FULL_VOLTS * (double)DW_FULL;
    return (int32_t)(units < 0 ? units - 0.5 : units + 0.5);
}

/* mantissa * 2^exponent / whole modulo 1, in 2^-64: long division, bit by bit. */
static uint64_t divided(uint32_t mantissa, int32_t exponent, uint32_t whole)
{
    uint64_t rest = mantissa % whole, quotient = 0;
    int32_t bits = 64 + exponent;
    for (int32_t i = 0; i < exponent; i++) rest = 2u * rest % whole;
    if (exponent > 0) bits = 64;
    if (exponent < 0) quotient = mantissa / whole;
    for (int32_t i = 0; i < bits; i++) {
        rest *= 2u;
        quotient = 2u * quotient + (rest >= whole);
        if (rest >= whole) rest -= whole;
    }
    if (bits < 0) return bits > -64 ? quotient >> -bits : 0;
    return quotient;
}

uint64_t dw_turns_of_hz(float hz)
{
    parts p = parts_of(hz);
    uint64_t turns = divided(p.mantissa, p.exponent, DW_RATE_HZ);
    return p.negative ? 0u - turns : turns;
}

uint64_t dw_turns_of_radians(float radians)
{
    static const uint64_t per_radian = 0x28be60db9391054au; /* 2^64 / (2 pi) */
    parts p = parts_of(radians);
    uint64_t turns, low = per_radian & 0xffffffffu, high = per_radian >> 32;
    if (p.exponent >= 0) {
        turns = p.exponent < 64 ? per_radian * p.mantissa << p.exponent : 0;
    } else {
        /* The product has 88 bits: shifted right in two parts. */
        uint64_t lower = low * p.mantissa, upper = high * p.mantissa + (lower >> 32);
        int32_t down = -p.exponent;
        lower &= 0xffffffffu;
        if (down <= 32) turns = (upper << (32 - down)) | (lower >> down);
        else turns = down - 32 < 64 ? upper >> (down - 32) : 0;
    }
    return p.negative ? 0u - turns : turns;
}

dw_phasor dw_phasor_of(float volts, float phase)
{
    dw_phasor wave = dw_turned(dw_turns_of_radians(phase)), scaled;
    int64_t units = dw_units(volts);
    scaled.re = (int32_t)(units * wave.re / ((int64_t)1 << 30));
    scaled.im = (int32_t)(units * wave.im / ((int64_t)1 << 30));
    return scaled;
}

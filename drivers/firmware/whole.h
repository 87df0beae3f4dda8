/* Whole numbers of 64 bits where a target has no wider ones. */
#ifndef DOTWAVE_WHOLE_H
#define DOTWAVE_WHOLE_H

#include <stdint.h>

/* value * share / 2^64, towards zero. */
static inline int64_t dw_part_of(int64_t value, uint64_t share)
{
    uint64_t size = value < 0 ? 0u - (uint64_t)value : (uint64_t)value;
    uint64_t a = size >> 32, b = size & 0xffffffffu, c = share >> 32, d = share & 0xffffffffu;
    uint64_t middle = a * d + ((b * d) >> 32), other = b * c + (middle & 0xffffffffu);
    int64_t part = (int64_t)(a * c + (middle >> 32) + (other >> 32));
    return value < 0 ? -part : part;
}

/* 1 / ramp in 2^-64; 0 for a jump. */
static inline uint64_t dw_share_of(uint32_t ramp)
{
    return ramp ? UINT64_MAX / ramp : 0;
}

#endif

/* From reset to main on a Cortex-M. */
#ifndef DOTWAVE_START_H
#define DOTWAVE_START_H

#include <stdint.h>

extern uint32_t data_start[], data_end[], data_load[], bss_start[], bss_end[], stack_top[];

static inline void start_memory(void)
{
    uint32_t *to = data_start;
    for (const uint32_t *from = data_load; to < data_end; from++) *to++ = *from;
    for (to = bss_start; to < bss_end; to++) *to = 0;
}

#endif

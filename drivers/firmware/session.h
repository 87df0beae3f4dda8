/* Ordered packets: what they ask for is checked, and carried out or refused. */
#ifndef DOTWAVE_SESSION_H
#define DOTWAVE_SESSION_H

#include <stdint.h>

#include "dotwave_decoder.h"
#include "text.h"

typedef struct {
    uint32_t session; /* 0: none */
    uint32_t next;    /* the ordered packet that is awaited */
    uint32_t events;  /* of the session so far */
} dw_session;

extern dw_session dw_now;

/* With the interrupt locked away. 1: done. 0: refused, `why` says why, and the output ramps to zero. */
int dw_begin_session(const dw_packet *packet, dw_text *why);
int dw_carry_out(const dw_packet *packet, dw_text *why);

#endif

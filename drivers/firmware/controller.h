/* The controller of PROTOCOL.md. A main loop is:
 *
 *     dw_init();
 *     start the interrupt that calls dw_play() DW_RATE_HZ times a second;
 *     for (;;) dw_poll();
 */
#ifndef DOTWAVE_CONTROLLER_H
#define DOTWAVE_CONTROLLER_H

#include <stdint.h>

/* Silence, links at 0, no session. */
void dw_init(void);

/* Take what came, answer, and acknowledge when it is time. */
void dw_poll(void);

/* One sample goes out. */
void dw_play(void);

/* A key beside the grid went down (1) or up (0); codes are those of dotwave_live.h. */
void dw_key(uint16_t code, int down);

#endif

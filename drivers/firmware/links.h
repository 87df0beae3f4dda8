/* The links: codes that go straight from where they are to others, given in codes / 2^16. */
#ifndef DOTWAVE_LINKS_H
#define DOTWAVE_LINKS_H

#include <stdint.h>

#include "config.h"

void dw_links_init(void); /* all to 0, and the board is told */
void dw_links_zero(void);
void dw_links_stay(void); /* where they are now */
void dw_links_glide(uint32_t row, uint32_t ramp, const uint32_t *codes);

void dw_links_tell(void); /* tell the board what has changed */
void dw_links_step(void); /* the same, then go on to the next sample */

#endif

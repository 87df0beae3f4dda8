/* Plays from a pack in the controller's own memory, as if a host sent it: every piece is checked like a packet. */
#ifndef DOTWAVE_PACKS_H
#define DOTWAVE_PACKS_H

#include "dotwave_pack.h"

/* Begin an entry; 0 when the pack is for another grid. A session of a host ends it, and so does dw_pack_stop. */
int dw_pack_play(const dw_pack *pack, const dw_pack_entry *entry);

/* In the main loop, beside dw_poll: 1 while it plays. */
int dw_pack_poll(void);

/* Whether it was played to its end; else a piece was refused, or it was stopped. */
int dw_pack_played(void);

void dw_pack_stop(void);

#endif

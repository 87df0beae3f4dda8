/* Reference store for ordered packets that came before their turn (see ../PROTOCOL.md, version 2).
 *
 * C99, no allocation; a zero-initialised dw_early is empty. Takes DW_EARLY x (DW_MAX_PAYLOAD + 12) bytes of memory. A
 * firmware without that memory leaves this file out and answers `kept` 0.
 *
 *     if (p->number == next)                          // p is an ordered packet of the present session
 *         do { carry_out(p); next++; } while (dw_early_take(&early, next, p));
 *     else if (p->number > next && !dw_early_keep(&early, p, next))
 *         gap = 1;
 *
 * Call dw_early_clear for every START that begins a session, for STOP and after REFUSED.
 */
#ifndef DOTWAVE_EARLY_H
#define DOTWAVE_EARLY_H

#include <string.h>

#include "dotwave_decoder.h"

#ifndef DW_EARLY
#define DW_EARLY 32u /* packets, 1 to 32 */
#endif
#define DW_AHEAD 32u /* an ACK tells of so many */

typedef struct {
    uint32_t number;
    uint32_t length;
    uint8_t kind;
    uint8_t used;
    uint8_t payload[DW_MAX_PAYLOAD];
} dw_slot;

typedef struct {
    dw_slot slots[DW_EARLY];
} dw_early;

static inline void dw_early_clear(dw_early *early)
{
    for (uint32_t i = 0; i < DW_EARLY; i++) early->slots[i].used = 0;
}

/* Keep a packet for its turn; 1 when it is kept, now or from before, 0 when the host has to send it again. */
static inline int dw_early_keep(dw_early *early, const dw_packet *packet, uint32_t next)
{
    dw_slot *room = 0;
    for (uint32_t i = 0; i < DW_EARLY; i++) {
        dw_slot *slot = &early->slots[i];
        if (slot->used && slot->number == packet->number) return 1;
        if (!slot->used) room = slot;
    }
    if (!room || packet->number <= next || packet->number - next > DW_AHEAD || packet->length > DW_MAX_PAYLOAD) return 0;
    room->number = packet->number;
    room->length = packet->length;
    room->kind = packet->kind;
    room->used = 1;
    memcpy(room->payload, packet->payload, packet->length);
    return 1;
}

/* Take out the packet `next`; 1 when it was kept. It stays valid until the next call of dw_early_keep. */
static inline int dw_early_take(dw_early *early, uint32_t next, dw_packet *packet)
{
    for (uint32_t i = 0; i < DW_EARLY; i++) {
        dw_slot *slot = &early->slots[i];
        if (slot->used && slot->number == next) {
            slot->used = 0;
            packet->kind = slot->kind;
            packet->number = next;
            packet->payload = slot->payload;
            packet->length = slot->length;
            return 1;
        }
    }
    return 0;
}

/* `kept` of an ACK: bit i for packet next + 1 + i. */
static inline uint32_t dw_early_kept(const dw_early *early, uint32_t next)
{
    uint32_t kept = 0;
    for (uint32_t i = 0; i < DW_EARLY; i++) {
        uint32_t ahead = early->slots[i].number - next - 1u;
        if (early->slots[i].used && ahead < DW_AHEAD) kept |= (uint32_t)1 << ahead;
    }
    return kept;
}

#endif

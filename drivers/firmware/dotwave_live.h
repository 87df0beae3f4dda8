/* Reference for open sessions and keys (see ../PROTOCOL.md, version 4).
 *
 * C99, no allocation, no library but <stdint.h>. A zero-initialised dw_keys is empty.
 *
 *     enough = dw_enough(&in.packet, buffer_samples);       // of a START: samples in store that start the clock
 *     dw_press(&keys, DW_KEY_NEXT, 1);                      // a key went down
 *     length = dw_keys_payload(&keys, payload);             // at once, and every 50 ms while it is not 0
 *     dw_encode(wire, DW_KEY, 0, payload, length);
 *     dw_keyed(&keys, &in.packet);                          // a KEYED: what the host has waits no longer
 *
 * Call dw_keys_clear for every HELLO. Send no KEY to a host of version 3 or older, nor before HELLO.
 */
#ifndef DOTWAVE_LIVE_H
#define DOTWAVE_LIVE_H

#include "dotwave_decoder.h"

#define DW_PARAMETRIC 1u /* bits of START's mode */
#define DW_PREFILL 2u
#define DW_START_HEAD 17u

enum dw_grid_key {
    DW_KEY_PREVIOUS = 1, DW_KEY_NEXT = 2, DW_KEY_HOME = 3, DW_KEY_UP = 4, DW_KEY_DOWN = 5, DW_KEY_STOP = 6
};
#define DW_KEY_CELL 0x100u /* + k: the key over cell k */
#define DW_KEY_RELEASED 0x8000u
#define DW_KEYS 16u
#define DW_KEYS_MOST (4u + 2u * DW_KEYS) /* bytes of a payload */

typedef struct {
    uint32_t first; /* number of the oldest event that waits */
    uint32_t count;
    uint16_t codes[DW_KEYS];
} dw_keys;

/* Whether a START has all that its mode announces; one that has not is passed over. */
static inline int dw_start_fits(const dw_packet *start)
{
    uint32_t head = DW_START_HEAD + (start->length > 4u && start->payload[4] & DW_PREFILL ? 4u : 0u);
    return start->kind == DW_START && start->length >= head;
}

/* Samples in store that start the clock of a START that fits. */
static inline uint32_t dw_enough(const dw_packet *start, uint32_t buffer_samples)
{
    uint32_t half = buffer_samples / 2u + (buffer_samples & 1u);
    uint32_t prefill = start->payload[4] & DW_PREFILL ? dw_u32(start->payload + DW_START_HEAD) : 0u;
    return prefill && prefill < half ? prefill : half;
}

/* A key went down (1) or up (0); 0 when there is no room, and the event is lost. */
static inline int dw_press(dw_keys *keys, uint16_t code, int down)
{
    if (keys->count >= DW_KEYS) return 0;
    keys->codes[keys->count++] = (uint16_t)(down ? code : code | DW_KEY_RELEASED);
    return 1;
}

static inline void dw_keys_drop(dw_keys *keys, uint32_t count)
{
    for (uint32_t i = count; i < keys->count; i++) keys->codes[i - count] = keys->codes[i];
    keys->count -= count;
    keys->first += count;
}

static inline void dw_keys_clear(dw_keys *keys) { dw_keys_drop(keys, keys->count); }

/* Take out what the host has. */
static inline void dw_keyed(dw_keys *keys, const dw_packet *packet)
{
    uint32_t count = dw_u32(packet->payload) - keys->first;
    if (count <= keys->count) dw_keys_drop(keys, count);
}

/* The payload of a KEY with all that waits (room for DW_KEYS_MOST bytes); its length, 0 when nothing waits. */
static inline uint32_t dw_keys_payload(const dw_keys *keys, uint8_t *payload)
{
    if (!keys->count) return 0;
    dw_put32(payload, keys->first);
    for (uint32_t i = 0; i < keys->count; i++) dw_put16(payload + 4u + 2u * i, keys->codes[i]);
    return 4u + 2u * keys->count;
}

#endif

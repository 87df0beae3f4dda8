/* The output side: buffer, events, the ramp to zero and the watchdog. What dw_play touches stands here. */
#ifndef DOTWAVE_PLAYOUT_H
#define DOTWAVE_PLAYOUT_H

#include <stdint.h>

#include "config.h"
#include "voices.h"

enum dw_state { DW_IDLE, DW_FILLING, DW_PLAYING, DW_HELD, DW_DONE, DW_STOPPED };

typedef struct {
    uint64_t at;
    uint32_t ramp;
    uint16_t index; /* row or channel */
    uint8_t kind;
    uint8_t count;
    union {
        uint32_t frame;
        int32_t bias;
        uint32_t links[DW_LINKS]; /* codes / 2^16 */
        dw_tone tones[DW_TONES_MOST];
        struct {
            uint64_t turns;
            dw_phasor points[4];
        } envelope;
    } what;
} dw_event;

typedef struct {
    uint32_t frame;
    uint64_t at;
    uint64_t clock_us;
} dw_marked;

typedef struct {
    uint8_t state;
    uint8_t alive;      /* whether the host is heard */
    uint8_t parametric;
    uint8_t ended;      /* END is here */
    uint8_t full;       /* a voice was wanted and none was free */
    uint32_t underruns;
    uint64_t total;     /* of the session; 0 until END when it is open */
    uint64_t received, played, held; /* samples */
    uint32_t events_done;
} dw_playout;

extern dw_playout dw_out;

/* The board's interrupt calls this once a sample. No division of 64 bits but where an event begins, no floats. */
void dw_play(void);

/* For the main loop, with the interrupt locked away. */
void dw_playout_init(void);
void dw_begin(uint64_t total, int parametric, uint32_t begin_with);
void dw_clear(void);
void dw_hold(enum dw_state state);
void dw_heard(void);
void dw_end(uint64_t total);
void dw_start_if_ready(void);

/* The next free slot, 0 when none is; dw_event_add puts what is in it behind the others. */
dw_event *dw_event_slot(void);
void dw_event_add(void);
uint32_t dw_events_waiting(void);
uint64_t dw_last_event_at(void);

/* `count` samples of all channels, little-endian; the credit was checked. */
void dw_push(const uint8_t *codes, uint32_t count);

/* The oldest mark that went out; 0 when there is none. */
int dw_take_marked(dw_marked *marked);

#endif

/* Counts the instructions of one output vector, under `qemu-system-arm -icount shift=0`, where each takes a nanosecond.
 *
 * Every row has links that move. Every drive has two envelopes that bend, every other channel one.
 */
#include "board.h"
#include "controller.h"
#include "links.h"
#include "playout.h"
#include "semihosting.h"
#include "start.h"
#include "text.h"

#define VECTORS 1000u /* within the watchdog time */
#define CORE_HZ 25000000u
#define TICK ((volatile uint32_t *)0xe000e010u)

void board_lock(void) {}
void board_unlock(void) {}
void board_halt(void) { semihosting_exit(0); }
uint64_t board_clock_us(void) { return 0; }
int board_receive(void) { return -1; }

void board_send(const uint8_t *bytes, uint32_t length)
{
    (void)bytes;
    (void)length;
}

void board_links(uint32_t row, const uint16_t *codes)
{
    (void)row;
    (void)codes;
}

void board_write(const int16_t *codes)
{
    (void)codes;
}

static void envelope(uint32_t channel, uint64_t turns)
{
    static const dw_phasor points[4] = {{0, 0}, {9000000, 5000000}, {1000000, -7000000}, {50000000, 3000000}};
    if (!dw_envelope(0, channel, 60000u, turns, points)) semihosting_exit(0);
}

static void begin(void)
{
    uint32_t codes[DW_LINKS];
    dw_begin(VECTORS, 1, 1);
    for (uint32_t i = 0; i < DW_LINKS; i++) codes[i] = (60000u - i) << 16;
    for (uint32_t row = 0; row < DW_ROWS; row++) dw_links_glide(row, 60000u, codes);
    for (uint32_t channel = 0; channel < DW_CHANNELS; channel++) {
        envelope(channel, channel < DW_DRIVES ? (uint64_t)1 << 57 : 0);
        if (channel < DW_DRIVES) envelope(channel, (uint64_t)3 << 56);
    }
    dw_end(VECTORS);
}

void reset(void);
void reset(void)
{
    dw_text said;
    uint32_t ticks;
    start_memory();
    dw_init();
    begin();
    TICK[1] = 0xffffffu;
    TICK[2] = 0;
    TICK[0] = 5u;
    for (uint32_t i = 0; i < VECTORS; i++) dw_play();
    ticks = 0xffffffu - TICK[2];
    said.length = 0;
    dw_say_number(&said, (uint64_t)ticks * (1000000000u / CORE_HZ) / VECTORS);
    dw_say(&said, " instructions a vector\n");
    said.bytes[said.length] = 0;
    semihosting_say((const char *)said.bytes);
    semihosting_exit(dw_out.played == VECTORS);
}

__attribute__((section(".vectors"), used)) static const struct {
    uint32_t *stack;
    void (*reset)(void);
} table = {stack_top, reset};

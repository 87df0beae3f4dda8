/* A Cortex-M4 without an operating system: QEMU's mps2-an386, host on UART0, sample clock from TIMER0.
 *
 * The emulated line carries 3 to 6 kB/s, a hundredth of what USB does, so time on this board goes DW_SLOW times slower
 * than outside. What goes out while a session plays is written by semihosting to the file that the command line names.
 * With a second word, an icon of that name is played from the pack that a loader put at PACK_AT, in its own time, and then
 * the program ends.
 */
#include "board.h"
#include "controller.h"
#include "packs.h"
#include "semihosting.h"
#include "start.h"
#include "vectors.h"

#ifndef DW_SLOW
#define DW_SLOW 10u
#endif

#define CORE_HZ 25000000u
#define TIMER_IRQ 8
#define UART_IRQ 0
#define VECTORS_ROOM 0x40000u
#define LINE_ROOM 4096u
#define PACK_AT ((const uint8_t *)0x21000000u)
#define PACK_ROOM 0x1000000u

typedef struct {
    volatile uint32_t control, value, reload, interrupt;
} timer;
typedef struct {
    volatile uint32_t data, state, control, interrupt, divider;
} uart;

#define TIMER0 ((timer *)0x40000000u)
#define UART0 ((uart *)0x40004000u)
#define SET_ENABLE (*(volatile uint32_t *)0xe000e100u)

static uint8_t came[LINE_ROOM];
static volatile uint32_t came_read, came_written;
static uint8_t vectors[VECTORS_ROOM];
static volatile uint32_t vectors_length;
static volatile uint64_t samples_out;
static int32_t record = -1;

void board_lock(void) { __asm__ volatile("cpsid i" ::: "memory"); }
void board_unlock(void) { __asm__ volatile("cpsie i" ::: "memory"); }

void board_halt(void)
{
    semihosting_say("dotwave: halted\n");
    semihosting_exit(0);
}

/* Called from the interrupt, and with it locked away: the count cannot change between. */
uint64_t board_clock_us(void)
{
    uint64_t before, now = samples_out;
    do {
        before = now;
        now = samples_out;
    } while (before != now);
    return now * 1000000u / DW_RATE_HZ;
}

int board_receive(void)
{
    uint8_t byte;
    if (came_read == came_written) return -1;
    byte = came[came_read % LINE_ROOM];
    came_read++;
    return byte;
}

void board_send(const uint8_t *bytes, uint32_t length)
{
    for (uint32_t i = 0; i < length; i++) {
        while (UART0->state & 1u) {
        }
        UART0->data = bytes[i];
    }
}

void board_links(uint32_t row, const uint16_t *codes)
{
    vector_keep(row, codes);
}

void board_write(const int16_t *codes)
{
    uint32_t length = vectors_length;
    if (record < 0) return;
    if (length + VECTOR_BYTES > VECTORS_ROOM) {
        board_halt();
    } else if (vector_put(vectors + length, codes)) {
        vectors_length = length + VECTOR_BYTES;
    }
}

static void keep_record(void)
{
    int ok;
    if (record < 0 || !vectors_length || (vectors_length < VECTORS_ROOM / 2u && dw_out.state == DW_PLAYING)) return;
    board_lock();
    ok = semihosting_write(record, vectors, vectors_length);
    vectors_length = 0;
    board_unlock();
    if (!ok) board_halt();
}

static void sample_due(void)
{
    TIMER0->interrupt = 1;
    dw_play();
    samples_out++;
}

static void byte_came(void)
{
    UART0->interrupt = 2;
    while (UART0->state & 2u) {
        uint8_t byte = (uint8_t)UART0->data;
        if (came_written - came_read < LINE_ROOM) came[came_written++ % LINE_ROOM] = byte;
    }
}

/* Without a line, and as quickly as the core can. */
static int play_pack(const char *name)
{
    dw_pack pack;
    dw_pack_entry entry;
    if (!dw_pack_open(&pack, PACK_AT, PACK_ROOM) || !dw_pack_whole(&pack)) return 0;
    if (!dw_pack_find(&pack, name, (uint32_t)strlen(name), &entry) || !dw_pack_play(&pack, &entry)) return 0;
    while (dw_pack_poll()) {
        dw_play();
        samples_out++;
        keep_record();
    }
    keep_record();
    return dw_pack_played();
}

void reset(void);
void reset(void)
{
    char *name, *icon;
    start_memory();
    name = semihosting_words();
    icon = strchr(name, ' ');
    if (icon) *icon++ = 0;
    if (*name) record = semihosting_create(name);
    dw_init();
    if (icon) semihosting_exit(play_pack(icon));
    UART0->divider = 16;
    UART0->control = 1u | 2u | 8u;
    TIMER0->reload = (uint32_t)((uint64_t)CORE_HZ * DW_SLOW / DW_RATE_HZ) - 1u;
    TIMER0->value = TIMER0->reload;
    TIMER0->control = 1u | 8u;
    SET_ENABLE = (1u << TIMER_IRQ) | (1u << UART_IRQ);
    board_unlock();
    for (;;) {
        dw_poll();
        keep_record();
    }
}

static void fault(void)
{
    board_halt();
}

__attribute__((section(".vectors"), used)) static const struct {
    uint32_t *stack;
    void (*handlers[15])(void);
    void (*interrupts[16])(void);
} table = {
    stack_top,
    {reset, fault, fault, fault, fault, fault, 0, 0, 0, 0, fault, fault, 0, fault, fault},
    {[UART_IRQ] = byte_came, [TIMER_IRQ] = sample_due},
};

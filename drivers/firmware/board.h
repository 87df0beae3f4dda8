/* What a board does for the controller: eight functions. Whoever ports the controller writes these, and no more.
 *
 * board_write, board_links and board_clock_us are called from dw_play, which the interrupt of the sample clock calls; they
 * must be short. The others are called from the main loop only.
 */
#ifndef DOTWAVE_BOARD_H
#define DOTWAVE_BOARD_H

#include <stdint.h>

/* Microseconds since any moment; never goes back. */
uint64_t board_clock_us(void);

/* The next byte that came over the line, or -1. */
int board_receive(void);

/* Send `length` bytes, at most 256. A line that is full may lose all of them, never a part; do not wait for long. */
void board_send(const uint8_t *bytes, uint32_t length);

/* Put out one sample of DW_CHANNELS channels; 32767 is DW_FULL_VOLTS. */
void board_write(const int16_t *codes);

/* Set the links of a row, DW_COLS - 1 of them; a code is DW_LAM_STEP. Called when one has changed. */
void board_links(uint32_t row, const uint16_t *codes);

/* Keep the interrupt of the sample clock away, and let it come again. Never nested. */
void board_lock(void);
void board_unlock(void);

/* The controller met what cannot be: cut the amplifiers off and do not come back. */
void board_halt(void);

#endif

/* linked-6x6: six rows of six, one drive a row, a lam of its own for every link, 24 kHz. */
#define DW_NAME "linked-6x6"
#define DW_ROWS 6u
#define DW_COLS 6u
#define DW_CHANNELS 6u
#define DW_DRIVES 6u
#define DW_RATE_HZ 24000u
#define DW_FULL_VOLTS 100.0f
#define DW_LAM_MAX 1.0f

/* A small grid for tests: two rows of three, one drive a row, 8 kHz, little room. */
#define DW_NAME "trial"
#define DW_ROWS 2u
#define DW_COLS 3u
#define DW_CHANNELS 2u
#define DW_DRIVES 2u
#define DW_RATE_HZ 8000u
#define DW_FULL_VOLTS 100.0f
#define DW_LAM_MAX 1.0f
#define DW_BUFFER_SAMPLES 2000u
#define DW_EVENT_SLOTS 16u
#define DW_VOICES 16u
#define DW_BYTES_AT_A_TIME 0x100000u

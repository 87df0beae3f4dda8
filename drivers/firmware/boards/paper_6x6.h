/* paper-6x6: six rows of six, one drive a row and one bias an actuator, 8 kHz. */
#define DW_NAME "paper-6x6"
#define DW_ROWS 6u
#define DW_COLS 6u
#define DW_CHANNELS 42u
#define DW_DRIVES 6u
#define DW_RATE_HZ 8000u
#define DW_FULL_VOLTS 100.0f
#define DW_LAM_MAX 0.05f

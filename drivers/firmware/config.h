/* What the controller is built for: a board's header (DW_BOARD names it) and what it leaves open. */
#ifndef DOTWAVE_CONFIG_H
#define DOTWAVE_CONFIG_H

#ifndef DW_BOARD
#error "name the header of your grid: -DDW_BOARD='\"boards/paper_6x6.h\"'"
#endif
#include DW_BOARD

/* Room for samples; 0 makes a controller of parametric sessions only. */
#ifndef DW_BUFFER_SAMPLES
#define DW_BUFFER_SAMPLES (DW_RATE_HZ / 2u)
#endif
/* Room for events, at most 65535; 56 bytes each. */
#ifndef DW_EVENT_SLOTS
#define DW_EVENT_SLOTS 512u
#endif
/* What sounds at a time: one for each bias, tone or envelope that is not silent; 96 bytes each. */
#ifndef DW_VOICES
#define DW_VOICES (DW_CHANNELS + 2u * DW_DRIVES)
#endif
#define DW_TONES_MOST 2u /* of one TONES */
#ifndef DW_MARKS
#define DW_MARKS 16u /* that went out and are not yet told */
#endif
/* Taken before the next look at the clock. */
#ifndef DW_BYTES_AT_A_TIME
#define DW_BYTES_AT_A_TIME 4096u
#endif
#ifndef DW_WATCHDOG_MS
#define DW_WATCHDOG_MS 200u
#endif
#ifndef DW_RAMP_MS
#define DW_RAMP_MS 50u
#endif

#define DW_LINKS (DW_COLS - 1u)
#define DW_LAM_STEP (DW_LAM_MAX / 65535.0f)
#define DW_RAMP_SAMPLES (DW_RATE_HZ * DW_RAMP_MS / 1000u)
#define DW_SILENT_SAMPLES (DW_RATE_HZ * (DW_WATCHDOG_MS - DW_RAMP_MS) / 1000u)

#endif

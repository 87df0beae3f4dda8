/* Playing from a pack without a line. */
#ifndef DOTWAVE_POSIX_PACK_H
#define DOTWAVE_POSIX_PACK_H

#include <stdint.h>

/* Play entry `name` of the pack in `file` to its end, as quickly as the machine can; `sample` lets one sample pass.
 * 0 when it cannot, which was then said. */
int play_pack(const char *file, const char *name, void (*sample)(void));

#endif

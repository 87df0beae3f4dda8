/* Files and the end of the program, by the debugger's or emulator's semihosting. */
#ifndef DOTWAVE_SEMIHOSTING_H
#define DOTWAVE_SEMIHOSTING_H

#include <stdint.h>

/* The words behind the program's name; "" when there are none. */
char *semihosting_words(void);

/* A file to write anew; below 0 when it cannot be. */
int32_t semihosting_create(const char *name);

/* 1 when all was written. */
int semihosting_write(int32_t file, const uint8_t *bytes, uint32_t length);

void semihosting_say(const char *line);
void semihosting_exit(int ok);

#endif

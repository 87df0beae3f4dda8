/* One line of text in memory of its own, for REFUSED. */
#ifndef DOTWAVE_TEXT_H
#define DOTWAVE_TEXT_H

#include <stdint.h>

#define DW_TEXT_MOST 160u

typedef struct {
    uint8_t bytes[DW_TEXT_MOST];
    uint32_t length;
} dw_text;

static inline void dw_say(dw_text *text, const char *words)
{
    while (*words && text->length < DW_TEXT_MOST) text->bytes[text->length++] = (uint8_t)*words++;
}

static inline void dw_say_number(dw_text *text, uint64_t number)
{
    char digits[21];
    uint32_t at = 20;
    digits[at] = 0;
    do {
        digits[--at] = (char)('0' + number % 10u);
        number /= 10u;
    } while (number);
    dw_say(text, digits + at);
}

#endif

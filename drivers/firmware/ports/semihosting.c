#include "semihosting.h"

#include <string.h>

enum { OPEN = 0x01, WRITE0 = 0x04, WRITE = 0x05, GET_CMDLINE = 0x15, EXIT = 0x18 };

#define WRITE_BINARY 5u
#define STOPPED_WELL 0x20026u
#define STOPPED_ILL 0x20023u

static uint32_t ask(uint32_t operation, const void *argument)
{
    register uint32_t r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = argument;
    __asm__ volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

char *semihosting_words(void)
{
    static char line[256];
    struct {
        char *text;
        uint32_t size;
    } block = {line, sizeof line};
    char *words;
    if (ask(GET_CMDLINE, &block)) line[0] = 0;
    words = strchr(line, ' ');
    return words ? words + 1 : line + strlen(line);
}

int32_t semihosting_create(const char *name)
{
    struct {
        const char *name;
        uint32_t mode, length;
    } block = {name, WRITE_BINARY, (uint32_t)strlen(name)};
    return (int32_t)ask(OPEN, &block);
}

int semihosting_write(int32_t file, const uint8_t *bytes, uint32_t length)
{
    struct {
        int32_t file;
        const uint8_t *bytes;
        uint32_t length;
    } block = {file, bytes, length};
    return ask(WRITE, &block) == 0;
}

void semihosting_say(const char *line)
{
    ask(WRITE0, line);
}

void semihosting_exit(int ok)
{
    ask(EXIT, (const void *)(uintptr_t)(ok ? STOPPED_WELL : STOPPED_ILL));
}

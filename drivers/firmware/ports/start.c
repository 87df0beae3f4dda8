/* Starts a program of the standard library under an emulator: arguments and files come by semihosting. */
#include <stdlib.h>
#include <string.h>

#include "start.h"

extern void initialise_monitor_handles(void);
extern int main(int argc, char **argv);

#define WORDS 8

static char line[1024];

static int words_of_line(char **words)
{
    struct {
        char *text;
        uint32_t size;
    } block = {line, sizeof line};
    register uint32_t operation __asm__("r0") = 0x15; /* SYS_GET_CMDLINE */
    register void *argument __asm__("r1") = &block;
    int count = 0;
    __asm__ volatile("bkpt 0xab" : "+r"(operation) : "r"(argument) : "memory");
    for (char *word = strtok(line, " "); word && count < WORDS - 1; word = strtok(0, " ")) words[count++] = word;
    words[count] = 0;
    return count;
}

void reset(void);
void reset(void)
{
    char *words[WORDS];
    start_memory();
    initialise_monitor_handles();
    exit(main(words_of_line(words), words));
}

static void fault(void)
{
    abort();
}

__attribute__((section(".vectors"), used)) static const struct {
    uint32_t *stack;
    void (*handlers[15])(void);
} vectors = {stack_top, {reset, fault, fault, fault, fault, fault, 0, 0, 0, 0, fault, fault, 0, fault, fault}};

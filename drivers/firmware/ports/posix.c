/* A board that is a pseudo-terminal: in real time by the monotonic clock, in one thread, so that nothing needs a lock.
 *
 *     controller [--link PATH] [--record FILE] [--output FILE] [--pack FILE --icon NAME]
 *
 * prints the name of its port. PATH becomes a symbolic link to it; the record gets what goes out while
 * a session plays (vectors.h), the output the codes of every sample, i16 each, also while nothing plays. Ends on SIGTERM and SIGINT. With a pack there is no line: it plays one icon of it as
 * quickly as the machine can, and ends.
 */
#define _XOPEN_SOURCE 700

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#include "board.h"
#include "config.h"
#include "controller.h"
#include "posix_pack.h"
#include "vectors.h"

#define STEP_MS 1
#define BYTES_READ 65536u
#define BYTES_PENDING (1u << 20)
#define LONGEST_STEP_US 10000u /* a machine that is busy for longer lets time go slower, for a line holds no more */

static volatile sig_atomic_t ended;
static int line;
static FILE *record, *output;
static uint8_t coming[BYTES_READ], pending[BYTES_PENDING];
static uint32_t coming_at, coming_length, pending_length;
static uint64_t now_us, samples_out;

uint64_t board_clock_us(void) { return now_us; }
void board_lock(void) {}
void board_unlock(void) {}
void board_halt(void) { abort(); }

int board_receive(void)
{
    return coming_at < coming_length ? coming[coming_at++] : -1;
}

void board_send(const uint8_t *bytes, uint32_t length)
{
    if (pending_length + length > BYTES_PENDING) return;
    memcpy(pending + pending_length, bytes, length);
    pending_length += length;
}

void board_links(uint32_t row, const uint16_t *codes)
{
    vector_keep(row, codes);
}

void board_write(const int16_t *codes)
{
    uint8_t bytes[VECTOR_BYTES];
    if (output && fwrite(codes, sizeof *codes, DW_CHANNELS, output) != DW_CHANNELS) ended = 1;
    if (record && vector_put(bytes, codes) && fwrite(bytes, 1, sizeof bytes, record) != sizeof bytes) ended = 1;
}

static uint64_t real_us(void)
{
    struct timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return (uint64_t)time.tv_sec * 1000000u + (uint64_t)time.tv_nsec / 1000u;
}

static void end(int signal)
{
    (void)signal;
    ended = 1;
}

/* Raw, and with this side's end open too, so that a host that goes away does not end the line. */
static int open_line(const char **name)
{
    struct termios raw;
    int slave;
    line = posix_openpt(O_RDWR | O_NOCTTY);
    if (line < 0 || grantpt(line) || unlockpt(line)) return 0;
    *name = ptsname(line);
    slave = *name ? open(*name, O_RDWR | O_NOCTTY) : -1;
    if (slave < 0 || tcgetattr(slave, &raw)) return 0;
    raw.c_iflag = raw.c_oflag = raw.c_lflag = 0;
    raw.c_cflag = (raw.c_cflag & ~(tcflag_t)CSIZE) | CS8;
    raw.c_cc[VMIN] = 1;
    raw.c_cc[VTIME] = 0;
    return tcsetattr(slave, TCSANOW, &raw) == 0 && fcntl(line, F_SETFL, O_NONBLOCK) == 0;
}

static void exchange(void)
{
    struct pollfd ready = {0, POLLIN, 0};
    ssize_t count;
    if (pending_length) {
        count = write(line, pending, pending_length);
        if (count > 0) {
            pending_length -= (uint32_t)count;
            memmove(pending, pending + count, pending_length);
        }
    }
    ready.fd = line;
    if (poll(&ready, 1, STEP_MS) <= 0) return;
    count = read(line, coming, sizeof coming);
    coming_at = 0;
    coming_length = count > 0 ? (uint32_t)count : 0;
}

static void pass_time(uint64_t *real)
{
    uint64_t next = real_us(), passed = next - *real, until;
    *real = next;
    until = now_us + (passed < LONGEST_STEP_US ? passed : LONGEST_STEP_US);
    while ((samples_out + 1u) * 1000000u <= until * DW_RATE_HZ) {
        now_us = samples_out * 1000000u / DW_RATE_HZ;
        dw_play();
        samples_out++;
    }
    now_us = until;
}

static void sample(void)
{
    now_us = samples_out++ * 1000000u / DW_RATE_HZ;
    dw_play();
}

static int run(const char *link)
{
    const char *name = 0;
    uint64_t real = real_us();
    if (!open_line(&name) || (link && symlink(name, link))) return 0;
    printf("%s\n", link ? link : name);
    fflush(stdout);
    dw_init();
    while (!ended) {
        exchange();
        pass_time(&real);
        do dw_poll();
        while (coming_at < coming_length);
    }
    if (link) unlink(link);
    return 1;
}

int main(int argc, char **argv)
{
    static const char *const names[] = {"--link", "--record", "--output", "--pack", "--icon"};
    const char *given[5] = {0, 0, 0, 0, 0};
    struct sigaction action;
    int done;
    memset(&action, 0, sizeof action);
    action.sa_handler = end;
    sigaction(SIGTERM, &action, 0);
    sigaction(SIGINT, &action, 0);
    for (int i = 1; i < argc; i += 2) {
        int k = 0;
        while (k < 5 && strcmp(argv[i], names[k]) != 0) k++;
        if (k == 5 || i + 1 == argc) {
            fprintf(stderr, "%s: %s: expected --link PATH, --record FILE, --output FILE, or --pack FILE --icon NAME\n",
                    argv[0], argv[i]);
            return 2;
        }
        given[k] = argv[i + 1];
    }
    done = (!given[1] || (record = fopen(given[1], "wb"))) && (!given[2] || (output = fopen(given[2], "wb")));
    if (done && given[3]) {
        if (!play_pack(given[3], given[4] ? given[4] : "", sample)) return 1;
    } else if (done) {
        done = run(given[0]);
    }
    if (record && fclose(record) != 0) done = 0;
    if (output && fclose(output) != 0) done = 0;
    if (done) return 0;
    fprintf(stderr, "%s: %s\n", argv[0], strerror(errno));
    return 1;
}

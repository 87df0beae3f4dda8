/* A board whose time is given: for tests, on any target with a standard library.
 *
 * Reads requests, {u64 now_us, u32 length, u32 keys, u16 each, bytes}: time goes on to now_us, sample by sample, keys go
 * down or up (bit 15), then the bytes come. A length of 2^32 - 1 switches it off and on, and has no answer. Answers
 * each with {u32 length, bytes sent}, {u32 samples} and for each {u8 changed links' rows; for each row u8, codes}, codes.
 * Without arguments it talks over stdin and stdout, with two it reads a file of requests and writes one of answers.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "board.h"
#include "controller.h"
#include "config.h"
#include "dotwave_decoder.h"

#define MOST_BYTES (1u << 20)
#define OFF_AND_ON 0xffffffffu

static FILE *requests, *answers;
static uint8_t coming[MOST_BYTES], sent[MOST_BYTES];
static uint32_t coming_length, coming_at, sent_length;
static uint8_t *record;
static uint32_t record_length, record_room, vectors;
static uint8_t links[DW_ROWS][2u * DW_LINKS], changed[DW_ROWS];
static uint64_t now_us, samples_out;

uint64_t board_clock_us(void) { return now_us; }
int board_receive(void) { return coming_at < coming_length ? coming[coming_at++] : -1; }
void board_lock(void) {}
void board_unlock(void) {}
void board_halt(void) { abort(); }

void board_send(const uint8_t *bytes, uint32_t length)
{
    if (sent_length + length > MOST_BYTES) return;
    memcpy(sent + sent_length, bytes, length);
    sent_length += length;
}

static void keep(const uint8_t *bytes, uint32_t length)
{
    if (record_length + length > record_room) {
        record_room = 2u * (record_room + length);
        record = realloc(record, record_room);
        if (!record) abort();
    }
    memcpy(record + record_length, bytes, length);
    record_length += length;
}

void board_links(uint32_t row, const uint16_t *codes)
{
    changed[row] = 1;
    for (uint32_t i = 0; i < DW_LINKS; i++) dw_put16(links[row] + 2u * i, codes[i]);
}

void board_write(const int16_t *codes)
{
    uint8_t bytes[2], rows = 0;
    for (uint32_t row = 0; row < DW_ROWS; row++) rows = (uint8_t)(rows + changed[row]);
    keep(&rows, 1);
    for (uint32_t row = 0; row < DW_ROWS; row++) {
        uint8_t which = (uint8_t)row;
        if (!changed[row]) continue;
        changed[row] = 0;
        keep(&which, 1);
        keep(links[row], 2u * DW_LINKS);
    }
    for (uint32_t i = 0; i < DW_CHANNELS; i++) {
        dw_put16(bytes, (uint16_t)codes[i]);
        keep(bytes, 2);
    }
    vectors++;
}

static void put32(uint32_t value)
{
    uint8_t bytes[4];
    dw_put32(bytes, value);
    fwrite(bytes, 1, 4, answers);
}

static void play_until(uint64_t until)
{
    while ((samples_out + 1u) * 1000000u <= until * DW_RATE_HZ) {
        now_us = samples_out * 1000000u / DW_RATE_HZ;
        dw_play();
        samples_out++;
    }
    now_us = until;
}

static int begin(void)
{
    now_us = samples_out = 0;
    coming_length = coming_at = sent_length = record_length = vectors = 0;
    dw_init();
    return 1;
}

static int exchange(void)
{
    uint8_t head[16], key[2];
    uint32_t keys;
    uint64_t until;
    if (fread(head, 1, 16, requests) != 16) return 0;
    until = dw_u64(head);
    coming_length = dw_u32(head + 8);
    coming_at = 0;
    keys = dw_u32(head + 12);
    if (coming_length == OFF_AND_ON) return begin();
    if (coming_length > MOST_BYTES) return 0;
    play_until(until);
    for (; keys; keys--) {
        if (fread(key, 1, 2, requests) != 2) return 0;
        dw_key(dw_u16(key) & 0x7fffu, !(key[1] & 0x80u));
    }
    if (fread(coming, 1, coming_length, requests) != coming_length) return 0;
    /* A main loop that is quick: it takes all that came before time goes on. */
    do dw_poll();
    while (coming_at < coming_length);
    put32(sent_length);
    fwrite(sent, 1, sent_length, answers);
    put32(vectors);
    if (record_length) fwrite(record, 1, record_length, answers);
    fflush(answers);
    sent_length = record_length = vectors = 0;
    return 1;
}

int main(int argc, char **argv)
{
    requests = argc == 3 ? fopen(argv[1], "rb") : stdin;
    answers = argc == 3 ? fopen(argv[2], "wb") : stdout;
    if (!requests || !answers) return 2;
    begin();
    while (exchange()) {
    }
    return argc == 3 && fclose(answers) ? 1 : 0;
}

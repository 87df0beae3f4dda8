/* Reader of packs (see ../../docs/pack.md): many sessions without samples in one file, read where it lies in memory.
 *
 * C99, one header, no allocation, no library but <string.h>. It never reads outside of the bytes it was given, whatever
 * they are. All functions give 1 when it is there, 0 when it is not, or the pack is damaged.
 *
 *     dw_pack pack;
 *     dw_pack_entry heart;
 *     if (dw_pack_open(&pack, flash, length) && dw_pack_find(&pack, "heart", 5, &heart)) ...
 */
#ifndef DOTWAVE_PACK_H
#define DOTWAVE_PACK_H

#include <string.h>

#include "dotwave_decoder.h"

#define DW_PACK_HEAD 60u
#define DW_PACK_SEALED 56u
#define DW_PACK_VERSION 1u
#define DW_PACK_ENTRY 32u
#define DW_PACK_PART 6u
#define DW_PACK_WAY 12u
#define DW_PACK_CURVE 12u
#define DW_PACK_LINKS 0xffffu        /* place of a part: the links of the row */
#define DW_PACK_NO_PATTERN 0xffffffffu /* settled: nothing is to be felt */
#define DW_PACK_PHASES 2u

typedef struct {
    const uint8_t *bytes;
    uint32_t length;
    uint16_t rows, cols, channels;
    uint32_t rate_hz, entries, entries_at, places_at, rest_crc;
    float full_volts, lam_max;
} dw_pack;

typedef struct {
    const uint8_t *name, *spoken, *pattern; /* UTF-8; a byte of percent for each actuator, row by row */
    uint32_t name_length, spoken_length, code_point, frames, frames_at;
} dw_pack_entry;

typedef struct {
    uint32_t settled, samples;
    const uint8_t *ways; /* u32 for each row */
} dw_pack_frame;

/* What one channel, or the links of a row, does in a frame: `pieces` of `size` bytes. */
typedef struct {
    uint16_t place; /* DW_PACK_LINKS, or which channel of the row */
    uint64_t turns;
    uint32_t pieces, size;
    const uint8_t *first;
} dw_pack_part;

static inline int dw_pack_has(const dw_pack *pack, uint32_t at, uint64_t length)
{
    return at <= pack->length && length <= pack->length - at;
}

static inline int dw_pack_open(dw_pack *pack, const uint8_t *bytes, uint32_t length)
{
    static const uint8_t magic[8] = {'d', 'w', 'p', 'a', 'c', 'k', '\r', '\n'};
    memset(pack, 0, sizeof *pack);
    if (length < DW_PACK_HEAD || memcmp(bytes, magic, sizeof magic) != 0 || dw_u16(bytes + 8) != DW_PACK_VERSION) return 0;
    if (dw_crc32(bytes, DW_PACK_SEALED) != dw_u32(bytes + DW_PACK_SEALED) || dw_u32(bytes + 48) > length) return 0;
    pack->bytes = bytes;
    pack->length = dw_u32(bytes + 48);
    pack->rows = dw_u16(bytes + 10);
    pack->cols = dw_u16(bytes + 12);
    pack->channels = dw_u16(bytes + 14);
    pack->rate_hz = dw_u32(bytes + 16);
    pack->full_volts = dw_f32(bytes + 20);
    pack->lam_max = dw_f32(bytes + 24);
    pack->entries = dw_u32(bytes + 28);
    pack->entries_at = dw_u32(bytes + 32);
    pack->places_at = dw_u32(bytes + 36);
    pack->rest_crc = dw_u32(bytes + 52);
    return pack->length >= DW_PACK_HEAD && pack->rows && pack->cols && pack->channels && pack->channels % pack->rows == 0 &&
           dw_pack_has(pack, pack->entries_at, (uint64_t)pack->entries * DW_PACK_ENTRY) &&
           dw_pack_has(pack, pack->places_at, 2u * (uint64_t)pack->channels);
}

/* Every byte held against the CRC; reads the whole pack. */
static inline int dw_pack_whole(const dw_pack *pack)
{
    return dw_crc32(pack->bytes + DW_PACK_HEAD, pack->length - DW_PACK_HEAD) == pack->rest_crc;
}

static inline int dw_pack_at(const dw_pack *pack, uint32_t index, dw_pack_entry *entry)
{
    const uint8_t *p;
    uint32_t name_at, pattern_at;
    if (index >= pack->entries) return 0;
    p = pack->bytes + pack->entries_at + index * DW_PACK_ENTRY;
    name_at = dw_u32(p);
    entry->name_length = dw_u16(p + 4);
    entry->spoken_length = dw_u16(p + 6);
    entry->code_point = dw_u32(p + 8);
    entry->frames_at = dw_u32(p + 12);
    entry->frames = dw_u32(p + 16);
    pattern_at = dw_u32(p + 20);
    if (!dw_pack_has(pack, name_at, entry->name_length + entry->spoken_length) ||
        !dw_pack_has(pack, pattern_at, (uint64_t)pack->rows * pack->cols) ||
        !dw_pack_has(pack, entry->frames_at, (uint64_t)entry->frames * (8u + 4u * (uint64_t)pack->rows)))
        return 0;
    entry->name = pack->bytes + name_at;
    entry->spoken = entry->name + entry->name_length;
    entry->pattern = pack->bytes + pattern_at;
    return 1;
}

/* Names stand in the order of their bytes; half of what is left is ruled out by each look. */
static inline int dw_pack_find(const dw_pack *pack, const char *name, uint32_t length, dw_pack_entry *entry)
{
    uint32_t low = 0, high = pack->entries;
    while (low < high) {
        uint32_t middle = low + (high - low) / 2u, shorter;
        int order;
        if (!dw_pack_at(pack, middle, entry)) return 0;
        shorter = entry->name_length < length ? entry->name_length : length;
        order = memcmp(entry->name, name, shorter);
        if (order == 0 && entry->name_length == length) return 1;
        if (order < 0 || (order == 0 && entry->name_length < length)) low = middle + 1u;
        else high = middle;
    }
    return 0;
}

static inline int dw_pack_frame_at(const dw_pack *pack, const dw_pack_entry *entry, uint32_t index, dw_pack_frame *frame)
{
    const uint8_t *p = pack->bytes + entry->frames_at + index * (8u + 4u * pack->rows);
    if (index >= entry->frames) return 0;
    frame->settled = dw_u32(p);
    frame->samples = dw_u32(p + 4);
    frame->ways = p + 8;
    return 1;
}

/* Part `index` of what `row` does in a frame; 0 when there is none, or it is damaged (then *whole becomes 0). */
static inline int dw_pack_part_at(
    const dw_pack *pack, const dw_pack_frame *frame, uint32_t row, uint32_t index, dw_pack_part *part, int *whole)
{
    uint32_t way = dw_u32(frame->ways + 4u * row), curve;
    uint64_t parts, each;
    const uint8_t *p = pack->bytes + way;
    if (!dw_pack_has(pack, way, DW_PACK_WAY)) return *whole = 0;
    if (index >= dw_u16(p + 2)) return 0;
    each = 4u * (uint64_t)pack->cols;
    parts = DW_PACK_WAY + each * (p[0] & DW_PACK_PHASES ? 3u : 2u) + 8u * (uint64_t)p[1] + DW_PACK_PART * (uint64_t)index;
    if (!dw_pack_has(pack, way, parts + DW_PACK_PART)) return *whole = 0;
    p += parts;
    part->place = dw_u16(p);
    curve = dw_u32(p + 2);
    if (!dw_pack_has(pack, curve, DW_PACK_CURVE)) return *whole = 0;
    if (part->place != DW_PACK_LINKS && part->place >= pack->channels / pack->rows) return *whole = 0;
    p = pack->bytes + curve;
    part->turns = dw_u64(p);
    part->pieces = dw_u32(p + 8);
    part->first = p + DW_PACK_CURVE;
    if (part->place == DW_PACK_LINKS) part->size = 8u + 4u * (pack->cols - 1u);
    else part->size = part->turns ? 40u : 24u;
    if (!dw_pack_has(pack, curve, DW_PACK_CURVE + (uint64_t)part->pieces * part->size)) return *whole = 0;
    return 1;
}

/* Which output a place of a row is. */
static inline uint16_t dw_pack_channel(const dw_pack *pack, uint32_t row, uint16_t place)
{
    return dw_u16(pack->bytes + pack->places_at + 2u * (row * (uint32_t)(pack->channels / pack->rows) + place));
}

#endif

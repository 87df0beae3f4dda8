/* Reference decoder and encoder for the dotwave controller protocol (see ../PROTOCOL.md), versions 1 to 6.
 *
 * C99, one header, no allocation, no library but <stdint.h> and <stddef.h>. Feed it every byte that comes; it
 * passes over whatever is no packet, and never reads or writes outside its own struct, whatever the bytes are.
 *
 *     static dw_decoder in;                      // zero-initialised: ready
 *     if (dw_feed(&in, uart_read())) handle(&in.packet);
 *
 * The packet and its payload stay valid until the next call of dw_feed.
 */
#ifndef DOTWAVE_DECODER_H
#define DOTWAVE_DECODER_H

#include <stddef.h>
#include <stdint.h>

#ifndef DW_MAX_PAYLOAD
#define DW_MAX_PAYLOAD 4096u /* announce what you choose in CAPABILITIES.max_payload */
#endif
#define DW_HEAD 5u
#define DW_SEAL 4u
#define DW_MAX_BODY (DW_HEAD + DW_MAX_PAYLOAD + DW_SEAL)
#define DW_MAX_WIRE (DW_MAX_BODY + DW_MAX_BODY / 254u + 2u)

enum dw_kind {
    DW_HELLO = 0x01, DW_STATUS = 0x02, DW_HEARTBEAT = 0x03, DW_STOP = 0x04, DW_KEYED = 0x05,
    DW_START = 0x10, DW_COUPLING = 0x11, DW_BIAS = 0x12, DW_TONES = 0x13, DW_MARK = 0x14, DW_SAMPLES = 0x15,
    DW_END = 0x16, DW_MEASURE = 0x17, DW_ENVELOPE = 0x18, DW_LINKS_TO = 0x19,
    DW_CAPABILITIES = 0x81, DW_ACK = 0x82, DW_MARKED = 0x83, DW_REFUSED = 0x84, DW_MEASURED = 0x85, DW_KEY = 0x86
};

typedef struct {
    uint8_t kind;
    uint32_t number;
    const uint8_t *payload;
    uint32_t length;
} dw_packet;

typedef struct {
    dw_packet packet;
    uint32_t bad; /* frames that were no packet */
    /* private */
    uint32_t length;   /* unstuffed bytes in body */
    uint32_t seen;     /* stuffed bytes of this frame */
    uint8_t run;       /* bytes left of the present run */
    uint8_t zero_due;  /* the run that ends was not full: a zero follows if more comes */
    uint8_t broken;    /* too long: skip to the next zero */
    uint8_t body[DW_MAX_BODY];
} dw_decoder;

/* CRC-32 (reflected, polynomial 0xEDB88320, as in zlib), four bits at a time. */
static inline uint32_t dw_crc32(const uint8_t *data, uint32_t length)
{
    static const uint32_t table[16] = {
        0x00000000u, 0x1db71064u, 0x3b6e20c8u, 0x26d930acu, 0x76dc4190u, 0x6b6b51f4u, 0x4db26158u, 0x5005713cu,
        0xedb88320u, 0xf00f9344u, 0xd6d6a3e8u, 0xcb61b38cu, 0x9b64c2b0u, 0x86d3d2d4u, 0xa00ae278u, 0xbdbdf21cu};
    uint32_t crc = 0xffffffffu;
    for (uint32_t i = 0; i < length; i++) {
        crc ^= data[i];
        crc = (crc >> 4) ^ table[crc & 15u];
        crc = (crc >> 4) ^ table[crc & 15u];
    }
    return ~crc;
}

static inline uint16_t dw_u16(const uint8_t *p) { return (uint16_t)(p[0] | (uint16_t)(p[1] << 8)); }
static inline uint32_t dw_u32(const uint8_t *p) { return (uint32_t)dw_u16(p) | ((uint32_t)dw_u16(p + 2) << 16); }
static inline uint64_t dw_u64(const uint8_t *p) { return (uint64_t)dw_u32(p) | ((uint64_t)dw_u32(p + 4) << 32); }
static inline int16_t dw_i16(const uint8_t *p)
{
    int32_t value = dw_u16(p);
    return (int16_t)(value >= 0x8000 ? value - 0x10000 : value);
}
static inline float dw_f32(const uint8_t *p)
{
    union { uint32_t bits; float value; } both;
    both.bits = dw_u32(p);
    return both.value;
}

static inline void dw_put16(uint8_t *p, uint16_t v) { p[0] = (uint8_t)v; p[1] = (uint8_t)(v >> 8); }
static inline void dw_put32(uint8_t *p, uint32_t v) { dw_put16(p, (uint16_t)v); dw_put16(p + 2, (uint16_t)(v >> 16)); }
static inline void dw_put64(uint8_t *p, uint64_t v) { dw_put32(p, (uint32_t)v); dw_put32(p + 4, (uint32_t)(v >> 32)); }

/* Whether a payload of `length` bytes is right for `kind`: `fixed` bytes, then any number of items. */
static inline int dw_length_fits(uint8_t kind, uint32_t length)
{
    uint32_t fixed, item;
    switch (kind) {
    case DW_HELLO: fixed = 2; item = 0; break;
    case DW_STATUS: case DW_HEARTBEAT: case DW_STOP: fixed = 0; item = 0; break;
    case DW_KEYED: fixed = 4; item = 0; break;
    case DW_START: fixed = 17; item = 1; break;
    case DW_COUPLING: fixed = 14; item = 2; break;
    case DW_BIAS: fixed = 18; item = 0; break;
    case DW_TONES: fixed = 14; item = 12; break;
    case DW_MARK: fixed = 12; item = 1; break;
    case DW_SAMPLES: fixed = 10; item = 2; break;
    case DW_END: fixed = 8; item = 0; break;
    case DW_MEASURE: fixed = 16; item = 8; break;
    case DW_ENVELOPE: fixed = 22; item = 8; break;
    case DW_LINKS_TO: fixed = 14; item = 4; break;
    case DW_CAPABILITIES: fixed = 45; item = 1; break;
    case DW_ACK: fixed = 58; item = 4; break;
    case DW_MARKED: fixed = 20; item = 0; break;
    case DW_REFUSED: fixed = 4; item = 1; break;
    case DW_MEASURED: fixed = 10; item = 24; break;
    case DW_KEY: fixed = 4; item = 2; break;
    default: return 0;
    }
    if (length < fixed || length > DW_MAX_PAYLOAD) return 0;
    return item ? (length - fixed) % item == 0 : length == fixed;
}

static inline int dw_end_of_frame(dw_decoder *d)
{
    uint32_t length = d->length, seen = d->seen;
    int whole = !d->broken && d->run == 0;
    d->length = d->seen = 0;
    d->run = d->zero_due = d->broken = 0;
    if (seen == 0) return 0; /* zeros in a row are no frame */
    if (!whole || length < DW_HEAD + DW_SEAL || dw_crc32(d->body, length - DW_SEAL) != dw_u32(d->body + length - DW_SEAL) ||
        !dw_length_fits(d->body[0], length - DW_HEAD - DW_SEAL)) {
        d->bad++;
        return 0;
    }
    d->packet.kind = d->body[0];
    d->packet.number = dw_u32(d->body + 1);
    d->packet.payload = d->body + DW_HEAD;
    d->packet.length = length - DW_HEAD - DW_SEAL;
    return 1;
}

static inline void dw_append(dw_decoder *d, uint8_t byte)
{
    if (d->length < DW_MAX_BODY) d->body[d->length++] = byte;
    else d->broken = 1;
}

/* Take one byte; 1 when it completes a packet, which is then in d->packet. */
static inline int dw_feed(dw_decoder *d, uint8_t byte)
{
    if (byte == 0) return dw_end_of_frame(d);
    if (d->seen < DW_MAX_WIRE) d->seen++;
    if (d->broken) return 0;
    if (d->run) {
        d->run--;
        dw_append(d, byte);
    } else {
        if (d->zero_due) dw_append(d, 0);
        d->zero_due = byte != 0xff;
        d->run = (uint8_t)(byte - 1);
    }
    return 0;
}

/* Write a packet with its final zero to `out` (room for DW_MAX_WIRE bytes); returns its length, 0 when the payload
 * has not the length of its kind. Unstuffed bytes come from `dw_byte_at`, so no second buffer is needed. */
static inline uint8_t dw_byte_at(const uint8_t *head, const uint8_t *payload, uint32_t length, const uint8_t *seal, uint32_t i)
{
    if (i < DW_HEAD) return head[i];
    if (i < DW_HEAD + length) return payload[i - DW_HEAD];
    return seal[i - DW_HEAD - length];
}

static inline uint32_t dw_encode(uint8_t *out, uint8_t kind, uint32_t number, const uint8_t *payload, uint32_t length)
{
    uint8_t head[DW_HEAD], seal[DW_SEAL];
    uint32_t crc = 0xffffffffu, at = 1, code_at = 0, total = DW_HEAD + length + DW_SEAL;
    if (!dw_length_fits(kind, length)) return 0;
    head[0] = kind;
    dw_put32(head + 1, number);
    for (uint32_t i = 0; i < DW_HEAD + length; i++) {
        crc ^= i < DW_HEAD ? head[i] : payload[i - DW_HEAD];
        for (int bit = 0; bit < 8; bit++) crc = (crc >> 1) ^ (crc & 1u ? 0xedb88320u : 0u);
    }
    dw_put32(seal, ~crc);
    out[0] = 1;
    for (uint32_t i = 0; i < total; i++) {
        uint8_t byte = dw_byte_at(head, payload, length, seal, i);
        if (byte) {
            out[at++] = byte;
            out[code_at]++;
        }
        /* A full run closes itself; a new one is opened only when more follows. */
        if (!byte || (out[code_at] == 0xff && i + 1 < total)) {
            code_at = at;
            out[at++] = 1;
        }
    }
    out[at++] = 0;
    return at;
}

#endif

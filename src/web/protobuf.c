#include "web/protobuf.h"

#include <string.h>

enum { VARINT = 0, FIXED64 = 1, COUNTED = 2, FIXED32 = 5, VARINT_BYTES_MAX = 10 };

static size_t varint(uint64_t value, uint8_t to[VARINT_BYTES_MAX])
{
    size_t bytes = 0;
    for (; value >= 0x80; value >>= 7)
        to[bytes++] = (uint8_t)(value | 0x80);
    to[bytes++] = (uint8_t)value;
    return bytes;
}

static void put(struct fv_protobuf *to, const void *data, size_t bytes)
{
    if (to->full || bytes > to->capacity - to->bytes) {
        to->full = true;
        return;
    }
    if (bytes > 0) memcpy(to->data + to->bytes, data, bytes);
    to->bytes += bytes;
}

static void put_varint(struct fv_protobuf *to, uint64_t value)
{
    uint8_t made[VARINT_BYTES_MAX];
    put(to, made, varint(value, made));
}

static void put_tag(struct fv_protobuf *to, uint32_t field, uint32_t wire)
{
    put_varint(to, (uint64_t)field << 3 | wire);
}

/* Little-endian, whatever the host is. */
static void put_fixed(struct fv_protobuf *to, uint64_t value, int bytes)
{
    uint8_t made[8];
    for (int i = 0; i < bytes; i++)
        made[i] = (uint8_t)(value >> 8 * i);
    put(to, made, (size_t)bytes);
}

void fv_protobuf_number(struct fv_protobuf *to, uint32_t field, uint64_t value)
{
    if (value == 0) return;
    put_tag(to, field, VARINT);
    put_varint(to, value);
}

void fv_protobuf_fixed32(struct fv_protobuf *to, uint32_t field, uint32_t value)
{
    if (value == 0) return;
    put_tag(to, field, FIXED32);
    put_fixed(to, value, 4);
}

void fv_protobuf_double(struct fv_protobuf *to, uint32_t field, double value)
{
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    if (bits == 0) return;
    put_tag(to, field, FIXED64);
    put_fixed(to, bits, 8);
}

void fv_protobuf_head(struct fv_protobuf *to, uint32_t field, size_t bytes)
{
    put_tag(to, field, COUNTED);
    put_varint(to, bytes);
}

void fv_protobuf_more_float(struct fv_protobuf *to, float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    put_fixed(to, bits, sizeof bits);
}

void fv_protobuf_bytes(struct fv_protobuf *to, uint32_t field, const uint8_t *data, size_t bytes)
{
    if (bytes == 0) return;
    fv_protobuf_head(to, field, bytes);
    put(to, data, bytes);
}

void fv_protobuf_text(struct fv_protobuf *to, uint32_t field, const char *text)
{
    fv_protobuf_bytes(to, field, (const uint8_t *)text, strlen(text));
}

/* One byte is left for the length; a message that needs more of them moves at its end. */
size_t fv_protobuf_begin(struct fv_protobuf *to, uint32_t field)
{
    put_tag(to, field, COUNTED);
    put(to, &(const uint8_t){0}, 1);
    return to->bytes;
}

void fv_protobuf_end(struct fv_protobuf *to, size_t begun)
{
    uint8_t made[VARINT_BYTES_MAX];
    if (to->full) return;
    const size_t inside = to->bytes - begun, bytes = varint(inside, made);
    if (bytes - 1 > to->capacity - to->bytes) {
        to->full = true;
        return;
    }
    memmove(to->data + begun + bytes - 1, to->data + begun, inside);
    memcpy(to->data + begun - 1, made, bytes);
    to->bytes += bytes - 1;
}

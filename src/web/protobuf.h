/* Writes messages of Protocol Buffers (protobuf.dev/programming-guides/encoding), version 3, into
 * memory of the caller: fields in the order of the calls, numbers of 0 left out, as its own
 * libraries write them. What does not fit sets `full`, and nothing more is written. No heap. */
#ifndef FOVEA_WEB_PROTOBUF_H
#define FOVEA_WEB_PROTOBUF_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct fv_protobuf {
    uint8_t *data;
    size_t bytes, capacity;
    bool full;
};

/* Fields of the message that is written. Negative numbers of int32 and int64: as they are, cast. */
void fv_protobuf_number(struct fv_protobuf *to, uint32_t field, uint64_t value);
void fv_protobuf_fixed32(struct fv_protobuf *to, uint32_t field, uint32_t value);
void fv_protobuf_double(struct fv_protobuf *to, uint32_t field, double value);
void fv_protobuf_text(struct fv_protobuf *to, uint32_t field, const char *text);
void fv_protobuf_bytes(struct fv_protobuf *to, uint32_t field, const uint8_t *data, size_t bytes);
/* The head of a field of that many bytes, which must follow it piece by piece. */
void fv_protobuf_head(struct fv_protobuf *to, uint32_t field, size_t bytes);
void fv_protobuf_more_float(struct fv_protobuf *to, float value);

/* What is written between these two is a message inside it; `end` takes what `begin` returned. */
size_t fv_protobuf_begin(struct fv_protobuf *to, uint32_t field);
void fv_protobuf_end(struct fv_protobuf *to, size_t begun);

#endif

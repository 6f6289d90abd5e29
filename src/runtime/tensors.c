#include "runtime/tensors.h"

#include <string.h>

#include "nn/tensor.h"

enum { WIDE_BYTES = 8, ELEMENT_BYTES = 4 };

static size_t bytes_of(const struct fv_model *model, int32_t tensor)
{
    struct fovea_tensor t;
    fv_tensor_describe(model, tensor, &t);
    return t.type == FOVEA_TENSOR_INT64 ? t.bytes / WIDE_BYTES * ELEMENT_BYTES : t.bytes;
}

size_t fv_tensors_bytes(const struct fv_model *model)
{
    size_t bytes = 0;
    for (uint32_t i = 0; i < fv_model_output_count(model); i++)
        bytes += bytes_of(model, fv_model_output(model, i));
    return bytes;
}

/* Messages have no 64-bit integers: the nearest value of 32 bits. */
static int32_t narrowed(int64_t value)
{
    return value > INT32_MAX ? INT32_MAX : value < INT32_MIN ? INT32_MIN : (int32_t)value;
}

/* Bytes [first, first + count) of an output as messages hold it. */
static void read_piece(const struct fv_model *model, int32_t tensor, uint8_t *arena, size_t first,
                       size_t count, uint8_t *out)
{
    struct fovea_tensor t;
    fv_tensor_describe(model, tensor, &t);
    if (t.type != FOVEA_TENSOR_INT64) {
        fv_tensor_read_some(model, tensor, arena, first, count, out);
        return;
    }
    for (size_t i = 0; i < count; i += ELEMENT_BYTES) {
        int64_t value;
        uint8_t bytes[WIDE_BYTES];
        fv_tensor_read_some(model, tensor, arena, (first + i) / ELEMENT_BYTES * WIDE_BYTES,
                            WIDE_BYTES, bytes);
        memcpy(&value, bytes, sizeof value);
        const int32_t narrow = narrowed(value);
        memcpy(out + i, &narrow, sizeof narrow);
    }
}

static void describe(const struct fv_model *model, uint32_t output, struct fovea_tensor *t)
{
    fv_tensor_describe(model, fv_model_output(model, output), t);
    fv_tensor_output_name(model, output, t->name);
    t->bytes = bytes_of(model, fv_model_output(model, output));
    if (t->type == FOVEA_TENSOR_INT64) t->type = FOVEA_TENSOR_INT32;
}

uint32_t fv_tensors_encode(const struct fv_model *model, uint8_t *arena, const fovea_stamp_t *stamp,
                           uint32_t *sent, uint8_t *scratch, uint8_t *buffer, size_t capacity)
{
    struct fv_message_tensors message = {.stamp = *stamp, .model = fv_model_name(model)};
    size_t skip = *sent, used = 0;
    for (uint32_t i = 0; i < fv_model_output_count(model); i++) {
        const int32_t tensor = fv_model_output(model, i);
        const size_t bytes = bytes_of(model, tensor);
        if (skip >= bytes) { /* in earlier messages */
            skip -= bytes;
            continue;
        }
        const size_t room = (FV_MESSAGE_TENSOR_BYTES_MAX - used) / ELEMENT_BYTES * ELEMENT_BYTES,
                     size = bytes - skip < room ? bytes - skip : room;
        if (size == 0) break;
        struct fv_message_tensor *piece = &message.pieces[message.count++];
        describe(model, i, &piece->tensor);
        read_piece(model, tensor, arena, skip, size, scratch + used);
        piece->first_byte = skip;
        piece->size_bytes = size;
        piece->data = scratch + used;
        used += size;
        skip = 0;
    }
    *sent += (uint32_t)used;
    return fv_message_tensors_encode(&message, buffer, capacity);
}

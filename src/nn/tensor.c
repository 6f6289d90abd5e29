#include "nn/tensor.h"

#include <stdio.h>
#include <string.h>

static const uint8_t element_bytes[FV_TYPE_COUNT] = {1, 4, 8, 4};

size_t fv_tensor_bytes(const struct fv_model *model, int32_t tensor)
{
    const struct fv_model_tensor *t = &model->tensors[tensor];
    size_t bytes = element_bytes[t->type];
    for (int32_t i = 0; i < t->rank; i++)
        bytes *= (size_t)t->dims[i];
    return bytes;
}

void fv_tensor_describe(const struct fv_model *model, int32_t tensor, struct fovea_tensor *out)
{
    static const enum fovea_tensor_type types[FV_TYPE_COUNT] = {
        FOVEA_TENSOR_UINT8, FOVEA_TENSOR_INT32, FOVEA_TENSOR_INT64, FOVEA_TENSOR_FLOAT32};
    const struct fv_model_tensor *t = &model->tensors[tensor];
    const int is_signed = t->type == FV_TYPE_U8 && (t->flags & FV_TENSOR_SIGNED) != 0;
    *out = (struct fovea_tensor){.type = is_signed ? FOVEA_TENSOR_INT8 : types[t->type],
                                 .axis_count = t->rank,
                                 .scale = t->type == FV_TYPE_U8 ? t->scale : 1.0f,
                                 .zero_point =
                                     t->type == FV_TYPE_U8 ? t->zero - (is_signed ? 128 : 0) : 0,
                                 .bytes = fv_tensor_bytes(model, tensor)};
    for (int32_t i = 0; i < t->rank; i++)
        out->shape[i] = t->dims[i];
}

void fv_tensor_output_name(const struct fv_model *model, uint32_t index,
                           char name[FOVEA_TENSOR_NAME_BYTES])
{
    const char *given = fv_model_output_name(model, index);
    if (given != NULL && given[0] != 0)
        snprintf(name, FOVEA_TENSOR_NAME_BYTES, "%s", given);
    else
        snprintf(name, FOVEA_TENSOR_NAME_BYTES, "output%u", index);
}

/* Where byte `at` of the packed elements lies, and how many follow it without a gap. */
static size_t place_of(const struct fv_model_tensor *t, size_t at, size_t *left)
{
    const size_t last = (size_t)(t->rank == 0 ? 1 : t->dims[t->rank - 1]) * element_bytes[t->type];
    *left = last - at % last;
    return at / last * (size_t)t->pixel_stride + at % last;
}

void fv_tensor_read_some(const struct fv_model *model, int32_t tensor, uint8_t *arena, size_t first,
                         size_t count, uint8_t *out)
{
    const struct fv_model_tensor *t = &model->tensors[tensor];
    const uint8_t *from = fv_nn_tensor(model, arena, tensor),
                  flip = (t->flags & FV_TENSOR_SIGNED) != 0 ? 0x80 : 0;
    for (size_t i = 0, some; i < count; i += some) {
        const size_t at = place_of(t, first + i, &some);
        some = some < count - i ? some : count - i;
        memcpy(out + i, from + at, some);
    }
    for (size_t i = 0; i < count && flip != 0; i++)
        out[i] ^= flip;
}

void fv_tensor_read(const struct fv_model *model, int32_t tensor, uint8_t *arena, void *out)
{
    fv_tensor_read_some(model, tensor, arena, 0, fv_tensor_bytes(model, tensor), out);
}

void fv_tensor_write(const struct fv_model *model, int32_t tensor, uint8_t *arena, const void *data)
{
    const struct fv_model_tensor *t = &model->tensors[tensor];
    uint8_t *to = fv_nn_tensor(model, arena, tensor);
    const uint8_t *from = data, flip = (t->flags & FV_TENSOR_SIGNED) != 0 ? 0x80 : 0;
    const size_t count = fv_tensor_bytes(model, tensor);
    for (size_t i = 0, some; i < count; i += some) {
        const size_t at = place_of(t, i, &some);
        for (size_t k = 0; k < some; k++)
            to[at + k] = from[i + k] ^ flip;
    }
}

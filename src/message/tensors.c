/* Raw outputs of networks as LCM bytes. */
#include <assert.h>

#include "message/message.h"
#include "message/wire.h"

#include "fovea_tensors_t.h"

static_assert((int)FV_MESSAGE_TENSOR_BYTES_MAX == FOVEA_TENSORS_T_BYTES_MAX &&
                  (int)FV_MESSAGE_TENSORS_MAX <= FOVEA_TENSORS_T_COUNT_MAX,
              "the limits of tensors_t");
static_assert((int)FOVEA_TENSOR_INT8 == FOVEA_TENSOR_T_TYPE_INT8 &&
                  (int)FOVEA_TENSOR_UINT8 == FOVEA_TENSOR_T_TYPE_UINT8 &&
                  (int)FOVEA_TENSOR_INT32 == FOVEA_TENSOR_T_TYPE_INT32 &&
                  (int)FOVEA_TENSOR_FLOAT32 == FOVEA_TENSOR_T_TYPE_FLOAT32,
              "the types of tensor_t");

uint32_t fv_message_tensors_encode(const struct fv_message_tensors *in, uint8_t *buffer,
                                   size_t capacity)
{
    fovea_tensor_t list[FV_MESSAGE_TENSORS_MAX];
    char model[FV_MESSAGE_LABEL_BYTES_MAX];
    fv_message_label(in->model, model);
    for (uint32_t i = 0; i < in->count; i++) {
        const struct fv_message_tensor *piece = &in->pieces[i];
        const struct fovea_tensor *t = &piece->tensor;
        list[i] = (fovea_tensor_t){
            .name = (char *)t->name, /* lcm-gen only reads these */
            .type = (int8_t)t->type,
            .dimension_count = t->axis_count,
            .shape = (int32_t *)t->shape,
            .scale = t->scale,
            .zero_point = t->zero_point,
            .whole_bytes = (int64_t)t->bytes,
            .first_byte = (int64_t)piece->first_byte,
            .size_bytes = (int32_t)piece->size_bytes,
            .data = (uint8_t *)piece->data,
        };
    }
    const fovea_tensors_t message = {
        .stamp = in->stamp, .model = model, .count = (int32_t)in->count, .tensors = list};
    return fv_wire_encoded(fovea_tensors_t_encode(buffer, 0, fv_wire_capacity(capacity), &message));
}

/* A model's tensors as others see them: in the types of the .tflite file, packed. Real-time safe.
 */
#ifndef FOVEA_NN_TENSOR_H
#define FOVEA_NN_TENSOR_H

#include "fovea/network.h"
#include "nn/run.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Bytes of all elements, packed. */
size_t fv_tensor_bytes(const struct fv_model *model, int32_t tensor);

/* Everything but the name and the data. */
void fv_tensor_describe(const struct fv_model *model, int32_t tensor, struct fovea_tensor *out);

/* The name of output `index`, "output0" and so on where the file gives none. */
void fv_tensor_output_name(const struct fv_model *model, uint32_t index,
                           char name[FOVEA_TENSOR_NAME_BYTES]);

/* Packed elements out of the arena and into it; bytes that stand for int8 change their form. */
void fv_tensor_read(const struct fv_model *model, int32_t tensor, uint8_t *arena, void *out);
void fv_tensor_write(const struct fv_model *model, int32_t tensor, uint8_t *arena,
                     const void *data);

/* The same for `count` bytes from byte `first` of the packed elements on. */
void fv_tensor_read_some(const struct fv_model *model, int32_t tensor, uint8_t *arena, size_t first,
                         size_t count, uint8_t *out);

#ifdef __cplusplus
}
#endif
#endif

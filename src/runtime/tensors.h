/* The raw outputs of a network without a decoder, as messages: pieces of at most one packet, in the
 * order of the outputs and of their bytes. */
#ifndef FOVEA_RUNTIME_TENSORS_H
#define FOVEA_RUNTIME_TENSORS_H

#include "message/message.h"
#include "nn/run.h"

/* Bytes of all outputs as messages hold them: 64-bit integers as 32-bit ones. */
size_t fv_tensors_bytes(const struct fv_model *model);

/* Encode the next message of a finished run, from byte `*sent` of all outputs on, which moves on by
 * what the message holds. `scratch`: FV_MESSAGE_TENSOR_BYTES_MAX bytes. Returns the message's
 * bytes. Real-time safe. */
uint32_t fv_tensors_encode(const struct fv_model *model, uint8_t *arena, const fovea_stamp_t *stamp,
                           uint32_t *sent, uint8_t *scratch, uint8_t *buffer, size_t capacity);

#endif

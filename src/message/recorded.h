/* What recordings hold besides published messages: frames, inputs and grants, into the caller's
 * memory and back.
 *
 * Encoders: real-time safe, return the bytes written or 0 when `capacity` is too small. Decoders
 * take events from outside: they check the message first, allocate nothing, and leave outputs
 * untouched when they refuse.
 */
#ifndef FOVEA_MESSAGE_RECORDED_H
#define FOVEA_MESSAGE_RECORDED_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "fovea/fovea.h"
#include "fovea_stamp_t.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    FV_MESSAGE_PARAMETERS_MAX = 8, /* changes of parameters that one step takes */
    FV_MESSAGE_MAP_NAME_BYTES = 128
};

/* Exact for frames. */
size_t fv_message_frame_size_max(const struct fovea_frame *frame);
size_t fv_message_rig_size_max(void);
size_t fv_message_sample_size_max(void);
size_t fv_message_inputs_size_max(void);
size_t fv_message_parameter_size_max(void);
/* Of a map file of `bytes` bytes whose name has less than FV_MESSAGE_MAP_NAME_BYTES. */
size_t fv_message_loaded_map_size_max(size_t bytes);
size_t fv_message_grants_size_max(void);

/* The pixels that count: all planes at the image's stride, or all of a compressed picture; 0: the
 * image is absent. */
size_t fv_message_image_bytes(const struct fovea_image *image);

uint32_t fv_message_frame_encode(const struct fovea_frame *frame, int64_t utc_offset_ns,
                                 uint8_t *buffer, size_t capacity);
/* A message of the sample's kind; its stamp is `stamp` at the sample's own time. */
uint32_t fv_message_sample_encode(const struct fovea_sample *sample, const fovea_stamp_t *stamp,
                                  uint8_t *buffer, size_t capacity);
uint32_t fv_message_rig_encode(const struct fovea_rig *rig, uint8_t *buffer, size_t capacity);
uint32_t fv_message_inputs_encode(const struct fovea_inputs *inputs, uint64_t frame_hash,
                                  uint8_t *buffer, size_t capacity);
uint32_t fv_message_grants_encode(int64_t now_ns, const struct fovea_grants *grants,
                                  uint8_t *buffer, size_t capacity);

/* A parameter_t with key and value alone, as recordings have it. */
uint32_t fv_message_parameter_encode(const char *key, const char *value, uint8_t *buffer,
                                     size_t capacity);

/* A loaded_map_t: in the time that copying it takes. */
uint32_t fv_message_loaded_map_encode(const char *file, const uint8_t *data, size_t bytes,
                                      uint8_t *buffer, size_t capacity);

/* `has_frame` and `frame_hash` tell of the frame that went with these inputs; inputs->frame and
 * inputs->samples are NULL, and sample_count includes changes of parameters and maps. Jobs that
 * this build does not have are refused, jobs that the recording did not have get no units. On
 * refusal
 * `*problem` and `*at` (byte within the message) say why and where. */
bool fv_message_inputs_decode(const uint8_t *data, size_t bytes, struct fovea_inputs *inputs,
                              bool *has_frame, uint64_t *frame_hash, const char **problem,
                              size_t *at);
bool fv_message_grants_decode(const uint8_t *data, size_t bytes, struct fovea_grants *grants,
                              const char **problem, size_t *at);

#ifdef __cplusplus
}
#endif
#endif

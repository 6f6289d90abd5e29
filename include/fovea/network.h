/* An int8 network by itself: it takes inputs and gives output tensors, with the scales that convert
 * them to real numbers. For networks whose outputs no decoder of the library reads
 * (embeddings, depth), and for programs that have their own.
 *
 * All memory is one block of the caller's. The model file (.fvm, made by tools/import) stays the
 * caller's too, and must stay as it is while the network is in use: it is read in place. Every
 * input is set before each run, since a run may overwrite it. The states that a model was imported
 * with (`tools/import --state`) are no inputs: they begin as zero and go from one run to the next
 * by themselves. Outputs are the same bits on every processor.
 *
 * Real-time safe but for size and init. Not for two threads at a time. */
#ifndef FOVEA_NETWORK_H
#define FOVEA_NETWORK_H

#include <stddef.h>
#include <stdint.h>

#include "fovea/image.h"
#include "fovea/status.h"

#ifdef __cplusplus
extern "C" {
#endif

struct fovea_network;

enum { FOVEA_TENSOR_AXES_MAX = 6, FOVEA_TENSOR_NAME_BYTES = 64 };

enum fovea_tensor_type {
    FOVEA_TENSOR_INT8 = 0,
    FOVEA_TENSOR_UINT8 = 1,
    FOVEA_TENSOR_INT32 = 3,
    FOVEA_TENSOR_FLOAT32 = 4,
    FOVEA_TENSOR_INT64 = 5 /* in tensors_t messages INT32, values beyond its range the nearest */
};

/* The real value of an 8-bit element q is scale (q - zero_point); of other types it is the element
 * itself, and scale is 1, zero_point 0. */
struct fovea_tensor {
    char name[FOVEA_TENSOR_NAME_BYTES]; /* of the .tflite file, or "input0", "output0"... */
    enum fovea_tensor_type type;
    int32_t axis_count, shape[FOVEA_TENSOR_AXES_MAX]; /* outermost first; the others are 0 */
    float scale;
    int32_t zero_point;
    size_t bytes;     /* of all elements */
    const void *data; /* row-major; NULL for inputs, and for outputs before the first run */
};

/* Bytes of the block for a model. Init-only. FOVEA_ERROR_INPUT: `error` names the byte of the model
 * at fault. */
enum fovea_status fovea_network_size(const void *model, size_t model_bytes, size_t *bytes,
                                     struct fovea_error *error);

/* Make a network in `memory`, which is at a multiple of 64, as is `model`. Init-only.
 * FOVEA_ERROR_MEMORY: the block is too small. */
enum fovea_status fovea_network_init(void *memory, size_t bytes, const void *model,
                                     size_t model_bytes, struct fovea_network **network,
                                     struct fovea_error *error);

uint32_t fovea_network_input_count(const struct fovea_network *network);
uint32_t fovea_network_output_count(const struct fovea_network *network);

/* Input or output `index`. FOVEA_ERROR_ARGUMENT: there is none; `tensor` is untouched. The data of
 * an output stay valid until the next run begins. */
enum fovea_status fovea_network_input(const struct fovea_network *network, uint32_t index,
                                      struct fovea_tensor *tensor);
enum fovea_status fovea_network_output(const struct fovea_network *network, uint32_t index,
                                       struct fovea_tensor *tensor);

/* Set an input to `bytes` bytes of elements as its tensor says, row-major. FOVEA_ERROR_ARGUMENT:
 * there is no such input, its size differs, or a run is under way. */
enum fovea_status fovea_network_set(struct fovea_network *network, uint32_t index, const void *data,
                                    size_t bytes);

/* Set the only input to an image, resized as the model says. FOVEA_ERROR_UNSUPPORTED: the model has
 * several inputs or takes no images, or the format cannot be read. FOVEA_ERROR_ARGUMENT: a run is
 * under way. */
enum fovea_status fovea_network_set_image(struct fovea_network *network,
                                          const struct fovea_image *image);

/* Go on with the run for at most `units` units of bounded work, 0: all. FOVEA_OK: the outputs
 * are there. FOVEA_AGAIN: units are left. FOVEA_ERROR_ARGUMENT: an input was not set since the last
 * run. */
enum fovea_status fovea_network_run(struct fovea_network *network, uint32_t units);

/* Begin again: the states become zero, inputs count as not set, a run under way is given up, and
 * outputs have no data until the next run. */
void fovea_network_reset(struct fovea_network *network);

#ifdef __cplusplus
}
#endif
#endif

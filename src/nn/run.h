/* Running a checked model in units.
 *
 * The state is the arena (fv_nn_arena_bytes, 64-byte aligned, owned by the caller) and a struct
 * fv_nn_progress; neither holds addresses, so both may be copied, moved and saved between units. A
 * unit is a run of rows of one operator worth at most FV_NN_UNIT_COST (or one row, if that is
 * more): 0.25 ms, as costs of rows are sixteenths of a nanosecond. Units depend on the model alone,
 * so a recorded number of units does the same work on every machine.
 *
 * Operators may overwrite the input tensors: write the inputs before every run. The states of a
 * model lie in the arena too: an arena of zeros, or fv_nn_clear_states, begins with all of them
 * real zeros; a run that is given up may leave some of them new and some old. All functions are
 * real-time safe and touch nothing but their arguments. */
#ifndef FOVEA_NN_RUN_H
#define FOVEA_NN_RUN_H

#include <stdbool.h>
#include <stdint.h>

#include "kernels/kernels.h"
#include "nn/model.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { FV_NN_UNIT_COST = 4000000 };

struct fv_nn_progress {
    int32_t op, row; /* what comes next */
};

size_t fv_nn_arena_bytes(const struct fv_model *model);

/* Make the states real zeros, as before the first run. */
void fv_nn_clear_states(const struct fv_model *model, uint8_t *arena);

/* Units that a whole run takes. */
uint32_t fv_nn_units(const struct fv_model *model);

/* Go on from `progress` ({0, 0} starts) for at most `units` units; `done` takes how many ran.
 * FOVEA_OK: the run is complete. FOVEA_AGAIN: units are left. */
enum fovea_status fv_nn_run(const struct fv_model *model, const struct fv_kernels *kernels,
                            uint8_t *arena, struct fv_nn_progress *progress, uint32_t units,
                            uint32_t *done);

/* Where a tensor's bytes are: in the arena, or in the file when constant (then not to be written).
 */
uint8_t *fv_nn_tensor(const struct fv_model *model, uint8_t *arena, int32_t tensor);

/* ---- operators, one file each; they compute rows [begin, end) of op->rows -------------------- */
struct fv_nn_call {
    const struct fv_model *model;
    const struct fv_kernels *kernels;
    const struct fv_model_op *op;
    uint8_t *in[4], *out[4], *scratch;
};
typedef void fv_nn_op_fn(const struct fv_nn_call *call, int32_t begin, int32_t end);
fv_nn_op_fn fv_nn_op_conv, fv_nn_op_depthwise, fv_nn_op_binary, fv_nn_op_pool, fv_nn_op_reduce,
    fv_nn_op_copy, fv_nn_op_fill, fv_nn_op_resize, fv_nn_op_softmax, fv_nn_op_arg_max,
    fv_nn_op_dequantize, fv_nn_op_quantize, fv_nn_op_cast, fv_nn_op_matmul, fv_nn_op_detection,
    fv_nn_op_normalise;

/* Where part `part` of `parts` (0 to `parts`) begins among `all` pieces of work, as even as can be:
 * all x part / parts, rounded down. That product has too many bits where both numbers are large. */
static inline int64_t fv_nn_part_first(int64_t all, int32_t part, int32_t parts)
{
    return all / parts * part + all % parts * part / parts;
}

/* LiteRT's fully connected layer: acc times a double, of which `low` and `high` are the words,
 * rounded once, halves away from zero; within +-100000. */
int32_t fv_nn_scale_once(int32_t acc, int32_t low, int32_t high);

/* Whether a detection's steps may be so many rows. Those of regular suppression are as many for
 * each class, from 1 to the boxes that it may select: the file decides how many boxes a step
 * selects. */
bool fv_nn_detection_rows_fit(const struct fv_op_detection *p, int32_t rows);

#ifdef __cplusplus
}
#endif
#endif

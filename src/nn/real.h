/* Rounding by real numbers that gives the bytes of fv_nn_requantize, for kernels that round towards
 * zero both a product of float32 plus an offset and its conversion: the integer part of sum factor
 * + offset takes three or four steps for 16 sums with AVX-512, the exact product of 64 bits seven
 * to eleven.
 *
 * Both ways never fall as the sum rises. So they give the same bytes for all sums that a channel
 * can have, if they do at the 255 sums at most where the exact way comes to a byte, and at the sums
 * just below. For a factor next to the exact one these sums bound the offset from both sides; where
 * there is a float32 between the bounds, the channel is rounded so, else exactly. Sums below zero
 * have the same offset with their sign, since the exact way rounds halves away from zero.
 *
 * Filled when a network is set up, within its memory; takes some microseconds a channel. Init-only,
 * but for fv_nn_real_of. */
#ifndef FOVEA_NN_REAL_H
#define FOVEA_NN_REAL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "base/arena.h"
#include "kernels/kernels.h"
#include "nn/model.h"

#ifdef __cplusplus
extern "C" {
#endif

/* One channel: its scale (contracts/nn.h), the bytes less the zero point that it gives, and the
 * sums that it can have. */
struct fv_nn_real_channel {
    int32_t multiplier, shift;
    int32_t first, last; /* results that differ from the least one */
    int64_t least, most;
};

/* The factor and the offset. False: there are none. */
bool fv_nn_real_find(const struct fv_nn_real_channel *channel, float found[2]);

/* Those of all channels, as `real` of the contract has them: 2 floats for each of n rounded up to
 * 16. */
void fv_nn_real_gemm(const struct fv_nn_gemm *gemm, float *real);
void fv_nn_real_depthwise(const struct fv_nn_depthwise *depthwise, float *real);

/* A model's table: how many bytes it takes; its place, zeroed and 64-byte aligned, which becomes
 * model->real; filling it, where the kernels use it; an operator's part of it, or NULL. A model
 * without a table, or whose table was not filled, is rounded exactly. */
size_t fv_nn_real_bytes(const struct fv_model *model);
void fv_nn_real_carve(struct fv_model *model, struct fv_arena *arena);
void fv_nn_real_fill(const struct fv_model *model, const struct fv_kernels *kernels);
const float *fv_nn_real_of(const struct fv_model *model, const struct fv_model_op *op);

#ifdef __cplusplus
}
#endif
#endif

/* What the two ways of a convolution share: rows that are gathered (op_conv.c), and rows whose
 * inputs the product reads where they lie (conv_apart.c). */
#ifndef FOVEA_NN_CONV_H
#define FOVEA_NN_CONV_H

#include "nn/run.h"

/* The arguments of the kernel that computes an operator. */
struct fv_nn_gemm fv_nn_gemm_of(const struct fv_model *model, const struct fv_model_op *op);
struct fv_nn_depthwise fv_nn_depthwise_of(const struct fv_model *model,
                                          const struct fv_model_op *op);

/* What gathering asks of a convolution, once for all its rows. */
struct fv_nn_gathering {
    const struct fv_nn_call *call;
    const struct fv_op_conv *c;
    int32_t begin, end; /* of the output columns whose kernel rows are one run inside the image */
};

/* The inputs of `count` pixels of output row `row`, counted over all images, from column x on: in
 * rows of k bytes, `pitch` apart; writes up to 15 bytes past k. */
void fv_nn_gather(const struct fv_nn_gathering *g, int32_t row, int32_t x, int32_t count,
                  uint8_t *rows, ptrdiff_t pitch);

/* Rows [begin, end) of a convolution without gathering, but at borders. 0: it was not done, as
 * gathering is faster here. */
int fv_nn_conv_apart(const struct fv_nn_gathering *g, const struct fv_nn_gemm *gemm, int32_t begin,
                     int32_t end, ptrdiff_t pitch);

#endif

#include "kernels/x86/nn_depthwise_avx512.h"

void fv_k_nn_depthwise_u8__avx512icl(const struct fv_nn_depthwise *d, const uint8_t *in,
                                     uint8_t *out, int32_t begin, int32_t end, uint8_t *scratch)
{
    depthwise(d, in, out, begin, end, scratch);
}

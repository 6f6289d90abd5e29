/* Depthwise convolution with vpdpbusd, for the files of the VNNI and the Ice Lake set.
 *
 * The bytes of up to four rows are interleaved, so that one 32-bit lane holds one channel's column
 * of the kernel, and each column of the kernel costs one vpdpbusd per 16 channels. Three ways:
 * blocks, flat rows and streams. */
#ifndef FOVEA_KERNELS_X86_NN_DEPTHWISE_AVX512_H
#define FOVEA_KERNELS_X86_NN_DEPTHWISE_AVX512_H

#include "kernels/x86/nn_depthwise_blocks_avx512.h"
#include "kernels/x86/nn_depthwise_flat_avx512.h"
#include "kernels/x86/nn_depthwise_streams_avx512.h"

/* Channels from `first` on alone. */
static inline struct fv_nn_depthwise last_channels(const struct fv_nn_depthwise *d, int32_t first)
{
    struct fv_nn_depthwise last = *d;
    last.channels -= first;
    last.weights += first;
    last.bias += first;
    last.multiplier += first;
    last.shift += first;
    if (d->real != NULL) last.real += first;
    return last;
}

/* Whole blocks, and what is left, a quarter or half of one, as flat rows. */
static inline void by_blocks_and_rows(const struct fv_nn_depthwise *d, const uint8_t *in,
                                      uint8_t *out, int32_t begin, int32_t end, uint8_t *scratch)
{
    const int32_t first = d->channels / 64 * 64;
    const struct fv_nn_depthwise last = last_channels(d, first);
    if (first > 0 && (last.channels == 16 || last.channels == 32) && flat_fits(&last)) {
        by_blocks(d, first, in, out, begin, end, scratch);
        by_flat_rows(&last, in + first, out + first, begin, end, scratch);
    } else {
        by_blocks(d, d->channels, in, out, begin, end, scratch);
    }
}

static inline void depthwise(const struct fv_nn_depthwise *d, const uint8_t *in, uint8_t *out,
                             int32_t begin, int32_t end, uint8_t *scratch)
{
    if (streams_fit(d))
        by_streams(d, in, out, begin, end, scratch);
    else if (flat_fits(d))
        by_flat_rows(d, in, out, begin, end, scratch);
    else if (steps_of(d) <= STEPS_MAX)
        by_blocks_and_rows(d, in, out, begin, end, scratch);
    else
        fv_k_nn_depthwise_u8__avx2(d, in, out, begin, end, scratch);
}

#endif

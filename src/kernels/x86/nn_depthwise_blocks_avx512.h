/* Depthwise convolution by 64 channels at a time: each input column is interleaved once into
 * scratch and used by all outputs over it. */
#ifndef FOVEA_KERNELS_X86_NN_DEPTHWISE_BLOCKS_AVX512_H
#define FOVEA_KERNELS_X86_NN_DEPTHWISE_BLOCKS_AVX512_H

#include "kernels/x86/nn_depthwise_lanes_avx512.h"

/* Interleave input columns [first, first + count) of the rows for output row y, and for those that
 * are done with it. */
static inline void interleave_columns(const struct fv_nn_depthwise *d, const uint8_t *in, int32_t y,
                                      int32_t first, int32_t count, __mmask64 mask,
                                      uint8_t *scratch)
{
    const __m512i border = _mm512_set1_epi8((char)d->zero_in);
    const int32_t groups = groups_of(d);
    for (int32_t g = 0; g < groups; g++) {
        const uint8_t *row[4];
        for (int32_t r = 0; r < 4; r++)
            row[r] = input_row(d, in, y, 4 * g + r, rows_together(d));
        uint8_t *to = scratch + (ptrdiff_t)g * count * 256;
        for (int32_t i = 0; i < count; i++, to += 256) {
            const int32_t x = first + i;
            const int inside = x >= 0 && x < d->in_w;
            const ptrdiff_t at = (ptrdiff_t)x * d->in_stride;
            __m512i v[4], out[4];
            for (int r = 0; r < 4; r++)
                v[r] =
                    inside && row[r] != NULL ? _mm512_maskz_loadu_epi8(mask, row[r] + at) : border;
            interleave(v[0], v[1], v[2], v[3], out);
            for (int q = 0; q < 4; q++)
                _mm512_store_si512(to + 64 * q, out[q]);
        }
    }
}

/* Outputs of the `later`-th of the rows together. */
FV_INLINE void block_outputs(const struct lanes *l, const struct fv_nn_depthwise *d, int32_t later,
                             const uint8_t *scratch, int32_t columns, int32_t outputs, uint8_t *out,
                             const int KW, const int GROUPS, const int PLANES, const int MODE)
{
    const int STEPS = PLANES * GROUPS * KW;
    const ptrdiff_t step = (ptrdiff_t)d->stride_x * 256, out_step = d->out_stride;
    const __mmask64 mask = l->mask;
    ptrdiff_t at[STEPS_MAX];
    const __m512i(*weights)[4] = l->weights + later * STEPS;
    struct held h;
    hold(&h, l, d, weights, STEPS);
    for (int s = 0; s < STEPS; s++)
        at[s] = ((ptrdiff_t)(s / KW % GROUPS) * columns + s % KW * d->dilation_x) * 256;
    for (int32_t x = 0; x < outputs; x++, out += out_step, scratch += step) {
        __m512i acc[4] = {l->bias[0], l->bias[1], l->bias[2], l->bias[3]};
#pragma GCC unroll 10
        for (int s = 0; s < STEPS; s++) {
#pragma GCC unroll 4
            for (int q = 0; q < 4; q++)
                acc[q] = _mm512_dpbusd_epi32(acc[q], _mm512_load_si512(scratch + at[s] + 64 * q),
                                             weights_of(&h, weights, s, q, STEPS));
        }
        _mm512_mask_storeu_epi8(out, mask, finish(&h, l, acc, MODE));
    }
}

typedef void block_outputs_fn(const struct lanes *l, const struct fv_nn_depthwise *d, int32_t later,
                              const uint8_t *scratch, int32_t columns, int32_t outputs,
                              uint8_t *out);

/* Functions of their own, so that each has the registers that it needs. */
#define BLOCKS(name, kw, groups, planes, mode)                                                     \
    static __attribute__((noinline)) void name(                                                    \
        const struct lanes *l, const struct fv_nn_depthwise *d, int32_t later,                     \
        const uint8_t *scratch, int32_t columns, int32_t outputs, uint8_t *out)                    \
    {                                                                                              \
        block_outputs(l, d, later, scratch, columns, outputs, out, kw, groups, planes, mode);      \
    }
BLOCKS(blocks_3x3_from_zero, 3, 1, 1, BY_REAL | FROM_ZERO)
BLOCKS(blocks_3x3, 3, 1, 1, BY_REAL)
BLOCKS(blocks_5x5_from_zero, 5, 2, 1, BY_REAL | FROM_ZERO)
BLOCKS(blocks_5x5, 5, 2, 1, BY_REAL)
BLOCKS(blocks_by_real, d->kw, groups_of(d), d->planes, BY_REAL)
BLOCKS(blocks_exactly, d->kw, groups_of(d), d->planes, 0)

static inline block_outputs_fn *blocks_of(const struct lanes *l, const struct fv_nn_depthwise *d)
{
    const int32_t groups = groups_of(d);
    const int mode = mode_of(l, d);
    if (mode == 0) return blocks_exactly;
    if (d->planes == 1 && d->kw == 3 && groups == 1)
        return mode == BY_REAL ? blocks_3x3 : blocks_3x3_from_zero;
    if (d->planes == 1 && d->kw == 5 && groups == 2)
        return mode == BY_REAL ? blocks_5x5 : blocks_5x5_from_zero;
    return blocks_by_real;
}

/* Output rows y to y + rows - 1. */
static inline void block_rows(const struct lanes *l, const struct fv_nn_depthwise *d,
                              const uint8_t *in, uint8_t *out, int32_t y, int32_t rows,
                              uint8_t *scratch)
{
    const int32_t span = span_of(d);
    block_outputs_fn *const outputs = blocks_of(l, d);
    const int32_t most = span > COLUMNS_MAX ? 1 : (COLUMNS_MAX - span) / d->stride_x + 1;
    for (int32_t x = 0, count; x < d->out_w; x += count) {
        count = d->out_w - x < most ? d->out_w - x : most;
        const int32_t columns = (count - 1) * d->stride_x + span;
        interleave_columns(d, in, y, x * d->stride_x - d->pad_left, columns, l->mask, scratch);
        for (int32_t r = 0; r < rows; r++)
            outputs(l, d, r, scratch, columns, count,
                    out + ((ptrdiff_t)r * d->out_w + x) * d->out_stride);
    }
}

/* The first `channels` channels. */
static inline void by_blocks(const struct fv_nn_depthwise *d, int32_t channels, const uint8_t *in,
                             uint8_t *out, int32_t begin, int32_t end, uint8_t *scratch)
{
    struct lanes l;
    for (int32_t c = 0; c < channels; c += 64) {
        load_lanes(&l, d, c, 0);
        l.mask = first_bytes(channels - c);
        for (int32_t y = begin, rows; y < end; y += rows) {
            rows = end - y < rows_together(d) ? end - y : rows_together(d);
            block_rows(&l, d, in + c, out + c + (ptrdiff_t)(y - begin) * d->out_w * d->out_stride,
                       y, rows, scratch);
        }
    }
}

#endif

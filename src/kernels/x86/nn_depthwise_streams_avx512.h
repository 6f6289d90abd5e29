/* Depthwise convolution as by flat rows, where pixels are whole lanes of 16 bytes and follow each
 * other: each column is interleaved once for all outputs over it; the scratch holds them up to 48
 * channels. */
#ifndef FOVEA_KERNELS_X86_NN_DEPTHWISE_STREAMS_AVX512_H
#define FOVEA_KERNELS_X86_NN_DEPTHWISE_STREAMS_AVX512_H

#include "kernels/x86/nn_depthwise_lanes_avx512.h"

/* Of each of four streams an output reads kw lanes, a pixel apart. */
static inline ptrdiff_t stream_pitch(const struct fv_nn_depthwise *d)
{
    return ((ptrdiff_t)(d->out_w + d->kw - 1) * d->channels + 64 + 127) / 64 * 64;
}

/* Bytes before a stream, so that the image begins at a cache line. */
static inline ptrdiff_t stream_lead(const struct fv_nn_depthwise *d)
{
    return (64 - d->pad_left * d->channels % 64) % 64;
}

static inline int streams_fit(const struct fv_nn_depthwise *d)
{
    const int32_t all = d->out_w - 1 + d->kw;
    const ptrdiff_t room = (ptrdiff_t)(all < COLUMNS_MAX ? all : COLUMNS_MAX) * 256;
    return d->channels % 16 == 0 && d->stride_x == 1 && d->dilation_x == 1 && d->kh <= 8 &&
           steps_of(d) <= STEPS_MAX && d->in_stride == d->channels &&
           d->out_stride == d->channels && 4 * stream_pitch(d) <= room &&
           phases_of(d) <= PHASES_MAX;
}

/* Those of kernel rows from ky on. */
static inline void fill_streams(const struct fv_nn_depthwise *d, const uint8_t *in, int32_t y,
                                int32_t ky, uint8_t *streams, ptrdiff_t pitch)
{
    streams += stream_lead(d);
    const __m512i border = _mm512_set1_epi8((char)d->zero_in);
    const ptrdiff_t total = (ptrdiff_t)(d->out_w - 1 + d->kw) * d->channels,
                    before = (ptrdiff_t)d->pad_left * d->channels,
                    left = before < total ? before : total,
                    after = left + (ptrdiff_t)d->in_w * d->channels,
                    right = after < total ? after : total;
    const uint8_t *row[4];
    for (int32_t r = 0; r < 4; r++)
        row[r] = input_row(d, in, y, ky + r, rows_together(d));
    for (ptrdiff_t at = left; at < right; at += 64) {
        __m512i v[4], lanes[4];
        for (int r = 0; r < 4; r++)
            v[r] = row[r] != NULL ? _mm512_loadu_si512(row[r] + at - left) : border;
        interleave(v[0], v[1], v[2], v[3], lanes);
        for (int q = 0; q < 4; q++)
            _mm512_storeu_si512(streams + q * pitch + at, lanes[q]);
    }
    for (int q = 0; q < 4; q++) {
        memset(streams + q * pitch, d->zero_in, (size_t)left);
        memset(streams + q * pitch + right, d->zero_in, (size_t)(total - right));
    }
}

/* Outputs j, j + step, ... of the `later`-th of the rows together. */
FV_INLINE void stream_outputs(const struct lanes *l, const struct fv_nn_depthwise *d, int32_t later,
                              const uint8_t *streams, ptrdiff_t pitch, int32_t j, int32_t step,
                              int32_t total, uint8_t *out, const int KW, const int GROUPS,
                              const int PLANES, const int MODE)
{
    const __m512i(*weights)[4] = l->weights + later * PLANES * GROUPS * KW;
    struct held h;
    hold(&h, l, d, weights, PLANES * GROUPS * KW);
    streams += stream_lead(d);
    for (; j < total; j += step) {
        __m512i acc[4] = {l->bias[0], l->bias[1], l->bias[2], l->bias[3]};
        for (int g = 0; g < GROUPS; g++) {
#pragma GCC unroll 5
            for (int kx = 0; kx < KW; kx++) {
                const uint8_t *from = streams + 4 * g * pitch + (ptrdiff_t)kx * d->channels + j;
                for (int p = 0; p < PLANES; p++) {
#pragma GCC unroll 4
                    for (int q = 0; q < 4; q++)
                        acc[q] =
                            _mm512_dpbusd_epi32(acc[q], _mm512_loadu_si512(from + q * pitch),
                                                weights_of(&h, weights, (p * GROUPS + g) * KW + kx,
                                                           q, PLANES * GROUPS * KW));
                }
            }
        }
        const __mmask64 mask = first_bytes(total - j);
        _mm512_mask_storeu_epi8(out + j, mask, finish(&h, l, acc, MODE));
    }
}

/* Functions of their own, so that each has the registers that it needs. */
#define STREAMS(name, kw, groups, mode)                                                            \
    static __attribute__((noinline)) void name(const struct lanes *l,                              \
                                               const struct fv_nn_depthwise *d, int32_t later,     \
                                               const uint8_t *streams, ptrdiff_t pitch, int32_t j, \
                                               int32_t step, int32_t total, uint8_t *out)          \
    {                                                                                              \
        stream_outputs(l, d, later, streams, pitch, j, step, total, out, kw, groups, 1, mode);     \
    }
STREAMS(streams_3x3_from_zero, 3, 1, BY_REAL | FROM_ZERO)
STREAMS(streams_3x3, 3, 1, BY_REAL)
STREAMS(streams_5x5_from_zero, 5, 2, BY_REAL | FROM_ZERO)
STREAMS(streams_5x5, 5, 2, BY_REAL)

/* Any kernel. */
static inline void streams_of(const struct lanes *l, const struct fv_nn_depthwise *d, int32_t later,
                              const uint8_t *streams, ptrdiff_t pitch, int32_t j, int32_t step,
                              int32_t total, uint8_t *out)
{
    const int32_t groups = groups_of(d);
    if (l->is_real)
        stream_outputs(l, d, later, streams, pitch, j, step, total, out, d->kw, groups, d->planes,
                       BY_REAL);
    else
        stream_outputs(l, d, later, streams, pitch, j, step, total, out, d->kw, groups, d->planes,
                       0);
}

typedef void stream_outputs_fn(const struct lanes *l, const struct fv_nn_depthwise *d,
                               int32_t later, const uint8_t *streams, ptrdiff_t pitch, int32_t j,
                               int32_t step, int32_t total, uint8_t *out);

static inline stream_outputs_fn *streams_for(const struct lanes *l, const struct fv_nn_depthwise *d)
{
    const int32_t groups = groups_of(d);
    const int mode = mode_of(l, d);
    if (mode != 0 && d->planes == 1 && d->kw == 3 && groups == 1)
        return mode == BY_REAL ? streams_3x3 : streams_3x3_from_zero;
    if (mode != 0 && d->planes == 1 && d->kw == 5 && groups == 2)
        return mode == BY_REAL ? streams_5x5 : streams_5x5_from_zero;
    return streams_of;
}

static inline void by_streams(const struct fv_nn_depthwise *d, const uint8_t *in, uint8_t *out,
                              int32_t begin, int32_t end, uint8_t *streams)
{
    const int32_t phases = phases_of(d), total = d->out_w * d->channels, step = phases * 64;
    const ptrdiff_t pitch = stream_pitch(d);
    struct lanes lanes[PHASES_MAX];
    load_phases(lanes, d, phases);
    for (int32_t y = begin, rows; y < end; y += rows, out += (ptrdiff_t)rows * total) {
        rows = end - y < rows_together(d) ? end - y : rows_together(d);
        for (int32_t g = 0; g < groups_of(d); g++)
            fill_streams(d, in, y, 4 * g, streams + 4 * g * pitch, pitch);
        for (int32_t p = 0; p < phases && p * 64 < total; p++) {
            stream_outputs_fn *const outputs = streams_for(&lanes[p], d);
            for (int32_t r = 0; r < rows; r++)
                outputs(&lanes[p], d, r, streams, pitch, p * 64, step, total,
                        out + (ptrdiff_t)r * total);
        }
    }
}

#endif

/* What the ways of a depthwise convolution share: constants of 64 outputs that are computed
 * together, in the order in which interleaved bytes leave their channels, and how sums become
 * bytes. */
#ifndef FOVEA_KERNELS_X86_NN_DEPTHWISE_LANES_AVX512_H
#define FOVEA_KERNELS_X86_NN_DEPTHWISE_LANES_AVX512_H

#include "kernels/kernels.h"
#include "kernels/x86/nn_avx512.h"

enum { STEPS_MAX = 20, HELD_STEPS_MAX = 3, COLUMNS_MAX = 72, PHASES_MAX = 3 };

/* How sums become bytes: by real numbers, or exactly; with a zero point of 0, which exact rounding
 * need not know. */
enum { BY_REAL = 1, FROM_ZERO = 2 };

/* What 64 neighbouring outputs share. A step is one plane of weights, one group of four kernel
 * rows, one kernel column; those of the first of the rows together come first. */
struct lanes {
    __m512i weights[STEPS_MAX][4];
    __m512i bias[4];
    union { /* exact rounding; by `down` where is_down */
        struct down16 down[4];
        struct scale16 scale[4];
    };
    struct real16 real[4];
    int is_real, is_down; /* is_real: they are rounded by `real` in place of it */
    struct table64 table;
    struct clamp64 clamp;
    __mmask64 mask;
};

/* Input columns under the kernel of an output pixel, from the first to the last. */
static inline int32_t span_of(const struct fv_nn_depthwise *d)
{
    return (d->kw - 1) * d->dilation_x + 1;
}

/* Those under the kernels of a row of output pixels. */
static inline int32_t columns_of(const struct fv_nn_depthwise *d)
{
    return (d->out_w - 1) * d->stride_x + span_of(d);
}

/* Groups of four kernel rows. */
static inline int32_t groups_of(const struct fv_nn_depthwise *d)
{
    return (d->kh + 3) / 4;
}

/* Steps of an output row. */
static inline int32_t steps_of(const struct fv_nn_depthwise *d)
{
    return d->planes * groups_of(d) * d->kw;
}

/* Output rows that share what is interleaved: where kernel rows leave lanes free, the next rows of
 * the image are there, and weights that lie as many rows further give the next output rows. */
static inline int32_t rows_together(const struct fv_nn_depthwise *d)
{
    const int32_t rows = 4 * groups_of(d) - d->kh + 1, most = STEPS_MAX / steps_of(d);
    return d->stride_y != 1 || d->dilation_y != 1 ? 1 : rows < most ? rows : most;
}

/* The row under row ky of the kernels of output row y, or NULL: outside the image, or of no use for
 * the `together` output rows from y on. */
static inline const uint8_t *input_row(const struct fv_nn_depthwise *d, const uint8_t *in,
                                       int32_t y, int32_t ky, int32_t together)
{
    const int32_t iy = y * d->stride_y - d->pad_top + ky * d->dilation_y;
    if (ky >= d->kh + together - 1 || iy < 0 || iy >= d->in_h) return NULL;
    return in + (ptrdiff_t)iy * d->in_w * d->in_stride;
}

FV_INLINE void interleave(__m512i a, __m512i b, __m512i c, __m512i d, __m512i out[4])
{
    const __m512i ab_low = _mm512_unpacklo_epi8(a, b), ab_high = _mm512_unpackhi_epi8(a, b);
    const __m512i cd_low = _mm512_unpacklo_epi8(c, d), cd_high = _mm512_unpackhi_epi8(c, d);
    out[0] = _mm512_unpacklo_epi16(ab_low, cd_low);
    out[1] = _mm512_unpackhi_epi16(ab_low, cd_low);
    out[2] = _mm512_unpacklo_epi16(ab_high, cd_high);
    out[3] = _mm512_unpackhi_epi16(ab_high, cd_high);
}

/* 64 elements of a per-channel array from channel `first` on, cyclic when `period` is not 0; past
 * the end others repeat: lanes past the channels are never stored. */
FV_INLINE void spread(void *to, const void *from, const size_t size, int32_t first, int32_t period,
                      int32_t c16)
{
    uint8_t *out = to;
    const uint8_t *in = from;
    const int32_t end = period != 0 ? period : c16;
    if (first % 16 == 0 && end % 16 == 0) { /* in pieces of one size, without calls */
        for (int32_t n = 0, at = first; n < 64; n += 16, at += 16) {
            if (at == end) at = 0;
            memcpy(out + (size_t)n * size, in + (size_t)at * size, 16 * size);
        }
        return;
    }
    for (int32_t n = 0, at = first; n < 64; at = 0) {
        const int32_t count = end - at < 64 - n ? end - at : 64 - n;
        memcpy(out + (size_t)n * size, in + (size_t)at * size, (size_t)count * size);
        n += count;
    }
}

FV_INLINE __m512i spread_bytes(const int8_t *from, int32_t first, int32_t period, int32_t c16)
{
    int8_t bytes[64];
    if (period == 0 && first + 64 <= c16) return _mm512_loadu_si512(from + first);
    spread(bytes, from, 1, first, period, c16);
    return _mm512_loadu_si512(bytes);
}

/* Likewise, where they lie if they follow each other, else spread in `room`. */
FV_INLINE const void *spread_words(int32_t room[64], const void *from, int32_t first,
                                   int32_t period, int32_t c16)
{
    if (period == 0 && first + 64 <= c16) return (const int32_t *)from + first;
    spread(room, from, 4, first, period, c16);
    return room;
}

static inline void transpose_words(const void *words, __m512i out[4])
{
    __m512i in[4];
    for (int i = 0; i < 4; i++)
        in[i] = _mm512_loadu_si512((const int32_t *)words + 16 * i);
    transpose_lanes(in, out);
}

/* Rounding by real numbers, where there is one for all 64 lanes. */
static inline int load_real(struct real16 to[4], const struct fv_nn_depthwise *d, int32_t first,
                            int32_t period)
{
    int32_t words[64];
    __m512i part[2][4];
    for (int i = 0; i < 2; i++) {
        transpose_words(spread_words(words, d->real + (ptrdiff_t)i * d->c16, first, period, d->c16),
                        part[i]);
    }
    __mmask16 all = 0xFFFF;
    for (int q = 0; q < 4; q++) {
        all &= _mm512_test_epi32_mask(part[0][q], part[0][q]);
        to[q] = (struct real16){_mm512_castsi512_ps(part[0][q]), _mm512_castsi512_ps(part[1][q])};
    }
    return all == 0xFFFF;
}

/* Exact rounding, with the fewer steps where all shifts are below zero. */
static inline void load_exact(struct lanes *l, const struct fv_nn_depthwise *d, int32_t first,
                              int32_t period)
{
    int32_t words[64];
    __m512i multiplier[4], shift[4];
    __mmask16 up = 0;
    transpose_words(spread_words(words, d->multiplier, first, period, d->c16), multiplier);
    transpose_words(spread_words(words, d->shift, first, period, d->c16), shift);
    for (int32_t q = 0; q < 4; q++)
        up |= _mm512_mask_cmpge_epi32_mask(_mm512_test_epi32_mask(multiplier[q], multiplier[q]),
                                           shift[q], _mm512_setzero_si512());
    l->is_down = up == 0;
    for (int32_t q = 0; q < 4; q++) {
        if (l->is_down)
            load_down_of(&l->down[q], multiplier[q], shift[q]);
        else
            load_scale_of(&l->scale[q], multiplier[q], shift[q]);
    }
}

/* Prepare 64 lanes that stand for channels first, first + 1, ... (modulo `period` when it is not
 * 0). */
static inline void load_lanes(struct lanes *l, const struct fv_nn_depthwise *d, int32_t first,
                              int32_t period)
{
    const int32_t groups = groups_of(d);
    int32_t words[64];
    transpose_words(spread_words(words, d->bias, first, period, d->c16), l->bias);
    l->is_real = d->real != NULL && load_real(l->real, d, first, period);
    if (!l->is_real) load_exact(l, d, first, period);
    for (int32_t step = 0; step < rows_together(d) * steps_of(d); step++) {
        const int32_t kx = step % d->kw, group = step / d->kw % groups,
                      plane = step / d->kw / groups % d->planes, later = step / steps_of(d);
        __m512i column[4];
        for (int32_t r = 0; r < 4; r++) {
            const int32_t ky = 4 * group + r - later;
            column[r] = _mm512_setzero_si512();
            if (ky < 0 || ky >= d->kh) continue;
            const ptrdiff_t tap = (ptrdiff_t)(plane * d->kh + ky) * d->kw + kx;
            column[r] = spread_bytes(d->weights + tap * d->c16, first, period, d->c16);
        }
        interleave(column[0], column[1], column[2], column[3], l->weights[step]);
    }
    load_table(&l->table, d->table);
    l->clamp = clamp_of(d->zero_out, d->act_min, d->act_max);
}

static inline int32_t common_divisor(int32_t a, int32_t b)
{
    while (b != 0) {
        const int32_t rest = a % b;
        a = b;
        b = rest;
    }
    return a;
}

/* Every n-th 64 bytes of a row stand for the same channels. */
static inline int32_t phases_of(const struct fv_nn_depthwise *d)
{
    return d->channels / common_divisor(d->channels, 64);
}

static inline void load_phases(struct lanes *lanes, const struct fv_nn_depthwise *d, int32_t phases)
{
    for (int32_t p = 0; p < phases; p++)
        load_lanes(&lanes[p], d, p * 64 % d->channels, d->channels);
}

static inline int mode_of(const struct lanes *l, const struct fv_nn_depthwise *d)
{
    return !l->is_real ? 0 : d->zero_out == 0 ? BY_REAL | FROM_ZERO : BY_REAL;
}

/* What stays in registers over a row of outputs: as stores of bytes may change anything in memory,
 * compilers would load it again for each. */
struct held {
    __m512i weights[HELD_STEPS_MAX][4];
    struct real16 real[4];
    struct clamp64 clamp;
    int has_table;
};

FV_INLINE void hold(struct held *h, const struct lanes *l, const struct fv_nn_depthwise *d,
                    const __m512i (*weights)[4], const int STEPS)
{
    h->clamp = l->clamp;
    h->has_table = d->table != NULL;
#pragma GCC unroll 4
    for (int q = 0; q < 4; q++) {
        h->real[q] = l->real[q];
#pragma GCC unroll 3
        for (int s = 0; s < STEPS && s < HELD_STEPS_MAX; s++)
            h->weights[s][q] = weights[s][q];
    }
}

/* The weights of a step: held, if they can be. */
FV_INLINE __m512i weights_of(const struct held *h, const __m512i (*weights)[4], int s, int q,
                             const int STEPS)
{
    return STEPS <= HELD_STEPS_MAX ? h->weights[s][q] : weights[s][q];
}

FV_INLINE __m512i finish(const struct held *h, const struct lanes *l, const __m512i acc[4],
                         const int MODE)
{
    __m512i r[4];
    if ((MODE & BY_REAL) != 0) {
#pragma GCC unroll 4
        for (int q = 0; q < 4; q++)
            r[q] = requantize_real(acc[q], &h->real[q], (MODE & FROM_ZERO) != 0);
    } else if (l->is_down) {
#pragma GCC unroll 4
        for (int q = 0; q < 4; q++)
            r[q] = requantize_down(acc[q], &l->down[q], 0);
    } else {
#pragma GCC unroll 4
        for (int q = 0; q < 4; q++)
            r[q] = requantize(acc[q], &l->scale[q], 0);
    }
    const __m512i bytes = pack_lanes(r[0], r[1], r[2], r[3], &h->clamp, (MODE & FROM_ZERO) != 0);
    return h->has_table ? look_up(bytes, &l->table) : bytes;
}

#endif

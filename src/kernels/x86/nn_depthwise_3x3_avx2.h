/* Depthwise convolution by windows of 3x3, 16 channels at a time, without scratch: bytes of two
 * neighbouring inputs are widened to the pairs of pmaddwd in registers, once for all outputs that
 * they belong to. Included by nn_depthwise_avx2.c.
 *
 * Without strides two output rows are made at once: their four input rows are two pairs of rows,
 * and each column is added to three outputs of each row. With a stride of two columns the first two
 * rows are pairs, and the third one has pairs of columns. */
#ifndef FOVEA_KERNELS_X86_NN_DEPTHWISE_3X3_AVX2_H
#define FOVEA_KERNELS_X86_NN_DEPTHWISE_3X3_AVX2_H

#include "kernels/kernels.h"
#include "kernels/x86/nn_real_avx2.h"

/* What 16 channels share, 0-7 and 8-15. */
struct channels {
    __m256i bias[2];
    struct scale8 scale[2];
    int32_t width; /* valid channels */
    int mode;
};

/* Weights of 16 channels for two output rows: by column of the window, output row, and pair of
 * input rows. */
struct two_rows_weights {
    __m256i of[3][2][2][2];
};

/* Weights of 16 channels for a stride of two columns: those of the first two rows by column, then
 * of the third row the first two and the last one. */
struct stride_weights {
    __m256i of[5][2];
};

/* One row of pixels, or of border, where `mask` is 0 and all columns are the first. */
struct line {
    const uint8_t *pixels;
    ptrdiff_t mask;
};

/* Input rows of one output row (three) or two (four), and where these begin. A row that is not
 * wanted has the place of the other. */
struct window_rows {
    struct line lines[4];
    const uint8_t *border;
    uint8_t *out[2];
};

FV_INLINE void pair_weights(__m256i to[2], __m256i first, __m256i second)
{
    const __m256i x = _mm256_permute4x64_epi64(first, 0xD8),
                  y = _mm256_permute4x64_epi64(second, 0xD8);
    to[0] = _mm256_unpacklo_epi16(x, y);
    to[1] = _mm256_unpackhi_epi16(x, y);
}

/* From the weights of all taps, 16 bits each. */
static void set_two_rows(struct two_rows_weights *to, __m256i taps[3][3])
{
    const __m256i zero = _mm256_setzero_si256();
    for (int kx = 0; kx < 3; kx++) {
        pair_weights(to->of[kx][0][0], taps[0][kx], taps[1][kx]);
        pair_weights(to->of[kx][0][1], taps[2][kx], zero);
        pair_weights(to->of[kx][1][0], zero, taps[0][kx]);
        pair_weights(to->of[kx][1][1], taps[1][kx], taps[2][kx]);
    }
}

static void set_stride(struct stride_weights *to, __m256i taps[3][3])
{
    for (int kx = 0; kx < 3; kx++)
        pair_weights(to->of[kx], taps[0][kx], taps[1][kx]);
    pair_weights(to->of[3], taps[2][0], taps[2][1]);
    pair_weights(to->of[4], taps[2][2], _mm256_setzero_si256());
}

/* Pairs of bytes, widened: channels 0-7 and 8-15. Both lanes hold all bytes: to widen them across
 * lanes takes twice as long. */
FV_INLINE void widen_pair(const uint8_t *a, const uint8_t *b, __m256i to[2])
{
    const __m256i x = _mm256_broadcastsi128_si256(
                      _mm_loadu_si128((const __m128i *)(const void *)a)),
                  y = _mm256_broadcastsi128_si256(
                      _mm_loadu_si128((const __m128i *)(const void *)b));
    const __m256i wide =
        _mm256_setr_epi8(0, -1, 1, -1, 2, -1, 3, -1, 4, -1, 5, -1, 6, -1, 7, -1, 8, -1, 9, -1, 10,
                         -1, 11, -1, 12, -1, 13, -1, 14, -1, 15, -1);
    to[0] = _mm256_shuffle_epi8(_mm256_unpacklo_epi8(x, y), wide);
    to[1] = _mm256_shuffle_epi8(_mm256_unpackhi_epi8(x, y), wide);
}

/* Written out: compilers put off the sums and run out of registers. */
FV_INLINE void add_pair(__m256i *acc, __m256i x, const __m256i *w)
{
    __m256i products;
    __asm__("vpmaddwd %2, %3, %1\n\tvpaddd %1, %0, %0"
            : "+x"(*acc), "=&x"(products)
            : "m"(*w), "x"(x));
}

FV_INLINE void add_pairs(__m256i acc[2], const __m256i x[2], const __m256i w[2])
{
    add_pair(&acc[0], x[0], &w[0]);
    add_pair(&acc[1], x[1], &w[1]);
}

/* The same weights, unknown to compilers, which would copy them to the stack: bytes that are stored
 * might be they. */
FV_INLINE const void *again(const void *weights)
{
    __asm__("" : "+r"(weights));
    return weights;
}

FV_INLINE void load_column(const struct window_rows *r, int32_t x, const struct fv_nn_depthwise *d,
                           __m256i to[2][2])
{
    if (x < 0 || x >= d->in_w) {
        widen_pair(r->border, r->border, to[0]);
        to[1][0] = to[0][0];
        to[1][1] = to[0][1];
        return;
    }
    const ptrdiff_t at = (ptrdiff_t)x * d->in_stride;
    const struct line *l = r->lines;
    widen_pair(l[0].pixels + (at & l[0].mask), l[1].pixels + (at & l[1].mask), to[0]);
    widen_pair(l[2].pixels + (at & l[2].mask), l[3].pixels + (at & l[3].mask), to[1]);
}

/* Column kx of the window of two outputs. */
FV_INLINE void add_column(const struct two_rows_weights *w, const int kx, __m256i x[2][2],
                          __m256i acc[2][2])
{
#pragma GCC unroll 2
    for (int row = 0; row < 2; row++) {
        add_pairs(acc[row], x[0], w->of[kx][row][0]);
        add_pairs(acc[row], x[1], w->of[kx][row][1]);
    }
}

FV_INLINE void begin(const struct channels *c, __m256i acc[2][2])
{
    acc[0][0] = acc[1][0] = c->bias[0];
    acc[0][1] = acc[1][1] = c->bias[1];
}

/* The column is the last one of the sums `first`, the middle one of `second` and the first one of
 * `third`. */
FV_INLINE void next_column(const struct channels *c, const struct two_rows_weights *weights,
                           __m256i x[2][2], __m256i first[2][2], __m256i second[2][2],
                           __m256i third[2][2], const struct output *o, uint8_t *const out[2],
                           ptrdiff_t at, const int mode)
{
    const struct two_rows_weights *w = again(weights);
    add_column(w, 2, x, first);
    store_two(o, c->scale, first, out[0] + at, out[1] + at, c->width, mode);
    add_column(w, 1, x, second);
    begin(c, third);
    add_column(w, 0, x, third);
}

/* Outputs from column `x` on, every dilation_x-th. */
FV_INLINE void two_output_rows(const struct channels *c, const struct two_rows_weights *w,
                               const struct fv_nn_depthwise *d, const struct window_rows *r,
                               int32_t x, const struct output *o, const int mode)
{
    const int32_t apart = d->dilation_x;
    const ptrdiff_t step = (ptrdiff_t)apart * d->out_stride;
    ptrdiff_t at = (ptrdiff_t)x * d->out_stride;
    __m256i pairs[2][2], sums[3][2][2];
    int32_t column = x - d->pad_left;
    load_column(r, column, d, pairs);
    begin(c, sums[0]);
    add_column(w, 0, pairs, sums[0]);
    load_column(r, column += apart, d, pairs);
    add_column(w, 1, pairs, sums[0]);
    begin(c, sums[1]);
    add_column(w, 0, pairs, sums[1]);
    for (;; x += apart, at += step) {
        load_column(r, column += apart, d, pairs);
        next_column(c, w, pairs, sums[0], sums[1], sums[2], o, r->out, at, mode);
        if ((x += apart) >= d->out_w) return;
        load_column(r, column += apart, d, pairs);
        next_column(c, w, pairs, sums[1], sums[2], sums[0], o, r->out, at += step, mode);
        if ((x += apart) >= d->out_w) return;
        load_column(r, column += apart, d, pairs);
        next_column(c, w, pairs, sums[2], sums[0], sums[1], o, r->out, at += step, mode);
        if (x + apart >= d->out_w) return;
    }
}

/* An input of line l, perhaps of the border. */
FV_INLINE const uint8_t *input_at(const struct window_rows *r, int l, int32_t x,
                                  const struct fv_nn_depthwise *d)
{
    const ptrdiff_t at = (ptrdiff_t)x * d->in_stride & r->lines[l].mask;
    return x < 0 || x >= d->in_w ? r->border : r->lines[l].pixels + at;
}

/* Pairs of a window's middle and last column, and in its last row of the last one and the next. */
FV_INLINE void load_columns(const struct window_rows *r, int32_t x, const struct fv_nn_depthwise *d,
                            __m256i middle[2], __m256i last[2], __m256i beside[2])
{
    if (x >= 0 && x + 2 < d->in_w) {
        const ptrdiff_t step = d->in_stride, at = x * step;
        const struct line *l = r->lines;
        const uint8_t *a = l[0].pixels + (at & l[0].mask), *b = l[1].pixels + (at & l[1].mask),
                      *c = l[2].pixels + ((at + step) & l[2].mask);
        widen_pair(a, b, middle);
        widen_pair(a + (step & l[0].mask), b + (step & l[1].mask), last);
        widen_pair(c, c + (step & l[2].mask), beside);
    } else {
        widen_pair(input_at(r, 0, x, d), input_at(r, 1, x, d), middle);
        widen_pair(input_at(r, 0, x + 1, d), input_at(r, 1, x + 1, d), last);
        widen_pair(input_at(r, 2, x + 1, d), input_at(r, 2, x + 2, d), beside);
    }
}

/* Output x; `first` and `beside` are the pairs of its window's first column, and become those of
 * the next one's. */
FV_INLINE void strided_output(const struct channels *c, const struct stride_weights *weights,
                              const struct fv_nn_depthwise *d, const struct window_rows *r,
                              int32_t x, __m256i first[2], __m256i beside[2], __m256i acc[2])
{
    const struct stride_weights *w = again(weights);
    __m256i middle[2];
    acc[0] = c->bias[0];
    acc[1] = c->bias[1];
    add_pairs(acc, first, w->of[0]);
    add_pairs(acc, beside, w->of[3]);
    load_columns(r, 2 * x - d->pad_left + 1, d, middle, first, beside);
    add_pairs(acc, middle, w->of[1]);
    add_pairs(acc, first, w->of[2]);
    add_pairs(acc, beside, w->of[4]);
}

FV_INLINE void strided_row(const struct channels *c, const struct stride_weights *w,
                           const struct fv_nn_depthwise *d, const struct window_rows *r,
                           const struct output *o, const int mode)
{
    __m256i first[2], beside[2], acc[2][2];
    const int32_t left = -d->pad_left;
    widen_pair(input_at(r, 0, left, d), input_at(r, 1, left, d), first);
    widen_pair(input_at(r, 2, left, d), input_at(r, 2, left + 1, d), beside);
    for (int32_t x = 0; x < d->out_w; x += 2) {
        uint8_t *to = r->out[0] + (ptrdiff_t)x * d->out_stride, *next = to;
        strided_output(c, w, d, r, x, first, beside, acc[0]);
        if (x + 1 < d->out_w) {
            strided_output(c, w, d, r, x + 1, first, beside, acc[1]);
            next += d->out_stride;
        } else {
            acc[1][0] = acc[0][0];
            acc[1][1] = acc[0][1];
        }
        store_two(o, c->scale, acc, to, next, c->width, mode);
    }
}

#endif

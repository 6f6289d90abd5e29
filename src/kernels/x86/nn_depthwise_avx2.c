/* Depthwise convolution with vpmaddwd: two taps at a time, 16 channels at a time, weights as 16-bit
 * sums of their planes.
 *
 * The taps of a pair lie in neighbouring rows of the kernel, or, where a last row is left over,
 * side by side in it. Each input column is widened and interleaved once into scratch, for the
 * outputs of all kernel columns over it: [column][pair of rows][16 channels][2]. */
#include "kernels/kernels.h"
#include "kernels/x86/nn_avx2.h"

enum { STEPS_MAX = 64, COLUMNS_MAX = 72, TILE = 4, PAIR_BYTES = 64 };

struct block {
    __m256i weights[STEPS_MAX][2], bias[2]; /* channels 0-7 and 8-15 */
    struct scale8 scale[2];
    ptrdiff_t
        from[STEPS_MAX]; /* of a step's inputs in scratch, from the output's first column on */
    ptrdiff_t column_bytes;
    int32_t steps, pairs; /* pairs of rows */
    int32_t width;        /* valid channels */
    int mode;             /* LESSENED or 0 */
};

/* 16-bit weights of a tap; zero beyond the kernel. */
static __m256i tap_weights(const struct fv_nn_depthwise *d, int32_t channel, int32_t ky, int32_t kx)
{
    __m256i sum = _mm256_setzero_si256();
    const int32_t taps = d->kh * d->kw, tap = ky * d->kw + kx;
    for (int32_t p = 0; p < d->planes && ky < d->kh && kx < d->kw; p++) {
        const int8_t *w = d->weights + ((ptrdiff_t)p * taps + tap) * d->c16 + channel;
        sum = _mm256_add_epi16(
            sum, _mm256_cvtepi8_epi16(_mm_load_si128((const __m128i *)(const void *)w)));
    }
    return sum;
}

static void add_step(struct block *b, const struct fv_nn_depthwise *d, int32_t channel,
                     int32_t pair, int32_t kx)
{
    const int beside = 2 * pair + 1 == d->kh;
    const __m256i first = tap_weights(d, channel, 2 * pair, kx);
    const __m256i second = tap_weights(d, channel, 2 * pair + !beside, kx + beside);
    const __m256i x = _mm256_permute4x64_epi64(first, 0xD8),
                  y = _mm256_permute4x64_epi64(second, 0xD8);
    b->weights[b->steps][0] = _mm256_unpacklo_epi16(x, y);
    b->weights[b->steps][1] = _mm256_unpackhi_epi16(x, y);
    b->from[b->steps] = kx * d->dilation_x * b->column_bytes + (ptrdiff_t)pair * PAIR_BYTES;
    ++b->steps;
}

static int32_t step_count(const struct fv_nn_depthwise *d)
{
    return d->kh / 2 * d->kw + d->kh % 2 * (d->kw + 1) / 2;
}

static void load_block(struct block *b, const struct fv_nn_depthwise *d, int32_t channel)
{
    b->steps = 0;
    b->pairs = (d->kh + 1) / 2;
    b->column_bytes = (ptrdiff_t)b->pairs * PAIR_BYTES;
    b->width = d->channels - channel < 16 ? d->channels - channel : 16;
    for (int32_t pair = 0; pair < b->pairs; pair++) {
        for (int32_t kx = 0; kx < d->kw; kx += 2 * pair + 1 == d->kh ? 2 : 1)
            add_step(b, d, channel, pair, kx);
    }
    for (int32_t h = 0; h < 2; h++)
        b->bias[h] = load32(d->bias + channel + 8 * h);
    b->mode = load_any_scales(b->scale, d->multiplier + channel, d->shift + channel);
}

/* Both lanes hold all bytes: to widen them across lanes takes twice as long. */
FV_INLINE void interleave(const uint8_t *a, const uint8_t *b, uint8_t *to)
{
    const __m256i x = _mm256_broadcastsi128_si256(
                      _mm_loadu_si128((const __m128i *)(const void *)a)),
                  y = _mm256_broadcastsi128_si256(
                      _mm_loadu_si128((const __m128i *)(const void *)b));
    const __m256i wide =
        _mm256_setr_epi8(0, -1, 1, -1, 2, -1, 3, -1, 4, -1, 5, -1, 6, -1, 7, -1, 8, -1, 9, -1, 10,
                         -1, 11, -1, 12, -1, 13, -1, 14, -1, 15, -1);
    _mm256_store_si256((__m256i *)(void *)to,
                       _mm256_shuffle_epi8(_mm256_unpacklo_epi8(x, y), wide));
    _mm256_store_si256((__m256i *)(void *)(to + 32),
                       _mm256_shuffle_epi8(_mm256_unpackhi_epi8(x, y), wide));
}

/* One row of pixels, or of border. */
struct line {
    const uint8_t *pixels;
    ptrdiff_t step;
};

static struct line line_of(const struct fv_nn_depthwise *d, const uint8_t *in,
                           const uint8_t *border, int32_t y, int32_t ky)
{
    const int32_t iy = y * d->stride_y - d->pad_top + ky * d->dilation_y;
    if (iy < 0 || iy >= d->in_h) return (struct line){.pixels = border, .step = 0};
    return (struct line){.pixels = in + (ptrdiff_t)iy * d->in_w * d->in_stride,
                         .step = d->in_stride};
}

/* Columns x, x + 1, ... of line a, each with the column `shift` further of line b. */
static void interleave_lines(const struct fv_nn_depthwise *d, struct line a, struct line b,
                             int32_t shift, int32_t x, int32_t count, const uint8_t *border,
                             uint8_t *to, ptrdiff_t pitch)
{
    const int32_t end = x + count, inner_end = d->in_w - shift < end ? d->in_w - shift : end;
    while (x < end) {
        if (x >= 0 && x < inner_end) {
            const uint8_t *from_a = a.pixels + x * a.step,
                          *from_b = b.pixels + (x + shift) * b.step;
            for (; x < inner_end; x++, from_a += a.step, from_b += b.step, to += pitch)
                interleave(from_a, from_b, to);
        } else {
            const uint8_t *from_a = x < 0 || x >= d->in_w ? border : a.pixels + x * a.step;
            const uint8_t *from_b =
                x + shift < 0 || x + shift >= d->in_w ? border : b.pixels + (x + shift) * b.step;
            interleave(from_a, from_b, to);
            ++x;
            to += pitch;
        }
    }
}

static void interleave_columns(const struct block *b, const struct fv_nn_depthwise *d,
                               const uint8_t *in, int32_t y, int32_t x, int32_t count,
                               const uint8_t *border, uint8_t *scratch)
{
    for (int32_t pair = 0; pair < b->pairs; pair++) {
        const int beside = 2 * pair + 1 == d->kh;
        const struct line first = line_of(d, in, border, y, 2 * pair);
        const struct line second = beside ? first : line_of(d, in, border, y, 2 * pair + 1);
        interleave_lines(d, first, second, beside ? d->dilation_x : 0, x, count, border,
                         scratch + (ptrdiff_t)pair * PAIR_BYTES, b->column_bytes);
    }
}

/* N neighbouring outputs. */
FV_INLINE void tile(const struct block *b, const uint8_t *columns, ptrdiff_t step, const int N,
                    const struct output *o, uint8_t *out, ptrdiff_t ldo, const int steps,
                    const int mode)
{
    __m256i acc[TILE][2];
#pragma GCC unroll 4
    for (int i = 0; i < N; i++) {
        acc[i][0] = b->bias[0];
        acc[i][1] = b->bias[1];
    }
#pragma GCC unroll 1
    for (int s = 0; s < steps; s++) {
        const __m256i *x = (const __m256i *)(const void *)(columns + b->from[s]);
        const __m256i w0 = b->weights[s][0], w1 = b->weights[s][1];
#pragma GCC unroll 4
        for (int i = 0; i < N;
             ++i, x = (const __m256i *)(const void *)((const uint8_t *)x + step)) {
            acc[i][0] = _mm256_add_epi32(acc[i][0], _mm256_madd_epi16(w0, x[0]));
            acc[i][1] = _mm256_add_epi32(acc[i][1], _mm256_madd_epi16(w1, x[1]));
        }
    }
    store_tile(o, b->scale, acc, N, out, ldo, b->width, mode);
}

FV_INLINE void outputs(const struct block *b, const struct fv_nn_depthwise *d,
                       const uint8_t *columns, int32_t count, const struct output *o, uint8_t *out,
                       const int steps, const int mode)
{
    const ptrdiff_t step = d->stride_x * b->column_bytes;
    if (count < TILE) {
        for (int32_t i = 0; i < count; i++) {
            tile(b, columns + i * step, step, 1, o, out + (ptrdiff_t)i * d->out_stride,
                 d->out_stride, steps, mode);
        }
        return;
    }
    for (int32_t i = 0; i < count; i += TILE) {
        const int32_t at =
            i + TILE > count ? count - TILE : i; /* the last tile overlaps the one before */
        tile(b, columns + at * step, step, TILE, o, out + (ptrdiff_t)at * d->out_stride,
             d->out_stride, steps, mode);
    }
}

static void row(const struct block *b, const struct fv_nn_depthwise *d, const uint8_t *in,
                int32_t y, const struct output *o, const uint8_t *border, uint8_t *out,
                uint8_t *scratch)
{
    const int32_t span = (d->kw - 1) * d->dilation_x + 1;
    const int32_t most = span > COLUMNS_MAX ? 1 : (COLUMNS_MAX - span) / d->stride_x + 1;
    const int above = d->act_min >= d->zero_out, small = d->kh == 3 && d->kw == 3;
    for (int32_t x = 0, count; x < d->out_w; x += count) {
        count = d->out_w - x < most ? d->out_w - x : most;
        uint8_t *to = out + (ptrdiff_t)x * d->out_stride;
        interleave_columns(b, d, in, y, x * d->stride_x - d->pad_left,
                           (count - 1) * d->stride_x + span, border, scratch);
        if (b->mode == 0)
            outputs(b, d, scratch, count, o, to, b->steps, 0);
        else if (small && above)
            outputs(b, d, scratch, count, o, to, 5, LESSENED | ABOVE_ZERO);
        else if (small)
            outputs(b, d, scratch, count, o, to, 5, LESSENED);
        else
            outputs(b, d, scratch, count, o, to, b->steps, LESSENED);
    }
}

void fv_k_nn_depthwise_u8__avx2(const struct fv_nn_depthwise *d, const uint8_t *in, uint8_t *out,
                                int32_t begin, int32_t end, uint8_t *scratch)
{
    if (step_count(d) > STEPS_MAX) {
        fv_k_nn_depthwise_u8__c(d, in, out, begin, end, scratch);
        return;
    }
    uint8_t border[16];
    memset(border, d->zero_in, sizeof border);
    struct output o;
    init_output(&o, d->zero_out, d->act_min, d->act_max, d->table);
    for (int32_t c = 0; c < d->channels; c += 16) {
        struct block b;
        load_block(&b, d, c);
        for (int32_t y = begin; y < end; y++) {
            row(&b, d, in + c, y, &o, border,
                out + c + (ptrdiff_t)(y - begin) * d->out_w * d->out_stride, scratch);
        }
    }
}

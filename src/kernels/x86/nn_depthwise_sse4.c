/* Depthwise convolution with pmaddwd: two taps at a time, 16 channels at a time, weights as 16-bit
 * sums of their planes.
 *
 * The taps of a pair lie in neighbouring rows of the kernel, or, where a last row is left over,
 * side by side in it. Each input column is widened and interleaved once into scratch, for the
 * outputs of all kernel columns over it: [column][pair of rows][16 channels][2]. */
#include "kernels/kernels.h"
#include "kernels/x86/nn_sse4.h"

enum { STEPS_MAX = 64, COLUMNS_MAX = 72, TILE = 2, PAIR_BYTES = 64, FOURS = 4 };

struct block {
    __m128i weights[STEPS_MAX][FOURS], bias[FOURS]; /* four channels each */
    struct scale4 scale[FOURS];
    ptrdiff_t
        from[STEPS_MAX]; /* of a step's inputs in scratch, from the output's first column on */
    ptrdiff_t column_bytes;
    int32_t steps, pairs; /* pairs of rows */
    int32_t width;        /* valid channels */
};

/* 16-bit weights of eight channels of a tap; zero beyond the kernel. */
static __m128i tap_weights(const struct fv_nn_depthwise *d, int32_t channel, int32_t ky, int32_t kx)
{
    __m128i sum = _mm_setzero_si128();
    const int32_t taps = d->kh * d->kw, tap = ky * d->kw + kx;
    for (int32_t p = 0; p < d->planes && ky < d->kh && kx < d->kw; p++) {
        const int8_t *w = d->weights + ((ptrdiff_t)p * taps + tap) * d->c16 + channel;
        sum = _mm_add_epi16(sum,
                            _mm_cvtepi8_epi16(_mm_loadl_epi64((const __m128i *)(const void *)w)));
    }
    return sum;
}

static void add_step(struct block *b, const struct fv_nn_depthwise *d, int32_t channel,
                     int32_t pair, int32_t kx)
{
    const int beside = 2 * pair + 1 == d->kh;
    for (int32_t h = 0; h < 2; h++) {
        const __m128i first = tap_weights(d, channel + 8 * h, 2 * pair, kx),
                      second = tap_weights(d, channel + 8 * h, 2 * pair + !beside, kx + beside);
        b->weights[b->steps][2 * h] = _mm_unpacklo_epi16(first, second);
        b->weights[b->steps][2 * h + 1] = _mm_unpackhi_epi16(first, second);
    }
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
    for (int32_t h = 0; h < FOURS; h++) {
        const int32_t at = channel + 4 * h;
        b->bias[h] = load16(d->bias + at);
        load_scale(&b->scale[h], d->multiplier + at, d->shift + at);
    }
}

FV_INLINE void interleave(const uint8_t *a, const uint8_t *b, uint8_t *to)
{
    const __m128i x = load16(a), y = load16(b), zero = _mm_setzero_si128();
    const __m128i low = _mm_unpacklo_epi8(x, y), high = _mm_unpackhi_epi8(x, y);
    __m128i *out = (__m128i *)(void *)to;
    _mm_store_si128(out, _mm_unpacklo_epi8(low, zero));
    _mm_store_si128(out + 1, _mm_unpackhi_epi8(low, zero));
    _mm_store_si128(out + 2, _mm_unpacklo_epi8(high, zero));
    _mm_store_si128(out + 3, _mm_unpackhi_epi8(high, zero));
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
                    const int above)
{
    __m128i acc[TILE][FOURS];
#pragma GCC unroll 2
    for (int i = 0; i < N; i++) {
#pragma GCC unroll 4
        for (int h = 0; h < FOURS; h++)
            acc[i][h] = b->bias[h];
    }
#pragma GCC unroll 1
    for (int s = 0; s < steps; s++) {
        const uint8_t *from = columns + b->from[s];
#pragma GCC unroll 4
        for (int h = 0; h < FOURS; h++) {
            const __m128i w = b->weights[s][h];
#pragma GCC unroll 2
            for (int i = 0; i < N; i++) {
                const __m128i x = load16(from + i * step + 16 * (ptrdiff_t)h);
                acc[i][h] = _mm_add_epi32(acc[i][h], _mm_madd_epi16(w, x));
            }
        }
    }
    for (int i = 0; i < N; i++) {
        const __m128i bytes = to_bytes(o, requantize(acc[i][0], &b->scale[0], above),
                                       requantize(acc[i][1], &b->scale[1], above),
                                       requantize(acc[i][2], &b->scale[2], above),
                                       requantize(acc[i][3], &b->scale[3], above));
        store_bytes(o, out + i * ldo, bytes, b->width);
    }
}

FV_INLINE void outputs(const struct block *b, const struct fv_nn_depthwise *d,
                       const uint8_t *columns, int32_t count, const struct output *o, uint8_t *out,
                       const int steps, const int above)
{
    const ptrdiff_t step = d->stride_x * b->column_bytes;
    if (count < TILE) {
        for (int32_t i = 0; i < count; i++) {
            tile(b, columns + i * step, step, 1, o, out + (ptrdiff_t)i * d->out_stride,
                 d->out_stride, steps, above);
        }
        return;
    }
    for (int32_t i = 0; i < count; i += TILE) {
        const int32_t at =
            i + TILE > count ? count - TILE : i; /* the last tile overlaps the one before */
        tile(b, columns + at * step, step, TILE, o, out + (ptrdiff_t)at * d->out_stride,
             d->out_stride, steps, above);
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
        if (small && above)
            outputs(b, d, scratch, count, o, to, 5, 1);
        else if (small)
            outputs(b, d, scratch, count, o, to, 5, 0);
        else
            outputs(b, d, scratch, count, o, to, b->steps, 0);
    }
}

void fv_k_nn_depthwise_u8__sse4(const struct fv_nn_depthwise *d, const uint8_t *in, uint8_t *out,
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

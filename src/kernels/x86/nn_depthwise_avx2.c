/* Depthwise convolution with vpmaddwd: two taps at a time, 16 channels at a time, weights as 16-bit
 * sums of their planes.
 *
 * Windows of 3x3 are in nn_depthwise_3x3_avx2.h. Of others the taps of a pair lie in neighbouring
 * rows of the kernel, or, where a last row is left over, side by side in it. Each input column is
 * widened and interleaved once into scratch, for the outputs of all kernel columns over it:
 * [column][pair of rows][16 channels][2]. */
#include "kernels/x86/nn_depthwise_3x3_avx2.h"

enum { STEPS_MAX = 64, COLUMNS_MAX = 72, TILE = 4, PAIR_BYTES = 64 };

struct block {
    struct channels channels;
    __m256i weights[STEPS_MAX][2]; /* channels 0-7 and 8-15 */
    ptrdiff_t
        from[STEPS_MAX]; /* of a step's inputs in scratch, from the output's first column on */
    ptrdiff_t column_bytes;
    int32_t steps, pairs; /* pairs of rows */
};

/* How all results are rounded where `mode` is not 0 (nn_real_avx2.h). */
struct real {
    struct scale8 scale;
    int mode;
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
    pair_weights(b->weights[b->steps], first, second);
    b->from[b->steps] = kx * d->dilation_x * b->column_bytes + (ptrdiff_t)pair * PAIR_BYTES;
    ++b->steps;
}

static int32_t step_count(const struct fv_nn_depthwise *d)
{
    return d->kh / 2 * d->kw + d->kh % 2 * (d->kw + 1) / 2;
}

static void load_channels(struct channels *c, const struct fv_nn_depthwise *d, int32_t channel,
                          const struct real *real)
{
    c->width = d->channels - channel < 16 ? d->channels - channel : 16;
    for (int32_t h = 0; h < 2; h++)
        c->bias[h] = load32(d->bias + channel + 8 * h);
    c->mode = real->mode;
    if (real->mode != 0) {
        c->scale[0] = real->scale;
        return;
    }
    c->mode = load_any_scales(c->scale, d->multiplier + channel, d->shift + channel);
    if (c->mode == 0 || d->table != NULL)
        c->mode |= TABLED;
    else if (d->act_min >= d->zero_out)
        c->mode |= ABOVE_ZERO;
}

static void load_block(struct block *b, const struct fv_nn_depthwise *d, int32_t channel)
{
    b->steps = 0;
    b->pairs = (d->kh + 1) / 2;
    b->column_bytes = (ptrdiff_t)b->pairs * PAIR_BYTES;
    for (int32_t pair = 0; pair < b->pairs; pair++) {
        for (int32_t kx = 0; kx < d->kw; kx += 2 * pair + 1 == d->kh ? 2 : 1)
            add_step(b, d, channel, pair, kx);
    }
}

FV_INLINE void interleave(const uint8_t *a, const uint8_t *b, uint8_t *to)
{
    __m256i pairs[2];
    widen_pair(a, b, pairs);
    _mm256_store_si256((__m256i *)(void *)to, pairs[0]);
    _mm256_store_si256((__m256i *)(void *)(to + 32), pairs[1]);
}

/* Input row ky of output row y. */
static struct line line_of(const struct fv_nn_depthwise *d, const uint8_t *in,
                           const uint8_t *border, int32_t y, int32_t ky)
{
    const int32_t iy = y * d->stride_y - d->pad_top + ky * d->dilation_y;
    if (iy < 0 || iy >= d->in_h) return (struct line){.pixels = border, .mask = 0};
    return (struct line){.pixels = in + (ptrdiff_t)iy * d->in_w * d->in_stride, .mask = -1};
}

/* Columns x, x + 1, ... of line a, each with the column `shift` further of line b. */
static __attribute__((noinline)) void
interleave_lines(const struct fv_nn_depthwise *d, struct line a, struct line b, int32_t shift,
                 int32_t x, int32_t count, const uint8_t *border, uint8_t *to, ptrdiff_t pitch)
{
    const ptrdiff_t step_a = d->in_stride & a.mask, step_b = d->in_stride & b.mask;
    const int32_t end = x + count, inner_end = d->in_w - shift < end ? d->in_w - shift : end;
    while (x < end) {
        if (x >= 0 && x < inner_end) {
            const uint8_t *from_a = a.pixels + x * step_a,
                          *from_b = b.pixels + (x + shift) * step_b;
            for (; x < inner_end; x++, from_a += step_a, from_b += step_b, to += pitch)
                interleave(from_a, from_b, to);
        } else {
            const uint8_t *from_a = x < 0 || x >= d->in_w ? border : a.pixels + x * step_a;
            const uint8_t *from_b =
                x + shift < 0 || x + shift >= d->in_w ? border : b.pixels + (x + shift) * step_b;
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
                    const struct output *o, uint8_t *out, ptrdiff_t ldo, const int mode)
{
    __m256i acc[TILE][2];
#pragma GCC unroll 4
    for (int i = 0; i < N; i++) {
        acc[i][0] = b->channels.bias[0];
        acc[i][1] = b->channels.bias[1];
    }
#pragma GCC unroll 1
    for (int s = 0; s < b->steps; s++) {
        const __m256i *x = (const __m256i *)(const void *)(columns + b->from[s]);
        const __m256i w0 = b->weights[s][0], w1 = b->weights[s][1];
#pragma GCC unroll 4
        for (int i = 0; i < N;
             ++i, x = (const __m256i *)(const void *)((const uint8_t *)x + step)) {
            acc[i][0] = _mm256_add_epi32(acc[i][0], _mm256_madd_epi16(w0, x[0]));
            acc[i][1] = _mm256_add_epi32(acc[i][1], _mm256_madd_epi16(w1, x[1]));
        }
    }
    store_tile(o, b->channels.scale, acc, N, out, ldo, b->channels.width, mode);
}

FV_INLINE void outputs(const struct block *b, const struct fv_nn_depthwise *d,
                       const uint8_t *columns, int32_t count, const struct output *o, uint8_t *out,
                       const int mode)
{
    const ptrdiff_t step = d->stride_x * b->column_bytes;
    if (count < TILE) {
        for (int32_t i = 0; i < count; i++) {
            tile(b, columns + i * step, step, 1, o, out + (ptrdiff_t)i * d->out_stride,
                 d->out_stride, mode);
        }
        return;
    }
    for (int32_t i = 0; i < count; i += TILE) {
        const int32_t at =
            i + TILE > count ? count - TILE : i; /* the last tile overlaps the one before */
        tile(b, columns + at * step, step, TILE, o, out + (ptrdiff_t)at * d->out_stride,
             d->out_stride, mode);
    }
}

static void outputs_in_mode(const struct block *b, const struct fv_nn_depthwise *d,
                            const uint8_t *columns, int32_t count, const struct output *o,
                            uint8_t *out)
{
    switch (b->channels.mode) {
    case REAL | ABOVE_ZERO:
        outputs(b, d, columns, count, o, out, REAL | ABOVE_ZERO);
        break;
    case REAL:
        outputs(b, d, columns, count, o, out, REAL);
        break;
    case TABLED:
        outputs(b, d, columns, count, o, out, TABLED);
        break;
    default:
        outputs(b, d, columns, count, o, out, LESSENED | TABLED);
    }
}

static void row(const struct block *b, const struct fv_nn_depthwise *d, const uint8_t *in,
                int32_t y, const struct output *o, const uint8_t *border, uint8_t *out,
                uint8_t *scratch)
{
    const int32_t span = (d->kw - 1) * d->dilation_x + 1;
    const int32_t most = span > COLUMNS_MAX ? 1 : (COLUMNS_MAX - span) / d->stride_x + 1;
    for (int32_t x = 0, count; x < d->out_w; x += count) {
        count = d->out_w - x < most ? d->out_w - x : most;
        interleave_columns(b, d, in, y, x * d->stride_x - d->pad_left,
                           (count - 1) * d->stride_x + span, border, scratch);
        outputs_in_mode(b, d, scratch, count, o, out + (ptrdiff_t)x * d->out_stride);
    }
}

static void load_taps(__m256i taps[3][3], const struct fv_nn_depthwise *d, int32_t channel)
{
    for (int32_t ky = 0; ky < 3; ky++) {
        for (int32_t kx = 0; kx < 3; kx++)
            taps[ky][kx] = tap_weights(d, channel, ky, kx);
    }
}

static void two_in_mode(const struct channels *c, const struct two_rows_weights *w,
                        const struct fv_nn_depthwise *d, const struct window_rows *r, int32_t x,
                        const struct output *o)
{
    switch (c->mode) {
    case REAL | ABOVE_ZERO:
        two_output_rows(c, w, d, r, x, o, REAL | ABOVE_ZERO);
        break;
    case REAL:
        two_output_rows(c, w, d, r, x, o, REAL);
        break;
    case LESSENED | ABOVE_ZERO:
        two_output_rows(c, w, d, r, x, o, LESSENED | ABOVE_ZERO);
        break;
    default:
        two_output_rows(c, w, d, r, x, o, LESSENED);
    }
}

static void strided_in_mode(const struct channels *c, const struct stride_weights *w,
                            const struct fv_nn_depthwise *d, const struct window_rows *r,
                            const struct output *o)
{
    switch (c->mode) {
    case REAL | ABOVE_ZERO:
        strided_row(c, w, d, r, o, REAL | ABOVE_ZERO);
        break;
    case REAL:
        strided_row(c, w, d, r, o, REAL);
        break;
    case LESSENED | ABOVE_ZERO:
        strided_row(c, w, d, r, o, LESSENED | ABOVE_ZERO);
        break;
    default:
        strided_row(c, w, d, r, o, LESSENED);
    }
}

/* Output rows [from, end) of 16 channels; `out` is row `from`'s. Without strides a row is made with
 * the one below, or with a dilation of rows with the one so far below. */
static void small_rows(const struct channels *c, const struct fv_nn_depthwise *d, const uint8_t *in,
                       int32_t channel, int32_t from, int32_t end, const struct output *o,
                       const uint8_t *border, uint8_t *out)
{
    const ptrdiff_t pitch = (ptrdiff_t)d->out_w * d->out_stride;
    const int32_t apart = d->stride_x == 1 ? d->dilation_y : 0;
    struct window_rows r = {.border = border};
    struct two_rows_weights two;
    struct stride_weights stride;
    __m256i taps[3][3];
    load_taps(taps, d, channel);
    if (apart > 0)
        set_two_rows(&two, taps);
    else
        set_stride(&stride, taps);
    for (int32_t y = from; y < end; y++) {
        for (int32_t ky = 0; ky < 4; ky++)
            r.lines[ky] = line_of(d, in, border, y, ky);
        r.out[0] = r.out[1] = out + (y - from) * pitch;
        if (apart == 0) {
            strided_in_mode(c, &stride, d, &r, o);
            continue;
        }
        if (y + apart < end) r.out[1] += apart * pitch;
        for (int32_t x = 0; x < d->dilation_x && x < d->out_w; x++)
            two_in_mode(c, &two, d, &r, x, o);
        if ((y - from) % apart == apart - 1) y += apart;
    }
}

/* Whether all windows are ones that small_rows takes. */
static int are_small(const struct fv_nn_depthwise *d)
{
    if (d->kh != 3 || d->kw != 3) return 0;
    return (d->stride_x == 1 && d->stride_y == 1) || (d->stride_x == 2 && d->dilation_x == 1);
}

void fv_k_nn_depthwise_u8__avx2(const struct fv_nn_depthwise *d, const uint8_t *in, uint8_t *out,
                                int32_t begin_row, int32_t end, uint8_t *scratch)
{
    if (step_count(d) > STEPS_MAX) {
        fv_k_nn_depthwise_u8__c(d, in, out, begin_row, end, scratch);
        return;
    }
    const ptrdiff_t pitch = (ptrdiff_t)d->out_w * d->out_stride;
    uint8_t border[16];
    struct real real = {.mode = 0};
    struct output o;
    struct block b;
    memset(border, d->zero_in, sizeof border);
    init_output(&o, d->zero_out, d->act_min, d->act_max, d->table);
    if (d->table == NULL &&
        (int64_t)(end - begin_row) * d->out_w * d->channels >= REAL_RESULTS_LEAST &&
        have_one_scale(d->multiplier, d->shift, d->channels)) {
        real.mode = find_real(&real.scale, d->multiplier[0], d->shift[0], d->zero_out, d->act_min,
                              d->act_max);
    }
    for (int32_t c = 0; c < d->channels; c += 16) {
        load_channels(&b.channels, d, c, &real);
        if (are_small(d) && (b.channels.mode & TABLED) == 0) {
            small_rows(&b.channels, d, in + c, c, begin_row, end, &o, border, out + c);
            continue;
        }
        load_block(&b, d, c);
        for (int32_t y = begin_row; y < end; y++)
            row(&b, d, in + c, y, &o, border, out + c + (y - begin_row) * pitch, scratch);
    }
}

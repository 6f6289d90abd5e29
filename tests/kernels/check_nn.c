#include "kernels/check.h"
#include "kernels/check_nn_sums.h"
#include "nn/real.h"

#include <stdio.h>
#include <string.h>

enum { SLACK = 64 };

/* Multipliers, shifts and biases as real models have them, for all channels the same or not, and at
 * the ends of their ranges. */
static void fill_scaling(struct check *check, int32_t *bias, int32_t *multiplier, int32_t *shift,
                         int32_t count)
{
    const int32_t extreme = check_between(check, 0, 3) == 0;
    const int32_t same = check_between(check, 0, 1);
    const int32_t down = check_between(check, 0, 1); /* all below one half, or zero */
    for (int32_t i = 0; i < count; i++) {
        bias[i] = check_between(check, -200000, 200000);
        multiplier[i] = (int32_t)(0x40000000u + check_random(check) % 0x40000000u);
        shift[i] = !extreme ? check_between(check, -12, -4)
                   : down   ? check_between(check, -31, -1)
                            : check_between(check, -20, 2);
        if (extreme && check_between(check, 0, 5) == 0) multiplier[i] = 0x40000000;
        if (extreme && check_between(check, 0, 9) == 0) multiplier[i] = shift[i] = 0;
        if (extreme && check_between(check, 0, 5) == 0)
            bias[i] = (int32_t)(check_random(check) << 4);
        if (same) {
            multiplier[i] = multiplier[0];
            shift[i] = shift[0];
        }
    }
}

/* Small weights, positive, negative or both, whose sums reach the ends of 16 bits after some. */
static void fill_small(struct check *check, int8_t *weights, int32_t count)
{
    const int32_t most = check_between(check, 1, 24), signs = check_between(check, -1, 1);
    for (int32_t i = 0; i < count; i++)
        weights[i] = (int8_t)(signs != 0 ? signs * most : check_between(check, -most, most));
}

/* The ends of the range alone: all the lowest, all the highest, or both. */
static void fill_ends(struct check *check, int8_t *weights, int32_t count)
{
    const int32_t ends = check_between(check, -1, 1);
    for (int32_t i = 0; i < count; i++) {
        const int32_t up = ends != 0 ? ends : 2 * check_between(check, 0, 1) - 1;
        weights[i] = up > 0 ? INT8_MAX : INT8_MIN;
    }
}

/* Mostly of sizes whose pairs just fit 16 bits when multiplied by 255, or just do not. */
static void fill_near_limit(struct check *check, int8_t *weights, int32_t count)
{
    for (int32_t i = 0; i < count; i++) {
        const int32_t size = check_between(check, 60, 64), kind = check_between(check, 0, 200);
        if (kind != 0)
            weights[i] = (int8_t)(kind == 1         ? 65
                                  : kind == 2       ? -65
                                  : weights[i] >= 0 ? size
                                                    : -size);
    }
}

static void fill_weights(struct check *check, int8_t *weights, int32_t count)
{
    check_fill(check, weights, (size_t)count);
    switch (check_between(check, 0, 4)) {
    case 0: /* of all sizes */
        return;
    case 1:
        fill_small(check, weights, count);
        return;
    case 2:
        fill_ends(check, weights, count);
        return;
    default:
        fill_near_limit(check, weights, count);
    }
}

static struct fv_nn_gemm draw_gemm(struct check *check, int32_t k, int32_t n)
{
    const int32_t k4 = (k + 3) / 4, n16 = (n + 15) / 16 * 16;
    int8_t *weights = check_buffer(check, (size_t)(n16 * k4 * 4), 64, SLACK);
    fill_weights(check, weights, n16 * k4 * 4);
    for (int32_t c = 0; c < n16; c++) { /* padding is zero by contract */
        for (int32_t i = 0; i < k4 * 4; i++) {
            if (c >= n || i >= k) weights[((c / 16 * k4 + i / 4) * 16 + c % 16) * 4 + i % 4] = 0;
        }
    }
    int32_t *bias = check_buffer(check, (size_t)n16 * 4, 64, SLACK),
            *multiplier = check_buffer(check, (size_t)n16 * 4, 64, SLACK);
    int32_t *shift = check_buffer(check, (size_t)n16 * 4, 64, SLACK);
    fill_scaling(check, bias, multiplier, shift, n16);
    struct fv_nn_gemm g = {.k = k,
                           .k4 = k4,
                           .n = n,
                           .weights = weights,
                           .bias = bias,
                           .multiplier = multiplier,
                           .shift = shift};
    check_draw_range(check, &g.zero_out, &g.act_min, &g.act_max);
    g.row_sum_factor = check_between(check, 0, 1) ? 0 : check_between(check, -256, 256);
    if (check_between(check, 0, 3) == 0) {
        uint8_t *table = check_buffer(check, 256, 1, 0);
        check_fill(check, table, 256);
        g.table = table;
    }
    return g;
}

/* Bytes of all sizes, the largest in most places, as of a clamped activation, or everywhere. */
static void fill_inputs(struct check *check, uint8_t *to, ptrdiff_t count)
{
    const int32_t kept = (const int32_t[]){255, 40, -1}[check_between(check, 0, 2)];
    check_fill(check, to, (size_t)count);
    for (ptrdiff_t i = 0; i < count; i++) {
        if (to[i] > kept) to[i] = 255;
    }
}

/* Few channels as often as many. */
static int32_t draw_channels(struct check *check)
{
    const int32_t kind = check_between(check, 0, 5);
    return kind == 0   ? 16 * check_between(check, 1, 3)
           : kind == 1 ? check_between(check, 1, 8)
           : kind == 2 ? 8
                       : check_between(check, 1, 150);
}

void check_nn_gemm_u8(struct check *check, fv_k_nn_gemm_u8_fn *reference,
                      fv_k_nn_gemm_u8_fn *variant)
{
    if (check_between(check, 0, 7) == 0) {
        check_all_sums(check, reference, variant);
        check_hard_sums(check, reference, variant);
        return;
    }
    const int32_t k = check_between(check, 1, 150), n = draw_channels(check);
    const int32_t m =
        check_between(check, 0, 9) ? check_between(check, 1, 40) : check_between(check, 120, 270);
    struct fv_nn_gemm g = draw_gemm(check, k, n);
    check_draw_real(check, &g);
    const ptrdiff_t lda = k + check_between(check, 0, 9),
                    ldo = n + check_between(check, 0, 1) * check_between(check, 0, 9);
    uint8_t *a = check_buffer(check, (size_t)((m - 1) * lda + k), 1, SLACK);
    fill_inputs(check, a, (m - 1) * lda + k);
    const size_t bytes = (size_t)((m - 1) * ldo + n);
    uint8_t *expected = check_buffer(check, bytes, 1, 0), *found = check_buffer(check, bytes, 1, 0);
    reference(&g, a, lda, expected, ldo, m);
    variant(&g, a, lda, found, ldo, m);
    check_equal(check, "out", expected, found, bytes);
}

/* Groups of inputs anywhere in a buffer, over each other too. */
void check_nn_apart_u8(struct check *check, fv_k_nn_apart_u8_fn *reference,
                       fv_k_nn_apart_u8_fn *variant)
{
    enum { SPAN = 4000, MOST = 100, ROWS = 160, GROUPS = 60 };
    const int32_t k4 = check_between(check, 1, GROUPS), n = draw_channels(check);
    const int32_t m = check_between(check, 1, check_between(check, 0, 2) ? 40 : ROWS);
    struct fv_nn_gemm g = draw_gemm(check, 4 * k4, n);
    g.row_sum_factor = 0;
    check_draw_real(check, &g);
    uint8_t *a = check_buffer(check, SPAN, 1, 0);
    fill_inputs(check, a, SPAN);
    const ptrdiff_t ldo = n + check_between(check, 0, 1) * check_between(check, 0, 9);
    const size_t bytes = (size_t)((m - 1) * ldo + n);
    uint8_t *expected = check_buffer(check, bytes, 1, 0), *found = check_buffer(check, bytes, 1, 0);
    struct fv_nn_rows rows[ROWS], found_rows[ROWS];
    int32_t offsets[GROUPS], count = 0, most = check_between(check, 0, 1) ? ROWS : 20;
    for (int32_t i = 0; i < k4; i++)
        offsets[i] = check_between(check, -MOST, MOST - 4);
    const ptrdiff_t step = check_between(check, -20, 20);
    for (int32_t left = m; left > 0; left -= rows[count++].count) {
        struct fv_nn_rows *r = &rows[count];
        r->count = check_between(check, 1, left < most ? left : most);
        if (check_between(check, 0, 1))
            r->count = (r->count + 3) / 4 * 4 < left ? (r->count + 3) / 4 * 4 : left;
        r->in_step = check_between(check, 0, 3) ? step : check_between(check, -20, 20);
        const ptrdiff_t reach = (r->count - 1) * r->in_step, low = reach < 0 ? -reach : 0;
        r->in = a + MOST + low +
                check_between(check, 0, (int32_t)(SPAN - 2 * MOST - (reach < 0 ? -reach : reach)));
        r->out_step = check_between(check, 0, 3) ? ldo : -ldo;
        r->out = expected + (r->out_step < 0 ? left - 1 : left - r->count) * ldo;
        found_rows[count] = *r;
        found_rows[count].out += found - expected;
    }
    reference(&g, offsets, rows, count);
    variant(&g, offsets, found_rows, count);
    check_equal(check, "out", expected, found, bytes);
}

void check_nn_gemm_i32(struct check *check, fv_k_nn_gemm_i32_fn *reference,
                       fv_k_nn_gemm_i32_fn *variant)
{
    const int32_t k = check_between(check, 1, 300), n = check_between(check, 1, 90);
    const int32_t m =
        check_between(check, 0, 9) ? check_between(check, 1, 24) : check_between(check, 120, 270);
    const struct fv_nn_gemm g = draw_gemm(check, k, n);
    const ptrdiff_t lda = k + check_between(check, 0, 9), ldo = (n + 15) / 16 * 16;
    uint8_t *a = check_buffer(check, (size_t)((m - 1) * lda + k), 1, SLACK);
    fill_inputs(check, a, (m - 1) * lda + k);
    const size_t bytes = (size_t)(m * ldo) * 4;
    int32_t *expected = check_buffer(check, bytes, 64, 0),
            *found = check_buffer(check, bytes, 64, 0);
    reference(&g, a, lda, expected, ldo, m);
    variant(&g, a, lda, found, ldo, m);
    check_equal(check, "accumulators", expected, found, bytes);
}

/* What stays the same over calls of one benchmark. */
struct bench_gemm {
    struct fv_nn_gemm g;
    uint8_t *a;
};

static struct bench_gemm *bench_gemm_inputs(struct check *check)
{
    enum { M = 361, K = 256, N = 256 };
    if (check->kept == NULL) {
        struct bench_gemm *b = check_buffer(check, sizeof *b, 8, 0);
        b->g = draw_gemm(check, K, N);
        b->g.row_sum_factor = 0;
        b->g.table = NULL;
        check_draw_real(check, &b->g);
        b->a = check_buffer(check, M * K, 64, SLACK);
        check_fill(check, b->a, M * K);
        check->kept = b;
    }
    snprintf(check->size, sizeof check->size, "361x256x256");
    return check->kept;
}

void bench_nn_gemm_u8(struct check *check, fv_k_nn_gemm_u8_fn *variant)
{
    const struct bench_gemm *b = bench_gemm_inputs(check);
    variant(&b->g, b->a, 256, bench_scratch(), 256, 361);
}

void bench_nn_apart_u8(struct check *check, fv_k_nn_apart_u8_fn *variant)
{
    enum { M = 361, K = 256 };
    const struct bench_gemm *b = bench_gemm_inputs(check);
    int32_t offsets[K / 4];
    for (int32_t i = 0; i < K / 4; i++)
        offsets[i] = 4 * i;
    variant(&b->g, offsets, &(struct fv_nn_rows){b->a, bench_scratch(), K, 256, M}, 1);
}

void bench_nn_gemm_i32(struct check *check, fv_k_nn_gemm_i32_fn *variant)
{
    const struct bench_gemm *b = bench_gemm_inputs(check);
    variant(&b->g, b->a, 256, (int32_t *)(void *)bench_scratch(), 256, 361);
}

/* As networks mostly have them: pixels and columns of the kernel are neighbours. */
static void make_usual(struct check *check, struct fv_nn_depthwise *d)
{
    d->kh = check_between(check, 0, 1) ? 3 : check_between(check, 1, 4);
    d->kw = check_between(check, 0, 3) ? 3 : d->kw;
    if (check_between(check, 0, 2) == 0) d->kh = d->kw = 5;
    const int32_t kind = check_between(check, 0, 3);
    d->channels = kind < 2    ? 16 * check_between(check, 1, 3)
                  : kind == 2 ? 16 * check_between(check, 4, 13)
                              : 8 * check_between(check, 1, 12);
    d->in_w = check_between(check, 1, check_between(check, 0, 1) ? 100 : 20);
    d->out_stride = d->channels;
    d->in_stride = d->channels + 16 * check_between(check, 0, 1);
    d->dilation_y = check_between(check, 0, 3) == 0 ? 2 : 1;
    d->dilation_x = check_between(check, 0, 3) == 0 ? 2 : 1;
    d->stride_y = d->stride_x = check_between(check, 0, 3) == 0 ? 2 : 1;
    if (check_between(check, 0, 9) > 0) return;
    /* Copies of three rows fit the scratch, of four they do not. */
    d->kh = d->kw = 3;
    d->dilation_y = d->dilation_x = d->stride_y = d->stride_x = 1;
    d->channels = d->out_stride = 32;
    d->in_stride = 48;
    d->in_w = check_between(check, 140, 180);
}

static struct fv_nn_depthwise draw_depthwise(struct check *check, bool usual)
{
    const int32_t most =
        check_between(check, 0, 5) == 0 ? 12 : 5; /* beyond what some keep at hand */
    struct fv_nn_depthwise d = {.kh = check_between(check, 1, most),
                                .kw = check_between(check, 1, most)};
    if (check_between(check, 0, 1)) d.kh = d.kw = 3;
    d.channels =
        check_between(check, 0, 2) ? check_between(check, 1, 150) : 8 * check_between(check, 1, 18);
    d.in_stride = d.channels + check_between(check, 0, 1) * check_between(check, 0, 20);
    d.out_stride = d.channels + check_between(check, 0, 1) * check_between(check, 0, 20);
    d.in_h = check_between(check, 1, 9);
    d.in_w = check_between(check, 1, check_between(check, 0, 3) == 0 ? 170 : 20);
    d.stride_y = d.stride_x = check_between(check, 1, 3);
    d.dilation_y = check_between(check, 1, 2);
    d.dilation_x = check_between(check, 1, 3);
    d.pad_top = check_between(check, 0, 3);
    d.pad_left = check_between(check, 0, 3);
    if (usual) make_usual(check, &d);
    d.out_w = (d.in_w + 4) / d.stride_x + 1; /* to beyond the right border, or not up to it */
    if (check_between(check, 0, 3) == 0) d.out_w = check_between(check, 1, d.out_w);
    d.planes = check_between(check, 0, 2) == 0 ? 2 : 1;
    d.c16 = (d.channels + 15) / 16 * 16;
    int8_t *weights = check_buffer(check, (size_t)(d.planes * d.kh * d.kw * d.c16), 64, SLACK);
    check_fill(check, weights, (size_t)(d.planes * d.kh * d.kw * d.c16));
    int32_t *bias = check_buffer(check, (size_t)d.c16 * 4, 64, SLACK),
            *multiplier = check_buffer(check, (size_t)d.c16 * 4, 64, SLACK);
    int32_t *shift = check_buffer(check, (size_t)d.c16 * 4, 64, SLACK);
    fill_scaling(check, bias, multiplier, shift, d.c16);
    d.weights = weights;
    d.bias = bias;
    d.multiplier = multiplier;
    d.shift = shift;
    d.zero_in = check_between(check, 0, 255);
    check_draw_range(check, &d.zero_out, &d.act_min, &d.act_max);
    if (check_between(check, 0, 1)) {
        float *real = check_buffer(check, (size_t)d.c16 * 2 * sizeof *real, 64, 0);
        fv_nn_real_depthwise(&d, real);
        d.real = real;
    }
    return d;
}

static uint8_t *depthwise_scratch(struct check *check, const struct fv_nn_depthwise *d)
{
    const int32_t span = (d->kw - 1) * d->dilation_x + 1, all = (d->out_w - 1) * d->stride_x + span;
    const int32_t most = span > 72 ? span : 72;
    return check_buffer(check, (size_t)(all < most ? all : most) * 256 * (size_t)((d->kh + 3) / 4),
                        64, 0);
}

static void check_depthwise(struct check *check, bool usual, fv_k_nn_depthwise_u8_fn *reference,
                            fv_k_nn_depthwise_u8_fn *variant)
{
    struct fv_nn_depthwise d = draw_depthwise(check, usual);
    if (check_between(check, 0, 3) == 0) {
        uint8_t *table = check_buffer(check, 256, 1, 0);
        check_fill(check, table, 256);
        d.table = table;
    }
    const size_t in_bytes = (size_t)((d.in_h * d.in_w - 1) * d.in_stride + d.channels);
    uint8_t *in = check_buffer(check, in_bytes, 1, SLACK);
    check_fill(check, in, in_bytes);
    const int32_t y = check_between(check, 0, (d.in_h + 4) / d.stride_y),
                  rows = check_between(check, 1, 7);
    const size_t bytes = (size_t)((rows * d.out_w - 1) * d.out_stride + d.channels);
    uint8_t *expected = check_buffer(check, bytes, 1, 0), *found = check_buffer(check, bytes, 1, 0);
    uint8_t *scratch = depthwise_scratch(check, &d);
    reference(&d, in, expected, y, y + rows, scratch);
    variant(&d, in, found, y, y + rows, scratch);
    check_equal(check, "rows", expected, found, bytes);
}

void check_nn_depthwise_u8(struct check *check, fv_k_nn_depthwise_u8_fn *reference,
                           fv_k_nn_depthwise_u8_fn *variant)
{
    check_depthwise(check, false, reference, variant);
    for (int i = 0; i < 2; i++) /* of their many ways each is drawn some times */
        check_depthwise(check, true, reference, variant);
}

void bench_nn_depthwise_u8(struct check *check, fv_k_nn_depthwise_u8_fn *variant)
{
    enum { SIDE = 38, CHANNELS = 256 };
    struct fv_nn_depthwise *d = check->kept;
    if (d == NULL) {
        d = check_buffer(check, sizeof *d, 8, 0);
        *d = draw_depthwise(check, false);
        d->kh = d->kw = 3;
        d->stride_x = d->stride_y = d->dilation_x = d->dilation_y = d->pad_left = d->pad_top =
            d->planes = 1;
        d->in_w = d->out_w = d->in_h = SIDE;
        d->channels = d->c16 = d->in_stride = d->out_stride = CHANNELS;
        d->weights = check_buffer(check, 9 * CHANNELS, 64, SLACK);
        int32_t *scaling[3];
        for (int i = 0; i < 3; i++)
            scaling[i] = check_buffer(check, CHANNELS * 4, 64, SLACK);
        fill_scaling(check, scaling[0], scaling[1], scaling[2], CHANNELS);
        d->bias = scaling[0];
        d->multiplier = scaling[1];
        d->shift = scaling[2];
        d->act_min = d->zero_out;
        check->kept = d;
    }
    snprintf(check->size, sizeof check->size, "38x38x256, 3x3");
    variant(d, bench_scratch(), bench_scratch() + (1 << 20), 0, SIDE, bench_scratch() + (4 << 20));
}

void check_nn_table_u8(struct check *check, fv_k_nn_table_u8_fn *reference,
                       fv_k_nn_table_u8_fn *variant)
{
    const int32_t count = check_between(check, 1, 400);
    uint8_t *table = check_buffer(check, 256, 1, 0), *in = check_buffer(check, (size_t)count, 1, 0);
    uint8_t *expected = check_buffer(check, (size_t)count, 1, 0),
            *found = check_buffer(check, (size_t)count, 1, 0);
    check_fill(check, table, 256);
    check_fill(check, in, (size_t)count);
    reference(table, in, expected, count);
    if (check_between(check, 0, 1)) {
        memcpy(found, in, (size_t)count);
        variant(table, found, found, count);
    } else {
        variant(table, in, found, count);
    }
    check_equal(check, "out", expected, found, (size_t)count);
}

void bench_nn_table_u8(struct check *check, fv_k_nn_table_u8_fn *variant)
{
    static const uint8_t table[256] = {1, 2, 3};
    snprintf(check->size, sizeof check->size, "65536");
    variant(table, bench_scratch(), bench_scratch() + (1 << 20), 65536);
}

void check_nn_transpose_u8(struct check *check, fv_k_nn_transpose_u8_fn *reference,
                           fv_k_nn_transpose_u8_fn *variant)
{
    const int32_t rows = check_between(check, 1, 60), columns = check_between(check, 1, 60);
    const ptrdiff_t ldi = columns + check_between(check, 0, 9),
                    ldo = rows + check_between(check, 0, 9);
    const size_t in_bytes = (size_t)((rows - 1) * ldi + columns),
                 bytes = (size_t)((columns - 1) * ldo + rows);
    uint8_t *in = check_buffer(check, in_bytes, 1, 0);
    uint8_t *expected = check_buffer(check, bytes, 1, 0), *found = check_buffer(check, bytes, 1, 0);
    check_fill(check, in, in_bytes);
    reference(in, ldi, expected, ldo, rows, columns);
    variant(in, ldi, found, ldo, rows, columns);
    check_equal(check, "out", expected, found, bytes);
}

void bench_nn_transpose_u8(struct check *check, fv_k_nn_transpose_u8_fn *variant)
{
    snprintf(check->size, sizeof check->size, "784x144");
    variant(bench_scratch(), 144, bench_scratch() + (1 << 20), 784, 784, 144);
}

void check_nn_blend_u8(struct check *check, fv_k_nn_blend_u8_fn *reference,
                       fv_k_nn_blend_u8_fn *variant)
{
    const int32_t in_w = check_between(check, 1, 20), out_w = check_between(check, 1, 30),
                  bits = check_between(check, 0, 10);
    struct fv_nn_blend p = {.channels = check_between(check, 1, 70),
                            .out_w = out_w,
                            .bits = bits,
                            .middle = 128 * check_between(check, 0, 1)};
    p.in_stride = p.channels + check_between(check, 0, 5);
    p.out_stride = p.channels + check_between(check, 0, 5);
    int32_t *columns = check_buffer(check, (size_t)out_w * 12, 4, 0);
    for (int32_t x = 0; x < out_w; x++) {
        columns[3 * x] = check_between(check, 0, in_w - 1);
        columns[3 * x + 1] = check_between(check, 0, in_w - 1);
        columns[3 * x + 2] = check_between(check, 0, 1 << bits);
    }
    p.columns = columns;
    const size_t in_bytes = (size_t)((in_w - 1) * p.in_stride + p.channels),
                 bytes = (size_t)((out_w - 1) * p.out_stride + p.channels);
    uint8_t *top = check_buffer(check, in_bytes, 1, SLACK),
            *bottom = check_buffer(check, in_bytes, 1, SLACK);
    uint8_t *expected = check_buffer(check, bytes, 1, 0), *found = check_buffer(check, bytes, 1, 0);
    check_fill(check, top, in_bytes);
    check_fill(check, bottom, in_bytes);
    const int32_t weight = check_between(check, 0, 1 << bits);
    reference(&p, top, bottom, weight, expected);
    variant(&p, top, bottom, weight, found);
    check_equal(check, "row", expected, found, bytes);
}

void bench_nn_blend_u8(struct check *check, fv_k_nn_blend_u8_fn *variant)
{
    struct fv_nn_blend *p = check->kept;
    if (p == NULL) {
        p = check_buffer(check, sizeof *p, 8, 0);
        int32_t *columns = check_buffer(check, 513 * 12, 4, 0);
        for (int32_t x = 0; x < 513; x++) {
            columns[3 * x] = x / 16;
            columns[3 * x + 1] = x / 16 + (x < 512);
            columns[3 * x + 2] = x % 16;
        }
        *p = (struct fv_nn_blend){.channels = 21,
                                  .in_stride = 21,
                                  .out_w = 513,
                                  .out_stride = 21,
                                  .bits = 4,
                                  .columns = columns};
        check->kept = p;
    }
    snprintf(check->size, sizeof check->size, "row of 513x21");
    variant(p, bench_scratch(), bench_scratch() + 4096, 7, bench_scratch() + (1 << 20));
}

void check_nn_argmax_u8(struct check *check, fv_k_nn_argmax_u8_fn *reference,
                        fv_k_nn_argmax_u8_fn *variant)
{
    const int32_t axis = check_between(check, 1, check_between(check, 0, 1) ? 40 : 200),
                  count = check_between(check, 1, 20);
    uint8_t *in = check_buffer(check, (size_t)(axis * count), 1, SLACK);
    int32_t *expected = check_buffer(check, (size_t)count * 4, 4, 0),
            *found = check_buffer(check, (size_t)count * 4, 4, 0);
    check_fill(check, in, (size_t)(axis * count));
    reference(in, axis, expected, count);
    variant(in, axis, found, count);
    check_equal(check, "indices", expected, found, (size_t)count * 4);
}

void bench_nn_argmax_u8(struct check *check, fv_k_nn_argmax_u8_fn *variant)
{
    snprintf(check->size, sizeof check->size, "4096 x 21");
    variant(bench_scratch(), 21, (int32_t *)(void *)(bench_scratch() + (1 << 20)), 4096);
}

void check_nn_gather_u8(struct check *check, fv_k_nn_gather_u8_fn *reference,
                        fv_k_nn_gather_u8_fn *variant)
{
    const int32_t run = check_between(check, 1, check_between(check, 0, 1) ? 20 : 300),
                  count = check_between(check, 1, 12), step = check_between(check, 1, 200);
    const ptrdiff_t pitch = run + 15 + check_between(check, 0, 30);
    const size_t in_bytes = (size_t)((count - 1) * step + run), bytes = (size_t)(count * pitch);
    uint8_t *in = check_buffer(check, in_bytes, 1, 15);
    uint8_t *expected = check_buffer(check, bytes, 1, 0), *found = check_buffer(check, bytes, 1, 0);
    check_fill(check, in, in_bytes);
    reference(in, step, expected, pitch, run, count);
    variant(in, step, found, pitch, run, count);
    for (int32_t i = 0; i < count; i++)
        check_equal(check, "run", expected + i * pitch, found + i * pitch, (size_t)run);
}

void bench_nn_gather_u8(struct check *check, fv_k_nn_gather_u8_fn *variant)
{
    snprintf(check->size, sizeof check->size, "784 runs of 192");
    variant(bench_scratch(), 64, bench_scratch() + (1 << 20), 640, 192, 784);
}

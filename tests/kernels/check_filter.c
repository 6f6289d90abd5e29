#include "kernels/check.h"

#include <stdbool.h>
#include <string.h>

static uint8_t *filled(struct check *check, int32_t count)
{
    uint8_t *row = check_buffer(check, (size_t)count, 1, 0);
    check_fill(check, row, (size_t)count);
    return row;
}

static uint8_t *empty(struct check *check, int32_t count)
{
    return check_buffer(check, (size_t)count, 1, 0);
}

static void bench_rows(const uint8_t **rows, int y, int radius)
{
    for (int i = 0; i <= 2 * radius; i++)
        rows[i] = bench_image() + (y + i - radius) * BENCH_STRIDE;
}

void check_gauss_row_u8(struct check *check, fv_k_gauss_row_u8_fn *reference,
                        fv_k_gauss_row_u8_fn *variant)
{
    const int32_t width = check_between(check, 8, 300), radius = check_between(check, 1, 3);
    uint16_t weights[FV_GAUSS_RADIUS_MAX + 1] = {256};
    for (int32_t i = 1; i <= radius; i++) {
        weights[i] = (uint16_t)check_between(check, 0, weights[0] / 2);
        weights[0] = (uint16_t)(weights[0] - 2 * weights[i]);
    }
    const uint8_t *rows[2 * FV_GAUSS_RADIUS_MAX + 1];
    for (int32_t i = 0; i <= 2 * radius; i++)
        rows[i] = i > 0 && check_between(check, 0, 3) == 0 ? rows[i - 1] : filled(check, width);
    uint16_t *scratch = check_buffer(check, 2 * (size_t)(width + FV_GAUSS_PAD), 64, 0);
    uint8_t *expected = empty(check, width), *found = empty(check, width);
    reference(expected, rows, width, weights, radius, scratch);
    check_fill(check, scratch, 2 * (size_t)(width + FV_GAUSS_PAD));
    variant(found, rows, width, weights, radius, scratch);
    check_equal(check, "blurred row", expected, found, (size_t)width);
}

void bench_gauss_row_u8(struct check *check, fv_k_gauss_row_u8_fn *variant)
{
    (void)check;
    static uint16_t scratch[BENCH_WIDTH + FV_GAUSS_PAD] __attribute__((aligned(64)));
    const uint16_t weights[3] = {96, 64, 16};
    for (int y = 2; y < BENCH_HEIGHT - 2; y++) {
        const uint8_t *rows[5];
        bench_rows(rows, y, 2);
        variant(bench_scratch() + y * BENCH_STRIDE, rows, BENCH_WIDTH, weights, 2, scratch);
    }
}

void check_median3_row_u8(struct check *check, fv_k_median3_row_u8_fn *reference,
                          fv_k_median3_row_u8_fn *variant)
{
    const int32_t width = check_between(check, 2, 300);
    const uint8_t *rows[3] = {filled(check, width), filled(check, width), filled(check, width)};
    uint8_t *expected = empty(check, width), *found = empty(check, width);
    reference(expected, rows, width);
    variant(found, rows, width);
    check_equal(check, "median", expected, found, (size_t)width);
}

void bench_median3_row_u8(struct check *check, fv_k_median3_row_u8_fn *variant)
{
    (void)check;
    for (int y = 1; y < BENCH_HEIGHT - 1; y++) {
        const uint8_t *rows[3];
        bench_rows(rows, y, 1);
        variant(bench_scratch() + y * BENCH_STRIDE, rows, BENCH_WIDTH);
    }
}

void check_mix_u8(struct check *check, fv_k_mix_u8_fn *reference, fv_k_mix_u8_fn *variant)
{
    const int32_t count = check_between(check, 0, 300), weight = check_between(check, 0, 2048);
    const uint8_t *a = filled(check, count), *b = filled(check, count);
    uint8_t *expected = empty(check, count), *found = empty(check, count);
    reference(expected, a, b, count, weight);
    memcpy(found, a, (size_t)count);
    if (check_between(check, 0, 1))
        variant(found, found, b, count, weight);
    else
        variant(found, a, b, count, weight);
    check_equal(check, "mix", expected, found, (size_t)count);
}

void bench_mix_u8(struct check *check, fv_k_mix_u8_fn *variant)
{
    (void)check;
    for (int y = 1; y < BENCH_HEIGHT; y++) {
        const uint8_t *row = bench_image() + y * BENCH_STRIDE;
        variant(bench_scratch() + y * BENCH_STRIDE, row, row - BENCH_STRIDE, BENCH_WIDTH, 384);
    }
}

void check_line_u8(struct check *check, fv_k_line_u8_fn *reference, fv_k_line_u8_fn *variant)
{
    const int32_t count = check_between(check, 0, 300);
    const uint8_t *in = filled(check, count);
    uint8_t *expected = check_buffer(check, (size_t)count, 1, 0);
    uint8_t *found = check_buffer(check, (size_t)count, 1, 0);
    const bool large = check_between(check, 0, 3) == 0; /* halves otherwise: ties */
    const float factor = (float)check_between(check, -512, 512) / (large ? .01f : 128);
    const float offset = (float)check_between(check, -512, 512) / (large ? .01f : 2);
    reference(expected, in, count, factor, offset);
    variant(found, in, count, factor, offset);
    check_equal(check, "out", expected, found, (size_t)count);
}

void bench_line_u8(struct check *check, fv_k_line_u8_fn *variant)
{
    (void)check;
    for (int y = 0; y < BENCH_HEIGHT; y++)
        variant(bench_scratch() + y * BENCH_STRIDE, bench_image() + y * BENCH_STRIDE, BENCH_WIDTH,
                1.37f, -20.5f);
}

void check_range_u8(struct check *check, fv_k_range_u8_fn *reference, fv_k_range_u8_fn *variant)
{
    const int32_t count = check_between(check, 0, 300);
    const uint8_t *in = filled(check, count);
    uint8_t expected[2] = {(uint8_t)check_between(check, 0, 255),
                           (uint8_t)check_between(check, 0, 255)};
    uint8_t found[2] = {expected[0], expected[1]};
    reference(expected, in, count);
    variant(found, in, count);
    check_equal(check, "range", expected, found, sizeof found);
}

void bench_range_u8(struct check *check, fv_k_range_u8_fn *variant)
{
    (void)check;
    uint8_t range[2] = {255, 0};
    for (int y = 0; y < BENCH_HEIGHT; y++)
        variant(range, bench_image() + y * BENCH_STRIDE, BENCH_WIDTH);
    memcpy(bench_scratch(), range, sizeof range);
}

void check_histogram_u8(struct check *check, fv_k_histogram_u8_fn *reference,
                        fv_k_histogram_u8_fn *variant)
{
    static uint32_t expected[4][256], found[4][256];
    const int32_t count = check_between(check, 0, 300);
    const uint8_t *in = filled(check, count);
    memset(expected, 0, sizeof expected);
    memset(found, 0, sizeof found);
    reference(expected, in, count);
    variant(found, in, count);
    for (int i = 0; i < 256; i++)
        for (int k = 1; k < 4; k++) {
            expected[0][i] += expected[k][i];
            found[0][i] += found[k][i];
        }
    check_equal(check, "counts", expected[0], found[0], sizeof found[0]);
    uint32_t counted = 0;
    for (int32_t i = 0; i < count; i++)
        counted += in[i] == 255;
    if (counted != found[0][255]) check_fail(check, "pixels of 255: %u", found[0][255]);
}

void bench_histogram_u8(struct check *check, fv_k_histogram_u8_fn *variant)
{
    (void)check;
    static uint32_t counts[4][256];
    for (int y = 0; y < BENCH_HEIGHT; y++)
        variant(counts, bench_image() + y * BENCH_STRIDE, BENCH_WIDTH);
}

void check_bilateral_row_u8(struct check *check, fv_k_bilateral_row_u8_fn *reference,
                            fv_k_bilateral_row_u8_fn *variant)
{
    static uint16_t weights[3][256];
    const int32_t width = check_between(check, 8, 300);
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < 256; i++)
            weights[k][i] = (uint16_t)check_between(check, 0, FV_BILATERAL_WEIGHT_MAX);
    const uint8_t *rows[5];
    for (int i = 0; i < 5; i++)
        rows[i] = filled(check, width);
    uint8_t *expected = empty(check, width), *found = empty(check, width);
    reference(expected, rows, width, (const uint16_t(*)[256])weights);
    variant(found, rows, width, (const uint16_t(*)[256])weights);
    check_equal(check, "filtered row", expected, found, (size_t)width);
}

void bench_bilateral_row_u8(struct check *check, fv_k_bilateral_row_u8_fn *variant)
{
    (void)check;
    static uint16_t weights[3][256];
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < 256; i++)
            weights[k][i] = (uint16_t)((2000 - 500 * k) * 100 / (100 + i * i));
    for (int y = 2; y < BENCH_HEIGHT - 2; y++) {
        const uint8_t *rows[5];
        bench_rows(rows, y, 2);
        variant(bench_scratch() + y * BENCH_STRIDE, rows, BENCH_WIDTH,
                (const uint16_t(*)[256])weights);
    }
}

void check_contrast_blend_u16(struct check *check, fv_k_contrast_blend_u16_fn *reference,
                              fv_k_contrast_blend_u16_fn *variant)
{
    const uint8_t *a = filled(check, 256), *b = filled(check, 256);
    const int32_t weight = check_between(check, 0, 4096);
    uint16_t *expected = check_buffer(check, 512, 2, 0), *found = check_buffer(check, 512, 2, 0);
    reference(expected, a, b, weight);
    variant(found, a, b, weight);
    check_equal(check, "table", expected, found, 512);
}

void bench_contrast_blend_u16(struct check *check, fv_k_contrast_blend_u16_fn *variant)
{
    strcpy(check->size, "480 x 8 tables");
    uint16_t *out = (uint16_t *)(void *)bench_scratch();
    for (int i = 0; i < 480 * 8; i++)
        variant(out + i % 8 * 256, bench_image() + i % 100 * BENCH_STRIDE,
                bench_image() + i % 100 * BENCH_STRIDE + 300, i);
}

static void contrast_inputs(struct check *check, uint16_t left[256], uint16_t right[256],
                            uint16_t *weights, int32_t count)
{
    for (int i = 0; i < 256; i++) {
        left[i] = (uint16_t)check_between(check, 0, 65280);
        right[i] = (uint16_t)check_between(check, 0, 65280);
    }
    for (int32_t i = 0; i < count; i++)
        weights[i] = (uint16_t)check_between(check, 0, 4096);
}

void check_contrast_row_u8(struct check *check, fv_k_contrast_row_u8_fn *reference,
                           fv_k_contrast_row_u8_fn *variant)
{
    uint16_t left[256], right[256];
    const int32_t count = check_between(check, 0, 300);
    uint16_t *weights = check_buffer(check, 2 * (size_t)count, 2, 0);
    contrast_inputs(check, left, right, weights, count);
    const uint8_t *in = filled(check, count);
    uint8_t *expected = empty(check, count), *found = empty(check, count);
    reference(expected, in, count, left, right, weights);
    memcpy(found, in, (size_t)count);
    if (check_between(check, 0, 1))
        variant(found, found, count, left, right, weights);
    else
        variant(found, in, count, left, right, weights);
    check_equal(check, "row", expected, found, (size_t)count);
}

void bench_contrast_row_u8(struct check *check, fv_k_contrast_row_u8_fn *variant)
{
    static uint16_t left[256], right[256], weights[BENCH_WIDTH];
    if (left[255] == 0) contrast_inputs(check, left, right, weights, BENCH_WIDTH);
    for (int y = 0; y < BENCH_HEIGHT; y++)
        variant(bench_scratch() + y * BENCH_STRIDE, bench_image() + y * BENCH_STRIDE, BENCH_WIDTH,
                left, right, weights);
}

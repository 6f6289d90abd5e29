/* Gaussian scale spaces (contracts/scale.h). */
#include "kernels/check.h"

#include "kernels/kernels.h"

static uint16_t *level_row(struct check *check, int32_t width)
{
    const int32_t count = fv_scale_stride(width);
    uint16_t *row = check_buffer(check, 2 * (size_t)count, 64, 0);
    check_fill(check, row, 2 * (size_t)count);
    for (int32_t i = 0; i < count; i++)
        row[i] = (uint16_t)(row[i] % (FV_SCALE_WHITE + 1));
    return row;
}

static void random_weights(struct check *check, uint16_t *weights, int32_t radius)
{
    int32_t left = 65536;
    for (int32_t i = radius; i > 0; i--) {
        weights[i] = (uint16_t)check_between(check, 0, (left - 1) / (2 * i + 1));
        left -= 2 * weights[i];
    }
    weights[0] = (uint16_t)(left > 65535 ? 65535 : left);
}

void check_scale_blur_row_u16(struct check *check, fv_k_scale_blur_row_u16_fn *reference,
                              fv_k_scale_blur_row_u16_fn *variant)
{
    const int32_t radius = check_between(check, 1, FV_SCALE_RADIUS_MAX);
    const int32_t width = check_between(check, radius + 1, 300);
    const size_t bytes = 2 * (size_t)fv_scale_stride(width);
    uint16_t weights[FV_SCALE_RADIUS_MAX + 1];
    random_weights(check, weights, radius);
    const uint16_t *rows[2 * FV_SCALE_RADIUS_MAX + 1];
    for (int32_t i = 0; i <= 2 * radius; i++)
        rows[i] = i > 0 && check_between(check, 0, 2) == 0 ? rows[i - 1] : level_row(check, width);
    uint16_t *scratch = check_buffer(check, bytes + 4 * FV_SCALE_PAD, 64, 0);
    uint16_t *expected = check_buffer(check, bytes, 64, 0);
    uint16_t *found = check_buffer(check, bytes, 64, 0);
    reference(expected, rows, width, weights, radius, scratch);
    check_fill(check, scratch, bytes + 4 * FV_SCALE_PAD);
    variant(found, rows, width, weights, radius, scratch);
    check_equal(check, "blurred row", expected, found, 2 * (size_t)width);
}

/* The benchmarks' levels, made of the image once. */
enum { LEVEL_STRIDE = (BENCH_WIDTH + FV_SCALE_LANES - 1) / FV_SCALE_LANES * FV_SCALE_LANES };
static uint16_t levels[FV_SCALE_LEVELS][BENCH_HEIGHT][LEVEL_STRIDE] __attribute__((aligned(64)));

static void fill_levels(void)
{
    for (int l = 0; l < FV_SCALE_LEVELS && levels[0][1][1] == 0; l++)
        for (int y = 0; y < BENCH_HEIGHT; y++)
            for (int x = 0; x < BENCH_WIDTH; x++)
                levels[l][y][x] = (uint16_t)(1 + 120 * bench_image()[y * BENCH_STRIDE + x] + 9 * l);
}

void bench_scale_blur_row_u16(struct check *check, fv_k_scale_blur_row_u16_fn *variant)
{
    (void)check;
    enum { RADIUS = 6 };
    static uint16_t scratch[LEVEL_STRIDE + 2 * FV_SCALE_PAD] __attribute__((aligned(64)));
    static uint16_t out[LEVEL_STRIDE] __attribute__((aligned(64)));
    static const uint16_t weights[RADIUS + 1] = {13110, 11542, 7874, 4163, 1706, 541, 387};
    fill_levels();
    for (int y = RADIUS; y < BENCH_HEIGHT - RADIUS; y++) {
        const uint16_t *rows[2 * RADIUS + 1];
        for (int i = 0; i <= 2 * RADIUS; i++)
            rows[i] = levels[0][y + i - RADIUS];
        variant(out, rows, BENCH_WIDTH, weights, RADIUS, scratch);
    }
}

void check_scale_peaks_row_u16(struct check *check, fv_k_scale_peaks_row_u16_fn *reference,
                               fv_k_scale_peaks_row_u16_fn *variant)
{
    const int32_t width = check_between(check, 3, 300);
    const int32_t threshold = check_between(check, 0, 1) * check_between(check, 0, 5000);
    const size_t row = 2 * (size_t)(fv_scale_stride(width) + 2 * FV_SCALE_PAD);
    const uint16_t *rows[3 * FV_SCALE_LEVELS];
    const bool equal = check_between(check, 0, 3) == 0; /* many ties */
    for (int i = 0; i < 3 * FV_SCALE_LEVELS; i++) {
        uint16_t *made = level_row(check, width);
        for (int32_t x = 0; equal && x < fv_scale_stride(width); x++)
            made[x] = (uint16_t)(made[x] % 3 * 100);
        rows[i] = made;
    }
    int16_t *scratch = check_buffer(check, 2 * FV_SCALE_DIFFERENCES * row, 64, 0);
    uint16_t *expected = check_buffer(check, row, 64, 0), *found = check_buffer(check, row, 64, 0);
    reference(expected, rows, width, threshold, scratch);
    check_fill(check, scratch, 2 * FV_SCALE_DIFFERENCES * row);
    variant(found, rows, width, threshold, scratch);
    check_equal(check, "marks", expected, found, 2 * (size_t)width);
}

void bench_scale_peaks_row_u16(struct check *check, fv_k_scale_peaks_row_u16_fn *variant)
{
    (void)check;
    static int16_t scratch[2 * FV_SCALE_DIFFERENCES * (LEVEL_STRIDE + 2 * FV_SCALE_PAD)]
        __attribute__((aligned(64)));
    static uint16_t marks[LEVEL_STRIDE] __attribute__((aligned(64)));
    fill_levels();
    for (int y = 1; y < BENCH_HEIGHT - 1; y++) {
        const uint16_t *rows[3 * FV_SCALE_LEVELS];
        for (int i = 0; i < 3 * FV_SCALE_LEVELS; i++)
            rows[i] = levels[i / 3][y + i % 3 - 1];
        variant(marks, rows, BENCH_WIDTH, 200, scratch);
    }
}

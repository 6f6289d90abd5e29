#include "kernels/check.h"

#include <string.h>

struct rows {
    const uint8_t *of[3];
    int32_t width;
    int16_t *expected, *found;
};

static struct rows random_rows(struct check *check)
{
    struct rows rows = {.width = check_between(check, 2, 300)};
    const size_t width = (size_t)rows.width;
    for (int i = 0; i < 3; i++) {
        uint8_t *row = check_buffer(check, width, 1, 0);
        check_fill(check, row, width);
        rows.of[i] = row;
    }
    rows.expected = check_buffer(check, 2 * width, 2, 0);
    rows.found = check_buffer(check, 2 * width, 2, 0);
    return rows;
}

static void bench_rows(const uint8_t *rows[3], int y)
{
    for (int i = 0; i < 3; i++)
        rows[i] = bench_image() + (y + i - 1) * BENCH_STRIDE;
}

static int16_t *bench_out(int y)
{
    return (int16_t *)(void *)bench_scratch() + y * BENCH_STRIDE;
}

typedef void derivative(int16_t *, const uint8_t *const *, int32_t, int32_t, int32_t, int32_t);

static void check_derivative(struct check *check, derivative *reference, derivative *variant)
{
    const struct rows rows = random_rows(check);
    const int32_t kind = check_between(check, 0, 2), repeat = check_between(check, 0, 1);
    const int32_t side = kind == 0 ? 1 : kind == 1 ? 3 : check_between(check, 0, 10);
    const int32_t centre = kind == 0 ? 2 : kind == 1 ? 10 : check_between(check, 0, 10);
    reference(rows.expected, rows.of, rows.width, side, centre, repeat);
    variant(rows.found, rows.of, rows.width, side, centre, repeat);
    check_equal(check, "derivatives", rows.expected, rows.found, 2 * (size_t)rows.width);
}

static void bench_derivative(derivative *variant)
{
    for (int y = 1; y < BENCH_HEIGHT - 1; y++) {
        const uint8_t *rows[3];
        bench_rows(rows, y);
        variant(bench_out(y), rows, BENCH_WIDTH, 1, 2, 0);
    }
}

void check_derivative_x_row_s16(struct check *check, fv_k_derivative_x_row_s16_fn *reference,
                                fv_k_derivative_x_row_s16_fn *variant)
{
    check_derivative(check, reference, variant);
}

void bench_derivative_x_row_s16(struct check *check, fv_k_derivative_x_row_s16_fn *variant)
{
    (void)check;
    bench_derivative(variant);
}

void check_derivative_y_row_s16(struct check *check, fv_k_derivative_y_row_s16_fn *reference,
                                fv_k_derivative_y_row_s16_fn *variant)
{
    check_derivative(check, reference, variant);
}

void bench_derivative_y_row_s16(struct check *check, fv_k_derivative_y_row_s16_fn *variant)
{
    (void)check;
    bench_derivative(variant);
}

void check_laplacian_row_s16(struct check *check, fv_k_laplacian_row_s16_fn *reference,
                             fv_k_laplacian_row_s16_fn *variant)
{
    const struct rows rows = random_rows(check);
    const int32_t corners = check_between(check, 0, 1);
    reference(rows.expected, rows.of, rows.width, corners);
    variant(rows.found, rows.of, rows.width, corners);
    check_equal(check, "Laplacian", rows.expected, rows.found, 2 * (size_t)rows.width);
}

void bench_laplacian_row_s16(struct check *check, fv_k_laplacian_row_s16_fn *variant)
{
    (void)check;
    for (int y = 1; y < BENCH_HEIGHT - 1; y++) {
        const uint8_t *rows[3];
        bench_rows(rows, y);
        variant(bench_out(y), rows, BENCH_WIDTH, 0);
    }
}

static int16_t *random_derivatives(struct check *check, int32_t width, int32_t most)
{
    int16_t *row = check_buffer(check, 2 * (size_t)width, 2, 0);
    const int32_t reach = check_between(check, 0, 1) ? most : 3;
    for (int32_t x = 0; x < width; x++)
        row[x] = (int16_t)check_between(check, -reach, reach);
    return row;
}

void check_magnitude_row_s32(struct check *check, fv_k_magnitude_row_s32_fn *reference,
                             fv_k_magnitude_row_s32_fn *variant)
{
    const int32_t width = check_between(check, 2, 300), squared = check_between(check, 0, 1);
    const int16_t *dx = random_derivatives(check, width, 8160),
                  *dy = random_derivatives(check, width, 8160);
    int32_t *expected = check_buffer(check, 4 * (size_t)width, 4, 0),
            *found = check_buffer(check, 4 * (size_t)width, 4, 0);
    reference(expected, dx, dy, width, squared);
    variant(found, dx, dy, width, squared);
    check_equal(check, "magnitudes", expected, found, 4 * (size_t)width);
}

void bench_magnitude_row_s32(struct check *check, fv_k_magnitude_row_s32_fn *variant)
{
    static int16_t dx[BENCH_WIDTH], dy[BENCH_WIDTH];
    for (int i = 0; i < BENCH_WIDTH; i++) {
        dx[i] = (int16_t)check_between(check, -1020, 1020);
        dy[i] = (int16_t)check_between(check, -1020, 1020);
    }
    for (int y = 0; y < BENCH_HEIGHT; y++)
        variant((int32_t *)(void *)bench_scratch() + y * BENCH_STRIDE, dx, dy, BENCH_WIDTH, 0);
}

void check_thin_row_s32(struct check *check, fv_k_thin_row_s32_fn *reference,
                        fv_k_thin_row_s32_fn *variant)
{
    const int32_t width = check_between(check, 2, 300), words = (width + 63) / 64;
    const int16_t *dx = random_derivatives(check, width, 1020),
                  *dy = random_derivatives(check, width, 1020);
    const int32_t *magnitude[3], reach = check_between(check, 0, 1) ? 2081000 : 6;
    for (int i = 0; i < 3; i++) {
        int32_t *row = check_buffer(check, 4 * (size_t)(width + 2), 4, 0);
        for (int32_t x = 0; x < width + 2; x++)
            row[x] = check_between(check, 0, reach);
        magnitude[i] = row + 1;
    }
    const int32_t low = check_between(check, 0, reach / 2), high = check_between(check, low, reach);
    uint64_t *expected = check_buffer(check, 16 * (size_t)words, 8, 0),
             *found = check_buffer(check, 16 * (size_t)words, 8, 0);
    reference(expected, expected + words, magnitude, dx, dy, width, low, high);
    variant(found, found + words, magnitude, dx, dy, width, low, high);
    check_equal(check, "bits", expected, found, 16 * (size_t)words);
}

void bench_thin_row_s32(struct check *check, fv_k_thin_row_s32_fn *variant)
{
    static int16_t dx[BENCH_WIDTH], dy[BENCH_WIDTH];
    static int32_t magnitude[3][BENCH_WIDTH + 2];
    if (dx[0] == 0)
        for (int i = 0; i < BENCH_WIDTH; i++) {
            dx[i] = (int16_t)check_between(check, 1, 1020);
            dy[i] = (int16_t)check_between(check, -1020, 1020);
            for (int k = 0; k < 3; k++)
                magnitude[k][i + 1] = check_between(check, 0, 400);
        }
    const int32_t *const rows[3] = {magnitude[0] + 1, magnitude[1] + 1, magnitude[2] + 1};
    uint64_t *bits = (uint64_t *)(void *)bench_scratch();
    for (int y = 0; y < BENCH_HEIGHT; y++)
        variant(bits + 32 * y, bits + 32 * y + 16, rows, dx, dy, BENCH_WIDTH, 50, 150);
}

/* Corners by derivatives (contracts/response.h). */
#include "kernels/check.h"

#include <string.h>

#include "kernels/kernels.h"

enum { DERIVATIVE_MAX = 1020, ROW_MAX = 300 };

static const int16_t *derivatives(struct check *check, int32_t width)
{
    int16_t *row = check_buffer(check, 2 * (size_t)width, 2, 0);
    check_fill(check, row, 2 * (size_t)width);
    for (int32_t x = 0; x < width; x++)
        row[x] = (int16_t)(row[x] % (DERIVATIVE_MAX + 1));
    return row;
}

void check_response_row_f32(struct check *check, fv_k_response_row_f32_fn *reference,
                            fv_k_response_row_f32_fn *variant)
{
    const int32_t width = check_between(check, 3, ROW_MAX);
    const float k = check_between(check, 0, 1) ? -1 : .04f;
    const int32_t most = check_between(check, 0, 1) * check_between(check, 0, 1 << 30);
    const int16_t *dx[3], *dy[3];
    for (int i = 0; i < 3; i++) {
        dx[i] = derivatives(check, width);
        dy[i] = derivatives(check, width);
    }
    const size_t bytes = 4 * (size_t)width;
    int32_t *sums = check_buffer(check, 3 * bytes, 4, 0);
    int32_t *expected = check_buffer(check, bytes, 4, 0), *found = check_buffer(check, bytes, 4, 0);
    const int32_t most_expected = reference(expected, dx, dy, width, k, sums, most);
    check_fill(check, sums, 3 * bytes);
    const int32_t most_found = variant(found, dx, dy, width, k, sums, most);
    check_equal(check, "responses", expected, found, bytes);
    check_equal(check, "largest", &most_expected, &most_found, sizeof most_found);
}

void bench_response_row_f32(struct check *check, fv_k_response_row_f32_fn *variant)
{
    (void)check;
    static int16_t d[BENCH_HEIGHT][BENCH_WIDTH];
    static int32_t out[BENCH_WIDTH], sums[3 * BENCH_WIDTH];
    if (d[1][1] == 0)
        for (int y = 0; y < BENCH_HEIGHT; y++)
            for (int x = 0; x < BENCH_WIDTH; x++)
                d[y][x] = (int16_t)(1 + 3 * bench_image()[y * BENCH_STRIDE + x]);
    for (int y = 2; y < BENCH_HEIGHT - 2; y++) {
        const int16_t *dx[3] = {d[y - 1], d[y], d[y + 1]}, *dy[3] = {d[y - 2], d[y], d[y + 2]};
        variant(out, dx, dy, BENCH_WIDTH, -1, sums, 0);
    }
}

void check_response_peaks_row_s32(struct check *check, fv_k_response_peaks_row_s32_fn *reference,
                                  fv_k_response_peaks_row_s32_fn *variant)
{
    const int32_t width = check_between(check, 3, ROW_MAX);
    const int32_t threshold = check_between(check, 0, 1) * check_between(check, 0, 1 << 30);
    const size_t bytes = 4 * (size_t)width;
    const bool equal = check_between(check, 0, 2) == 0; /* many ties */
    const int32_t *rows[3];
    for (int i = 0; i < 3; i++) {
        int32_t *row = check_buffer(check, bytes, 4, 0);
        check_fill(check, row, bytes);
        for (int32_t x = 0; equal && x < width; x++)
            row[x] &= 3;
        rows[i] = row;
    }
    int32_t *most = check_buffer(check, bytes, 4, 0);
    int32_t *expected = check_buffer(check, bytes, 4, 0), *found = check_buffer(check, bytes, 4, 0);
    reference(expected, rows, width, threshold, most);
    check_fill(check, most, bytes);
    variant(found, rows, width, threshold, most);
    check_equal(check, "marks", expected, found, bytes);
}

void bench_response_peaks_row_s32(struct check *check, fv_k_response_peaks_row_s32_fn *variant)
{
    (void)check;
    static int32_t rows[BENCH_HEIGHT][BENCH_WIDTH], marks[BENCH_WIDTH], most[BENCH_WIDTH];
    if (rows[1][1] == 0)
        for (int y = 0; y < BENCH_HEIGHT; y++)
            for (int x = 0; x < BENCH_WIDTH; x++)
                rows[y][x] = 1 + bench_image()[y * BENCH_STRIDE + x];
    for (int y = 1; y < BENCH_HEIGHT - 1; y++) {
        const int32_t *three[3] = {rows[y - 1], rows[y], rows[y + 1]};
        variant(marks, three, BENCH_WIDTH, 100, most);
    }
}

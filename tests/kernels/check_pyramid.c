#include "kernels/check.h"

enum { SLACK = 64 };

void check_blend_rows_u8(struct check *check, fv_k_blend_rows_u8_fn *reference,
                         fv_k_blend_rows_u8_fn *variant)
{
    const int32_t count = check_between(check, 1, 700), weight = check_between(check, 1, 127);
    const size_t bytes = (size_t)count;
    uint8_t *a = check_buffer(check, bytes, 1, SLACK), *b = check_buffer(check, bytes, 1, SLACK);
    uint8_t *expected = check_buffer(check, bytes, 1, SLACK),
            *found = check_buffer(check, bytes, 1, SLACK);
    check_fill(check, a, bytes);
    check_fill(check, b, bytes);
    reference(expected, a, b, count, weight);
    variant(found, a, b, count, weight);
    check_equal(check, "row", expected, found, bytes);
}

void bench_blend_rows_u8(struct check *check, fv_k_blend_rows_u8_fn *variant)
{
    (void)check;
    for (int y = 0; y < BENCH_HEIGHT; y++) {
        const uint8_t *row = bench_image() + y * BENCH_STRIDE;
        variant(bench_scratch() + y * BENCH_STRIDE, row, row + BENCH_STRIDE, BENCH_WIDTH, 38);
    }
}

void check_shrink_row_u8(struct check *check, fv_k_shrink_row_u8_fn *reference,
                         fv_k_shrink_row_u8_fn *variant)
{
    const int32_t count = check_between(check, 1, 700);
    const size_t bytes = (size_t)count, bytes_in = (size_t)(count - 1 + (count - 1) / 5 + 2);
    uint8_t *in = check_buffer(check, bytes_in, 1, SLACK);
    uint8_t *expected = check_buffer(check, bytes, 1, SLACK),
            *found = check_buffer(check, bytes, 1, SLACK);
    check_fill(check, in, bytes_in);
    reference(expected, in, count);
    variant(found, in, count);
    check_equal(check, "row", expected, found, bytes);
}

void bench_shrink_row_u8(struct check *check, fv_k_shrink_row_u8_fn *variant)
{
    (void)check;
    for (int y = 0; y < BENCH_HEIGHT; y++)
        variant(bench_scratch() + y * BENCH_STRIDE, bench_image() + y * BENCH_STRIDE,
                BENCH_WIDTH * 5 / 6);
}

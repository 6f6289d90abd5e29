/* Determinants of SURF (contracts/surf.h). */
#include "kernels/check.h"

#include "kernels/kernels.h"

void check_surf_row_f32(struct check *check, fv_k_surf_row_f32_fn *reference,
                        fv_k_surf_row_f32_fn *variant)
{
    const int32_t side = 3 * (2 * check_between(check, 0, (FV_SURF_SIDE_MAX / 3 - 1) / 2) + 1);
    const int32_t step = 1 << check_between(check, 0, 3), count = check_between(check, 1, 100);
    const int32_t half = side / 2, width = (count - 1) * step + 2 * half + 2;
    const uint32_t *rows[FV_SURF_BOX_ROWS];
    for (int k = 0; k < FV_SURF_BOX_ROWS; k++) {
        uint32_t *row = check_buffer(check, 4 * (size_t)width, 4, 0);
        check_fill(check, row, 4 * (size_t)width);
        rows[k] = row + half;
    }
    const size_t bytes = 4 * (size_t)count;
    uint32_t *sums = check_buffer(check, 12 * (size_t)width, 4, 0);
    float *expected = check_buffer(check, bytes, 4, 0), *found = check_buffer(check, bytes, 4, 0);
    reference(expected, rows, side, step, count, sums);
    check_fill(check, sums, 12 * (size_t)width);
    variant(found, rows, side, step, count, sums);
    check_equal(check, "determinants", expected, found, bytes);
}

/* A filter of side 15 on every second pixel of every second row. */
void bench_surf_row_f32(struct check *check, fv_k_surf_row_f32_fn *variant)
{
    (void)check;
    enum { SIDE = 15, STEP = 2, COUNT = (BENCH_WIDTH - SIDE - 1) / STEP };
    static uint32_t integral[BENCH_HEIGHT + 1][BENCH_WIDTH + 1], sums[3 * BENCH_WIDTH];
    static float out[COUNT];
    static const int8_t at[FV_SURF_BOX_ROWS] = {-4, 5, -7, 8, -2, 3, -5, 0, 1, 6};
    if (integral[BENCH_HEIGHT][BENCH_WIDTH] == 0)
        for (int y = 0; y < BENCH_HEIGHT; y++)
            for (int x = 0; x < BENCH_WIDTH; x++)
                integral[y + 1][x + 1] = integral[y][x + 1] + integral[y + 1][x] - integral[y][x] +
                                         128u * bench_image()[y * BENCH_STRIDE + x];
    for (int y = SIDE / 2; y + SIDE / 2 < BENCH_HEIGHT; y += STEP) {
        const uint32_t *rows[FV_SURF_BOX_ROWS];
        for (int k = 0; k < FV_SURF_BOX_ROWS; k++)
            rows[k] = integral[y + at[k]] + SIDE / 2;
        variant(out, rows, SIDE, STEP, COUNT, sums);
    }
}

#include "kernels/check_nn_sums.h"

#include <math.h>
#include <stdlib.h>

#include "kernels/nn_requantize.h"
#include "nn/real.h"

enum { SLACK = 64 };

/* The least sum that the exact way rounds to `to`, of a channel by itself. */
static int32_t rise_of(int32_t to, int32_t multiplier, int32_t shift)
{
    int32_t sum = (int32_t)((to - 0.5) * (double)(INT64_C(1) << (31 - shift)) / multiplier) - 3;
    while (fv_nn_requantize(sum, multiplier, shift) < to)
        sum++;
    return sum;
}

/* Near such a rise: where sums are larger than float32 holds and the rise is one that it holds, or
 * where the real number below the rise comes nearest to it. */
static int32_t hardest_rise(int32_t multiplier, int32_t shift, bool large)
{
    const float factor = (float)((double)multiplier / (double)(INT64_C(1) << (31 - shift)));
    double nearest = 1;
    int32_t best = 0;
    for (int32_t to = -127; to <= 127; to++) {
        const int32_t rise = rise_of(to, multiplier, shift);
        const double real = (rise - 1) * (double)factor + 0.5, left = ceil(real) - real;
        if (large && abs(rise) > 1 << 25 && rise % 16 == 0) return rise;
        if (large || left >= nearest) continue;
        nearest = left;
        best = rise;
    }
    return best;
}

void check_hard_sums(struct check *check, fv_k_nn_gemm_u8_fn *reference,
                     fv_k_nn_gemm_u8_fn *variant)
{
    enum { ROWS = 256, CHANNELS = 32 };
    const bool large = check_between(check, 0, 1);
    int8_t *weights = check_buffer(check, CHANNELS * 4, 64, SLACK);
    int32_t *numbers[3];
    for (int i = 0; i < 3; i++)
        numbers[i] = check_buffer(check, CHANNELS * 4, 64, SLACK);
    for (int32_t c = 0; c < CHANNELS; c++) {
        weights[4 * c] = 1;
        numbers[1][c] = (int32_t)(0x40000000u + check_random(check) % 0x40000000u);
        numbers[2][c] = large ? -check_between(check, 19, 21) : -check_between(check, 7, 9);
        numbers[0][c] = hardest_rise(numbers[1][c], numbers[2][c], large) - 100;
    }
    struct fv_nn_gemm g = {.k = 1,
                           .k4 = 1,
                           .n = CHANNELS,
                           .weights = weights,
                           .bias = numbers[0],
                           .multiplier = numbers[1],
                           .shift = numbers[2],
                           .zero_out = 128,
                           .act_max = 255};
    float *real = check_buffer(check, (size_t)CHANNELS * 3 * sizeof *real, 64, 0);
    fv_nn_real_gemm(&g, real);
    g.real = real;
    uint8_t *a = check_buffer(check, ROWS, 1, SLACK);
    for (int32_t i = 0; i < ROWS; i++)
        a[i] = (uint8_t)i;
    uint8_t *expected = check_buffer(check, ROWS * CHANNELS, 1, 0),
            *found = check_buffer(check, ROWS * CHANNELS, 1, 0);
    reference(&g, a, 1, expected, CHANNELS, ROWS);
    variant(&g, a, 1, found, CHANNELS, ROWS);
    check_equal(check, "hard sums", expected, found, ROWS * CHANNELS);
}

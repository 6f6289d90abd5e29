#include "kernels/check_nn_sums.h"

#include <math.h>
#include <stdlib.h>

#include "kernels/nn_requantize.h"
#include "nn/real.h"

enum { SLACK = 64, ROWS = 256 };

void check_draw_real(struct check *check, struct fv_nn_gemm *g)
{
    const size_t n16 = (size_t)(g->n + 15) / 16 * 16;
    float *real = check_buffer(check, n16 * 2 * sizeof *real, 64, 0);
    if (check_between(check, 0, 1) == 0) return;
    fv_nn_real_gemm(g, real);
    g->real = real;
}

/* Channels whose sums are their bias and one input; `numbers`: bias, multiplier and shift of each.
 */
static struct fv_nn_gemm sums_from(struct check *check, int32_t channels, int32_t *numbers[3])
{
    int8_t *weights = check_buffer(check, (size_t)channels * 4, 64, SLACK);
    for (int i = 0; i < 3; i++)
        numbers[i] = check_buffer(check, (size_t)channels * 4, 64, SLACK);
    for (int32_t c = 0; c < channels; c++)
        weights[4 * c] = 1;
    return (struct fv_nn_gemm){.k = 1,
                               .k4 = 1,
                               .n = channels,
                               .weights = weights,
                               .bias = numbers[0],
                               .multiplier = numbers[1],
                               .shift = numbers[2]};
}

/* With inputs 0 to 255. */
static void compare_sums(struct check *check, const char *what, const struct fv_nn_gemm *g,
                         fv_k_nn_gemm_u8_fn *reference, fv_k_nn_gemm_u8_fn *variant)
{
    const size_t bytes = (size_t)ROWS * (size_t)g->n;
    uint8_t *a = check_buffer(check, ROWS, 1, SLACK), *expected = check_buffer(check, bytes, 1, 0),
            *found = check_buffer(check, bytes, 1, 0);
    for (int32_t i = 0; i < ROWS; i++)
        a[i] = (uint8_t)i;
    reference(g, a, 1, expected, g->n, ROWS);
    variant(g, a, 1, found, g->n, ROWS);
    check_equal(check, what, expected, found, bytes);
}

static int32_t draw_multiplier(struct check *check)
{
    return (int32_t)(0x40000000u + check_random(check) % 0x40000000u);
}

void check_all_sums(struct check *check, fv_k_nn_gemm_u8_fn *reference, fv_k_nn_gemm_u8_fn *variant)
{
    enum { CHANNELS = 272 };
    const int32_t multiplier = check_between(check, 0, 7) ? draw_multiplier(check) : 0x40000000;
    const int32_t shift = check_between(check, 0, 1) ? -9 : check_between(check, -14, 0);
    const double scale = (double)multiplier / (double)(INT64_C(1) << (31 - shift));
    const int32_t first = (int32_t)(check_between(check, -255, 255) / scale) - ROWS * CHANNELS / 2;
    int32_t *numbers[3];
    struct fv_nn_gemm g = sums_from(check, CHANNELS, numbers);
    for (int32_t c = 0; c < CHANNELS; c++) {
        numbers[0][c] = first + ROWS * c;
        numbers[1][c] = multiplier;
        numbers[2][c] = shift;
    }
    check_draw_range(check, &g.zero_out, &g.act_min, &g.act_max);
    check_draw_real(check, &g);
    compare_sums(check, "all sums", &g, reference, variant);
}

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
    enum { CHANNELS = 32 };
    const bool large = check_between(check, 0, 1);
    int32_t *numbers[3];
    struct fv_nn_gemm g = sums_from(check, CHANNELS, numbers);
    for (int32_t c = 0; c < CHANNELS; c++) {
        numbers[1][c] = draw_multiplier(check);
        numbers[2][c] = large ? -check_between(check, 19, 21) : -check_between(check, 7, 9);
        numbers[0][c] = hardest_rise(numbers[1][c], numbers[2][c], large) - 100;
    }
    g.zero_out = 128;
    g.act_max = 255;
    float *real = check_buffer(check, (size_t)CHANNELS * 2 * sizeof *real, 64, 0);
    fv_nn_real_gemm(&g, real);
    g.real = real;
    compare_sums(check, "hard sums", &g, reference, variant);
}

#include "kernels/check.h"

#include <stdio.h>
#include <string.h>

/* Slopes as of real networks, none, steep ones, and some that end halfway between two numbers. */
static float draw_slope(struct check *check)
{
    const int32_t kind = check_between(check, 0, 9);
    if (kind == 0) return 0.0f;
    if (kind == 1) return (float)check_between(check, -16384, 16384);
    if (kind == 2) return (float)check_between(check, -8, 8) / 2.0f;
    return (float)check_between(check, -2000000, 2000000) / 1000000.0f;
}

void check_nn_slopes_u8(struct check *check, fv_k_nn_slopes_u8_fn *reference,
                        fv_k_nn_slopes_u8_fn *variant)
{
    const int32_t rows = check_between(check, 1, check_between(check, 0, 1) ? 5 : 20),
                  count = check_between(check, 0, 1) ? check_between(check, 1, 70)
                                                     : 16 * check_between(check, 1, 9);
    const int32_t gap = check_between(check, 0, 1) ? 9 : 0; /* often rows follow each other */
    const ptrdiff_t ldo = count + check_between(check, 0, gap),
                    ldi = count + check_between(check, 0, gap);
    const size_t bytes = (size_t)((rows - 1) * ldo + count),
                 read = (size_t)((rows - 1) * ldi + count);
    float *slopes = check_buffer(check, ((size_t)count + 1) * sizeof *slopes, 64, 0);
    uint8_t *expected = check_buffer(check, bytes, 1, 0), *found = check_buffer(check, bytes, 1, 0),
            *in = check_buffer(check, read, 1, 0);
    const struct fv_nn_slopes p = {.zero_in = check_between(check, 0, 255),
                                   .zero_out = check_between(check, 0, 255),
                                   .slopes = slopes};
    for (int32_t i = 0; i <= count; i++)
        slopes[i] = draw_slope(check);
    check_fill(check, in, read);
    check_fill(check, found, bytes);
    memcpy(expected, found, bytes);
    reference(&p, in, ldi, expected, ldo, rows, count);
    variant(&p, in, ldi, found, ldo, rows, count);
    check_equal(check, "out", expected, found, bytes);
    reference(&p, expected, ldo, expected, ldo, rows, count);
    variant(&p, found, ldo, found, ldo, rows, count);
    check_equal(check, "in place", expected, found, bytes);
}

void bench_nn_slopes_u8(struct check *check, fv_k_nn_slopes_u8_fn *variant)
{
    enum { PIXELS = 1024, CHANNELS = 64 };
    float *slopes = check->kept;
    if (slopes == NULL) { /* a buffer, and the time to fill it, for all calls */
        check->kept = slopes = check_buffer(check, (CHANNELS + 1) * sizeof *slopes, 64, 0);
        for (int32_t i = 0; i <= CHANNELS; i++)
            slopes[i] = draw_slope(check);
    }
    const struct fv_nn_slopes p = {.zero_in = 120, .zero_out = 100, .slopes = slopes};
    snprintf(check->size, sizeof check->size, "65536");
    variant(&p, bench_scratch(), CHANNELS, bench_scratch() + (1 << 20), CHANNELS, PIXELS, CHANNELS);
}

#include "kernels/check.h"

#include <string.h>

void check_corner_scores_u8(struct check *check, fv_k_corner_scores_u8_fn *reference,
                            fv_k_corner_scores_u8_fn *variant)
{
    enum { COUNT = 5, MARGIN = 8 };
    const int32_t width = check_between(check, 2 * MARGIN + 1, 60),
                  height = check_between(check, 11, 40);
    const int32_t stride = width + check_between(check, 0, 30),
                  count = check_between(check, 0, COUNT);
    const size_t bytes = (size_t)(stride * (height - 1) + width),
                 score_bytes = FV_CORNER_SCORES * (size_t)count;
    uint8_t *image = check_buffer(check, bytes, 1, 0);
    check_fill(check, image, bytes);
    int32_t centres[COUNT];
    for (int i = 0; i < COUNT; i++)
        centres[i] =
            check_between(check, 5, height - 6) * stride + check_between(check, 5, width - 9);
    uint8_t *expected = check_buffer(check, score_bytes, 1, 0),
            *found = check_buffer(check, score_bytes, 1, 0);
    reference(expected, image, stride, centres, count);
    variant(found, image, stride, centres, count);
    check_equal(check, "scores", expected, found, score_bytes);
}

void bench_corner_scores_u8(struct check *check, fv_k_corner_scores_u8_fn *variant)
{
    enum { FEATURES = 1000 };
    int32_t centres[FEATURES];
    strcpy(check->size, "1000 corners");
    for (int i = 0; i < FEATURES; i++)
        centres[i] =
            (8 + i * 7919 % (BENCH_HEIGHT - 16)) * BENCH_STRIDE + 8 + i * 6151 % (BENCH_WIDTH - 24);
    variant(bench_scratch(), bench_image(), BENCH_STRIDE, centres, FEATURES);
}

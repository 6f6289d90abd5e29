/* Sub-pixel places: exact on quadratics, and on corners drawn at known fractions of a pixel. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <math.h>
#include <string.h>

#include <cmocka.h>

#include "features/refine.h"

/* A paraboloid sampled to whole numbers comes back to the error of the rounding. */
static void peak_of_a_quadratic(void **state)
{
    (void)state;
    for (int i = 0; i < 400; i++) {
        const double x = 0.6 * sin(i), y = 0.6 * cos(1.7 * i), tilt = 2 * sin(0.3 * i);
        uint8_t scores[FV_CORNER_SCORES];
        memset(scores, 99, sizeof scores);
        for (int v = -2; v <= 2; v++)
            for (int u = -2; u <= 2; u++)
                scores[8 * (v + 2) + u + 2] = (uint8_t)lround(
                    230 - 8 * (u - x) * (u - x) - 6 * (v - y) * (v - y) + tilt * (u - x) * (v - y));
        float offset[2];
        fv_refine_peak(scores, offset);
        assert_true(fabs((double)offset[0] - x) < 0.04);
        assert_true(fabs((double)offset[1] - y) < 0.04);
    }
}

static void no_peak_no_offset(void **state)
{
    (void)state;
    uint8_t scores[FV_CORNER_SCORES];
    float offset[2] = {1, 1};
    memset(scores, 50, sizeof scores); /* flat */
    fv_refine_peak(scores, offset);
    assert_true(offset[0] == 0 && offset[1] == 0);
    for (int i = 0; i < FV_CORNER_SCORES; i++) /* a valley */
        scores[i] = (uint8_t)(10 * (i % 8 - 2) * (i % 8 - 2) + 10 * (i / 8 - 2) * (i / 8 - 2));
    fv_refine_peak(scores, offset);
    assert_true(offset[0] == 0 && offset[1] == 0);
    for (int i = 0; i < FV_CORNER_SCORES;
         i++) /* a ramp that bends a little: the peak is far away */
        scores[i] = (uint8_t)(100 + 30 * (i % 8 % 5) - (i % 8 - 2) * (i % 8 - 2) -
                              4 * (i / 8 - 2) * (i / 8 - 2));
    fv_refine_peak(scores, offset);
    assert_true(offset[0] <= 0.75f && offset[0] >= -0.75f && offset[1] <= 0.75f &&
                offset[1] >= -0.75f);
}

/* Bright discs with soft edges at known places: the strongest pixel is off by up to half a pixel,
 * the peak by little. */
static void disc_is_found_between_pixels(void **state)
{
    (void)state;
    enum { SIZE = 40 };
    double before = 0, after = 0;
    int cases = 0;
    for (int set = 0; set < FV_CPU_SET_COUNT; set++) {
        struct fv_kernels kernels;
        fv_kernels_init(&kernels, (enum fv_cpu_set)set);
        for (int i = 0; i < 60; i++) {
            static uint8_t image[SIZE * SIZE];
            const double fx = 0.5 * sin(2.3 * i), fy = 0.5 * cos(3.1 * i);
            for (int p = 0; p < SIZE * SIZE; p++) {
                const double x = p % SIZE - 20 - fx, y = p / SIZE - 20 - fy;
                image[p] = (uint8_t)lround(40 + 180 * exp(-(x * x + y * y) / 8));
            }
            struct fv_pyramid pyramid = {.levels = 1};
            pyramid.level[0] = (struct fv_plane){image, SIZE, SIZE, SIZE};
            const struct fv_corner corner = {20, 20, 0, 30};
            struct fovea_feature feature = {0};
            fv_refine_corners(&kernels, &pyramid, &corner, 1, &feature);
            before += hypot(fx, fy);
            after += hypot((double)feature.x_px - 20 - fx, (double)feature.y_px - 20 - fy);
            cases++;
        }
    }
    assert_true(after < 0.25 * before);
    assert_true(after / cases < 0.1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(peak_of_a_quadratic),
        cmocka_unit_test(no_peak_no_offset),
        cmocka_unit_test(disc_is_found_between_pixels),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

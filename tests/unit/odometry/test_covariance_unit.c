/* The variance of a unit of length about that of the map: the mean of its keyframes'. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>

#include "base/elementary.h"
#include "odometry/covariance_unit.h"

enum { COUNT = 40, DRAWS = 20000 };

static double about(const float *variances, uint32_t count, double variance)
{
    return fv_covariance_unit_about(variances, count,
                                    fv_covariance_half_difference(variances, count), variance);
}

/* One passage: who is on the side of most of the map is off it by little. */
static void test_one_passage(void **state)
{
    float variances[COUNT];
    (void)state;
    for (int before = 1; before < COUNT; before++) {
        const double share = (double)before / COUNT;
        for (int k = 0; k < COUNT; k++)
            variances[k] = k < before ? 0 : 0.01F;
        assert_true(fabs(about(variances, COUNT, 0.01F) - 0.01 * share * share) < 1e-8);
        assert_true(fabs(about(variances, COUNT, 0) - 0.01 * (1 - share) * (1 - share)) < 1e-8);
    }
}

/* No passage, no keyframe, and a frame whose landmarks lie on both sides: never below zero. */
static void test_ends(void **state)
{
    float variances[COUNT] = {0};
    (void)state;
    assert_true(about(variances, 0, 0.3) == 0);
    assert_true(about(variances, COUNT, 0) == 0);
    variances[0] = 0.04F;
    for (int tenths = 0; tenths <= 10; tenths++) {
        const double found = about(variances, COUNT, 0.004 * tenths);
        assert_true(found >= 0 && found <= 0.0400001);
    }
}

/* Units that walk from keyframe to keyframe, drawn: the mean square of how far each is off the mean
 * of all. */
static void test_is_that_of_a_walk(void **state)
{
    struct fv_random draws;
    float variances[COUNT];
    double step[COUNT], square[COUNT] = {0};
    (void)state;
    fv_random_seed(&draws, 1);
    for (int k = 0; k < COUNT; k++) {
        step[k] = k % 7 == 3 ? 0.05 * (k % 3 + 1) : 0;
        variances[k] = (float)(step[k] * step[k]) + (k > 0 ? variances[k - 1] : 0);
    }
    for (int n = 0; n < DRAWS; n++) {
        double unit[COUNT], mean = 0;
        for (int k = 0; k < COUNT; k++) {
            const double drawn = fv_random_below(&draws, 2) != 0 ? 1 : -1;
            unit[k] = (k > 0 ? unit[k - 1] : 0) + drawn * step[k];
            mean += unit[k] / COUNT;
        }
        for (int k = 0; k < COUNT; k++)
            square[k] += (unit[k] - mean) * (unit[k] - mean) / DRAWS;
    }
    for (int k = 0; k < COUNT; k++)
        assert_true(fabs(about(variances, COUNT, variances[k]) / square[k] - 1) < 0.05);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_one_passage),
                                       cmocka_unit_test(test_ends),
                                       cmocka_unit_test(test_is_that_of_a_walk)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}

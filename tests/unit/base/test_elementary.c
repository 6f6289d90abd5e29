/* Elementary functions and random numbers: against libm in long double over the stated domains;
 * golden bits that must be the same with every compiler and on every architecture. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <string.h>

#include "base/elementary.h"

enum { SAMPLES = 200000 };
static const uint64_t GOLDEN = 0x5a4b05aa894a1421;
static const double tolerance = 4e-16;

/* Magnitudes from `low` to `high`, evenly in the logarithm, both signs. */
static double wide(struct fv_random *random, double low, double high)
{
    double v = exp(log(low) + (log(high) - log(low)) * fv_random_unit(random));
    return fv_random_u32(random) & 1 ? v : -v;
}

static void within(const char *name, double argument, double got, long double want,
                   long double scale)
{
    long double error = fabsl(got - want) / scale;
    if (!(error <= tolerance))
        fail_msg("%s(%a) = %a, error %Lg of %Lg", name, argument, got, error, scale);
}

static long double larger(long double a, long double b)
{
    return a > b ? a : b;
}

static void circle_functions_match_long_double(void **state)
{
    (void)state;
    struct fv_random random;
    fv_random_seed(&random, 1);
    for (int i = 0; i < SAMPLES; i++) {
        double x = i & 1 ? wide(&random, 1e-300, 1e6) : wide(&random, 1e-3, 1e6);
        /* A multiple of pi/2 and its neighbours are the hard cases. */
        if (i % 7 == 0)
            x = (double)fv_random_below(&random, 600000) * 1.5707963267948966 + 1e-9 * (i % 3);
        long double s = sinl(x), c = cosl(x);
        within("sin", x, fv_sin(x), s, larger(fabsl(s), 1e-3L));
        within("cos", x, fv_cos(x), c, larger(fabsl(c), 1e-3L));
        if (fabsl(s) > 1e-3L && fabsl(c) > 1e-3L)
            within("tan", x, fv_tan(x), tanl(x), fabsl(tanl(x)));
    }
    double small = 1e-200;
    assert_true(fv_sin(small) == small);
    assert_true(fv_sin(1.1e6) == 0 && fv_cos(-1.1e6) == 1 && fv_sin(NAN) == 0 && fv_cos(NAN) == 1);
}

static void inverse_circle_functions_match_long_double(void **state)
{
    (void)state;
    struct fv_random random;
    fv_random_seed(&random, 2);
    for (int i = 0; i < SAMPLES; i++) {
        double x = wide(&random, i & 1 ? 1e-300 : 0.01, i & 1 ? 1e300 : 100);
        double y = wide(&random, i & 1 ? 1e-300 : 0.01, i & 1 ? 1e300 : 100);
        long double want = atan2l(y, x);
        if (fabsl(want) > 1e-290L) within("atan2", y / x, fv_atan2(y, x), want, fabsl(want));
    }
    assert_true(fv_atan2(0, 0) == 0 && fv_atan2(0, -1) == FV_PI && fv_atan2(1, 0) == FV_PI / 2);
    assert_true(fv_atan2(-1, 0) == -FV_PI / 2 && fv_atan2(5e-324, 5e-324) == FV_PI / 4);
}

static void exponentials_match_long_double(void **state)
{
    (void)state;
    struct fv_random random;
    fv_random_seed(&random, 3);
    for (int i = 0; i < SAMPLES; i++) {
        double x = wide(&random, 1e-20, 707.9);
        within("exp", x, fv_exp(x), expl(x), expl(x));
        double p = i & 1 ? fabs(wide(&random, 1e-300, 1e300)) : 1 + wide(&random, 1e-15, 0.9);
        long double want = logl(p);
        within("log", p, fv_log(p), want, larger(fabsl(want), 1e-300L));
    }
    assert_true(fv_exp(0) == 1 && fv_exp(-1e9) == fv_exp(-708) && fv_exp(1e9) == fv_exp(709));
    assert_true(fv_log(1) == 0 && fv_log(0) == fv_log(0x1p-1022) && fv_log(-1) == fv_log(0));
    assert_true(fabs(fv_pow(2, 0.5) - sqrt(2)) < 1e-15 && fabs(fv_pow(10, -3) - 1e-3) < 1e-17);
}

static void floor_is_floor(void **state)
{
    (void)state;
    struct fv_random random;
    fv_random_seed(&random, 4);
    for (int i = 0; i < SAMPLES; i++) {
        double x = wide(&random, 1e-3, 0x1p50);
        assert_true(fv_floor(x) == floor(x));
    }
    assert_true(fv_floor(-3) == -3 && fv_floor(-0.5) == -1 && fv_floor(2.999) == 2);
}

/* Fold the bits of many results into one number: it may not depend on the machine. */
static void bits_are_the_same_everywhere(void **state)
{
    (void)state;
    struct fv_random random;
    fv_random_seed(&random, 5);
    uint64_t hash = 14695981039346656037u;
    for (int i = 0; i < 20000; i++) {
        double x = (fv_random_unit(&random) - 0.5) * (i % 3 ? 20 : 2e6),
               y = fv_random_normal(&random);
        double values[] = {fv_sin(x),
                           fv_cos(x),
                           fv_tan(x),
                           fv_atan2(y, x),
                           fv_exp(y),
                           fv_log(y * y),
                           fv_pow(y * y + 0.1, y)};
        for (size_t k = 0; k < sizeof values / sizeof values[0]; k++) {
            uint64_t bits;
            memcpy(&bits, &values[k], sizeof bits);
            hash = (hash ^ bits) * 1099511628211u;
        }
    }
    if (hash != GOLDEN) fail_msg("hash of the results is 0x%016llx", (unsigned long long)hash);
}

static void random_numbers_are_uniform_and_normal(void **state)
{
    (void)state;
    struct fv_random random;
    fv_random_seed(&random, 7);
    double sum = 0, square = 0, sum_normal = 0, square_normal = 0;
    uint32_t histogram[10] = {0};
    for (int i = 0; i < SAMPLES; i++) {
        double u = fv_random_unit(&random), n = fv_random_normal(&random);
        assert_true(u >= 0 && u < 1);
        sum += u;
        square += u * u;
        sum_normal += n;
        square_normal += n * n;
        histogram[fv_random_below(&random, 10)]++;
    }
    assert_true(fabs(sum / SAMPLES - 0.5) < 0.003 && fabs(square / SAMPLES - 1.0 / 3) < 0.003);
    assert_true(fabs(sum_normal / SAMPLES) < 0.01 && fabs(square_normal / SAMPLES - 1) < 0.015);
    for (int i = 0; i < 10; i++)
        assert_in_range(histogram[i], SAMPLES / 10 - 600, SAMPLES / 10 + 600);
    /* Reference output of xoshiro128++ from the state 1 2 3 4, worked out from its definition. */
    struct fv_random counted = {{1, 2, 3, 4}};
    assert_int_equal(fv_random_u32(&counted), 641);
    assert_int_equal(fv_random_u32(&counted), 1573767);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(circle_functions_match_long_double),
        cmocka_unit_test(inverse_circle_functions_match_long_double),
        cmocka_unit_test(exponentials_match_long_double),
        cmocka_unit_test(floor_is_floor),
        cmocka_unit_test(bits_are_the_same_everywhere),
        cmocka_unit_test(random_numbers_are_uniform_and_normal),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

/* Preintegration: sums against fine integration, derivatives by difference, covariance by trial. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "base/elementary.h"
#include "geometry/se3.h"
#include "geometry/vec.h"
#include "inertial/preintegration.h"

static const struct fv_imu_noise noise = {1.7e-4 * 1.7e-4, 2e-3 * 2e-3};
static const struct fv_imu_biases none = {{0, 0, 0}, {0, 0, 0}};

/* A lively motion: what the sensor reads at an instant. */
static void reading(double t, double gyro[3], double acceleration[3])
{
    for (int i = 0; i < 3; i++) {
        gyro[i] = (1.5 - 0.4 * i) * sin((3 + i) * t + i) + 0.3;
        acceleration[i] = 4 * cos((2.5 + i) * t - i) + (i == 2 ? 9.8 : 0.5);
    }
}

static void integrate(double begin_s, double time_s, int steps, const struct fv_imu_biases *biases,
                      struct fv_preintegration *sum)
{
    fv_preintegration_begin(sum, biases);
    for (int k = 0; k < steps; k++) {
        double gyro[3], acceleration[3];
        reading(begin_s + (k + 0.5) * time_s / steps, gyro, acceleration);
        fv_preintegration_step(sum, &noise, gyro, acceleration, time_s / steps);
    }
}

static double turn_between(const double A[9], const double B[9], double r[3])
{
    double M[9];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            M[3 * i + j] = A[i] * B[j] + A[3 + i] * B[3 + j] + A[6 + i] * B[6 + j];
    fv_so3_log(M, r);
    return fv_norm3(r);
}

static void test_sums_are_those_of_fine_integration(void **state)
{
    (void)state;
    struct fv_preintegration coarse, fine;
    double r[3];
    integrate(0.2, 0.5, 100, &none, &coarse); /* 200 Hz */
    integrate(0.2, 0.5, 20000, &none, &fine);
    assert_true(turn_between(coarse.turn, fine.turn, r) < 1e-5);
    for (int i = 0; i < 3; i++) {
        assert_true(fabs(coarse.velocity[i] - fine.velocity[i]) < 2e-4);
        assert_true(fabs(coarse.position[i] - fine.position[i]) < 5e-5);
    }
    assert_true(fabs(fine.time_s - 0.5) < 1e-9);
}

/* Two spans in a row are the whole. */
static void test_spans_join(void **state)
{
    (void)state;
    struct fv_preintegration a, b, whole;
    double T[9], v[3], p[3];
    integrate(0, 0.3, 60, &none, &a);
    integrate(0.3, 0.2, 40, &none, &b);
    integrate(0, 0.5, 100, &none, &whole);
    fv_multiply33(a.turn, b.turn, T);
    fv_rotate3(a.turn, b.velocity, v);
    fv_rotate3(a.turn, b.position, p);
    for (int i = 0; i < 9; i++)
        assert_true(fabs(T[i] - whole.turn[i]) < 1e-12);
    for (int i = 0; i < 3; i++) {
        assert_true(fabs(a.velocity[i] + v[i] - whole.velocity[i]) < 1e-12);
        assert_true(fabs(a.position[i] + a.velocity[i] * b.time_s + p[i] - whole.position[i]) <
                    1e-12);
    }
}

static void test_derivatives_are_differences(void **state)
{
    (void)state;
    const double h = 1e-6;
    struct fv_preintegration base;
    integrate(0.1, 0.4, 80, &none, &base);
    for (int axis = 0; axis < 6; axis++) {
        struct fv_imu_biases b = none;
        struct fv_preintegration moved;
        double r[3];
        if (axis < 3)
            b.gyro[axis] = h;
        else
            b.acceleration[axis - 3] = h;
        integrate(0.1, 0.4, 80, &b, &moved);
        turn_between(base.turn, moved.turn, r);
        for (int i = 0; i < 3; i++) {
            const int at = 3 * i + axis % 3;
            const double v = (moved.velocity[i] - base.velocity[i]) / h,
                         p = (moved.position[i] - base.position[i]) / h;
            assert_true(fabs(r[i] / h - (axis < 3 ? base.turn_gyro[at] : 0)) < 2e-5);
            assert_true(fabs(v - (axis < 3 ? base.velocity_gyro[at]
                                           : base.velocity_acceleration[at])) < 2e-5);
            assert_true(fabs(p - (axis < 3 ? base.position_gyro[at]
                                           : base.position_acceleration[at])) < 2e-5);
        }
    }
}

/* A small change of the biases is corrected as well as by the samples again. */
static void test_correction_is_repropagation_to_first_order(void **state)
{
    (void)state;
    const struct fv_imu_biases b = {{2e-3, -1e-3, 3e-3}, {0.05, -0.02, 0.03}};
    struct fv_preintegration base, again;
    struct fv_preintegrated corrected;
    double r[3];
    integrate(0, 0.3, 60, &none, &base);
    integrate(0, 0.3, 60, &b, &again);
    fv_preintegration_correct(&base, &b, &corrected);
    assert_true(turn_between(corrected.turn, again.turn, r) < 1e-6);
    assert_true(turn_between(base.turn, again.turn, r) > 1e-4);
    for (int i = 0; i < 3; i++) {
        assert_true(fabs(corrected.velocity[i] - again.velocity[i]) < 1e-5);
        assert_true(fabs(corrected.position[i] - again.position[i]) < 1e-5);
    }
}

/* Squared errors over many noisy trials, in units of the stated covariance: 9 in the mean. */
static void test_covariance_is_that_of_trials(void **state)
{
    (void)state;
    enum { TRIALS = 400, STEPS = 60 };
    const double step = 0.005;
    struct fv_preintegration exact, sum;
    struct fv_random random;
    double nees = 0, last = 0;
    fv_random_seed(&random, 5);
    integrate(0.4, STEPS * step, STEPS, &none, &exact);
    for (int trial = 0; trial < TRIALS; trial++) {
        double e[9], S[81], scaled[9];
        fv_preintegration_begin(&sum, &none);
        for (int k = 0; k < STEPS; k++) {
            double gyro[3], acceleration[3];
            reading(0.4 + (k + 0.5) * step, gyro, acceleration);
            for (int i = 0; i < 3; i++) {
                gyro[i] += sqrt(noise.gyro / step) * fv_random_normal(&random);
                acceleration[i] += sqrt(noise.acceleration / step) * fv_random_normal(&random);
            }
            fv_preintegration_step(&sum, &noise, gyro, acceleration, step);
        }
        turn_between(exact.turn, sum.turn, e);
        fv_subtract3(sum.velocity, exact.velocity, e + 3);
        fv_subtract3(sum.position, exact.position, e + 6);
        /* Gauss elimination of the covariance, by hand so that nothing tested is used. */
        memcpy(S, sum.covariance, sizeof S);
        memcpy(scaled, e, sizeof e);
        for (int j = 0; j < 9; j++)
            for (int i = j + 1; i < 9; i++) {
                const double f = S[9 * i + j] / S[9 * j + j];
                for (int c = j; c < 9; c++)
                    S[9 * i + c] -= f * S[9 * j + c];
                scaled[i] -= f * scaled[j];
            }
        for (int j = 0; j < 9; j++) {
            assert_true(S[9 * j + j] > 0);
            nees += scaled[j] * scaled[j] / S[9 * j + j];
        }
        last += scaled[8] * scaled[8] / S[80];
    }
    assert_true(nees / TRIALS > 8.3 && nees / TRIALS < 9.7); /* sigma of the mean: 0.21 */
    assert_true(last / TRIALS > 0.75 && last / TRIALS < 1.25);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_sums_are_those_of_fine_integration),
        cmocka_unit_test(test_spans_join),
        cmocka_unit_test(test_derivatives_are_differences),
        cmocka_unit_test(test_correction_is_repropagation_to_first_order),
        cmocka_unit_test(test_covariance_is_that_of_trials),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

/* Measured turns: joined ones are those of the whole time, other biases to first order, and errors
 * and variances as they are stated. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "geometry/se3.h"
#include "geometry/turn.h"
#include "geometry/vec.h"
#include "inertial/preintegration.h"

static const double none[3] = {0, 0, 0};
static const double density2 = 1e-6; /* rad^2/s^2/Hz */

/* What a gyro with this bias reads of a lively turn, integrated and rid of another. */
static struct fv_turn measured(double begin_s, double end_s, const double own[3],
                               const double removed[3])
{
    enum { STEPS = 200 };
    const struct fv_imu_noise noise = {density2, 0};
    struct fv_imu_biases biases = {{0}, {0}};
    struct fv_preintegration sum;
    struct fv_turn turn;
    memcpy(biases.gyro, removed, sizeof biases.gyro);
    fv_preintegration_begin(&sum, &biases);
    for (int k = 0; k < STEPS; k++) {
        const double t = begin_s + (k + 0.5) * (end_s - begin_s) / STEPS;
        const double rate[3] = {sin(3 * t) + own[0], 0.7 * cos(4 * t) + own[1], 0.5 + own[2]};
        fv_preintegration_step(&sum, &noise, rate, none, (end_s - begin_s) / STEPS);
    }
    fv_turn_begin(&turn, removed);
    memcpy(turn.R, sum.turn, sizeof turn.R);
    memcpy(turn.by_bias, sum.turn_gyro, sizeof turn.by_bias);
    turn.variance = sum.covariance[0];
    turn.time_s = sum.time_s;
    const double first[3] = {sin(3 * begin_s), 0.7 * cos(4 * begin_s), 0.5},
                 last[3] = {sin(3 * end_s), 0.7 * cos(4 * end_s), 0.5};
    double carried[3];
    fv_rotate_back3(turn.R, first, carried);
    fv_subtract3(last, carried, turn.rate_change);
    return turn;
}

static double apart(const double A[9], const double B[9])
{
    struct fv_turn turn;
    double e[3];
    fv_turn_begin(&turn, none);
    memcpy(turn.R, A, sizeof turn.R);
    fv_turn_error(&turn, none, B, e);
    return fv_norm3(e);
}

static void test_joined_turns_are_that_of_the_whole_time(void **state)
{
    (void)state;
    const double other[3] = {0.02, -0.01, 0.015};
    const struct fv_turn whole = measured(0.2, 1.0, none, none),
                         next = measured(0.5, 1.0, none, none),
                         otherwise = measured(0.5, 1.0, none, other);
    struct fv_turn joined = measured(0.2, 0.5, none, none), mixed = joined, from_nothing;
    fv_turn_join(&joined, &next);
    fv_turn_join(&mixed, &otherwise);
    assert_true(apart(joined.R, whole.R) < 1e-5);
    assert_true(apart(mixed.R, whole.R) < 1e-4); /* to first order in .02 rad/s times .5 s */
    for (int i = 0; i < 9; i++)
        assert_true(fabs(joined.by_bias[i] - whole.by_bias[i]) < 1e-3);
    assert_true(fabs(joined.variance - density2 * 0.8) < 1e-9);
    for (int i = 0; i < 3; i++)
        assert_true(fabs(joined.rate_change[i] - whole.rate_change[i]) < 1e-4);
    assert_true(fabs(joined.time_s - 0.8) < 1e-12);
    fv_turn_begin(&from_nothing, none);
    fv_turn_join(&from_nothing, &next);
    assert_true(apart(from_nothing.R, next.R) < 1e-12);
}

static void test_another_bias_corrects(void **state)
{
    (void)state;
    const double bias[3] = {0.01, -0.02, 0.005};
    const struct fv_turn exact = measured(0, 0.6, none, none), off = measured(0, 0.6, bias, none);
    double R[9];
    assert_true(apart(off.R, exact.R) > 5e-3);
    fv_turn_correct(&off, bias, R);
    assert_true(apart(R, exact.R) < 1e-4);
}

static void test_the_error_is_on_the_side_of_the_end(void **state)
{
    (void)state;
    const double more[3] = {0.01, -0.004, 0.002};
    const struct fv_turn turn = measured(0, 0.6, none, none);
    double E[9], between[9], e[3];
    fv_so3_exp(more, E);
    fv_multiply33(turn.R, E, between);
    fv_turn_error(&turn, none, between, e);
    for (int i = 0; i < 3; i++)
        assert_true(fabs(e[i] - more[i]) < 1e-9);
}

static void test_doubt_grows_with_the_turn_and_with_the_rates_change(void **state)
{
    (void)state;
    const double quarter[3] = {0, 0, 0.25};
    const struct fv_turn_doubt sure = {{0}, 0, 0}, clock = {{0}, 0.004, 0}, scale = {{0}, 0, 0.02},
                               across = {{4e-4, 0, 0, 0, 4e-4, 0, 0, 0, 0}, 0, 0},
                               along = {{0, 0, 0, 0, 0, 0, 0, 0, 4e-4}, 0, 0};
    struct fv_turn turn;
    fv_turn_begin(&turn, none);
    assert_true(fv_turn_mount_fraction(&turn, &across) == 0);
    fv_so3_exp(quarter, turn.R);
    turn.variance = 4e-8;
    turn.rate_change[1] = 0.5;
    assert_true(fabs(fv_turn_variance(&turn, &sure) - 4e-8) < 2e-12);
    assert_true(fabs(fv_turn_variance(&turn, &across) - 4e-8 - 2.5e-5) < 2e-12);
    assert_true(fabs(fv_turn_mount_fraction(&turn, &across) - 4e-4) < 1e-12);
    /* an error of the mount about the axis that the camera turns about */
    assert_true(fabs(fv_turn_variance(&turn, &along) - 4e-8) < 2e-12);
    assert_true(fabs(fv_turn_variance(&turn, &clock) - 4e-8 - 4e-6) < 2e-12);
    assert_true(fabs(fv_turn_variance(&turn, &scale) - 4e-8 - 4e-4 * 0.0625 / 3) < 2e-12);
    turn.variance = 0;
    assert_true(fv_turn_variance(&turn, &sure) > 0);
}

/* The error that a mount makes: the turn of a sensor that is off by d, taken for the camera's. */
static void test_a_mount_errs_as_stated(void **state)
{
    (void)state;
    const double w[3] = {0.1, -0.2, 0.15}, d[3] = {0.01, 0.02, -0.01};
    struct fv_turn turn;
    struct fv_turn_doubt doubt = {{0}, 0, 0};
    double R[9], D[9], DR[9], seen[9], e[3];
    fv_so3_exp(w, R);
    fv_so3_exp(d, D);
    fv_multiply33(D, R, DR);
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++)
            seen[3 * r + c] = fv_dot3(DR + 3 * r, D + 3 * c); /* D R D^T */
    fv_turn_begin(&turn, none);
    memcpy(turn.R, R, sizeof R);
    fv_turn_error(&turn, none, seen, e);
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++)
            doubt.mount[3 * r + c] = d[r] * d[c];
    assert_true(fabs(fv_turn_variance(&turn, &doubt) / (fv_dot3(e, e) / 2) - 1) < 0.05);
}

/* A clock that is late by dt: the turn of instants that are so much later. */
static void test_a_clock_errs_as_stated(void **state)
{
    (void)state;
    const double dt = 0.003;
    const struct fv_turn_doubt doubt = {{0}, dt, 0};
    struct fv_turn turn = measured(0.2, 2.2, none, none);
    const struct fv_turn late = measured(0.2 + dt, 2.2 + dt, none, none);
    const double off = apart(turn.R, late.R);
    turn.variance = 0;
    assert_true(fabs(sqrt(fv_turn_variance(&turn, &doubt)) / off - 1) < 0.05);
}

static void test_contradictions(void **state)
{
    (void)state;
    const double little[3] = {0, 0.007, 0}, much[3] = {0, 0.009, 0}, broken[3] = {0, NAN, 0};
    assert_false(fv_turn_contradicts(little, 0));
    assert_true(fv_turn_contradicts(much, 0));
    assert_false(fv_turn_contradicts(much, 4e-6));
    assert_true(fv_turn_contradicts(broken, 1));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_joined_turns_are_that_of_the_whole_time),
        cmocka_unit_test(test_another_bias_corrects),
        cmocka_unit_test(test_the_error_is_on_the_side_of_the_end),
        cmocka_unit_test(test_a_mount_errs_as_stated),
        cmocka_unit_test(test_a_clock_errs_as_stated),
        cmocka_unit_test(test_contradictions),
        cmocka_unit_test(test_doubt_grows_with_the_turn_and_with_the_rates_change),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

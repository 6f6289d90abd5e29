/* Wheel odometry: what a robot can do passes, forged motion does not stretch the metres. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <math.h>
#include <stdint.h>

#include <cmocka.h>

#include "app/network/wheel_odometry_gate.h"

static bot_core_pose_t pose_at(double t_s, double x_m, double yaw_rad)
{
    return (bot_core_pose_t){.utime = (int64_t)(t_s * 1e6),
                             .pos = {x_m, 0, 0},
                             .orientation = {cos(yaw_rad / 2), 0, 0, sin(yaw_rad / 2)}};
}

static enum fv_wheel_odometry_verdict judge(struct fv_wheel_odometry_gate *gate, double t_s,
                                            double x_m, double yaw_rad)
{
    struct fovea_wheel_odometry_sample sample;
    const bot_core_pose_t pose = pose_at(t_s, x_m, yaw_rad);
    return fv_wheel_odometry_gate_judge(gate, &pose, &sample);
}

static void begin(struct fv_wheel_odometry_gate *gate, double speed, double turn)
{
    fv_wheel_odometry_gate_init(gate, &(struct fv_wheel_odometry_limits){speed, turn});
}

static void test_motion_within_the_limits_passes_with_its_jitter(void **state)
{
    struct fv_wheel_odometry_gate gate;
    (void)state;
    begin(&gate, 2, 3);
    for (int i = 0; i < 2000; i++) { /* 1.9 m/s and 2.9 rad/s, stamps off by up to 15 ms */
        const double jitter = 0.015 * sin(i * 1.7), t = 1 + 0.05 * i;
        assert_int_equal(judge(&gate, t + jitter, 1.9 * 0.05 * i, 2.9 * 0.05 * i),
                         FV_WHEEL_ODOMETRY_TAKEN);
    }
    assert_int_equal(judge(&gate, 1000, 190 + 2 * 890, 0),
                     FV_WHEEL_ODOMETRY_TAKEN); /* after a gap */
}

static void test_faster_motion_is_left_out(void **state)
{
    struct fv_wheel_odometry_gate gate;
    (void)state;
    begin(&gate, 2, 3);
    assert_int_equal(judge(&gate, 1, 0, 0), FV_WHEEL_ODOMETRY_TAKEN);
    assert_int_equal(judge(&gate, 2, 2.5, 0), FV_WHEEL_ODOMETRY_TOO_FAST);
    assert_int_equal(judge(&gate, 2, 0, 3.1),
                     FV_WHEEL_ODOMETRY_TAKEN); /* 0.1 s of jitter is used */
    assert_int_equal(judge(&gate, 2.01, 0, 3.35), FV_WHEEL_ODOMETRY_TOO_FAST);
    assert_int_equal(judge(&gate, 1.5, 0, 0), FV_WHEEL_ODOMETRY_OLD);
    assert_int_equal(judge(&gate, 2, 0, 3.1), FV_WHEEL_ODOMETRY_OLD);
    assert_int_equal(gate.counts[FV_WHEEL_ODOMETRY_TOO_FAST], 2);
    assert_int_equal(gate.counts[FV_WHEEL_ODOMETRY_OLD], 2);
    begin(&gate, 0, 0); /* no limits */
    assert_int_equal(judge(&gate, 1, 0, 0), FV_WHEEL_ODOMETRY_TAKEN);
    assert_int_equal(judge(&gate, 1.001, 1e6, 3), FV_WHEEL_ODOMETRY_TAKEN);
}

/* True samples of a robot that moves at 1 m/s, and between any two a forged one that says ten times
 * as much: what is taken moves by no more than the limit allows. */
static void test_forged_samples_do_not_stretch_the_metres(void **state)
{
    struct fv_wheel_odometry_gate gate;
    double moved = 0, last = 0;
    int taken_true = 0;
    (void)state;
    begin(&gate, 1.5, 3);
    for (int i = 0; i < 1000; i++) {
        const double t = 1 + 0.1 * i, x = 0.1 * i;
        if (judge(&gate, t, x, 0) == FV_WHEEL_ODOMETRY_TAKEN) {
            taken_true++;
            moved += fabs(x - last);
            last = x;
        }
        if (judge(&gate, t + 0.05, 10 * x, 0) == FV_WHEEL_ODOMETRY_TAKEN) {
            moved += fabs(10 * x - last);
            last = 10 * x;
        }
    }
    assert_true(moved <= 1.5 * (100 + 0.1));
    assert_true(taken_true > 950);
}

static void test_stamps_that_crawl_give_no_speed(void **state)
{
    struct fv_wheel_odometry_gate gate;
    int taken = 0;
    (void)state;
    begin(&gate, 2, 3);
    for (int i = 0; i < 1000; i++) /* 5 cm each, a microsecond apart */
        taken += judge(&gate, 1 + 1e-6 * i, 0.05 * taken, 0) == FV_WHEEL_ODOMETRY_TAKEN;
    assert_in_range(taken, 1, 6);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_motion_within_the_limits_passes_with_its_jitter),
        cmocka_unit_test(test_faster_motion_is_left_out),
        cmocka_unit_test(test_forged_samples_do_not_stretch_the_metres),
        cmocka_unit_test(test_stamps_that_crawl_give_no_speed),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

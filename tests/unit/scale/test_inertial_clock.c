/* What the offset between the clocks and the mount's error, as two filters know them, lead to: when
 * samples are moved, when that is a leap, and when a mount is wrong. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "geometry/se3.h"
#include "scale/inertial.h"

static const int64_t SECOND = 1000000000;

static struct fv_inertial_state estimate;
static struct fv_inertial_stage_clock clocks;
static struct fv_inertial_stage stage;
static struct fv_odometry odometry;
static struct fv_odometry_state odometry_state;
static int64_t now_ns;

static int set_up(void **state)
{
    (void)state;
    memset(&estimate, 0, sizeof estimate);
    memset(&stage, 0, sizeof stage);
    now_ns = 0;
    stage.enabled = true;
    stage.clock = &clocks;
    stage.estimator.state = &estimate;
    fv_se3_identity(&stage.estimator.config.T_cam_imu);
    fv_inertial_stage_init_clocks(&stage);
    return 0;
}

static void know(struct fv_imu_clock *clock, double offset_s, double sigma_s)
{
    clock->offset_s = offset_s;
    clock->P[6 * (FV_IMU_CLOCK_SIZE + 1)] = sigma_s * sigma_s;
}

/* A frame half a second later, with what the filters know: no sample comes. */
static bool leaps(void)
{
    odometry.state = &odometry_state;
    for (int i = 0; i < 3; i++)
        odometry_state.pose.T_world_cam[5 * i] = 1;
    now_ns += SECOND / 2;
    return fv_inertial_stage_compare_clocks(&stage, &odometry, now_ns);
}

static double used_s(void)
{
    struct fv_inertial_stage_offset offset;
    assert_true(fv_inertial_stage_offset(&stage, &offset));
    return offset.used_s;
}

static void test_samples_are_moved_by_what_is_sure_and_large(void **state)
{
    static const struct {
        double offset_s, sigma_s;
        bool moved, leaps;
    } rows[] = {
        {0.01, 0.0011, false, false},   /* not sure */
        {0.0014, 0.0001, false, false}, /* too small to matter */
        {0.0017, 0.0005, false, false}, /* 3.4 sigmas */
        {0.0021, 0.0005, true, false},  {-0.0021, 0.0005, true, false},
        {0.0029, 0.0005, true, false},  {0.0031, 0.0005, true, true},
        {-0.012, 0.0009, true, true},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        set_up(state);
        know(&clocks.found, rows[i].offset_s, rows[i].sigma_s);
        assert_int_equal(leaps(), rows[i].leaps);
        assert_int_equal(clocks.moved_ns, rows[i].moved ? (int64_t)(rows[i].offset_s * 1e9) : 0);
    }
}

static void test_a_moved_clock_is_followed_in_smaller_steps(void **state)
{
    (void)state;
    know(&clocks.found, 0.012, 0.0005);
    assert_true(leaps());
    know(&clocks.found, 0.0124, 0.0001); /* less than half a millisecond */
    assert_false(leaps());
    assert_true(used_s() == 0.012);
    know(&clocks.found, 0.0126, 0.0004); /* not two sigmas */
    assert_false(leaps());
    assert_true(used_s() == 0.012);
    know(&clocks.found, 0.0126, 0.0002);
    assert_false(leaps());
    assert_true(used_s() == 0.0126);
}

/* Turned by so much about x, one standard deviation of all axes. */
static void turn(double angle, double sigma)
{
    fv_so3_exp((const double[3]){angle, 0, 0}, clocks.mounted.mount);
    for (int i = 7; i < 10; i++)
        clocks.mounted.P[i * (FV_IMU_CLOCK_SIZE + 1)] = sigma * sigma;
}

static bool wrong(void)
{
    struct fv_inertial_stage_mount mount;
    (void)leaps();
    assert_true(fv_inertial_stage_mount(&stage, &mount));
    return mount.wrong;
}

static void test_a_mount_is_wrong_after_a_second(void **state)
{
    (void)state;
    turn(0.033, 0.001); /* below 2 degrees, however sure */
    for (int i = 0; i < 10; i++)
        assert_false(wrong());
    turn(0.087, 0.0175); /* not 5 sigmas */
    for (int i = 0; i < 10; i++)
        assert_false(wrong());
    turn(0.087, 0.017);
    assert_false(wrong());
    assert_false(wrong());
    turn(0, 0.017); /* it was none: the second begins anew */
    assert_false(wrong());
    turn(0.087, 0.017);
    assert_false(wrong());
    assert_false(wrong());
    assert_true(wrong());
    turn(0, 0.01);
    assert_true(wrong()); /* said once, it stays */
}

/* A filter that takes a wrong mount as stated finds a wrong offset. */
static void test_the_offset_of_a_wrong_mount_is_the_joint_filters(void **state)
{
    (void)state;
    struct fv_inertial_stage_offset offset;
    know(&clocks.found, 0.009, 0.002);
    know(&clocks.mounted, 0.001, 0.003);
    turn(0.087, 0.01);
    for (int i = 0; i < 3; i++) {
        assert_true(fv_inertial_stage_offset(&stage, &offset));
        assert_true(offset.offset_s == 0.009);
        (void)leaps();
    }
    assert_true(fv_inertial_stage_offset(&stage, &offset));
    assert_true(offset.offset_s == 0.001);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(test_samples_are_moved_by_what_is_sure_and_large, set_up),
        cmocka_unit_test_setup(test_a_moved_clock_is_followed_in_smaller_steps, set_up),
        cmocka_unit_test_setup(test_a_mount_is_wrong_after_a_second, set_up),
        cmocka_unit_test_setup(test_the_offset_of_a_wrong_mount_is_the_joint_filters, set_up),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

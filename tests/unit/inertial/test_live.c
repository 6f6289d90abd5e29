/* From frame to frame by samples: velocity, prediction, and samples that lack. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "base/elementary.h"
#include "geometry/vec.h"
#include "inertial/live.h"

static const double gravity[3] = {0, 0, -9.80665};
static const struct fv_imu_noise noise = {3e-8, 4e-6};
static const struct fv_imu_biases none = {{0, 0, 0}, {0, 0, 0}};

static double at(double t, int axis)
{
    return sin((1.2 + axis) * t + axis);
}

/* Axes of the sensor stay those of the world. */
static void sample(struct fv_inertial_live *live, int64_t n)
{
    const double t = (double)n * 0.005;
    struct fv_imu_reading next = {.stamp_ns = n * 5000000};
    for (int i = 0; i < 3; i++)
        next.acceleration[i] = -(1.2 + i) * (1.2 + i) * at(t, i) - gravity[i];
    fv_inertial_live_take(live, &noise, &next);
}

/* Ten samples to a frame, `frames` of them; poses have errors of 2 mm. */
static void run(struct fv_inertial_live *live, int frames)
{
    struct fv_random random;
    struct fv_preintegration sum;
    struct fv_se3 T;
    fv_random_seed(&random, 3);
    memset(live, 0, sizeof *live);
    fv_se3_identity(&T);
    for (int64_t n = 0; n <= frames * 10; n++) {
        sample(live, n);
        if (n % 10 != 0) continue;
        fv_inertial_live_advance(live, &noise, n * 5000000);
        for (int i = 0; i < 3; i++)
            T.t[i] = at((double)n * 0.005, i) + 0.002 * fv_random_normal(&random);
        const bool led = fv_inertial_live_reach(live, &noise, n * 5000000, &sum);
        assert_true(led == (n > 0));
        fv_inertial_live_pose(live, n * 5000000, &T, 0.002, led ? &sum : NULL, gravity, &none);
    }
}

static void test_velocity_is_filtered(void **state)
{
    (void)state;
    struct fv_inertial_live live;
    double off = 0;
    run(&live, 60);
    assert_true(live.moving);
    for (int i = 0; i < 3; i++) {
        const double v = live.velocity[i] - (1.2 + i) * cos((1.2 + i) * 3 + i);
        off += v * v / 3;
    }
    assert_true(sqrt(off) < 0.02); /* two poses alone: 0.057 */
    assert_true(live.variance > 1e-6 && live.variance < 0.03 * 0.03);
}

/* Of noisy samples the velocity follows less sure. */
static void test_noise_of_samples_is_in_the_velocity(void **state)
{
    (void)state;
    static const struct fv_imu_noise shaken = {3e-8, 4e-4};
    struct fv_inertial_live live;
    struct fv_preintegration sum;
    struct fv_se3 T;
    double variance[2];
    for (int i = 0; i < 2; i++) {
        run(&live, 60);
        fv_se3_identity(&T);
        fv_preintegration_begin(&sum, &none);
        fv_preintegration_step(&sum, i == 0 ? &noise : &shaken, none.gyro, none.acceleration, 0.1);
        fv_inertial_live_pose(&live, 3100000000, &T, 1, &sum, gravity, &none);
        variance[i] = live.variance;
    }
    assert_true(fabs(variance[1] - variance[0] - (4e-4 - 4e-6) * 0.1) < 2e-6);
}

static void test_poses_are_predicted(void **state)
{
    (void)state;
    struct fv_inertial_live live;
    struct fv_preintegration sum;
    struct fv_se3 T;
    double velocity[3];
    run(&live, 60);
    for (int64_t n = 601; n <= 620; n++)
        sample(&live, n);
    fv_inertial_live_advance(&live, &noise, 3102500000);
    assert_true(fv_inertial_live_reach(&live, &noise, 3102500000, &sum)); /* between samples */
    fv_inertial_live_predict(&live, &sum, gravity, &T, velocity);
    for (int i = 0; i < 3; i++)
        assert_true(fabs(T.t[i] - at(3.1025, i)) < 0.01);
}

static void test_samples_that_lack_end_it(void **state)
{
    (void)state;
    struct fv_inertial_live live;
    struct fv_preintegration sum;
    run(&live, 10);
    sample(&live, 125);
    fv_inertial_live_advance(&live, &noise, 630000000);
    assert_false(fv_inertial_live_reach(&live, &noise, 630000000, &sum));
    run(&live, 10);
    assert_false(fv_inertial_live_reach(&live, &noise, 600000000, &sum));
    assert_true(fv_inertial_live_reach(&live, &noise, 550000000, &sum));
}

/* Samples may be ahead of the frames: they change nothing before their time. */
static void test_samples_ahead_wait(void **state)
{
    (void)state;
    static struct fv_inertial_live on_time, ahead;
    struct fv_preintegration a, b;
    run(&on_time, 10);
    run(&ahead, 10);
    for (int64_t n = 101; n <= 118; n++) {
        if (n <= 110) sample(&on_time, n);
        sample(&ahead, n);
    }
    fv_inertial_live_advance(&on_time, &noise, 550000000);
    fv_inertial_live_advance(&ahead, &noise, 550000000);
    assert_true(fv_inertial_live_reach(&on_time, &noise, 550000000, &a));
    assert_true(fv_inertial_live_reach(&ahead, &noise, 550000000, &b));
    assert_memory_equal(&a, &b, sizeof a);
    fv_inertial_live_advance(&ahead, &noise, 590000000);
    assert_false(fv_inertial_live_reach(&ahead, &noise, 550000000, &b)); /* too late for that */
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_velocity_is_filtered),
        cmocka_unit_test(test_noise_of_samples_is_in_the_velocity),
        cmocka_unit_test(test_poses_are_predicted),
        cmocka_unit_test(test_samples_that_lack_end_it),
        cmocka_unit_test(test_samples_ahead_wait),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

/* Standing is said where pictures and samples show it, and never at constant velocity. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "base/elementary.h"
#include "inertial/still.h"

enum { SAMPLE_NS = 5000000, FRAME_NS = 50000000 };

static const struct fv_imu_still_noise noise = {2.4e-3, 0.028};

struct walk {
    struct fv_imu_still still;
    struct fv_random random;
    double x, seen_x; /* of the sensor, and as the picture shows it */
    double believed;  /* velocity by samples and poses */
    int64_t now_ns;
    int standing; /* frames of which it was said */
};

static void begin(struct walk *walk, uint64_t seed)
{
    memset(walk, 0, sizeof *walk);
    fv_imu_still_init(&walk->still);
    fv_random_seed(&walk->random, seed);
}

/* At `from` to `to` m/s, evenly; `stuck`: the picture stays as it is. */
static void go(struct walk *walk, double seconds, double from, double to, bool stuck)
{
    const int64_t begin_ns = walk->now_ns, end_ns = begin_ns + (int64_t)(seconds * 1e9);
    for (; walk->now_ns < end_ns; walk->now_ns += SAMPLE_NS) {
        const double t = (double)(walk->now_ns - begin_ns) * 1e-9,
                     v = from + (to - from) * t / seconds;
        struct fv_imu_reading sample = {.stamp_ns = walk->now_ns};
        for (int i = 0; i < 3; i++) {
            sample.gyro[i] = 0.02 + noise.gyro * fv_random_normal(&walk->random);
            sample.acceleration[i] = (i == 0 ? (to - from) / seconds : 5) +
                                     noise.acceleration * fv_random_normal(&walk->random);
        }
        fv_imu_still_take(&walk->still, &noise, &sample);
        walk->x += v * SAMPLE_NS * 1e-9;
        if (!stuck) walk->seen_x = walk->x;
        if (walk->now_ns % FRAME_NS != 0) continue;
        struct fv_imu_still_seen seen = {.stamp_ns = walk->now_ns,
                                         .depth = 3,
                                         .velocity = fabs(walk->believed),
                                         .velocity_sigma = 0.02,
                                         .of_use = true};
        fv_se3_identity(&seen.T_world_imu);
        seen.T_world_imu.t[0] = walk->seen_x + 5e-4 * fv_random_normal(&walk->random);
        fv_imu_still_see(&walk->still, &seen);
        walk->standing += walk->still.standing;
        walk->believed = stuck ? walk->believed / 2 : v; /* poses pull it along */
    }
}

static void test_a_stop_is_known(void **state)
{
    (void)state;
    for (uint64_t seed = 1; seed <= 100; seed++) {
        struct walk walk;
        begin(&walk, seed);
        go(&walk, 2, 0.5, 0.5, false);
        go(&walk, 1, 0.5, 0, false);
        assert_int_equal(walk.standing, 0);
        go(&walk, 3, 0, 0, false);
        assert_true(walk.still.standing && walk.standing > 35);
        walk.standing = 0;
        go(&walk, 1, 0, 0.4, false);
        assert_true(!walk.still.standing && walk.standing <= 1);
    }
}

/* The samples are as quiet as at rest. */
static void test_a_cruise_is_not(void **state)
{
    (void)state;
    for (uint64_t seed = 1; seed <= 100; seed++) {
        struct walk walk;
        begin(&walk, seed);
        go(&walk, 1, 0, 0.1, false);
        go(&walk, 10, 0.1, 0.1, false);
        assert_true(walk.still.blocks >= 2);
        go(&walk, 1, 0.1, 0.5, false);
        go(&walk, 3, 0.5, 0.5, false);
        assert_int_equal(walk.standing, 0);
        go(&walk, 5, 0.5, 0.5, true); /* and the picture sticks */
        assert_int_equal(walk.standing, 0);
        go(&walk, 2, 0.5, 0, false); /* comes back, and it stops */
        go(&walk, 3, 0, 0, false);
        assert_true(walk.still.standing);
    }
}

static void test_it_stands_on_without_pictures_until_a_force(void **state)
{
    (void)state;
    struct walk walk;
    begin(&walk, 3);
    go(&walk, 1, 0.3, 0, false);
    go(&walk, 2, 0, 0, false);
    assert_true(walk.still.standing);
    for (int n = 0; n < 600; n++, walk.now_ns += SAMPLE_NS) {
        struct fv_imu_reading sample = {.stamp_ns = walk.now_ns};
        for (int i = 0; i < 3; i++) {
            sample.gyro[i] = 0.02 + noise.gyro * fv_random_normal(&walk.random);
            sample.acceleration[i] = (i == 0 ? 0 : 5) + (n >= 400 && i == 1 ? 0.1 : 0) +
                                     noise.acceleration * fv_random_normal(&walk.random);
        }
        fv_imu_still_take(&walk.still, &noise, &sample);
        if (n == 399) assert_true(walk.still.standing);
    }
    assert_false(walk.still.standing); /* .1 m/s^2, within half a second */
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_stop_is_known),
        cmocka_unit_test(test_a_cruise_is_not),
        cmocka_unit_test(test_it_stands_on_without_pictures_until_a_force),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

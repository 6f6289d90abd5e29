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
        fv_se3_identity(&seen.T_world_cam);
        seen.T_world_cam.t[0] = walk->seen_x + 5e-4 * fv_random_normal(&walk->random);
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

/* Samples at rest, with `more` on one gyro axis; the pictures stay where they are. */
static void rest(struct walk *walk, int samples, double (*more)(int n))
{
    struct fv_imu_still_seen seen = {
        .depth = 3, .velocity = 0, .velocity_sigma = 0.02, .of_use = true};
    fv_se3_identity(&seen.T_world_cam);
    for (int n = 0; n < samples; n++, walk->now_ns += SAMPLE_NS) {
        struct fv_imu_reading sample = {.stamp_ns = walk->now_ns};
        for (int i = 0; i < 3; i++) {
            sample.gyro[i] = noise.gyro * fv_random_normal(&walk->random);
            sample.acceleration[i] = 5 + noise.acceleration * fv_random_normal(&walk->random);
        }
        sample.gyro[1] += more == NULL ? 0 : more(n);
        fv_imu_still_take(&walk->still, &noise, &sample);
        seen.stamp_ns = walk->now_ns;
        if (walk->now_ns % FRAME_NS != 0) continue;
        fv_imu_still_see(&walk->still, &seen);
        walk->standing += walk->still.standing;
    }
}

static double shaking(int n)
{
    return 2.5 * noise.gyro * sin(1.3 * n); /* no sample alone is far off */
}

static double jerk(int n)
{
    return n == 0 ? 12 * noise.gyro : 0;
}

static void test_what_shakes_does_not_stand(void **state)
{
    (void)state;
    struct walk walk;
    begin(&walk, 5);
    rest(&walk, 400, NULL);
    assert_true(walk.standing > 15);
    begin(&walk, 5);
    rest(&walk, 400, shaking);
    assert_int_equal(walk.standing, 0);
}

static void test_a_jerk_and_a_gap_end_it_at_once(void **state)
{
    (void)state;
    struct walk walk;
    begin(&walk, 6);
    rest(&walk, 421, NULL); /* in the middle of a block */
    assert_true(walk.still.standing);
    rest(&walk, 1, jerk);
    assert_false(walk.still.standing);
    rest(&walk, 400, NULL);
    assert_true(walk.still.standing);
    walk.now_ns += 100000000;
    rest(&walk, 1, NULL);
    assert_false(walk.still.standing);
}

/* Quiet from the first sample on, as in a cruise: a velocity of 8 cm/s is none that may be 0. */
static void test_a_known_velocity_needs_a_force_to_end(void **state)
{
    (void)state;
    for (int slow = 0; slow < 2; slow++) {
        struct walk walk;
        begin(&walk, 7);
        struct fv_imu_still_seen seen = {.stamp_ns = 1,
                                         .depth = 3,
                                         .velocity = slow ? 0.04 : 0.08,
                                         .velocity_sigma = 0.02,
                                         .of_use = true};
        fv_se3_identity(&seen.T_world_cam);
        walk.now_ns = FRAME_NS;
        rest(&walk, 10, NULL); /* what begins has stirred */
        seen.stamp_ns = walk.now_ns;
        fv_imu_still_see(&walk.still, &seen);
        rest(&walk, 600, NULL);
        assert_int_equal(walk.standing > 0, slow);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_stop_is_known),
        cmocka_unit_test(test_a_cruise_is_not),
        cmocka_unit_test(test_it_stands_on_without_pictures_until_a_force),
        cmocka_unit_test(test_what_shakes_does_not_stand),
        cmocka_unit_test(test_a_jerk_and_a_gap_end_it_at_once),
        cmocka_unit_test(test_a_known_velocity_needs_a_force_to_end),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

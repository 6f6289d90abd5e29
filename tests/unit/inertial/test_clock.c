/* The offset between the clocks of camera and inertial sensor, from turns: found, with a sigma that
 * holds, and not claimed where nothing shows it. */
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
#include "inertial/clock.h"

enum { SAMPLE_NS = 5000000, FRAME_NS = 50000000, FINE = 10 };

static const double gyro_noise = 1.7e-4, frame_sigma = 1e-3;
static const struct fv_imu_clock_noise noise = {1.7e-4 * 1.7e-4, 2e-5 * 2e-5};
static const double bias[3] = {0.02, -0.01, 0.03};

enum motion { STAND, EVEN, SHAKEN };

/* Rate at a time on the camera's clock, rad/s. */
static void rate_at(enum motion motion, double t, double rate[3])
{
    for (int i = 0; i < 3; i++) {
        rate[i] = motion == STAND ? 0 : 0.3 * (i + 1);
        if (motion == SHAKEN) rate[i] = 0.5 * sin((1.1 + 0.7 * i) * t + i);
    }
}

struct world {
    struct fv_imu_clock clock;
    struct fv_random random;
    enum motion motion;
    double R[9]; /* of the sensor now */
    int64_t now_ns;
};

static void begin(struct world *world, enum motion motion, uint64_t seed)
{
    static const double identity[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    memset(world, 0, sizeof *world);
    fv_imu_clock_init(&world->clock);
    fv_random_seed(&world->random, seed);
    world->motion = motion;
    memcpy(world->R, identity, sizeof identity);
}

static void turn_on(struct world *world, int64_t step_ns)
{
    const double t = (double)step_ns * 1e-9 / FINE;
    for (int n = 0; n < FINE; n++) {
        double w[3], E[9], R[9];
        rate_at(world->motion, (double)world->now_ns * 1e-9 + ((double)n + 0.5) * t, w);
        for (int i = 0; i < 3; i++)
            w[i] *= t;
        fv_so3_exp(w, E);
        fv_multiply33(world->R, E, R);
        memcpy(world->R, R, sizeof R);
    }
    world->now_ns += step_ns;
}

static void sample(struct world *world, double offset_s)
{
    struct fv_imu_reading reading = {.stamp_ns = world->now_ns - (int64_t)(offset_s * 1e9)};
    rate_at(world->motion, (double)world->now_ns * 1e-9, reading.gyro);
    for (int i = 0; i < 3; i++)
        reading.gyro[i] += bias[i] + gyro_noise * sqrt(200) * fv_random_normal(&world->random);
    fv_imu_clock_take(&world->clock, &reading);
}

/* `off`: how far the picture's turn is off, rad. */
static void frame(struct world *world, double off)
{
    struct fv_imu_clock_frame given = {.stamp_ns = world->now_ns};
    double w[3], E[9];
    for (int i = 0; i < 3; i++) {
        w[i] = off + frame_sigma * fv_random_normal(&world->random);
        given.covariance[4 * i] = frame_sigma * frame_sigma;
    }
    fv_so3_exp(w, E);
    fv_multiply33(world->R, E, given.R);
    fv_imu_clock_frame(&world->clock, &noise, &given);
}

/* Seconds of samples and frames, of which those in [wrong_s, wrong_s + 1] are off. */
static void go(struct world *world, double seconds, double offset_s, double wrong_s)
{
    const int64_t end_ns = world->now_ns + (int64_t)(seconds * 1e9);
    while (world->now_ns < end_ns) {
        const double t = (double)world->now_ns * 1e-9;
        sample(world, offset_s);
        if (world->now_ns % FRAME_NS == 0) frame(world, t >= wrong_s && t < wrong_s + 1 ? 0.2 : 0);
        turn_on(world, SAMPLE_NS);
    }
}

static double error_of(const struct world *world, double offset_s)
{
    return fv_abs(world->clock.offset_s - offset_s);
}

static void test_offsets_are_found(void **state)
{
    (void)state;
    int found = 0;
    double nees = 0;
    for (uint64_t seed = 1; seed <= 50; seed++) {
        static struct world world;
        const double offset_s = ((double)(seed * 17 % 41) - 20) * 1e-3;
        begin(&world, SHAKEN, seed);
        go(&world, 10, offset_s, 1e9);
        const double off = error_of(&world, offset_s), sigma = fv_imu_clock_sigma(&world.clock);
        found += off < 1e-3;
        nees += off * off / (sigma * sigma) / 50;
        assert_true(sigma < 1e-3 && off < 4 * sigma);
        for (int i = 0; i < 3; i++)
            assert_true(fv_abs(world.clock.bias[i] - bias[i]) < 2e-3);
    }
    assert_true(found >= 48);
    assert_true(nees < 1.5);
}

/* At a constant rate another offset is another attitude, and who stands shows nothing. */
static void test_sigma_stays_large_without_change_of_rate(void **state)
{
    (void)state;
    static struct world world;
    for (enum motion motion = STAND; motion <= EVEN; motion++) {
        begin(&world, motion, 3);
        go(&world, 20, 0.012, 1e9);
        assert_true(fv_imu_clock_sigma(&world.clock) > 0.01);
        assert_true(error_of(&world, 0.012) < 4 * fv_imu_clock_sigma(&world.clock));
    }
    world.motion = SHAKEN; /* and then shows it */
    go(&world, 10, 0.012, 1e9);
    assert_true(error_of(&world, 0.012) < 1e-3);
}

static void test_wrong_frames_are_left_out(void **state)
{
    (void)state;
    static struct world world;
    begin(&world, SHAKEN, 5);
    go(&world, 12, -0.015, 5);
    assert_true(error_of(&world, -0.015) < 1.5e-3);
    assert_true(fv_imu_clock_sigma(&world.clock) < 1.5e-3);
}

/* Lost samples and another world cost the attitude alone; a clock that leapt, what was known. */
static void test_gaps_worlds_and_leaps(void **state)
{
    (void)state;
    static struct world world;
    begin(&world, SHAKEN, 7);
    go(&world, 10, 0.008, 1e9);
    turn_on(&world, 4 * (int64_t)FRAME_NS);
    go(&world, 5, 0.008, 1e9);
    assert_true(error_of(&world, 0.008) < 1e-3);
    memcpy(world.R, (double[9]){0, -1, 0, 1, 0, 0, 0, 0, 1}, sizeof world.R);
    fv_imu_clock_restart(&world.clock);
    go(&world, 5, 0.008, 1e9);
    assert_true(error_of(&world, 0.008) < 1e-3);
    fv_imu_clock_jump(&world.clock);
    assert_true(fv_imu_clock_sigma(&world.clock) > 0.02);
    go(&world, 10, -0.019, 1e9);
    assert_true(error_of(&world, -0.019) < 1e-3);
}

/* More samples than can wait, before the first frame and after the last for some time. */
static void test_samples_without_frames(void **state)
{
    (void)state;
    static struct world world;
    begin(&world, SHAKEN, 9);
    for (int round = 0; round < 3; round++) {
        for (int n = 0; n < 500; n++) {
            sample(&world, 0.005);
            turn_on(&world, SAMPLE_NS);
        }
        go(&world, 6, 0.005, 1e9);
    }
    assert_true(error_of(&world, 0.005) < 1e-3);
    assert_true(fv_imu_clock_sigma(&world.clock) < 1e-3);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_offsets_are_found),
        cmocka_unit_test(test_sigma_stays_large_without_change_of_rate),
        cmocka_unit_test(test_wrong_frames_are_left_out),
        cmocka_unit_test(test_gaps_worlds_and_leaps),
        cmocka_unit_test(test_samples_without_frames),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

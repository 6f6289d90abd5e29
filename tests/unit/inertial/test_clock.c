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

enum motion { STAND, EVEN, SHAKEN, ROLLED };

/* Rate at a time on the camera's clock, rad/s. */
static void rate_at(enum motion motion, double t, double rate[3])
{
    for (int i = 0; i < 3; i++) {
        rate[i] = motion == STAND ? 0 : 0.3 * (i + 1);
        if (motion == ROLLED) rate[i] = i == 0 ? 0.5 * sin(1.1 * t) : 0;
        if (motion == SHAKEN) rate[i] = 0.5 * sin((1.1 + 0.7 * i) * t + i);
    }
}

struct world {
    struct fv_imu_clock clock;
    struct fv_random random;
    enum motion motion;
    double R[9];     /* of the sensor now, as it is stated to be mounted */
    double mount[9]; /* R_stated_true */
    double scale;    /* of what the gyro says */
    int64_t now_ns;
};

static void begin_mounted(struct world *world, enum motion motion, uint64_t seed,
                          double mount_sigma)
{
    static const double identity[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    memset(world, 0, sizeof *world);
    fv_imu_clock_init(&world->clock, mount_sigma);
    memcpy(world->mount, identity, sizeof identity);
    world->scale = 1;
    fv_random_seed(&world->random, seed);
    world->motion = motion;
    memcpy(world->R, identity, sizeof identity);
}

static void begin(struct world *world, enum motion motion, uint64_t seed)
{
    begin_mounted(world, motion, seed, 0);
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
    double stated[3];
    rate_at(world->motion, (double)world->now_ns * 1e-9, stated);
    fv_rotate_back3(world->mount, stated, reading.gyro);
    for (int i = 0; i < 3; i++)
        reading.gyro[i] = world->scale * reading.gyro[i] + bias[i] +
                          gyro_noise * sqrt(200) * fv_random_normal(&world->random);
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

/* ---- the mount ------------------------------------------------------------------------------- */

static const double degree = 3.14159265358979 / 180, mount_sigma = 0.1;

static void begin_turned(struct world *world, enum motion motion, uint64_t seed,
                         const double turned[3])
{
    begin_mounted(world, motion, seed, mount_sigma);
    fv_so3_exp(turned, world->mount);
}

/* Squared error over variance, summed over the axes; *off: the error, rad. */
static double mount_nees(const struct world *world, const double turned[3], double *off)
{
    struct fv_imu_clock_mount mount;
    double sum = 0, squared = 0;
    fv_imu_clock_mount(&world->clock, &mount);
    for (int i = 0; i < 3; i++) {
        const double d = mount.error[i] - turned[i];
        squared += d * d;
        sum += d * d / (mount.sigma[i] * mount.sigma[i]);
    }
    *off = sqrt(squared);
    return sum;
}

/* Together with the offset between the clocks. */
static void test_a_wrong_mount_is_found_within_its_sigma(void **state)
{
    (void)state;
    double nees = 0;
    for (uint64_t seed = 1; seed <= 30; seed++) {
        static struct world world;
        struct fv_imu_clock_mount mount;
        double turned[3] = {0}, off;
        const double angle = (seed & 1 ? 5 : -5) * degree, offset_s = 1e-3 * ((double)seed - 15);
        turned[seed % 3] = seed > 27 ? 3 * angle : angle;
        begin_turned(&world, SHAKEN, seed, turned);
        go(&world, 10, offset_s, 1e9);
        nees += mount_nees(&world, turned, &off) / 30;
        fv_imu_clock_mount(&world.clock, &mount);
        assert_true(off < 1 * degree);
        assert_true(mount.angle_sigma < 0.5 * degree);
        assert_true(fv_abs(mount.angle - fv_abs(turned[seed % 3])) < 4 * mount.angle_sigma);
        assert_true(error_of(&world, offset_s) < 4 * fv_imu_clock_sigma(&world.clock));
        assert_true(fv_imu_clock_sigma(&world.clock) < 5e-3);
    }
    assert_true(nees < 4.5);
}

/* Neither the offset between the clocks nor a gyro that says 1 % too much is taken for a turn. */
static void test_a_right_mount_stays_right(void **state)
{
    (void)state;
    static const double none[3] = {0};
    for (uint64_t seed = 1; seed <= 30; seed++) {
        static struct world world;
        double off;
        begin_turned(&world, SHAKEN, seed, none);
        world.scale = seed % 3 == 0 ? 1.01 : 1;
        for (int n = 0; n < 10; n++) {
            go(&world, 2, 1e-3 * ((double)seed - 15), 1e9);
            assert_true(mount_nees(&world, none, &off) < 16);
        }
        assert_true(off < 0.7 * degree);
    }
}

/* A turn about one axis shows the two errors across it, and standing none. */
static void test_one_axis_shows_nothing_about_itself(void **state)
{
    (void)state;
    static const double turned[3] = {0.05, -0.03, 0.06};
    static struct world world;
    struct fv_imu_clock_mount mount;
    double off;
    begin_turned(&world, STAND, 4, turned);
    go(&world, 10, 0, 1e9);
    fv_imu_clock_mount(&world.clock, &mount);
    for (int i = 0; i < 3; i++)
        assert_true(mount.sigma[i] > 0.9 * mount_sigma);
    world.motion = ROLLED;
    go(&world, 10, 0, 1e9);
    fv_imu_clock_mount(&world.clock, &mount);
    assert_true(mount.sigma[0] > 0.5 * mount_sigma);
    assert_true(mount.sigma[1] < 1 * degree && mount.sigma[2] < 1 * degree);
    assert_true(mount_nees(&world, turned, &off) < 16);
    world.motion = SHAKEN;
    go(&world, 10, 0, 1e9);
    assert_true(mount_nees(&world, turned, &off) < 16 && off < 0.7 * degree);
}

/* Between samples that are half a second apart nobody knows the turn: attitudes begin anew, and no
 * frame is refused for it. */
static void test_missing_samples_are_not_made_up(void **state)
{
    (void)state;
    static struct world world;
    begin(&world, SHAKEN, 4);
    go(&world, 10, 0.005, 1e9);
    const uint64_t frames = world.clock.frames;
    for (int n = 0; n < 120; n++) /* 0.6 s */
        turn_on(&world, SAMPLE_NS);
    go(&world, 0.06, 0.005, 1e9);
    assert_int_equal(world.clock.refused, 0);
    go(&world, 2, 0.005, 1e9);
    assert_true(world.clock.frames > frames + 30);
    assert_true(error_of(&world, 0.005) < 1e-3);
}

/* A clock that is suddenly another, which nobody says: frames do not fit, so offset and bias are
 * doubted, and the new one is found. */
static void test_another_clock_is_found_again(void **state)
{
    (void)state;
    static struct world world;
    begin(&world, SHAKEN, 9);
    go(&world, 15, 0, 1e9);
    assert_true(fv_imu_clock_sigma(&world.clock) < 5e-4);
    go(&world, 6, 0.02, 1e9);
    assert_true(error_of(&world, 0.02) < 1.5e-3);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_offsets_are_found),
        cmocka_unit_test(test_sigma_stays_large_without_change_of_rate),
        cmocka_unit_test(test_wrong_frames_are_left_out),
        cmocka_unit_test(test_gaps_worlds_and_leaps),
        cmocka_unit_test(test_samples_without_frames),
        cmocka_unit_test(test_a_wrong_mount_is_found_within_its_sigma),
        cmocka_unit_test(test_a_right_mount_stays_right),
        cmocka_unit_test(test_one_axis_shows_nothing_about_itself),
        cmocka_unit_test(test_missing_samples_are_not_made_up),
        cmocka_unit_test(test_another_clock_is_found_again),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

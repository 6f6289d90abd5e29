/* The inertial estimator on analytic motions: what it claims, and how sure it says it is. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/elementary.h"
#include "geometry/vec.h"
#include "inertial/estimator.h"

enum { RATE_HZ = 200, EVERY = 50, BLOCK_BYTES = 2 << 20 };

static const double gravity = 9.80665, unit_m = 0.4; /* metres per unit of world */
static const struct fv_imu_biases truth = {{0.03, -0.02, 0.05}, {0.08, -0.05, 0.06}};

static uint8_t block[BLOCK_BYTES] __attribute__((aligned(64)));
static struct fv_inertial inertial;
static struct fv_se3 T_cam_imu;
/* The map tilts by so much each second, which the estimator is prepared for, or not; from one
 * station to the next it leaps once, by so many sigmas; its unit grows by so much each second. */
static double tilt_rate, tilt_drift, leap, unit_rate;
static double world_turn[3] = {0.5, 1.1, -0.4}; /* of its axes against upright ones */

static void begin(double metric_sigma)
{
    struct fv_arena arena;
    struct fv_inertial_config config = {.noise = {1.7e-4 * 1.7e-4, 2e-3 * 2e-3},
                                        .acceleration_walk = 3e-3 * 3e-3,
                                        .gravity = gravity};
    const double turn[3] = {1.2, -0.7, 0.9}, lever[3] = {0.05, -0.02, 0.03};
    fv_so3_exp(turn, T_cam_imu.R);
    fv_copy3(lever, T_cam_imu.t);
    config.T_cam_imu = T_cam_imu;
    memset(block, 0, sizeof block);
    fv_arena_init(&arena, block, sizeof block);
    fv_inertial_carve(&inertial, &config, &arena);
    assert_false(arena.exhausted);
    fv_inertial_init(&inertial);
    fv_inertial_restart(&inertial, metric_sigma, 1e-8 + unit_rate * unit_rate,
                        tilt_drift * tilt_drift);
}

enum motion { LIVELY, LIVELY_THEN_HOVER, STEADY, HOVER, SPIN };

/* Attitude and position of the sensor, z up. */
static void pose_at(enum motion motion, double t, struct fv_se3 *T)
{
    const double stop = 9, lively = motion == LIVELY || motion == LIVELY_THEN_HOVER,
                 spin = lively || motion == SPIN;
    if (motion == LIVELY_THEN_HOVER && t > stop) t = stop + 0.5 * (1 - exp(2 * (stop - t)));
    const double turn[3] = {0.3 * spin * sin(1.3 * t), 0.2 * spin * sin(0.9 * t + 1),
                            0.6 * spin * sin(0.7 * t)};
    fv_so3_exp(turn, T->R);
    T->t[0] = lively * 0.8 * sin(1.1 * t) + (motion == STEADY) * 1.5 * t;
    T->t[1] = lively * 0.6 * cos(1.7 * t);
    T->t[2] = lively * 0.5 * sin(1.4 * t + 0.5);
}

static void velocity_at(enum motion motion, double t, double v[3])
{
    const double h = 1e-4;
    struct fv_se3 a, b;
    pose_at(motion, t - h, &a);
    pose_at(motion, t + h, &b);
    for (int i = 0; i < 3; i++)
        v[i] = (b.t[i] - a.t[i]) / (2 * h);
}

/* What the sensor reads over [t - step, t], as the mean of the interval. */
static void sample_at(enum motion motion, double t, struct fv_random *random, double gyro[3],
                      double acceleration[3])
{
    const double step = 1.0 / RATE_HZ;
    struct fv_se3 a, b, half;
    double v0[3], v1[3], M[9], f[3];
    pose_at(motion, t - step, &a);
    pose_at(motion, t, &b);
    pose_at(motion, t - step / 2, &half);
    velocity_at(motion, t - step, v0);
    velocity_at(motion, t, v1);
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++)
            M[3 * r + c] = a.R[r] * b.R[c] + a.R[3 + r] * b.R[3 + c] + a.R[6 + r] * b.R[6 + c];
    fv_so3_log(M, gyro);
    for (int i = 0; i < 3; i++)
        f[i] = (v1[i] - v0[i]) / step + (i == 2 ? gravity : 0);
    fv_rotate_back3(half.R, f, acceleration);
    for (int i = 0; i < 3; i++) {
        gyro[i] =
            gyro[i] / step + truth.gyro[i] + 1.7e-4 * sqrt(RATE_HZ) * fv_random_normal(random);
        acceleration[i] += truth.acceleration[i] + 2e-3 * sqrt(RATE_HZ) * fv_random_normal(random);
    }
}

/* World is turned and in a unit of its own; its gravity. */
static struct fv_se3 T_world_up, T_tilted_up;
static void station_at(enum motion motion, double t, double noise, struct fv_random *random,
                       struct fv_inertial_pose *pose)
{
    struct fv_se3 T_up_imu, T_imu_cam;
    pose_at(motion, t, &T_up_imu);
    fv_se3_invert(&T_cam_imu, &T_imu_cam);
    fv_se3_compose(&T_up_imu, &T_imu_cam, &pose->T_world_cam);
    const double tilted[3] = {0.8 * tilt_rate * t, -0.6 * tilt_rate * t, 0};
    double tilt[9];
    fv_so3_exp(tilted, tilt);
    fv_multiply33(T_world_up.R, tilt, T_tilted_up.R);
    fv_se3_compose(&T_tilted_up, &pose->T_world_cam, &pose->T_world_cam);
    pose->position_sigma = noise;
    pose->turn_sigma = 5e-4;
    double turn[6] = {0, 0, 0, 0, 0, 0}, E[9], R[9];
    for (int i = 0; i < 3; i++) {
        pose->T_world_cam.t[i] = pose->T_world_cam.t[i] / (unit_m * (1 + unit_rate * t)) +
                                 noise * fv_random_normal(random);
        if (leap != 0 && fabs(t - 4) < 0.1) pose->T_world_cam.t[i] += noise * leap;
        turn[3 + i] = 5e-4 * fv_random_normal(random);
    }
    fv_so3_exp(turn + 3, E);
    fv_multiply33(pose->T_world_cam.R, E, R);
    memcpy(pose->T_world_cam.R, R, sizeof R);
}

static bool prior_known; /* when the last estimate began */
static double sank;      /* by which factor gravity's sigma fell the most, once there was a prior */
static double worst;     /* of the estimates since `leap`, by how much the scale is off */
static void estimate(void)
{
    uint32_t units = 0;
    if (!fv_inertial_wanted(&inertial)) return;
    fv_inertial_begin(&inertial);
    prior_known = inertial.state->prior.known;
    const double sigma = fv_inertial_result(&inertial)->gravity_sigma;
    while (fv_inertial_busy(&inertial)) {
        (void)fv_inertial_unit(&inertial);
        assert_true(++units < 1000);
    }
    const struct fv_inertial_estimate *e = fv_inertial_result(&inertial);
    const double off = fabs(e->own.scale / unit_m - 1);
    if (e->stamp_ns >= 3000000000 && off > worst) worst = off;
    if (prior_known && sigma > sank * e->gravity_sigma) sank = sigma / e->gravity_sigma;
}

/* Seconds of a motion, with stations four times a second. */
static void run(enum motion motion, double seconds, double noise, uint64_t seed)
{
    struct fv_random random;
    const struct fv_inertial_owner nobody = {.slot = 0};
    fv_random_seed(&random, seed);
    fv_se3_identity(&T_world_up);
    fv_so3_exp(world_turn, T_world_up.R);
    for (int n = 0; n <= seconds * RATE_HZ; n++) {
        double gyro[3], acceleration[3];
        const double t = 1 + (double)n / RATE_HZ;
        sample_at(motion, t, &random, gyro, acceleration);
        /* a mean is one of the middle of its interval */
        fv_inertial_take(&inertial, (int64_t)n * 1000000000 / RATE_HZ - 500000000 / RATE_HZ, gyro,
                         acceleration);
        if (n % EVERY != 0) continue;
        struct fv_inertial_pose pose;
        station_at(motion, t, noise, &random, &pose);
        fv_inertial_add_station(&inertial, (int64_t)n * 1000000000 / RATE_HZ, &nobody, &pose);
        estimate();
    }
}

/* More stations, where the motion is at `t`, from an instant on. */
static void add_stations(enum motion motion, double t, int64_t first_ns, int count)
{
    const struct fv_inertial_owner nobody = {.slot = 0};
    struct fv_random random;
    struct fv_inertial_pose pose;
    fv_random_seed(&random, 9);
    station_at(motion, t, 0.005, &random, &pose);
    for (int k = 0; k < count; k++)
        fv_inertial_add_station(&inertial, first_ns + k, &nobody, &pose);
}

static double gravity_error(void)
{
    const double up[3] = {0, 0, -1};
    double down[3];
    fv_rotate3(T_tilted_up.R, up, down);
    return acos(fv_dot3(down, fv_inertial_result(&inertial)->own.down));
}

static void test_lively_motion_gives_scale_and_gravity(void **state)
{
    (void)state;
    double nees = 0, sigma = 0, misfit = 0;
    enum { SEEDS = 24 };
    for (uint64_t seed = 1; seed <= SEEDS; seed++) {
        begin(0);
        run(LIVELY, 6, 0.005, seed);
        const struct fv_inertial_estimate *e = fv_inertial_result(&inertial);
        assert_true(e->known);
        const double off = e->own.scale / unit_m - 1;
        assert_true(e->scale_sigma < 0.02);
        assert_true(fabs(off) < 4 * e->scale_sigma);
        assert_true(gravity_error() < 4 * 1.42 * e->gravity_sigma);
        assert_true(gravity_error() < 0.02);
        for (int i = 0; i < 3; i++)
            assert_true(fabs(e->shared.gyro_bias[i] - truth.gyro[i]) < 2e-3);
        nees += off * off / (e->scale_sigma * e->scale_sigma);
        sigma += e->scale_sigma;
        misfit += e->misfit;
    }
    assert_true(misfit / SEEDS > 0.85 && misfit / SEEDS < 1.15);
    assert_true(nees / SEEDS > 0.4 && nees / SEEDS < 1.9);
    assert_true(sigma / SEEDS < 0.01);
}

/* Longer than the window: what leaves it is handed on. */
static void test_window_moves_on(void **state)
{
    (void)state;
    begin(0);
    run(LIVELY, 30, 0.005, 3);
    const struct fv_inertial_estimate *e = fv_inertial_result(&inertial);
    assert_true(e->known && e->stations + 1 >= FV_INERTIAL_WINDOW &&
                e->stations <= FV_INERTIAL_WINDOW);
    assert_true(prior_known && inertial.state->prior.known);
    assert_true(fabs(e->own.scale / unit_m - 1) < 4 * e->scale_sigma);
    assert_true(e->scale_sigma < 0.006);
    double v[3], turned[3], off = 0;
    velocity_at(LIVELY, 1 + (double)e->stamp_ns * 1e-9, v);
    fv_rotate3(T_world_up.R, v, turned);
    for (int i = 0; i < 3; i++)
        off += (e->own.velocity[i] - turned[i]) * (e->own.velocity[i] - turned[i]);
    assert_true(sqrt(off) < 0.03);
    for (int i = 0; i < 3; i++)
        assert_true(fabs(e->own.acceleration_bias[i] - truth.acceleration[i]) < 0.03);
}

/* Directions across gravity are taken by which of its components is least. Where two are the same
 * they change with every estimate, and what is handed on must not: at rest gravity's direction
 * cannot be told from a bias, so no estimate makes it known all at once. */
static void test_axes_of_world_tell_nothing(void **state)
{
    (void)state;
    const double up[3] = {0, 0, -1}, down[3] = {0.5, 0.70710678118654752, 0.5};
    double usual[3], R[9];
    fv_copy3(world_turn, usual);
    for (int even = 0; even < 2; even++) {
        if (even) fv_so3_between(up, down, R);
        if (even) fv_so3_log(R, world_turn);
        begin(0.005);
        sank = 0;
        run(HOVER, 40, 0.002, 3);
        fv_copy3(usual, world_turn);
        const struct fv_inertial_estimate *e = fv_inertial_result(&inertial);
        assert_true(e->known && prior_known && inertial.state->gone > 10);
        assert_true(gravity_error() < 4 * 1.42 * e->gravity_sigma && e->gravity_sigma > 5e-3);
        if (sank > 1.3) fail_msg("gravity's sigma fell to a part of %.2f", 1 / sank);
    }
}

/* What was learnt while the camera moved holds once those stations are gone and it hovers. */
static void test_what_left_the_window_is_not_forgotten(void **state)
{
    (void)state;
    begin(0);
    run(LIVELY_THEN_HOVER, 36, 0.005, 3);
    const struct fv_inertial_estimate *e = fv_inertial_result(&inertial);
    assert_true(prior_known && e->known);
    assert_true(e->scale_sigma < 0.01);
    assert_true(fabs(e->own.scale / unit_m - 1) < 4 * e->scale_sigma);
}

/* There is room for stations that come while an estimate is made; one that is broken off, since
 * there is none left, is made anew at once. */
static void test_an_estimate_that_is_broken_off_is_made_anew(void **state)
{
    (void)state;
    begin(0);
    run(LIVELY, 24.5, 0.005, 3);
    assert_false(fv_inertial_wanted(&inertial));
    fv_inertial_begin(&inertial);
    assert_true(fv_inertial_unit(&inertial));
    assert_int_equal(inertial.state->count, FV_INERTIAL_WINDOW);
    add_stations(LIVELY, 25.6, 24600000000, FV_INERTIAL_ROOM);
    assert_true(fv_inertial_busy(&inertial));
    add_stations(LIVELY, 25.6, 24700000000, 1);
    assert_true(inertial.state->prior.known);
    assert_false(fv_inertial_busy(&inertial));
    assert_true(fv_inertial_wanted(&inertial));
}

/* Broken off while the oldest are eliminated, what they hand on is of two passes: none of it is
 * used. */
static void test_what_is_of_two_passes_is_not_handed_on(void **state)
{
    (void)state;
    begin(0);
    run(LIVELY, 24.5, 0.005, 3);
    fv_inertial_begin(&inertial);
    do
        assert_true(fv_inertial_unit(&inertial));
    while (inertial.state->phase != FV_INERTIAL_ELIMINATE || inertial.state->next == 0);
    assert_true(inertial.state->next < FV_INERTIAL_ROOM);
    add_stations(LIVELY, 25.6, 24600000000, FV_INERTIAL_ROOM + 1);
    assert_false(fv_inertial_busy(&inertial) || inertial.state->prior.known);
}

/* Gravity is where the map has it now, though it has tilted by a degree and a half on the way. */
static void test_gravity_follows_a_map_that_tilts(void **state)
{
    (void)state;
    for (int prepared = 0; prepared < 2; prepared++) {
        tilt_rate = 2e-3;
        tilt_drift = prepared ? 2e-3 : 0;
        begin(0);
        run(LIVELY, 12, 0.005, 5);
        tilt_rate = tilt_drift = 0;
        const struct fv_inertial_estimate *e = fv_inertial_result(&inertial);
        assert_true(e->known);
        if (prepared)
            assert_true(gravity_error() < 3e-3 && gravity_error() < 3 * 1.42 * e->gravity_sigma);
        else
            assert_true(gravity_error() > 6e-3);
    }
}

/* One station that is far from where it says leaves the others as they are, in the estimate that it
 * comes to as in those after. It states how far off it is from then on, and no other does. */
static void test_a_station_that_is_far_off_counts_for_less(void **state)
{
    (void)state;
    uint32_t corrected = 0;
    leap = 60;
    begin(0);
    worst = 0;
    run(LIVELY, 8, 0.005, 7);
    leap = 0;
    const struct fv_inertial_estimate *e = fv_inertial_result(&inertial);
    assert_true(e->known && e->misfit < 1.3);
    assert_true(e->scale_sigma < 0.01);
    assert_true(fabs(e->own.scale / unit_m - 1) < 4 * e->scale_sigma);
    assert_true(gravity_error() < 0.01);
    assert_true(worst < 0.02);
    for (uint32_t i = 0; i < fv_inertial_station_count(&inertial); i++) {
        const struct fv_inertial_station *s = fv_inertial_station_at(&inertial, i);
        if (s->pose.position_sigma == 0.005 && s->pose.turn_sigma == 5e-4) continue;
        assert_true(s->stamp_ns == 3000000000);
        assert_true(s->pose.position_sigma > 0.4 && s->pose.position_sigma < 0.7);
        corrected++;
    }
    assert_int_equal(corrected, 1);
}

/* The least of the errors is where it is, whatever the estimate begins from: gravity's direction at
 * the oldest station, which a prior holds, and at one in the middle, which its neighbours hold. */
static void test_an_estimate_comes_back_to_where_it_was(void **state)
{
    (void)state;
    static const double tilt[3] = {4e-3, 3e-3, -2e-3};
    tilt_drift = 3e-4;
    begin(0);
    run(LIVELY, 26, 0.005, 3);
    tilt_drift = 0;
    assert_true(inertial.state->prior.known);
    for (int pass = 0; pass < 4; pass++) { /* until nothing moves any more */
        inertial.state->waiting = FV_INERTIAL_STATIONS_PER_ESTIMATE;
        estimate();
    }
    const uint32_t count = fv_inertial_station_count(&inertial);
    for (uint32_t i = 0; i < count; i += count / 2) {
        struct fv_inertial_own *own = &fv_inertial_station_at(&inertial, i)->now;
        double was[3], off[3];
        fv_copy3(own->down, was);
        for (int k = 0; k < 3; k++)
            own->down[k] += tilt[k];
        (void)fv_normalise3(own->down);
        for (int pass = 0; pass < 4; pass++) {
            inertial.state->waiting = FV_INERTIAL_STATIONS_PER_ESTIMATE;
            estimate();
        }
        fv_subtract3(own->down, was, off);
        assert_true(fv_norm3(off) < 2e-5);
    }
}

/* Each third station makes an estimate worth while. */
static void test_every_third_station_asks_for_an_estimate(void **state)
{
    (void)state;
    const struct fv_inertial_owner nobody = {.slot = 0};
    struct fv_random random;
    struct fv_inertial_pose pose;
    begin(0);
    fv_random_seed(&random, 9);
    station_at(HOVER, 1, 0.005, &random, &pose);
    for (int k = 1; k <= 6; k++) {
        fv_inertial_add_station(&inertial, 100000000 * (int64_t)k, &nobody, &pose);
        assert_true(fv_inertial_wanted(&inertial) == (k % 3 == 0));
        estimate();
    }
}

/* Those that were corrected before count among the fourth that may be wrong. */
static void test_no_more_than_a_fourth_is_corrected(void **state)
{
    (void)state;
    for (uint32_t before = 0; before < 10; before += 9) {
        begin(0);
        run(LIVELY, 8, 0.003, 6);
        for (uint32_t i = 0; i < before; i++)
            fv_inertial_station_at(&inertial, i)->corrected = true;
        struct fv_inertial_station *moved = fv_inertial_station_at(&inertial, 20);
        moved->pose.T_world_cam.t[1] += 0.3;
        inertial.state->waiting = FV_INERTIAL_STATIONS_PER_ESTIMATE;
        estimate();
        assert_true(inertial.state->taking_part > 30 && inertial.state->taking_part < 36);
        assert_int_equal(moved->corrected, before == 0);
        assert_int_equal(moved->pose.position_sigma > 0.1, before == 0);
    }
}

/* A sensor that sits otherwise than stated is a misfit, and no poses are corrected for it. */
static void test_a_wrong_mount_is_a_misfit(void **state)
{
    (void)state;
    for (uint64_t seed = 1; seed <= 4; seed++) {
        const double off[3] = {0.05, -0.04, 0.04};
        double turn[9], R[9];
        begin(0);
        fv_so3_exp(off, turn);
        fv_multiply33(inertial.config.T_cam_imu.R, turn, R);
        memcpy(inertial.config.T_cam_imu.R, R, sizeof R);
        run(LIVELY, 8, 0.003, seed);
        assert_true(fv_inertial_result(&inertial)->misfit > 8);
    }
}

/* Longer than the window, of a map that tilts steadily: gravity of the whole way is that of its
 * middle, and the tilts differ by what they do. */
static void test_gravity_of_the_whole_way(void **state)
{
    (void)state;
    const double up[3] = {0, 0, -1};
    double middle[3];
    tilt_rate = tilt_drift = 2e-3;
    begin(0);
    run(LIVELY, 30, 0.002, 11);
    const struct fv_inertial_estimate *e = fv_inertial_result(&inertial);
    const double way_s = (double)e->stamp_ns * 1e-9, t = 1 + way_s / 2;
    const double tilted[3] = {0.8 * tilt_rate * t, -0.6 * tilt_rate * t, 0};
    double tilt[9], R[9];
    fv_so3_exp(tilted, tilt);
    fv_multiply33(T_world_up.R, tilt, R);
    fv_rotate3(R, up, middle);
    assert_true(e->known && inertial.state->gone > 10);
    assert_true(acos(fv_dot3(middle, e->mean_down)) < 4e-3);
    assert_true(acos(fv_dot3(middle, e->own.down)) > 0.02);
    const double variance = tilt_rate * tilt_rate * way_s * way_s / 24;
    assert_true(e->down_variance > 0.7 * variance && e->down_variance < 1.3 * variance);
    tilt_rate = tilt_drift = 0;
}

/* Longer than the window: the scale here is that of the end, that of the whole way its mean. */
static void test_scale_of_the_whole_way(void **state)
{
    (void)state;
    unit_rate = 3e-3;
    begin(0);
    run(LIVELY, 30, 0.002, 11);
    const struct fv_inertial_estimate *e = fv_inertial_result(&inertial);
    assert_true(e->known && inertial.state->gone > 10);
    const double from = 1, to = 1 + (double)e->stamp_ns * 1e-9;
    assert_true(fabs(e->own.scale / (unit_m * (1 + unit_rate * to)) - 1) < 0.02);
    assert_true(fabs(exp(e->log_scale) / (unit_m * (1 + unit_rate * (from + to) / 2)) - 1) < 0.008);
    unit_rate = 0;
}

static void test_no_scale_without_acceleration(void **state)
{
    (void)state;
    static const enum motion motions[] = {STEADY, HOVER, SPIN};
    for (uint32_t m = 0; m < 3; m++)
        for (uint64_t seed = 1; seed <= 8; seed++) {
            begin(0);
            run(motions[m], 12, 0.005, seed);
            const struct fv_inertial_estimate *e = fv_inertial_result(&inertial);
            if (!e->known) continue;
            assert_true(e->scale_sigma > 0.04 ||
                        fabs(e->own.scale / unit_m - 1) < 3 * e->scale_sigma);
        }
}

/* With the scale known, gravity and velocity follow even at rest. */
static void test_metric_poses_at_rest(void **state)
{
    (void)state;
    begin(0.003);

    run(HOVER, 3, 0.002, 1);
    const struct fv_inertial_estimate *e = fv_inertial_result(&inertial);
    assert_true(e->known && e->scale_sigma < 0.01);
    assert_true(gravity_error() < 3 * 1.42 * e->gravity_sigma);
    assert_true(e->gravity_sigma > 0.01); /* tilt cannot be told from the acceleration bias */
    assert_true(fv_norm3(e->own.velocity) < 0.01);
    for (int i = 0; i < 3; i++)
        assert_true(fabs(e->shared.gyro_bias[i] - truth.gyro[i]) < 3e-3);
}

/* A sensor that is shaken is believed less. */
static void test_shaking_is_noise(void **state)
{
    (void)state;
    struct fv_random random;
    begin(0);
    fv_random_seed(&random, 4);
    for (int n = 0; n < 1000; n++) {
        double gyro[3], acceleration[3];
        sample_at(LIVELY, 1 + n * 0.005, &random, gyro, acceleration);
        if (n == 500) {
            assert_true(inertial.state->noise.gyro == inertial.config.noise.gyro);
            assert_true(inertial.state->noise.acceleration == inertial.config.noise.acceleration);
        }
        for (int i = 0; n >= 500 && i < 3; i++)
            acceleration[i] += 0.7 * fv_random_normal(&random);
        fv_inertial_take(&inertial, n * 5000000LL, gyro, acceleration);
    }
    const double sigma = sqrt(inertial.state->noise.acceleration * RATE_HZ);
    assert_true(inertial.state->noise.gyro == inertial.config.noise.gyro);
    assert_true(sigma > 0.13 && sigma < 0.19); /* a fourth, but for what is forgotten slowly */
}

/* A second without samples cuts the link: the estimate begins anew, and the biases stay known. */
static void test_missing_samples_cut_the_link(void **state)
{
    (void)state;
    begin(0);
    run(LIVELY, 8, 0.005, 2);
    add_stations(LIVELY, 10, 9000000000, FV_INERTIAL_STATIONS_PER_ESTIMATE);
    struct fv_random random;
    fv_random_seed(&random, 10);
    double gyro[3], acceleration[3];
    sample_at(LIVELY, 10.005, &random, gyro, acceleration);
    fv_inertial_take(&inertial, 9005000000, gyro, acceleration);
    estimate();
    assert_false(fv_inertial_result(&inertial)->known);
    assert_true(inertial.state->cuts > 0);
    for (int i = 0; i < 3; i++)
        assert_true(fabs(inertial.state->shared.gyro_bias[i] - truth.gyro[i]) < 2e-3);
    assert_true(inertial.state->bias_sigma[0] < 5e-3);
}

static void test_too_many_samples_cut_the_link(void **state)
{
    (void)state;
    const struct fv_inertial_owner nobody = {.slot = 0};
    const double gyro[3] = {0, 0, 0}, acceleration[3] = {0, 0, 9.8};
    struct fv_random random;
    struct fv_inertial_pose pose;
    begin(0);
    fv_random_seed(&random, 9);
    station_at(HOVER, 1, 0.005, &random, &pose);
    fv_inertial_add_station(&inertial, 0, &nobody, &pose);
    for (int k = 0; k < FV_INERTIAL_SAMPLES_MAX; k++)
        fv_inertial_take(&inertial, 1000000 * (int64_t)(k + 1), gyro, acceleration);
    assert_int_equal(inertial.state->overflows, 0);
    fv_inertial_take(&inertial, 1000000 * (int64_t)(FV_INERTIAL_SAMPLES_MAX + 1), gyro,
                     acceleration);
    assert_int_equal(inertial.state->overflows, 1);
    assert_true(fv_inertial_station_at(&inertial, 0)->cut);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_lively_motion_gives_scale_and_gravity),
        cmocka_unit_test(test_window_moves_on),
        cmocka_unit_test(test_axes_of_world_tell_nothing),
        cmocka_unit_test(test_what_left_the_window_is_not_forgotten),
        cmocka_unit_test(test_an_estimate_that_is_broken_off_is_made_anew),
        cmocka_unit_test(test_gravity_follows_a_map_that_tilts),
        cmocka_unit_test(test_a_station_that_is_far_off_counts_for_less),
        cmocka_unit_test(test_an_estimate_comes_back_to_where_it_was),
        cmocka_unit_test(test_every_third_station_asks_for_an_estimate),
        cmocka_unit_test(test_no_more_than_a_fourth_is_corrected),
        cmocka_unit_test(test_a_wrong_mount_is_a_misfit),
        cmocka_unit_test(test_what_is_of_two_passes_is_not_handed_on),
        cmocka_unit_test(test_scale_of_the_whole_way),
        cmocka_unit_test(test_gravity_of_the_whole_way),
        cmocka_unit_test(test_no_scale_without_acceleration),
        cmocka_unit_test(test_metric_poses_at_rest),
        cmocka_unit_test(test_shaking_is_noise),
        cmocka_unit_test(test_missing_samples_cut_the_link),
        cmocka_unit_test(test_too_many_samples_cut_the_link),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

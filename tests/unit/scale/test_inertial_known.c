/* What the inertial stage makes of an estimate: how sure what it claims is, and turns by the
 * sensor. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "geometry/se3.h"
#include "geometry/vec.h"
#include "odometry/odometry.h"
#include "scale/inertial.h"

enum {
    BLOCK_BYTES = 4 << 20,
    SAMPLES_A_FRAME = 10,
    SAMPLE_NS = 5000000,
    TAIL = FV_INERTIAL_TAIL,
    VELOCITY = 6,
    BIAS = 10,
    DOWN = 13,
    GYRO = 15 /* columns of the covariance */
};

static uint8_t block[BLOCK_BYTES] __attribute__((aligned(64)));
static struct fovea_rig rig;
static struct fv_inertial_stage stage;

/* An estimate to be judged, each variance of its own; one that was claimed before. */
static int set_up(void **state)
{
    (void)state;
    struct fv_arena arena;
    memset(block, 0, sizeof block);
    fv_se3_to_rows(&(struct fv_se3){.R = {1, 0, 0, 0, 1, 0, 0, 0, 1}}, rig.imu.T_body_imu);
    memcpy(rig.cameras[0].T_body_cam, rig.imu.T_body_imu, sizeof rig.imu.T_body_imu);
    fv_arena_init(&arena, block, sizeof block);
    fv_inertial_stage_carve(&stage, &rig, 2, 9.80665, &arena);
    assert_false(arena.exhausted);
    fv_inertial_stage_init(&stage);
    struct fv_inertial_estimate *e = &stage.estimator.state->estimate;
    e->known = true;
    e->stations = 20;
    e->misfit = 1;
    e->own.scale = 2;
    e->own.down[1] = 1;
    e->scale_sigma = 1e-4;
    e->gravity_sigma = 1e-4;
    for (int k = 0; k < TAIL; k++)
        e->covariance[k * (TAIL + 1)] = 1e-6 * (k + 1);
    stage.state->known.claimed = true;
    return 0;
}

static void test_what_is_claimed_is_of_the_right_variables(void **state)
{
    (void)state;
    static const int diagonal[6] = {0, 6, 11, 15, 18, 20};
    struct fv_inertial_estimate *e = &stage.estimator.state->estimate;
    e->log_scale = 1;
    e->covariance[GYRO * TAIL + BIAS + 1] = e->covariance[(BIAS + 1) * TAIL + GYRO] = 5e-7;
    for (int i = 0; i < 3; i++) {
        e->own.acceleration_bias[i] = 0.1 * (i + 1);
        e->shared.gyro_bias[i] = 0.01 * (i + 1);
    }
    fv_inertial_stage_unit(&stage, NULL);
    const struct fv_inertial_known *known = fv_inertial_stage_known(&stage);
    assert_true(known->scale == 2);
    assert_true(known->map_scale > 2.71828 && known->map_scale < 2.71829);
    assert_true(known->gravity[0] == 0 && known->gravity[1] > 9.8 && known->gravity[2] == 0);
    for (int i = 0; i < 3; i++) {
        assert_true(known->biases.gyro[i] == 0.01 * (i + 1));
        assert_true(known->biases.acceleration[i] == 0.1 * (i + 1));
        assert_true(known->bias_covariance[diagonal[i]] == 1e-6 * (GYRO + i + 1));
        assert_true(known->bias_covariance[diagonal[3 + i]] == 1e-6 * (BIAS + i + 1));
    }
    assert_true(known->bias_covariance[4] == 5e-7);
}

/* Gravity of the map is that of its whole way, no surer than the way is straight; what the map
 * brought counts with it, by how sure it is. */
static void test_gravity_of_the_map_is_of_its_whole_way(void **state)
{
    (void)state;
    struct fv_inertial_estimate *e = &stage.estimator.state->estimate;
    const struct fv_map_gravity *gravity = &stage.state->known.map_gravity;
    e->gravity_sigma = 3e-3;
    e->mean_down[2] = 1;
    e->down_variance = 1.6e-5;
    fv_inertial_stage_unit(&stage, NULL);
    const double own = gravity->sigma;
    assert_true(gravity->down[2] == 1 && own > 5e-3 && own < 5.2e-3);
    stage.state->brought = (struct fv_map_gravity){{0.01, 0, 1}, own};
    fv_inertial_stage_unit(&stage, NULL);
    assert_true(gravity->down[0] > 0.00499 && gravity->down[0] < 0.00501);
    assert_true(gravity->sigma > 0.7 * own && gravity->sigma < 0.71 * own);
    stage.state->brought.sigma = own / 100;
    fv_inertial_stage_unit(&stage, NULL);
    assert_true(gravity->down[0] > 0.0099 && gravity->sigma > 1e-3);
}

/* However sure the estimate is, a map by one camera has not one unit everywhere. */
static void test_no_unit_is_surer_than_its_kind(void **state)
{
    (void)state;
    double sigma[2];
    for (int metric = 0; metric < 2; metric++) {
        stage.state->metric = metric;
        fv_inertial_stage_unit(&stage, NULL);
        sigma[metric] = stage.state->known.scale_sigma;
    }
    assert_true(sigma[0] >= 0.01 && sigma[0] < 0.011);
    assert_true(sigma[1] >= 0.005 && sigma[1] < 0.0055);
}

/* What the biases are known to outlives the stations. */
static void test_biases_stay_as_sure_as_they_are(void **state)
{
    (void)state;
    struct fv_inertial_estimate *e = &stage.estimator.state->estimate;
    for (int k = 0; k < 3; k++)
        e->covariance[(BIAS + k) * (TAIL + 1)] = 0.04;
    fv_inertial_restart(&stage.estimator, 0, 1e-8, 1e-8);
    const double *sigma = stage.estimator.state->bias_sigma;
    assert_true(sigma[0] > 0.004 && sigma[0] < 0.01);
    assert_true(sigma[1] > 0.4 && sigma[1] < 0.5);
}

/* The rate is less the bias as estimated now, which no claim and no pose has taken over yet; it
 * serves slow turns once that is known. */
static void test_turns_wait_for_the_bias_and_use_it_at_once(void **state)
{
    (void)state;
    struct fv_inertial_estimate *e = &stage.estimator.state->estimate;
    struct fv_inertial_live *live = &stage.state->live;
    double rate[3];
    live->any_sample = true;
    live->gyro[0] = 0.06;
    live->sum.biases.gyro[0] = 0.01;
    e->shared.gyro_bias[0] = 0.05;
    for (int i = 0; i < 3; i++)
        e->covariance[(GYRO + i) * (TAIL + 1)] = 0.005 * 0.005;
    assert_true(fv_inertial_stage_rate(&stage, 0, rate));
    assert_true(rate[0] > 0.0099 && rate[0] < 0.0101);
    for (int i = 0; i < 3; i++)
        e->covariance[(GYRO + i) * (TAIL + 1)] = 0.03 * 0.03;
    assert_false(fv_inertial_stage_rate(&stage, 0, rate));
    live->gyro[0] = 1;
    assert_true(fv_inertial_stage_rate(&stage, 0, rate));
    live->gyro[0] = 0.06;
    stage.estimator.state->bias_sigma[0] = 0.005; /* a map before knew it */
    e->known = false;
    assert_true(fv_inertial_stage_rate(&stage, 0, rate));
    assert_true(rate[0] > 0.0499 && rate[0] < 0.0501);
}

/* What a frame errs by alone: in the unit of the world, and nothing without a pose. */
static void test_own_sigmas_are_in_the_unit_of_the_world(void **state)
{
    (void)state;
    static struct fv_odometry_state s;
    const struct fv_odometry odometry = {.state = &s};
    double position, turn;
    s.covariance.own_position = 0.02;
    s.covariance.own_turn = 0.001;
    s.pose.map_scale = 4;
    fv_odometry_own_sigmas(&odometry, &position, &turn);
    assert_true(position == 0 && turn == 0);
    s.pose.posed = true;
    fv_odometry_own_sigmas(&odometry, &position, &turn);
    assert_true(position == 0.005 && turn == 0.001);
}

/* A frame with a pose there, SAMPLES_A_FRAME samples of a sensor at rest after the one before. */
static void step(const struct fv_odometry *odometry, int64_t stamp_ns)
{
    for (int k = SAMPLES_A_FRAME; k-- > 0;) {
        const struct fv_imu_reading sample = {.stamp_ns = stamp_ns - k * SAMPLE_NS,
                                              .acceleration = {0, -9.80665, 0}};
        fv_inertial_live_take(&stage.state->live, &stage.estimator.state->noise, &sample);
    }
    fv_inertial_stage_step(&stage, odometry, stamp_ns);
}

/* Metres are known, and poses are about to come. */
static void begin_velocity(struct fv_odometry_state *s)
{
    memset(s, 0, sizeof *s);
    s->pose.map_scale = 1;
    s->pose.posed = true;
    s->pose.state = FOVEA_TRACKING_OK;
    fv_se3_to_rows(&(struct fv_se3){.R = {1, 0, 0, 0, 1, 0, 0, 0, 1}}, s->pose.T_world_cam);
    stage.state->known.scale = 10;
    stage.state->known.gravity[1] = 9.80665;
    stage.state->begun = true;
    stage.state->depth = 5;
    stage.state->station_ns = 40000000; /* too near for the next */
}

/* The first way between two poses gives a velocity as sure as what the frames err by alone makes
 * it, in metres: sqrt(2) times 10 m per unit times somewhat more than .01 units, by .05 s. */
static void test_a_velocity_is_as_sure_as_its_poses(void **state)
{
    (void)state;
    static struct fv_odometry_state s;
    const struct fv_odometry odometry = {.state = &s};
    struct fv_inertial_known *known = &stage.state->known;
    begin_velocity(&s);
    s.covariance.own_position = 0.01;
    step(&odometry, 50000000);
    assert_false(known->moving);
    step(&odometry, 100000000);
    assert_true(known->moving);
    assert_true(known->velocity_sigma > 2.8 && known->velocity_sigma < 4.3);
    assert_true(fv_norm3(known->velocity) < 0.01);
}

/* All ways are off by what the scale is, and so is a velocity: on a way of 3 units in .05 s, 600
 * m/s at 10 m per unit, 2 % are 12 m/s, 7 of them in the mean of the axes. */
static void test_a_velocity_is_no_surer_than_the_scale(void **state)
{
    static struct fv_odometry_state s;
    const struct fv_odometry odometry = {.state = &s};
    double sigma[2];
    for (int i = 0; i < 2; i++) {
        (void)set_up(state);
        begin_velocity(&s);
        stage.state->claimed_sigma = i == 0 ? 0 : 0.02;
        s.covariance.own_position = 0.01;
        step(&odometry, 50000000);
        s.pose.T_world_cam[3] = 3;
        step(&odometry, 100000000);
        sigma[i] = stage.state->known.velocity_sigma;
        s.pose.T_world_cam[3] = 0;
    }
    const double more = sqrt(sigma[1] * sigma[1] - sigma[0] * sigma[0]);
    assert_true(more > 6 && more < 8);
}

/* After two seconds without a picture: each variance of the estimate by its own derivative. */
static void test_what_is_unsure_while_coasting(void **state)
{
    (void)state;
    enum { X = 0, Y = 6, Z = 11, TURN_X = 15 }; /* on the diagonal of the triangle */
    struct fv_inertial_estimate *e = &stage.estimator.state->estimate;
    struct fv_preintegration sum = {.time_s = 2};
    const double R[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1}, g = 9.80665, t = sum.time_s;
    double out[21], *C = e->covariance;
    memcpy(stage.state->live.T_world_imu.R, R, sizeof R);
    stage.state->live.variance = 0.01;
    for (int i = 0; i < 3; i++) {
        sum.position_acceleration[4 * i] = 0.5;
        sum.position_gyro[4 * i] = 0.25;
        sum.turn_gyro[4 * i] = -t;
    }
    e->across[0][0] = e->across[1][2] = 1;
    fv_inertial_stage_coast_covariance(&stage, &sum, R, out);
#define OF(column) C[(column) * (TAIL + 1)]
    for (int i = 0; i < 3; i++) {
        static const int at[3] = {X, Y, Z};
        const double down = i == 0   ? OF(DOWN)
                            : i == 2 ? OF(DOWN + 1)
                                     : 0,
                     expected = t * t * (0.01 + OF(VELOCITY + i)) + 0.25 * OF(BIAS + i) +
                                0.0625 * OF(GYRO + i) + g * t * t / 2 * g * t * t / 2 * down;
        assert_true(out[at[i]] > 0.999999 * expected && out[at[i]] < 1.000001 * expected);
    }
    assert_true(out[TURN_X] > 0.999999 * t * t * OF(GYRO) &&
                out[TURN_X] < 1.000001 * t * t * OF(GYRO));
#undef OF
}

/* Where the pictures do not determine a pose it is not the surest: as unsure as a tenth of the
 * distance of what is seen makes the velocity. */
static void test_a_pose_that_is_not_determined_says_little(void **state)
{
    (void)state;
    static struct fv_odometry_state s;
    const struct fv_odometry odometry = {.state = &s};
    begin_velocity(&s);
    s.covariance.own_position = 0;
    step(&odometry, 50000000);
    step(&odometry, 100000000);
    assert_true(stage.state->known.moving && stage.state->known.velocity_sigma > 50);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(test_what_is_claimed_is_of_the_right_variables, set_up),
        cmocka_unit_test_setup(test_gravity_of_the_map_is_of_its_whole_way, set_up),
        cmocka_unit_test_setup(test_no_unit_is_surer_than_its_kind, set_up),
        cmocka_unit_test_setup(test_biases_stay_as_sure_as_they_are, set_up),
        cmocka_unit_test_setup(test_turns_wait_for_the_bias_and_use_it_at_once, set_up),
        cmocka_unit_test_setup(test_a_velocity_is_as_sure_as_its_poses, set_up),
        cmocka_unit_test_setup(test_a_velocity_is_no_surer_than_the_scale, set_up),
        cmocka_unit_test_setup(test_what_is_unsure_while_coasting, set_up),
        cmocka_unit_test_setup(test_a_pose_that_is_not_determined_says_little, set_up),
        cmocka_unit_test_setup(test_own_sigmas_are_in_the_unit_of_the_world, set_up),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

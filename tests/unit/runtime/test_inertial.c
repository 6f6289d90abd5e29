/* Odometry with an inertial sensor of the simulation: metres and gravity in one announced change,
 * none where the motion does not show them, and what is refused. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "common/sim_body.h"
#include "fovea/fovea.h"
#include "geometry/se3.h"
#include "geometry/vec.h"
#include "runtime/state.h"

static struct sim_rig rig;
static fovea_pose_t body, before;
static uint8_t *dark;      /* instead of the pictures, unless NULL */
static uint32_t map_units; /* that the map's job is granted with each frame; 0: as usual */

#define SHAPE "width=400&height=300&rate=20&imu=200&gyro_bias=0.02&acceleration_bias=0.05&"

/* `turned`: by which rotation the sensor's stated attitude is off, rad. */
static void open_turned(const char *uri, int frames, enum fovea_sensors sensors,
                        const double turned[3])
{
    const double back[3] = {-turned[0], -turned[1], -turned[2]};
    struct fv_se3 T, off = {.t = {0}};
    dark = NULL;
    sim_rig_open(&rig, uri, 0, frames);
    rig.config.rig = rig.ops->info(rig.source)->rig;
    rig.config.odometry.sensors = sensors;
    rig.config.odometry.imu_noise_factor = 2;
    rig.config.odometry.keyframes = 40;
    fv_se3_from_rows(rig.config.rig.imu.T_body_imu, &T);
    fv_so3_exp(back, off.R);
    fv_se3_compose(&T, &off, &T);
    fv_se3_to_rows(&T, rig.config.rig.imu.T_body_imu);
    sim_rig_build(&rig);
}

static const double none[3] = {0};

static void open_rig(const char *uri, int frames, enum fovea_sensors sensors)
{
    open_turned(uri, frames, sensors, none);
}

static bool next(bool samples)
{
    if (!sim_rig_next(&rig)) return false;
    if (map_units > 0) rig.inputs.grants.units[FOVEA_JOB_MAP] = map_units;
    if (samples) sim_rig_take_samples(&rig);
    const struct fovea_image seen[2] = {rig.frame.images[0], rig.frame.images[1]};
    for (int i = 0; dark != NULL && i < 2; i++) {
        rig.frame.images[i].data = dark;
        rig.frame.images[i].stride_bytes = 400;
    }
    sim_rig_process(&rig);
    rig.frame.images[0] = seen[0];
    rig.frame.images[1] = seen[1];
    return true;
}

/* p_new = change p_old. */
static double changed_by(void)
{
    double R[9], turned[3], off = 0;
    fv_so3_from_quaternion(body.change_orientation, R);
    fv_rotate3(R, before.position, turned);
    for (int i = 0; i < 3; i++) {
        const double d = body.change_scale * turned[i] + body.change_position[i] - body.position[i];
        off += d * d;
    }
    return sqrt(off);
}

static void metres_and_gravity_come_in_one_change(void **state)
{
    (void)state;
    int first = 0;
    open_rig("sim:orbit?" SHAPE "seed=2", 140, FOVEA_SENSORS_AUTO);
    while (next(true)) {
        before = body;
        sim_body_take(&rig, &body);
        if (body.scale_state == FOVEA_POSE_T_SCALE_METRIC && first == 0) {
            first = rig.frames;
            assert_int_equal(body.change_count, 1);
            assert_true(changed_by() < 0.15); /* the way of a frame */
            assert_true(body.change_scale != 1);
            assert_true(fabs(body.change_orientation[0]) < 0.99);
            assert_int_equal(body.scale_source, FOVEA_POSE_T_SOURCE_INERTIAL);
            assert_true(body.scale_sigma < 0.045);
            assert_true(fabs(body.gravity[0]) < 1e-6 && fabs(body.gravity[1]) < 1e-6);
            assert_true(fabs(body.gravity[2] + 9.80665) < 1e-9);
        }
        if (first == 0 && body.map_id >= 0) {
            assert_int_equal(body.scale_state, FOVEA_POSE_T_SCALE_INITIALISING);
            assert_true(isnan(body.gravity[0]) && isnan(body.gyro_bias[0]));
        }
    }
    assert_true(first > 40 && first < 130);
    assert_int_equal(body.change_count, 1);
    assert_true(sim_body_gravity_error(&rig, &body) < 0.5 * FV_PI / 180 &&
                body.gravity_sigma < 0.02);
    const double way = sim_rig_moved(rig.pose[first].T_world_cam, rig.pose[139].T_world_cam) /
                       sim_rig_moved(rig.truth[first], rig.truth[139]);
    assert_true(fabs(way - 1) < 3 * body.scale_sigma + 0.01);
    for (int i = 0; i < 3; i++)
        assert_true(isfinite(body.acceleration_bias[i]) && fabs(body.gyro_bias[i]) < 0.1);
    sim_rig_close(&rig);
}

/* How far the accelerometer's bias is estimated off the vertical's true one, m/s^2, at the end of a
 * run under a gravity of 9.9 m/s^2; metres and gravity are checked. */
static double bias_under(double gravity_m_s2)
{
    double up[3], R[9], bias = 0;
    sim_rig_open(&rig,
                 "sim:orbit?width=400&height=300&rate=20&imu=200&imu_noise=.5&gravity=9.9&seed=2",
                 0, 160);
    dark = NULL;
    rig.config.rig = rig.ops->info(rig.source)->rig;
    rig.config.odometry.gravity_m_s2 = gravity_m_s2;
    sim_rig_build(&rig);
    while (next(true))
        sim_body_take(&rig, &body);
    assert_int_equal(body.scale_source, FOVEA_POSE_T_SOURCE_INERTIAL);
    double size = 0;
    for (int i = 0; i < 3; i++)
        size += body.gravity[i] * body.gravity[i];
    assert_true(fabs(sqrt(size) - gravity_m_s2) < 1e-9);
    const double way = sim_rig_moved(rig.pose[100].T_world_cam, rig.pose[159].T_world_cam) /
                       sim_rig_moved(rig.truth[100], rig.truth[159]);
    if (gravity_m_s2 == 9.9) assert_true(fabs(way - 1) < 3 * body.scale_sigma + 0.01);
    /* the sensor stands as the body does */
    fv_so3_from_quaternion(body.orientation, R);
    for (int i = 0; i < 3; i++)
        up[i] = -body.gravity[i] / gravity_m_s2;
    for (int i = 0; i < 3; i++)
        bias += body.acceleration_bias[i] * (R[i] * up[0] + R[3 + i] * up[1] + R[6 + i] * up[2]);
    sim_rig_close(&rig);
    return bias;
}

/* A gravity that is stated wrong by .2 m/s^2 is taken for a bias. */
static void gravity_is_as_strong_as_stated(void **state)
{
    (void)state;
    const double right = bias_under(9.9), wrong = bias_under(9.7);
    print_message("bias upwards %.4f m/s^2, by a wrong gravity %.4f\n", right, wrong);
    assert_true(fabs(right) < 0.05);
    assert_true(wrong > 0.15 && wrong < 0.25);
}

/* Second difference of three positions, in the axes of the last pose. */
static void bend(const struct fv_se3 T[3], double own[3])
{
    double d[3];
    for (int i = 0; i < 3; i++)
        d[i] = T[0].t[i] - 2 * T[1].t[i] + T[2].t[i];
    fv_rotate_back3(T[2].R, d, own);
}

/* Turn from the second pose to the last, and the way. */
static double stepped(const struct fv_se3 T[3], double turn[9])
{
    double way[3];
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++)
            turn[3 * r + c] = T[1].R[r] * T[2].R[c] + T[1].R[3 + r] * T[2].R[3 + c] +
                              T[1].R[6 + r] * T[2].R[6 + c];
    fv_subtract3(T[2].t, T[1].t, way);
    return fv_norm3(way);
}

/* What stations said, and where they were. */
enum { STATIONS = 96 };
static struct fv_se3 said[STATIONS], truth[STATIONS];
static double said_sigma[STATIONS], said_turn_sigma[STATIONS];

/* The stations of a run, and the mean of the frames' own sigma of turns. */
static int gather(double *own_turn)
{
    int n = 0;
    *own_turn = 0;
    while (next(true)) {
        const struct fv_inertial *estimator = &rig.rt->inertial.estimator;
        const uint32_t count = fv_inertial_station_count(estimator);
        double position, turn;
        if (count == 0 || rig.rt->inertial.state->station_ns != rig.frame.stamp_ns) continue;
        assert_true(n < STATIONS);
        const struct fv_inertial_pose *pose = &fv_inertial_station_at(estimator, count - 1)->pose;
        said[n] = pose->T_world_cam;
        said_sigma[n] = pose->position_sigma;
        said_turn_sigma[n] = pose->turn_sigma;
        fv_se3_from_rows(rig.truth[rig.frames - 1], &truth[n++]);
        fv_odometry_own_sigmas(&rig.rt->odometry, &position, &turn);
        *own_turn += turn;
    }
    *own_turn /= n;
    return n;
}

/* Mean squares of the errors of second differences of places and of turns, over what they should
 * be. */
static void compare(int n, double *place, double *turned)
{
    double said_way = 0, true_way = 0, A[9], B[9], E[9], a[3], b[3], error[3];
    for (int k = 2; k < n; k++) {
        said_way += stepped(said + k - 2, A);
        true_way += stepped(truth + k - 2, B);
    }
    *place = *turned = 0;
    for (int k = 2; k < n; k++) {
        (void)stepped(said + k - 2, A);
        (void)stepped(truth + k - 2, B);
        bend(said + k - 2, a);
        bend(truth + k - 2, b);
        for (int i = 0; i < 3; i++)
            error[i] = a[i] - b[i] * said_way / true_way;
        *place += fv_dot3(error, error) / (18 * said_sigma[k - 1] * said_sigma[k - 1]) / (n - 2);
        for (int r = 0; r < 3; r++)
            for (int c = 0; c < 3; c++)
                E[3 * r + c] = A[r] * B[c] + A[3 + r] * B[3 + c] + A[6 + r] * B[6 + c];
        fv_so3_log(E, error);
        *turned += fv_dot3(error, error) / (6 * said_turn_sigma[k] * said_turn_sigma[k]) / (n - 2);
    }
}

/* Stations err, beside those around them, by what they say. */
static void stations_err_by_what_they_say(void **state)
{
    (void)state;
    static const char *const uris[] = {"sim:orbit?" SHAPE "seed=3", "sim:corridor?" SHAPE "seed=3"};
    for (int u = 0; u < 2; u++) {
        double place, turned, own_turn;
        open_rig(uris[u], 180, FOVEA_SENSORS_MONO_INERTIAL);
        const int n = gather(&own_turn);
        compare(n, &place, &turned);
        print_message("%s: %d stations, squared errors over stated: place %.2f, turn %.2f; "
                      "turn by pixels %.1e rad\n",
                      uris[u], n, place, turned, own_turn);
        assert_true(n > 70);
        assert_true(place > 0.6 && place < 2.6);
        assert_true(turned > 0.4 && turned < 2.6);
        assert_true(own_turn > 5e-5);
        sim_rig_close(&rig);
    }
}

/* With the least that a busy board grants, and a station with each frame, estimates still end once
 * the window is full. */
static void estimates_end_on_a_slow_board(void **state)
{
    (void)state;
    open_rig("sim:orbit?width=400&height=300&rate=10&imu=200&seed=4", 160,
             FOVEA_SENSORS_MONO_INERTIAL);
    map_units = 24;
    while (next(true))
        continue;
    map_units = 0;
    const struct fv_inertial *estimator = &rig.rt->inertial.estimator;
    assert_true(fv_inertial_station_count(estimator) >= FV_INERTIAL_WINDOW);
    assert_true(rig.frame.stamp_ns - estimator->state->estimate.stamp_ns < 1500000000);
    sim_rig_close(&rig);
}

/* Gravity in the body's axes, against its stated sigma in both directions across: a chi-square of
 * two degrees of freedom, beyond 11.8 once in 400 times. */
static void gravity_is_as_sure_as_it_says(void **state)
{
    (void)state;
    static const char *const uris[] = {"sim:fast?" SHAPE "seed=12&baseline=0.11",
                                       "sim:corridor?" SHAPE "seed=12"};
    for (int i = 0; i < 2; i++) {
        int known = 0, beyond = 0;
        double sum = 0;
        open_rig(uris[i], 300, FOVEA_SENSORS_AUTO);
        while (next(true)) {
            sim_body_take(&rig, &body);
            if (!(body.gravity_sigma > 0)) continue;
            const double off = sim_body_gravity_error(&rig, &body) / body.gravity_sigma;
            known++;
            beyond += off * off > 11.8;
            sum += off * off / 2;
        }
        print_message("%s: %d frames, NEES per degree of freedom %.2f, %d beyond 3 sigma\n",
                      uris[i], known, sum / known, beyond);
        assert_true(known > 100);
        assert_true(sum < 3 * known && beyond * 20 <= known);
        sim_rig_close(&rig);
    }
}

/* In metres from the first pose on, `odom` is turned upright once, when gravity is known to 20 mrad
 * or after 6 s. */
static void odom_waits_for_gravity(void **state)
{
    (void)state;
    int turned = 0;
    open_rig("sim:wander?" SHAPE "seed=12&baseline=0.11", 150, FOVEA_SENSORS_AUTO);
    while (next(true) && turned == 0) {
        sim_body_take(&rig, &body);
        if (body.change_count > 0) turned = rig.frames;
    }
    assert_true(turned > 10);
    assert_true(body.gravity_sigma < 0.02 || turned > 6 * 20);
    assert_true(sim_body_gravity_error(&rig, &body) < 3.5 * body.gravity_sigma);
    sim_rig_close(&rig);
}

/* Black pictures: the pose goes on for 2 s, within its covariance, and comes back. */
static void poses_go_on_without_pictures(void **state)
{
    (void)state;
    enum { FIRST = 70, DARK = 50 };
    uint8_t *black = calloc(400, 300);
    int coasted = 0, lost = 0, back = 0;
    open_rig("sim:wander?" SHAPE "seed=5&baseline=0.11", 150, FOVEA_SENSORS_AUTO);
    for (int n = 0; n < 150; n++) {
        dark = n >= FIRST && n < FIRST + DARK ? black : NULL;
        assert_true(next(true));
        before = body;
        sim_body_take(&rig, &body);
        const struct fovea_pose *pose = &rig.pose[n];
        if (n < FIRST || dark == NULL) {
            if (n >= FIRST && back == 0 && pose->state == FOVEA_TRACKING_OK) back = n;
            continue;
        }
        coasted += pose->state == FOVEA_TRACKING_COASTING;
        lost += pose->state == FOVEA_TRACKING_LOST;
        if (pose->state != FOVEA_TRACKING_COASTING) continue;
        assert_int_equal(lost, 0);
        assert_true(pose->posed && isfinite(body.velocity[0]));
        assert_true(isfinite(body.velocity_covariance[0]) && body.velocity_covariance[0] > 0);
        const double way = sim_rig_moved(rig.pose[FIRST - 1].T_world_cam, pose->T_world_cam) -
                           sim_rig_moved(rig.truth[FIRST - 1], rig.truth[n]);
        const double sigma = sqrt(pose->covariance[0] + pose->covariance[6] + pose->covariance[11]);
        assert_true(fabs(way) < 4 * sigma && sigma < 0.1);
    }
    assert_true(coasted >= 39 && coasted <= 41 && lost == DARK - coasted);
    assert_true(back > 0 && back < FIRST + DARK + 8);
    sim_rig_close(&rig);
    free(black);
}

/* A picture that is stuck for .4 s shows no motion: the velocity goes on by the samples. */
static void a_stuck_picture_stops_no_velocity(void **state)
{
    (void)state;
    enum { FIRST = 120, STUCK = 8 };
    static uint8_t stuck[400 * 300];
    int frozen = 0;
    open_rig("sim:orbit?" SHAPE "seed=3", 150, FOVEA_SENSORS_MONO_INERTIAL);
    for (int n = 0; n < FIRST + STUCK; n++) {
        const struct fv_inertial_known *known = &rig.rt->inertial.state->known;
        struct fv_se3 last, now;
        double way[3];
        dark = n >= FIRST ? stuck : NULL;
        assert_true(next(true));
        for (size_t y = 0; n < FIRST && y < 300; y++)
            memcpy(stuck + 400 * y,
                   rig.frame.images[0].data + y * (size_t)rig.frame.images[0].stride_bytes, 400);
        if (n < FIRST) continue;
        fv_se3_from_rows(rig.truth[n - 1], &last);
        fv_se3_from_rows(rig.truth[n], &now);
        fv_subtract3(now.t, last.t, way);
        frozen += rig.rt->odometry.state->usable.frozen;
        assert_true(known->moving);
        assert_true(fabs(fv_norm3(known->velocity) / (20 * fv_norm3(way)) - 1) < 0.12);
    }
    assert_int_equal(frozen, STUCK);
    sim_rig_close(&rig);
}

/* Standing still shows no scale, nor does a turn on the spot. */
static void no_metres_without_motion(void **state)
{
    (void)state;
    static const char *const uris[] = {"sim:still?" SHAPE "seed=3", "sim:rotate?" SHAPE "seed=3"};
    for (int i = 0; i < 2; i++) {
        open_rig(uris[i], 80, FOVEA_SENSORS_MONO_INERTIAL);
        while (next(true)) {
            sim_body_take(&rig, &body);
            assert_int_equal(body.scale_state, FOVEA_POSE_T_SCALE_INITIALISING);
            assert_int_equal(body.change_count, 0);
        }
        sim_rig_close(&rig);
    }
}

/* The sensor's samples are without influence where it is not asked for. */
static void mono_keeps_its_bits(void **state)
{
    (void)state;
    static struct fovea_pose poses[60];
    open_rig("sim:orbit?" SHAPE "seed=4", 60, FOVEA_SENSORS_MONO);
    while (next(true))
        continue;
    memcpy(poses, rig.pose, sizeof poses);
    sim_rig_close(&rig);
    open_rig("sim:orbit?" SHAPE "seed=4", 60, FOVEA_SENSORS_AUTO);
    rig.config.rig.has_imu = false;
    while (next(false))
        continue;
    assert_true(poses[59].posed);
    assert_memory_equal(poses[59].T_world_cam, rig.pose[59].T_world_cam,
                        sizeof poses[59].T_world_cam);
    sim_rig_close(&rig);
}

static void what_cannot_be_is_refused(void **state)
{
    (void)state;
    struct fovea_config config;
    struct fovea_error error;
    size_t bytes;
    fovea_config_default(&config);
    config.rig.cameras[0].camera = (struct fovea_camera){
        .width = 400, .height = 300, .fx = 300, .fy = 300, .cx = 200, .cy = 150};
    assert_int_equal(fovea_camera_prepare(&config.rig.cameras[0].camera, &error), FOVEA_OK);
    config.odometry.sensors = FOVEA_SENSORS_MONO_INERTIAL;
    assert_int_equal(fovea_size(&config, &bytes, &error), FOVEA_ERROR_ARGUMENT);
    assert_non_null(strstr(error.text, "mono_inertial without an inertial sensor"));
    config.rig.has_imu = true;
    for (int i = 0; i < 12; i += 5)
        config.rig.imu.T_body_imu[i] = 1;
    assert_int_equal(fovea_size(&config, &bytes, &error), FOVEA_OK);
    config.scale.source = FOVEA_SCALE_WHEEL_ODOMETRY;
    assert_int_equal(fovea_size(&config, &bytes, &error), FOVEA_ERROR_ARGUMENT);
    assert_non_null(strstr(error.text, "with a scale source"));
}

/* The mount's error is known to a degree, and named where there is one. */
static void assert_mount(const struct fovea_imu_status *imu, const double turned[3])
{
    assert_true(imu->mount_wrong == (turned != none));
    assert_true(imu->mount_angle_sigma > 0 && imu->mount_angle_sigma < 0.0175);
    for (int k = 0; k < 3; k++)
        assert_true(fabs(imu->mount_error[k] - turned[k]) < 0.0175);
}

/* Samples whose stamps are off by what the rig does not state are moved by as much; others are not.
 */
static void a_wrong_clock_is_found(void **state)
{
    (void)state;
    static const char *const uris[3] = {
        "sim:orbit?" SHAPE "seed=4&imu_offset=12",
        "sim:orbit?" SHAPE "seed=4&imu_offset=12&imu_offset_known=0",
        "sim:orbit?" SHAPE "seed=4&imu_offset=-18&imu_offset_known=0"};
    static const double offsets_s[3] = {0, 0.012, -0.018};
    for (int i = 0; i < 3; i++) {
        struct fovea_imu_status imu;
        open_rig(uris[i], 260, FOVEA_SENSORS_AUTO);
        double used_s = 0;
        bool doubted = false;
        while (next(true)) {
            sim_body_take(&rig, &body);
            fovea_imu_status_get(rig.rt, &imu);
            if (used_s == 0 && imu.time_offset_used_s != 0)
                doubted = body.scale_state != FOVEA_POSE_T_SCALE_METRIC || body.scale_sigma > 0.4;
            used_s = imu.time_offset_used_s;
            const struct fv_inertial_stage_state *stage = rig.rt->inertial.state;
            if (!stage->doubted) continue;
            assert_false(stage->known.moving); /* no velocity comes of what is in doubt, */
            assert_true(stage->known.gravity_sigma > 0.1 &&
                        stage->known.bias_covariance[0] > 0.005 &&
                        stage->known.bias_covariance[20] > 0.05); /* and biases may be anything */
        }
        assert_int_equal(doubted, i > 0); /* by samples of the wrong clock */
        /* What carries poses on between frames moves them likewise. */
        const struct fv_sense *sense = rig.rt->sense;
        const unsigned place = atomic_load(&sense->between) % FV_SENSE_NEWER;
        assert_int_equal(sense->offers[place].moved_ns, (int64_t)lround(1e9 * used_s));
        assert_true(imu.time_offset_sigma_s > 1e-5 && imu.time_offset_sigma_s < 1e-3);
        assert_true(fabs(imu.time_offset_s - offsets_s[i]) < 1e-3);
        assert_true(i == 0 ? imu.time_offset_used_s == 0
                           : fabs(imu.time_offset_used_s - offsets_s[i]) < 2.5e-3);
        assert_int_equal(body.scale_state, FOVEA_POSE_T_SCALE_METRIC);
        assert_true(body.scale_sigma < 0.045); /* what came of the wrong clock is replaced */
        assert_true(sim_body_gravity_error(&rig, &body) < 1.5 * FV_PI / 180);
        assert_mount(&imu, none);
        sim_rig_close(&rig);
    }
}

/* A mount that is stated wrong by 5 degrees is named within 10 s, and not taken for a wrong clock.
 */
static void a_wrong_mount_is_named(void **state)
{
    (void)state;
    static const char *const uris[2] = {"sim:orbit?" SHAPE "seed=4", "sim:wander?" SHAPE "seed=4"};
    static const double turned[2][3] = {{0.0873, 0, 0}, {0, 0, -0.0873}};
    for (int i = 0; i < 2; i++) {
        struct fovea_imu_status imu;
        open_turned(uris[i], 160, FOVEA_SENSORS_AUTO, turned[i]);
        while (next(true))
            continue;
        fovea_imu_status_get(rig.rt, &imu);
        assert_mount(&imu, turned[i]);
        assert_true(imu.time_offset_used_s == 0);
        sim_rig_close(&rig);
    }
}

/* How far the camera went in the last step, by the truth. */
static double gone(void)
{
    double off = 0;
    for (int i = 0; i < 3; i++) {
        const double d =
            rig.truth[rig.frames - 1][4 * i + 3] - rig.truth[rig.frames - 2][4 * i + 3];
        off += d * d;
    }
    return sqrt(off);
}

/* Standing is said where the camera stands; in the dark it stays there then. */
static void who_stands_stays(void **state)
{
    (void)state;
    int standing = 0;
    open_rig("sim:stand?" SHAPE "seed=4", 250, FOVEA_SENSORS_AUTO);
    while (rig.frames < 220 && next(true)) {
        sim_body_take(&rig, &body);
        if (!rig.rt->inertial.state->still.standing) continue;
        standing++;
        assert_true(gone() < 1e-9);
        for (int i = 0; i < 3; i++)
            assert_true(body.velocity[i] == 0);
    }
    assert_true(standing > 40);
    before = body;
    dark = calloc(1, 400 * 300);
    assert_non_null(dark);
    while (next(true)) {
        sim_body_take(&rig, &body);
        assert_int_equal(body.state, FOVEA_POSE_T_STATE_COASTING);
        for (int i = 0; i < 3; i++) /* by samples alone 10 mm off after 1.5 s */
            assert_true(body.position[i] == before.position[i] && fabs(body.velocity[i]) < 1e-12);
        assert_true(body.covariance[0] > 0 && body.covariance[0] < 1e-3);
    }
    free(dark);
    sim_rig_close(&rig);
}

/* Short stops on a way, and ways that are slow. */
static void who_moves_does_not_stand(void **state)
{
    (void)state;
    static const char *const uris[2] = {"sim:stopgo?" SHAPE "seed=4",
                                        "sim:corridor?" SHAPE "seed=4"};
    for (int i = 0; i < 2; i++) {
        int standing = 0;
        open_rig(uris[i], i == 0 ? 300 : 150, FOVEA_SENSORS_AUTO);
        while (next(true)) {
            if (rig.frames < 2 || !rig.rt->inertial.state->still.standing) continue;
            standing++;
            assert_true(gone() < 2e-3); /* 4 cm/s: it has just begun to move */
        }
        assert_true(i == 0 ? standing > 10 : standing == 0);
        sim_rig_close(&rig);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(metres_and_gravity_come_in_one_change),
        cmocka_unit_test(gravity_is_as_strong_as_stated),
        cmocka_unit_test(stations_err_by_what_they_say),
        cmocka_unit_test(estimates_end_on_a_slow_board),
        cmocka_unit_test(gravity_is_as_sure_as_it_says),
        cmocka_unit_test(odom_waits_for_gravity),
        cmocka_unit_test(poses_go_on_without_pictures),
        cmocka_unit_test(a_stuck_picture_stops_no_velocity),
        cmocka_unit_test(no_metres_without_motion),
        cmocka_unit_test(mono_keeps_its_bits),
        cmocka_unit_test(what_cannot_be_is_refused),
        cmocka_unit_test(a_wrong_clock_is_found),
        cmocka_unit_test(a_wrong_mount_is_named),
        cmocka_unit_test(who_stands_stays),
        cmocka_unit_test(who_moves_does_not_stand),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

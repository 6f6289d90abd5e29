#include "scale/inertial.h"

#include <string.h>

#include "geometry/vec.h"
#include "inertial/stamp.h"

static const int64_t station_apart_ns = 90000000;
/* Poses err by somewhat more than what pixels that err independently do to them: 1.0 to 1.2 times
 * in simulation, 1.2 to 1.7 times on EuRoC. */
static const double own_share = 1.2;
static const double position_sigma_least = 5e-5; /* of the distance of what is seen */
static const double turn_sigma_least = 3e-4;
static const double unknown_sigma = 0.1;                     /* rad, and of that distance */
static const double mono_drift = 0.003, stereo_drift = 1e-4; /* of the scale, relative, by root s */
static const double tilt_drift = 3e-4;                       /* of a map, rad by root s */
static const double stereo_sigma = 0.003;
static const double gyro_bias_sigma_max = 0.01; /* to predict turns by, rad/s */
/* To hold poses by turns, rad/s, s and rad: poses that a wrong clock or mount has turned no longer
 * show that it is wrong. */
static const double held_bias_sigma_max = 1e-3, held_clock_max_s = 3e-3, held_mount_max = 0.02;
static const double gyro_scale_sigma = 0.01; /* of what no calibration has taken out */
static const double gyro_bias_least = 1e-4;
/* What is left in a turn of the noise that a shaken gyro's samples show beyond that of its data
 * sheet: what vibration turns it turns back. Over a second of euroc_mh05_a turns are good to .015
 * degrees. */
static const double shaken_fraction = 0.4;
static const double gyro_bias_most = 0.2; /* twice that of cheap sensors, rad/s */
static const int64_t coasting_max_ns = 2000000000, rate_age_max_ns = 20000000;
static const int64_t continuing_max_ns = 2500000000; /* time for another map behind coasting */
/* Of what came of samples by a wrong clock: scale (relative), gravity (rad), biases. */
static const double doubted_sigma = 0.5, doubted_gravity_sigma = 0.2;
static const double doubted_bias_sigma[2] = {0.1, 0.3};
/* ADIS16448, where a rig states no densities. */
static const double gyro_noise = 1.7e-4, acceleration_noise = 2e-3, acceleration_walk = 3e-3;

static double square_of(double stated, double otherwise, double factor)
{
    const double sigma = factor * (stated > 0 ? stated : otherwise);
    return sigma * sigma;
}

void fv_inertial_stage_carve(struct fv_inertial_stage *stage, const struct fovea_rig *rig,
                             double noise_factor, double gravity_m_s2, struct fv_arena *persistent)
{
    const struct fovea_rig_imu *imu = &rig->imu;
    struct fv_inertial_config config = {
        .noise = {square_of(imu->gyro_noise, gyro_noise, noise_factor),
                  square_of(imu->acceleration_noise, acceleration_noise, noise_factor)},
        .acceleration_walk = square_of(imu->acceleration_walk, acceleration_walk, 1),
        .gravity = gravity_m_s2};
    struct fv_se3 T_body_cam, T_body_imu;
    memset(stage, 0, sizeof *stage);
    stage->enabled = true;
    stage->imu = *imu;
    stage->gyro_noise = __builtin_sqrt(square_of(imu->gyro_noise, gyro_noise, 1));
    stage->acceleration_noise =
        __builtin_sqrt(square_of(imu->acceleration_noise, acceleration_noise, 1));
    fv_se3_from_rows(rig->cameras[0].T_body_cam, &T_body_cam);
    fv_se3_from_rows(imu->T_body_imu, &T_body_imu);
    fv_se3_invert(&T_body_cam, &T_body_cam);
    fv_se3_compose(&T_body_cam, &T_body_imu, &config.T_cam_imu);
    fv_inertial_carve(&stage->estimator, &config, persistent);
    stage->state = fv_arena_take(persistent, 1, sizeof *stage->state);
    stage->clock = fv_arena_take(persistent, 1, sizeof *stage->clock);
}

void fv_inertial_stage_init(struct fv_inertial_stage *stage)
{
    fv_inertial_init(&stage->estimator);
    fv_imu_still_init(&stage->state->still);
    fv_inertial_stage_init_clocks(stage);
}

/* ---- samples --------------------------------------------------------------------------------- */

/* Samples do not go on from those before. */
static void break_off(struct fv_inertial_stage *stage)
{
    fv_inertial_jump(&stage->estimator);
    stage->state->live.any_sample = stage->state->live.begun = false;
    stage->state->live.ahead_count = 0;
}

void fv_inertial_stage_observe(struct fv_inertial_stage *stage, const struct fv_imu_gate *gate)
{
    if (!stage->enabled) return;
    for (uint32_t i = 0; i < gate->count; i++) {
        struct fv_imu_reading reading;
        if (!fv_imu_read(&stage->imu, &gate->clean[i].sample, &reading)) continue;
        if (gate->clean[i].notes & FV_IMU_AFTER_JUMP) {
            break_off(stage);
            fv_imu_clock_jump(&stage->clock->found);
            fv_imu_clock_jump(&stage->clock->mounted);
            stage->clock->moved_ns = 0;
        }
        fv_imu_clock_take(&stage->clock->found, &reading);
        fv_imu_clock_take(&stage->clock->mounted, &reading);
        if (__builtin_add_overflow(reading.stamp_ns, stage->clock->moved_ns, &reading.stamp_ns))
            continue;
        fv_inertial_stage_still_take(stage, &reading);
        fv_inertial_take(&stage->estimator, reading.stamp_ns, reading.gyro, reading.acceleration);
        fv_inertial_live_take(&stage->state->live, &stage->estimator.state->noise, &reading);
    }
}

/* ---- stations -------------------------------------------------------------------------------- */

static void restart(struct fv_inertial_stage *stage)
{
    const bool metric = stage->state->metric;
    fv_inertial_restart(&stage->estimator, metric ? stereo_sigma : 0,
                        metric ? stereo_drift * stereo_drift : mono_drift * mono_drift,
                        tilt_drift * tilt_drift);
}

/* Another map, or another world: what is known of the biases stays. */
static void enter(struct fv_inertial_stage *stage, const struct fv_odometry *odometry)
{
    struct fv_inertial_stage_state *s = stage->state;
    const struct fv_inertial_live live = s->live;
    const struct fv_imu_still still = s->still;
    memset(s, 0, sizeof *s);
    s->live = live;
    s->still = still;
    fv_imu_still_forget(&s->still);
    s->live.begun = s->live.moving = false;
    s->begun = true;
    s->map = fv_odometry_pose(odometry)->map_id;
    s->reset_counter = fv_odometry_reset_counter(odometry);
    s->metric = fv_map_metric(fv_odometry_map(odometry));
    (void)fv_odometry_gravity(odometry, &s->brought);
    restart(stage);
    fv_imu_clock_restart(&stage->clock->found);
    fv_imu_clock_restart(&stage->clock->mounted);
}

/* Another map whose world is that of the map before: what is claimed holds, and stations begin
 * anew, since how the maps lie to each other is known by the samples alone. */
static void go_on_in(struct fv_inertial_stage *stage, const struct fv_odometry *odometry)
{
    struct fv_inertial_stage_state *s = stage->state;
    s->map = fv_odometry_pose(odometry)->map_id;
    (void)fv_odometry_gravity(odometry, &s->brought);
    s->station_ns = 0;
    s->cuts = 0;
    s->agreeing = 0;
    s->anew = true;
    restart(stage);
    fv_imu_clock_restart(&stage->clock->found);
    fv_imu_clock_restart(&stage->clock->mounted);
}

/* Covariance of biases whose axes err independently: sigmas of gyro and acceleration. */
static void bias_diagonal(const double sigma[2], double covariance[21])
{
    static const int diagonal[6] = {0, 6, 11, 15, 18, 20};
    memset(covariance, 0, 21 * sizeof *covariance);
    for (int i = 0; i < 6; i++)
        covariance[diagonal[i]] = sigma[i / 3] * sigma[i / 3];
}

/* Samples go by another clock from now on: begin anew, and doubt what is claimed. */
static void doubt(struct fv_inertial_stage *stage)
{
    struct fv_inertial_stage_state *s = stage->state;
    fv_inertial_init(&stage->estimator);
    restart(stage);
    break_off(stage);
    s->live.moving = s->known.moving = false;
    s->station_ns = 0;
    s->cuts = 0;
    s->agreeing = 0;
    s->anew = true;
    if (!s->known.claimed) return;
    s->doubted = true;
    s->claimed_sigma = s->known.scale_sigma = doubted_sigma;
    s->known.gravity_sigma = s->known.map_gravity.sigma = doubted_gravity_sigma;
    bias_diagonal(doubted_bias_sigma, s->known.bias_covariance);
}

/* Depth of what the newest keyframe sees, in the unit of world. */
static double depth_of(const struct fv_odometry *odometry)
{
    return fv_odometry_current_depth(odometry) / fv_odometry_pose(odometry)->map_scale;
}

/* By how much a pose errs beside those around it; in the unit of world, and rad. */
static void own_sigmas(const struct fv_odometry *odometry, double depth, double *position,
                       double *turn)
{
    fv_odometry_own_sigmas(odometry, position, turn);
    if (!(*position > 0)) { /* the pictures do not determine it */
        *position = unknown_sigma * depth;
        *turn = unknown_sigma;
    }
    *position *= own_share;
    *turn *= own_share;
    if (*position < position_sigma_least * depth) *position = position_sigma_least * depth;
    if (*turn < turn_sigma_least) *turn = turn_sigma_least;
}

static void add_station(struct fv_inertial_stage *stage, const struct fv_odometry *odometry,
                        int64_t stamp_ns)
{
    const struct fovea_pose *pose = fv_odometry_pose(odometry);
    const struct fv_odometry_reference reference = fv_odometry_reference(odometry);
    const double depth = depth_of(odometry);
    struct fv_inertial_owner of = {reference.slot, reference.number, reference.T_keyframe_cam};
    struct fv_inertial_pose given;
    own_sigmas(odometry, depth, &given.position_sigma, &given.turn_sigma);
    fv_se3_from_rows(pose->T_world_cam, &given.T_world_cam);
    fv_odometry_seen_attitude(odometry, given.T_world_cam.R);
    fv_odometry_seen_attitude(odometry, of.T_keyframe_cam.R);
    fv_inertial_add_station(&stage->estimator, stamp_ns, &of, &given);
    stage->state->station_ns = stamp_ns;
    stage->state->depth = depth;
    fv_copy3(
        stage->state->live.velocity,
        fv_inertial_station_at(&stage->estimator, fv_inertial_station_count(&stage->estimator) - 1)
            ->live);
}

/* Of the sensor, in metres, where the camera is at T (world's unit). */
static struct fv_se3 sensor_at(const struct fv_inertial_stage *stage, const struct fv_se3 *T,
                               double scale)
{
    struct fv_se3 out = *T;
    for (int i = 0; i < 3; i++)
        out.t[i] *= scale;
    fv_se3_compose(&out, &stage->estimator.config.T_cam_imu, &out);
    return out;
}

/* Motion of the camera since the last pose, in metres once claimed. */
static void camera_motion(const struct fv_inertial_stage *stage,
                          const struct fv_preintegration *sum, const double gravity[3],
                          struct fv_se3 *T_last_now, double velocity[3])
{
    const struct fv_se3 *T_cam_imu = &stage->estimator.config.T_cam_imu;
    struct fv_se3 T_world_now, inverse;
    fv_inertial_live_predict(&stage->state->live, sum, gravity, &T_world_now, velocity);
    fv_se3_invert(&stage->state->live.T_world_imu, &inverse);
    fv_se3_compose(&inverse, &T_world_now, T_last_now);
    fv_se3_compose(T_cam_imu, T_last_now, T_last_now);
    fv_se3_invert(T_cam_imu, &inverse);
    fv_se3_compose(T_last_now, &inverse, T_last_now);
}

static bool same_world(const struct fv_inertial_stage_state *s, const struct fv_odometry *odometry)
{
    return s->begun && s->reset_counter == fv_odometry_reset_counter(odometry);
}

/* out = C M C^T */
static void in_camera_axes(const double C[9], const double M[9], double out[9])
{
    double CM[9];
    fv_multiply33(C, M, CM);
    fv_multiply33_transposed(CM, C, out);
}

/* Variance of the gyro's bias about its least known axis. */
static double gyro_bias_variance(const struct fv_inertial_estimate *e)
{
    double most = 0;
    for (int i = FV_INERTIAL_GYRO_BIAS; i < FV_INERTIAL_TAIL; i++)
        if (e->covariance[i * (FV_INERTIAL_TAIL + 1)] > most)
            most = e->covariance[i * (FV_INERTIAL_TAIL + 1)];
    return most;
}

/* What is known of the gyro, in the camera's axes. */
static struct fv_gyro_known gyro_known(const struct fv_inertial_stage *stage)
{
    const struct fv_inertial_estimate *e = fv_inertial_result(&stage->estimator);
    const struct fv_se3 *T_cam_imu = &stage->estimator.config.T_cam_imu;
    struct fv_gyro_known known;
    struct fv_imu_clock_mount mount;
    struct fv_inertial_stage_offset offset;
    double square[9];
    fv_rotate3(T_cam_imu->R, e->shared.gyro_bias, known.bias);
    known.bias_sigma =
        e->known ? __builtin_sqrt(gyro_bias_variance(e) + gyro_bias_least * gyro_bias_least)
                 : gyro_bias_most;
    fv_imu_clock_mount(&stage->clock->mounted, &mount);
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++)
            square[3 * r + c] =
                mount.error[r] * mount.error[c] + (r == c ? mount.sigma[r] * mount.sigma[r] : 0);
    in_camera_axes(T_cam_imu->R, square, known.doubt.mount);
    (void)fv_inertial_stage_offset(stage, &offset);
    const double off_s = offset.offset_s - offset.used_s;
    known.doubt.clock_s = __builtin_sqrt(offset.sigma_s * offset.sigma_s + off_s * off_s);
    known.doubt.scale = gyro_scale_sigma;
    known.moved_ns = stage->clock->moved_ns;
    return known;
}

/* The turn as a measurement of the camera's. */
static void measure_turn(const struct fv_inertial_stage *stage, const struct fv_preintegration *sum,
                         struct fv_motion_hint *hint)
{
    const double *C = stage->estimator.config.T_cam_imu.R;
    const double stated = stage->estimator.config.noise.gyro,
                 believed = stage->estimator.state->noise.gyro;
    double rate[3];
    hint->gyro = gyro_known(stage);
    hint->turned.time_s = sum->time_s;
    in_camera_axes(C, sum->turn, hint->turned.R);
    hint->measured =
        hint->gyro.bias_sigma < held_bias_sigma_max &&
        hint->gyro.doubt.clock_s < held_clock_max_s &&
        fv_turn_mount_fraction(&hint->turned, &hint->gyro.doubt) < held_mount_max * held_mount_max;
    in_camera_axes(C, sum->turn_gyro, hint->turned.by_bias);
    fv_rotate3(C, sum->biases.gyro, hint->turned.bias);
    hint->turned.variance =
        (stated + shaken_fraction * shaken_fraction * (believed - stated)) * sum->time_s;
    fv_subtract3(stage->state->live.gyro, sum->biases.gyro, rate);
    fv_rotate3(C, rate, hint->rate);
}

/* Whether the gyro's bias is known: by this map, or by one before. */
static bool turns_known(const struct fv_inertial_stage *stage)
{
    const struct fv_inertial_estimate *e = fv_inertial_result(&stage->estimator);
    return (e->known && gyro_bias_variance(e) < gyro_bias_sigma_max * gyro_bias_sigma_max) ||
           stage->estimator.state->bias_sigma[0] < gyro_bias_sigma_max;
}

static double turn_variance(const struct fv_inertial_stage *stage,
                            const struct fv_preintegration *sum)
{
    const double bias = stage->state->known.bias_covariance[0];
    return sum->covariance[0] + bias * sum->time_s * sum->time_s;
}

void fv_inertial_stage_predict(struct fv_inertial_stage *stage, const struct fv_odometry *odometry,
                               int64_t stamp_ns, struct fv_motion_hint *hint)
{
    const struct fv_inertial_stage_state *s = stage->state;
    struct fv_preintegration sum;
    double velocity[3];
    memset(hint, 0, sizeof *hint);
    if (stage->enabled)
        fv_inertial_live_advance(&stage->state->live, &stage->estimator.state->noise, stamp_ns);
    if (!stage->enabled || !same_world(s, odometry) || !turns_known(stage) ||
        !fv_inertial_live_reach(&s->live, &stage->estimator.state->noise, stamp_ns, &sum))
        return;
    camera_motion(stage, &sum, s->known.gravity, &hint->T_now_last, velocity);
    if (!fv_odometry_withholds(odometry)) measure_turn(stage, &sum, hint);
    const double map_scale = fv_odometry_map(odometry)->state->S_map_world.s;
    const int64_t since_ns = fv_stamp_since(stamp_ns, s->live.pose_ns);
    const bool known = s->known.claimed && s->live.moving;
    hint->turn = true;
    hint->whole = known && since_ns <= coasting_max_ns;
    hint->continues =
        known && !s->doubted && since_ns <= continuing_max_ns && !fv_odometry_withholds(odometry);
    hint->turn_variance = turn_variance(stage, &sum);
    if (hint->continues && !hint->whole && s->still.standing) /* as it has coasted */
        fv_se3_identity(&hint->T_now_last);
    for (int i = 0; i < 3; i++)
        hint->T_now_last.t[i] *= hint->whole || hint->continues ? map_scale / s->known.scale : 0;
    fv_se3_invert(&hint->T_now_last, &hint->T_now_last);
}

bool fv_inertial_stage_rate(const struct fv_inertial_stage *stage, int64_t stamp_ns, double rate[3])
{
    const struct fv_inertial_live *live = &stage->state->live;
    double turned[3];
    if (!stage->enabled || !live->any_sample ||
        fv_stamp_since(stamp_ns, live->sample_ns) > rate_age_max_ns)
        return false;
    const struct fv_inertial_estimate *e = fv_inertial_result(&stage->estimator);
    fv_subtract3(live->gyro, e->known ? e->shared.gyro_bias : live->sum.biases.gyro, turned);
    fv_rotate3(stage->estimator.config.T_cam_imu.R, turned, rate);
    return turns_known(stage) || fv_norm3(rate) > gyro_bias_most;
}

/* Of a velocity, in the mean of the axes: all ways are off by what the scale is. */
static double scale_variance(const struct fv_inertial_stage_state *s, const double velocity[3])
{
    const double sigma = s->known.scale_sigma;
    return sigma * sigma * fv_dot3(velocity, velocity) / 3;
}

/* Velocity and rate of the camera for those who publish them. */
static void write_moving(struct fv_inertial_stage *stage, const struct fv_se3 *T_world_imu,
                         const double velocity[3])
{
    struct fv_inertial_stage_state *s = stage->state;
    const struct fv_inertial_config *config = &stage->estimator.config;
    double rate[3], lever[3], turned[3], added[3];
    fv_subtract3(s->live.gyro, s->known.biases.gyro, rate);
    fv_rotate_back3(config->T_cam_imu.R, config->T_cam_imu.t, lever); /* from the camera */
    fv_cross3(rate, lever, turned);
    fv_rotate3(T_world_imu->R, turned, added);
    fv_subtract3(velocity, added, s->known.velocity);
    fv_rotate3(config->T_cam_imu.R, rate, s->known.rate);
    s->known.velocity_sigma = __builtin_sqrt(s->live.variance + scale_variance(s, velocity));
    s->known.rate_sigma = __builtin_sqrt(stage->estimator.state->noise.gyro *
                                             (stage->imu.rate_hz > 0 ? stage->imu.rate_hz : 200) +
                                         s->known.bias_covariance[0]);
    s->known.moving = s->live.moving;
}

/* The frame has a pose. */
static void follow_pose(struct fv_inertial_stage *stage, const struct fv_odometry *odometry,
                        int64_t stamp_ns)
{
    const struct fovea_pose *pose = fv_odometry_pose(odometry);
    struct fv_inertial_stage_state *s = stage->state;
    const struct fv_inertial_estimate *e = fv_inertial_result(&stage->estimator);
    const struct fv_inertial_state *kept = stage->estimator.state;
    const bool claimed = s->known.claimed;
    double position, turn;
    own_sigmas(odometry, s->depth, &position, &turn);
    const double scale = claimed ? s->known.scale : 1, sigma = scale * position;
    struct fv_preintegration sum;
    struct fv_imu_biases biases;
    if (e->known) {
        memcpy(biases.gyro, e->shared.gyro_bias, sizeof biases.gyro);
        memcpy(biases.acceleration, e->own.acceleration_bias, sizeof biases.acceleration);
    } else { /* as a map before had them */
        memcpy(biases.gyro, kept->shared.gyro_bias, sizeof biases.gyro);
        memcpy(biases.acceleration, kept->acceleration_bias, sizeof biases.acceleration);
    }
    const bool led =
        fv_inertial_live_reach(&s->live, &stage->estimator.state->noise, stamp_ns, &sum);
    s->live.T_world_imu = sensor_at(stage, &s->T_world_cam, scale);
    fv_se3_from_rows(pose->T_world_cam, &s->T_world_cam);
    const struct fv_se3 T = sensor_at(stage, &s->T_world_cam, scale);
    fv_inertial_stage_still_see(stage, pose, stamp_ns);
    fv_inertial_live_pose(&s->live, stamp_ns, &T, sigma, led ? &sum : NULL,
                          claimed ? s->known.gravity : NULL, &biases);
    fv_inertial_stage_still_stop(stage);
    s->known.coasting = s->known.moving = false;
    if (claimed && !s->doubted) write_moving(stage, &T, s->live.velocity);
}

/* ---- without a picture ----------------------------------------------------------------------- */

/* The frame has none. */
static void coast(struct fv_inertial_stage *stage, const struct fv_odometry *odometry,
                  int64_t stamp_ns)
{
    struct fv_inertial_stage_state *s = stage->state;
    struct fv_preintegration sum;
    struct fv_se3 T_world_imu;
    double velocity[3];
    s->known.coasting = s->known.moving = false;
    if (!s->known.claimed || s->doubted || !s->live.moving || !same_world(s, odometry) ||
        fv_odometry_withholds(odometry) ||
        fv_stamp_since(stamp_ns, s->live.pose_ns) > coasting_max_ns ||
        !fv_inertial_result(&stage->estimator)->known ||
        !fv_inertial_live_reach(&s->live, &stage->estimator.state->noise, stamp_ns, &sum))
        return;
    camera_motion(stage, &sum, s->known.gravity, &s->known.T_last_now, velocity);
    fv_inertial_live_predict(&s->live, &sum, s->known.gravity, &T_world_imu, velocity);
    fv_inertial_stage_coast_covariance(stage, &sum, T_world_imu.R, s->known.covariance);
    write_moving(stage, &T_world_imu, velocity);
    s->known.velocity_sigma = fv_inertial_stage_coast_velocity_sigma(stage, &sum);
    fv_inertial_stage_still_stay(stage, stamp_ns);
    s->known.coasting = true;
}

/* While no estimate adds to it a scale is less and less sure. */
static void grow(struct fv_inertial_stage_state *s, int64_t stamp_ns)
{
    const double drift = s->metric ? stereo_drift : mono_drift;
    if (!s->known.claimed || stamp_ns <= s->claimed_ns) return;
    s->known.scale_sigma =
        __builtin_sqrt(s->claimed_sigma * s->claimed_sigma +
                       drift * drift * (double)fv_stamp_since(stamp_ns, s->claimed_ns) * 1e-9);
}

void fv_inertial_stage_step(struct fv_inertial_stage *stage, const struct fv_odometry *odometry,
                            int64_t stamp_ns)
{
    struct fv_inertial_stage_state *s = stage->state;
    const struct fovea_pose *pose = fv_odometry_pose(odometry);
    if (!stage->enabled) return;
    fv_inertial_live_advance(&s->live, &stage->estimator.state->noise, stamp_ns);
    grow(s, stamp_ns);
    if (!pose->posed) {
        coast(stage, odometry, stamp_ns);
        return;
    }
    if (!same_world(s, odometry))
        enter(stage, odometry);
    else if (s->map != pose->map_id)
        go_on_in(stage, odometry);
    follow_pose(stage, odometry, stamp_ns);
    if (fv_inertial_stage_compare_clocks(stage, odometry, stamp_ns)) {
        doubt(stage);
        return;
    }
    if (s->station_ns != 0 && fv_stamp_since(stamp_ns, s->station_ns) < station_apart_ns) return;
    add_station(stage, odometry, stamp_ns);
}

/* Poses of the stations as the map has their keyframes now. */
static void refresh(struct fv_inertial_stage *stage, const struct fv_odometry *odometry)
{
    const struct fv_map *map = fv_odometry_map(odometry);
    const uint32_t count = fv_inertial_station_count(&stage->estimator);
    struct fv_sim3 S_world_map, S;
    fv_sim3_invert(&map->state->S_map_world, &S_world_map);
    for (uint32_t i = 0; i < count; i++) {
        struct fv_inertial_station *station = fv_inertial_station_at(&stage->estimator, i);
        struct fv_map_keyframe keyframe;
        struct fv_se3 T_map_cam;
        if (!fv_map_keyframe_at(map, (uint32_t)station->of.slot, &keyframe) ||
            keyframe.number != station->of.number || keyframe.map_id != fv_map_current_id(map))
            continue;
        fv_se3_compose(&keyframe.T_world_cam, &station->of.T_keyframe_cam, &T_map_cam);
        fv_sim3_from_se3(&T_map_cam, 1, &S);
        fv_sim3_compose(&S_world_map, &S, &S);
        memcpy(station->pose.T_world_cam.R, S.R, sizeof S.R);
        fv_copy3(S.t, station->pose.T_world_cam.t);
    }
}

/* ---- units and results ----------------------------------------------------------------------- */

bool fv_inertial_stage_waiting(const struct fv_inertial_stage *stage)
{
    return stage->enabled &&
           (fv_inertial_busy(&stage->estimator) || fv_inertial_wanted(&stage->estimator));
}

void fv_inertial_stage_unit(struct fv_inertial_stage *stage, const struct fv_odometry *odometry)
{
    if (fv_inertial_wanted(&stage->estimator)) {
        refresh(stage, odometry);
        fv_inertial_begin(&stage->estimator);
        return;
    }
    if (!fv_inertial_unit(&stage->estimator)) fv_inertial_stage_judge(stage);
}

const struct fv_inertial_known *fv_inertial_stage_known(const struct fv_inertial_stage *stage)
{
    return stage->enabled && stage->state->known.claimed ? &stage->state->known : NULL;
}

bool fv_inertial_stage_biases(const struct fv_inertial_stage *stage, struct fv_imu_biases *biases,
                              double covariance[21])
{
    const struct fv_inertial_known *known = fv_inertial_stage_known(stage);
    memset(biases, 0, sizeof *biases);
    memset(covariance, 0, 21 * sizeof *covariance);
    if (known != NULL) {
        *biases = known->biases;
        memcpy(covariance, known->bias_covariance, sizeof known->bias_covariance);
        return true;
    }
    if (!stage->enabled || !fv_inertial_biases_kept(&stage->estimator)) return false;
    const struct fv_inertial_state *kept = stage->estimator.state;
    memcpy(biases->gyro, kept->gyro_bias, sizeof biases->gyro);
    memcpy(biases->acceleration, kept->acceleration_bias, sizeof biases->acceleration);
    bias_diagonal(kept->bias_sigma, covariance);
    return true;
}

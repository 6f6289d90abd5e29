#include "bounds/inertial_case.h"

#include <stdio.h>
#include <string.h>

#include "bounds/full_map.h"
#include "geometry/vec.h"

static const double gravity = 9.80665;

void inertial_case_uri(char *uri, size_t capacity, int32_t width, int32_t height)
{
    snprintf(uri, capacity, "sim:orbit?width=%d&height=%d&rate=20&baseline=0.12&imu=%d", (int)width,
             (int)height, INERTIAL_CASE_HZ);
}

void inertial_case_config(struct fovea_config *config, int32_t width, int32_t height)
{
    char uri[128];
    inertial_case_uri(uri, sizeof uri, width, height);
    fovea_config_default(config);
    config->rig = full_map_rig(uri);
}

/* ---- the motion ------------------------------------------------------------------------------ */

/* Turned about x, and moved along all axes. */
static double angle_at(double t)
{
    return 0.8 * fv_sin(3 * t);
}

void inertial_case_pose(int64_t at_ms, struct fv_se3 *T_world_cam)
{
    const double t = 1e-3 * (double)at_ms, turn[3] = {angle_at(t), 0, 0};
    fv_so3_exp(turn, T_world_cam->R);
    T_world_cam->t[0] = fv_sin(2 * t);
    T_world_cam->t[1] = fv_cos(2.5 * t);
    T_world_cam->t[2] = 0.5 * fv_sin(1.5 * t);
}

void inertial_case_sample(int64_t at_ms, struct fovea_imu_sample *sample)
{
    const double t = 1e-3 * (double)at_ms, turn[3] = {angle_at(t), 0, 0};
    const double felt[3] = {-4 * fv_sin(2 * t), -6.25 * fv_cos(2.5 * t),
                            -1.125 * fv_sin(1.5 * t) + gravity};
    double R[9], own[3];
    fv_so3_exp(turn, R);
    fv_rotate_back3(R, felt, own);
    memset(sample, 0, sizeof *sample);
    sample->stamp_ns = at_ms * 1000000;
    sample->gyro[0] = 2.4 * fv_cos(3 * t);
    for (int i = 0; i < 3; i++) {
        sample->gyro[i] += 0.02 * (double)((at_ms + i) % 3 - 1);
        sample->acceleration[i] = own[i] + 0.2 * (double)((at_ms + i) % 5 - 2);
    }
}

/* ---- stations -------------------------------------------------------------------------------- */

void inertial_case_fill(struct fovea *rt, uint32_t stations)
{
    struct fv_inertial *inertial = &rt->inertial.estimator;
    const struct fv_map *map = &rt->odometry.map;
    const int64_t end_ms = (int64_t)(stations - 1) * INERTIAL_CASE_STATION_MS;
    fv_inertial_init(inertial);
    fv_inertial_restart(inertial, 0.003, 1e-8, 1e-7);
    for (int64_t ms = -1; ms <= end_ms; ms++) {
        struct fovea_imu_sample sample;
        inertial_case_sample(ms, &sample);
        fv_inertial_take(inertial, sample.stamp_ns, sample.gyro, sample.acceleration);
        if (ms < 0 || ms % INERTIAL_CASE_STATION_MS != 0) continue;
        const uint32_t slot =
            (uint32_t)(ms / INERTIAL_CASE_STATION_MS) % rt->config.odometry.keyframes;
        struct fv_inertial_owner of = {.slot = slot, .number = map->keyframes[slot].number};
        struct fv_inertial_pose pose = {.position_sigma = 1e-3, .turn_sigma = 1e-3};
        inertial_case_pose(ms, &pose.T_world_cam);
        fv_se3_identity(&of.T_keyframe_cam);
        fv_inertial_add_station(inertial, sample.stamp_ns, &of, &pose);
    }
}

void inertial_case_claim(struct fovea *rt)
{
    struct fv_inertial_stage_state *s = rt->inertial.state;
    struct fv_inertial_estimate *e = &rt->inertial.estimator.state->estimate;
    s->known.claimed = s->known.settled = true;
    s->known.scale = 1;
    s->known.scale_sigma = 1; /* what comes is better */
    s->known.gravity[2] = -gravity;
    s->anew = s->doubted = false;
    e->known = true;
    e->own.scale = 1;
    e->own.down[2] = -1;
    for (int i = 0; i < FV_INERTIAL_TAIL; i++)
        e->covariance[i * (FV_INERTIAL_TAIL + 1)] = 1e-6;
    fv_inertial_across(e->own.down, e->across);
    s->live.moving = true;
    s->live.variance = 1e-2;
}

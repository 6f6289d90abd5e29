#include "scale/scale.h"

#include <string.h>

#include "geometry/vec.h"

enum { KEYFRAMES_BEHIND_MAX = 3 };

static const double drift =
    0.015; /* of the scale of a monocular map, relative, from keyframe to keyframe */
/* Floors are not flat, and robots nod on them: no fit is surer than this, relative. */
static const double floor_sigma_least = 0.03;
static const double surprise = 3; /* standard deviations; measurements further off count for less */

void fv_scale_carve(struct fv_scale *scale, const struct fovea_scale_config *config,
                    const double T_body_cam[12], struct fv_arena *persistent, struct fv_arena *job)
{
    memset(scale, 0, sizeof *scale);
    scale->config = *config;
    fv_se3_from_rows(T_body_cam, &scale->T_body_cam);
    const double *R = scale->T_body_cam.R;
    /* An identity is what stands there unless configured; body and camera axes never agree on a
     * robot. */
    bool turned = R[0] < 0.999 || R[4] < 0.999;
    for (int i = 0; i < 3; i++)
        scale->down[i] = turned ? -R[6 + i] : i == 1;
    scale->state = fv_arena_take(persistent, 1, sizeof *scale->state);
    scale->points = fv_arena_take(job, FV_FLOOR_POINTS_MAX, sizeof *scale->points);
}

void fv_scale_init(struct fv_scale *scale, uint64_t seed)
{
    fv_random_seed(&scale->state->random, seed);
    scale->state->map = UINT32_MAX; /* none yet: the first is taken up like any other */
}

/* Another map: its unit is another, and known where it brings a scale. Odometry itself goes on. */
static void scale_enter(struct fv_scale_state *s, uint32_t map, const struct fv_map_state *brought)
{
    s->started = false;
    s->known = brought->scale.source != FOVEA_SCALE_FREE;
    s->source = brought->scale.source;
    s->map_scale = brought->S_map_world.s;
    s->log_scale = s->prior = s->known ? brought->scale.log_scale - fv_log(s->map_scale) : 0;
    s->variance = s->prior_variance = brought->scale.variance;
    s->station_count = 0;
    s->station_next = s->fitted = s->gathering = 0;
    s->map = map;
}

/* A map in metres by two cameras: nothing is added. */
static bool given_by_stereo(const struct fv_odometry *odometry)
{
    return fv_map_metric(fv_odometry_map(odometry));
}

/* Take a measurement of the scale's logarithm. */
static void scale_measure(struct fv_scale *scale, enum fovea_scale_source source, double log_scale,
                          double variance)
{
    struct fv_scale_state *s = scale->state;
    s->source = source;
    if (!s->known) {
        s->known = true;
        s->log_scale = log_scale;
        s->variance = variance;
        return;
    }
    s->variance += drift * drift;
    double innovation = log_scale - s->log_scale, expected = s->variance + variance;
    double far2 = innovation * innovation / (surprise * surprise * expected);
    if (far2 > 1) variance *= far2;
    double gain = s->variance / (s->variance + variance);
    s->log_scale += gain * innovation;
    s->variance *= 1 - gain;
}

/* ---- camera height --------------------------------------------------------------------------- */

void fv_scale_unit(struct fv_scale *scale, const struct fv_odometry *odometry)
{
    struct fv_floor floor;
    bool found;
    if (!scale->state->gathering)
        scale->state->fitted = fv_odometry_map(odometry)->state->keyframe_number;
    if (!fv_scale_find_floor(scale, odometry, &floor, &found)) return;
    if (!found) {
        scale->state->variance += scale->state->known ? drift * drift : 0;
        return;
    }
    double log_scale = fv_log(scale->config.camera_height_m / floor.height);
    scale_measure(scale, scale->config.source, log_scale,
                  floor.sigma * floor.sigma + floor_sigma_least * floor_sigma_least);
}

bool fv_scale_waiting(const struct fv_scale *scale, const struct fv_odometry *odometry)
{
    const struct fv_scale_state *s = scale->state;
    const struct fovea_pose *pose = fv_odometry_pose(odometry);
    uint64_t behind = fv_odometry_map(odometry)->state->keyframe_number - s->fitted;
    if (scale->config.source != FOVEA_SCALE_CAMERA_HEIGHT || !pose->posed ||
        s->map != pose->map_id || given_by_stereo(odometry))
        return false;
    if (s->gathering) return true;
    if (behind == 0) return false;
    /* After the window has converged, unless it never does. */
    return behind >= KEYFRAMES_BEHIND_MAX || !fv_odometry_job_waiting(odometry);
}

/* ---- a frame --------------------------------------------------------------------------------- */

/* A closure gave the map another unit here: what is known of a unit's metres goes with it. */
static void scale_follow(struct fv_scale_state *s, double map_scale)
{
    if (map_scale == s->map_scale) return;
    const double longer = fv_log(map_scale / s->map_scale);
    s->log_scale -= longer; /* where nothing is known it says nothing */
    s->prior -= longer;
    s->map_scale = map_scale;
}

/* With each keyframe of a map that has a unit of its own. */
static void compare_distances(struct fv_scale *scale, const struct fv_odometry *odometry)
{
    struct fv_scale_state *s = scale->state;
    const uint64_t keyframes = fv_odometry_map(odometry)->state->keyframe_number;
    double log_scale, variance;
    if (s->fitted == keyframes || !fv_scale_compare_distances(odometry, &log_scale, &variance))
        return;
    s->fitted = keyframes;
    scale_measure(scale, FOVEA_SCALE_STEREO, log_scale, variance);
}

/* The estimator is a filter of its own. */
static void take_inertial(struct fv_scale_state *s, const struct fv_inertial_known *inertial)
{
    s->known = true;
    s->source = FOVEA_SCALE_INERTIAL;
    s->log_scale = fv_log(inertial->scale) - fv_log(s->map_scale);
    s->variance = inertial->scale_sigma * inertial->scale_sigma;
}

void fv_scale_step(struct fv_scale *scale, struct fv_odometry *odometry,
                   const struct fv_inertial_known *inertial)
{
    struct fv_scale_state *s = scale->state;
    const struct fovea_pose *pose = fv_odometry_pose(odometry);
    const struct fv_map_state *map = fv_odometry_map(odometry)->state;
    if (s->map != pose->map_id || (!s->known && map->scale.source != FOVEA_SCALE_FREE))
        scale_enter(s, pose->map_id, map);
    scale_follow(s, map->S_map_world.s);
    if (pose->posed && inertial != NULL && inertial->settled)
        fv_odometry_keep_gravity(odometry, &inertial->map_gravity);
    if (!pose->posed || given_by_stereo(odometry)) return;
    /* What a map's first pose says of the floor is used at once. */
    if (!s->started && scale->config.source == FOVEA_SCALE_CAMERA_HEIGHT) {
        s->gathering = 0;
        do
            fv_scale_unit(scale, odometry);
        while (s->gathering);
    }
    if (scale->config.source == FOVEA_SCALE_WHEEL_ODOMETRY) fv_scale_walk(scale, odometry);
    if (inertial != NULL)
        take_inertial(s, inertial);
    else if (scale->config.source == FOVEA_SCALE_FREE)
        compare_distances(scale, odometry);
    s->started = true;
    if (!s->known) return;
    /* What is kept is of the map as a whole, where that is known apart. */
    const double log_scale =
        inertial != NULL ? fv_log(inertial->map_scale) : s->log_scale + fv_log(s->map_scale);
    const struct fv_map_scale kept = {s->source, 0, log_scale, s->variance};
    fv_odometry_keep_scale(odometry, &kept);
}

struct fv_scale_value fv_scale_get(const struct fv_scale *scale)
{
    const struct fv_scale_state *s = scale->state;
    if (!s->known) return (struct fv_scale_value){false, FOVEA_SCALE_FREE, 1, 0};
    return (struct fv_scale_value){true, (enum fovea_scale_source)s->source, fv_exp(s->log_scale),
                                   __builtin_sqrt(s->variance)};
}

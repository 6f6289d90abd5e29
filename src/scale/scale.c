#include "odometry/scale.h"

#include <string.h>

#include "geometry/vec.h"

enum { KEYFRAMES_BEHIND_MAX = 3 };

static const double drift =
    0.015; /* of the scale of a monocular map, relative, from keyframe to keyframe */
/* Floors are not flat, and robots nod on them: no fit is surer than this, relative. */
static const double floor_sigma_least = 0.03;
static const double surprise = 3; /* standard deviations; measurements further off count for less */

void fv_scale_carve(struct fv_scale *scale, const struct fovea_scale_config *config,
                    const double T_base_cam[12], struct fv_arena *persistent,
                    struct fv_arena *frame)
{
    memset(scale, 0, sizeof *scale);
    scale->config = *config;
    fv_se3_from_rows(T_base_cam, &scale->T_base_cam);
    const double *R = scale->T_base_cam.R;
    /* An identity is what stands there unless configured; base and camera axes never agree on a
     * robot. */
    bool turned = R[0] < 0.999 || R[4] < 0.999;
    for (int i = 0; i < 3; i++)
        scale->down[i] = turned ? -R[6 + i] : i == 1;
    scale->state = fv_arena_take(persistent, 1, sizeof *scale->state);
    scale->points = fv_arena_take_raw(frame, FV_PLANE_POINTS_MAX, sizeof *scale->points);
}

void fv_scale_init(struct fv_scale *scale, uint64_t seed)
{
    fovea_random_seed(&scale->state->random, seed);
    scale->state->map = UINT32_MAX; /* none yet: the first is taken up like any other */
}

/* Another map: its unit is another, and known where it brings a scale. Odometry itself goes on. */
static void fv_scale_enter(struct fv_scale_state *s, uint32_t map,
                           const struct fv_map_state *brought)
{
    s->started = s->metric = false;
    s->known = brought->scale.source != FOVEA_SCALE_FREE;
    s->source = brought->scale.source;
    s->map_scale = brought->S_map_odom.s;
    s->log_scale = s->prior = s->known ? brought->scale.log_scale - fovea_log(s->map_scale) : 0;
    s->variance = s->prior_variance = brought->scale.variance;
    s->station_count = 0;
    s->station_next = s->fitted = 0;
    s->map = map;
    memset(s->inner, 0, sizeof s->inner);
    memset(s->outer, 0, sizeof s->outer);
}

/* Take a measurement of the scale's logarithm. */
static void fv_scale_measure(struct fv_scale *scale, double log_scale, double variance)
{
    struct fv_scale_state *s = scale->state;
    s->source = scale->config.source;
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

/* ---- camera height
 * ------------------------------------------------------------------------------------- */

void fv_scale_unit(struct fv_scale *scale, const struct fv_odometry *o)
{
    struct fv_plane floor;
    scale->state->fitted = o->map.state->keyframe_number;
    if (!fv_scale_find_floor(scale, o, &floor)) {
        scale->state->variance += scale->state->known ? drift * drift : 0;
        return;
    }
    double log_scale = fovea_log(scale->config.camera_height_m / floor.height);
    fv_scale_measure(scale, log_scale,
                     floor.sigma * floor.sigma + floor_sigma_least * floor_sigma_least);
}

bool fv_scale_waiting(const struct fv_scale *scale, const struct fv_odometry *o)
{
    const struct fv_scale_state *s = scale->state;
    uint64_t behind = o->map.state->keyframe_number - s->fitted;
    if (scale->config.source != FOVEA_SCALE_CAMERA_HEIGHT || !o->state->pose.posed ||
        s->map != o->state->pose.map_id || behind == 0)
        return false;
    /* After the window is settled, unless it never is. */
    return behind >= KEYFRAMES_BEHIND_MAX || !fv_odometry_job_waiting(o);
}

/* ---- publishing
 * ---------------------------------------------------------------------------------------- */

/* Lengths of a covariance (upper triangle by rows, translation first) in another unit. */
static void fv_scale_covariance(double covariance[21], double factor)
{
    for (int row = 0, k = 0; row < 6; row++)
        for (int column = row; column < 6; column++, k++)
            covariance[k] *= (row < 3 ? factor : 1) * (column < 3 ? factor : 1);
}

/* `metres` per unit of the map. The continuous world has a unit of its own, which loops leave
 * alone. */
static void fv_scale_publish(struct fv_scale_state *s, double metres)
{
    struct fovea_pose *pose = &s->pose;
    const double factor = metres * pose->map_scale;
    for (int i = 0; i < 3; i++) {
        double inner = pose->T_world_cam[4 * i + 3];
        s->outer[i] += factor * (inner - s->inner[i]);
        s->inner[i] = inner;
        pose->T_world_cam[4 * i + 3] = s->outer[i];
    }
    fv_scale_covariance(pose->covariance, factor);
}

/* T_map_odom in metres, where the path has bent as well: what takes the published pose to the
 * map's. */
static void fv_scale_map(struct fovea_pose *pose, const struct fv_odometry *o, double metres)
{
    struct fv_se3 T_map_cam, T_odom_cam, T;
    fv_se3_invert(&o->map.keyframes[fv_map_current(&o->map)].T_cam_world, &T_map_cam);
    for (int i = 0; i < 3; i++)
        T_map_cam.t[i] *= metres;
    fv_se3_from_rows(pose->T_world_cam, &T_odom_cam);
    fv_se3_invert(&T_odom_cam, &T);
    fv_se3_compose(&T_map_cam, &T, &T);
    fv_se3_to_rows(&T, pose->T_map_odom);
    pose->map_scale = 1;
}

/* The pose relative to the newest keyframe, in the unit of the map. */
static void fv_scale_refer(struct fv_scale_state *s, const struct fv_odometry *o)
{
    const struct fv_keyframe *keyframe = &o->map.keyframes[o->state->newest];
    struct fv_se3 T; /* in the world of the map, which corrections move against that of the pose */
    fv_se3_invert(&o->map.keyframes[fv_map_current(&o->map)].T_cam_world, &T);
    fv_se3_compose(&keyframe->T_cam_world, &T, &T);
    fv_se3_to_rows(&T, s->pose.T_keyframe_cam);
    s->pose.reference_keyframe = keyframe->number;
}

/* A loop gave the map another unit here: what is known of a unit's metres goes with it. */
static void fv_scale_follow(struct fv_scale_state *s, double map_scale)
{
    if (map_scale == s->map_scale) return;
    const double longer = fovea_log(map_scale / s->map_scale);
    s->log_scale -= longer; /* where nothing is known it says nothing */
    s->prior -= longer;
    s->map_scale = map_scale;
}

void fv_scale_step(struct fv_scale *scale, struct fv_odometry *o)
{
    struct fv_scale_state *s = scale->state;
    struct fv_map_state *map = o->map.state;
    if (s->map != o->state->pose.map_id) fv_scale_enter(s, o->state->pose.map_id, map);
    fv_scale_follow(s, map->S_map_odom.s);
    s->pose = o->state->pose;
    s->pose.scale = 1;
    if (!s->pose.posed) return;
    fv_scale_refer(s, o);
    /* What a map's first pose tells of the floor is used at once. */
    if (!s->started && scale->config.source == FOVEA_SCALE_CAMERA_HEIGHT) fv_scale_unit(scale, o);
    if (scale->config.source == FOVEA_SCALE_ODOMETRY) fv_scale_walk(scale, o);
    s->started = true;
    if (s->known && !s->metric) { /* from now on in metres, from the world's origin */
        s->metric = true;
        memset(s->inner, 0, sizeof s->inner);
        memset(s->outer, 0, sizeof s->outer);
    }
    if (!s->known) return;
    map->scale =
        (struct fv_map_scale){s->source, 0, s->log_scale + fovea_log(s->map_scale), s->variance};
    s->pose.scale = fovea_exp(s->log_scale);
    fv_scale_publish(s, s->pose.scale);
    fv_scale_map(&s->pose, o, s->pose.scale);
    s->pose.scale_sigma = __builtin_sqrt(s->variance);
    s->pose.scale_source = (enum fovea_scale_source)s->source;
}

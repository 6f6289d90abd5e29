/* Whether a frame becomes a keyframe, and making it one. */
#include "geometry/vec.h"
#include "odometry/covariance_unit.h"
#include "odometry/odometry.h"

enum {
    FRAMES_APART_MIN = 2,  /* between keyframes, unless matches run out */
    LANDMARKS_ROOM = 1000, /* free slots that landmark creation should find */
    STILL_FRAMES = 8,      /* in one place: standing, and a keyframe would only repeat the last */
    MATCHES_LOW = 100      /* fewer, and any change of view is worth a keyframe */
};

static const double kept_fraction =
    0.7; /* of the matches of the last keyframe, below which one is needed */
static const double kept_fraction_urgent = 0.5; /* at which it may not wait */
static const double parallax_wanted_rad =
    0.12; /* travelled over median depth: a new keyframe adds depth */
static const double parallax_least_rad =
    0.01; /* less is standing still or turning: no keyframe is of use, */
static const double turn_least_rad = 0.1; /* but for a turn where distances are measured */

static const double still_move_rad = 0.002; /* above the noise of a standing camera's pose */

/* By halving. */
double fv_odometry_current_depth(const struct fv_odometry *o)
{
    const struct fv_keyframe *frame = &o->map.keyframes[fv_map_current(&o->map)];
    double low = 1e-4, high = 1e5;
    for (int step = 0; step < 24; step++) {
        double middle = __builtin_sqrt(low * high);
        uint32_t below = 0;
        for (uint32_t i = 0; i < o->state->localise.recent_count; i++) {
            double q[3];
            fv_se3_apply(&frame->T_cam_world,
                         o->map.landmarks[o->localiser.recent[i].landmark].point, q);
            below += q[2] < middle;
        }
        *(2 * below > o->state->localise.recent_count ? &high : &low) = middle;
    }
    return __builtin_sqrt(low * high);
}

/* T_keyframe_cam of the current frame. */
static struct fv_se3 motion_since(const struct fv_map *map, uint32_t keyframe)
{
    struct fv_se3 T_world_cam, T;
    fv_se3_invert(&map->keyframes[fv_map_current(map)].T_cam_world, &T_world_cam);
    fv_se3_compose(&map->keyframes[keyframe].T_cam_world, &T_world_cam, &T);
    return T;
}

/* Measured distances make landmarks of what a turn brings into view; without parallax two views do
 * not. */
static bool turned(const struct fv_map *map, const struct fv_se3 *T)
{
    double turn[3];
    fv_so3_log(T->R, turn);
    return fv_map_metric(map) && fv_norm3(turn) > turn_least_rad;
}

/* Count the frames for which the camera has stayed within `still_move_rad` of one position, seen
 * from the scene.
 */
static void note_stillness(struct fv_odometry *o, double depth)
{
    struct fv_odometry_state *s = o->state;
    const struct fv_se3 *T = &o->map.keyframes[fv_map_current(&o->map)].T_cam_world;
    const double origin[3] = {0, 0, 0};
    double position[3], between[3];
    fv_se3_apply_inverse(T, origin, position);
    fv_subtract3(position, s->still.position, between);
    if (fv_norm3(between) < still_move_rad * depth) {
        s->still.frames++;
    } else {
        s->still.frames = 0;
        fv_copy3(position, s->still.position);
    }
}

bool fv_odometry_keyframe_needed(struct fv_odometry *o, uint32_t inliers)
{
    const struct fv_odometry_state *s = o->state;
    uint64_t apart = s->frame_number - s->keyframe_frame;
    double fraction = (double)inliers / (s->keyframe_matches > 0 ? s->keyframe_matches : 1);
    double depth = fv_odometry_current_depth(o);
    const struct fv_se3 T = motion_since(&o->map, s->newest);
    double parallax = fv_norm3(T.t) / depth;
    note_stillness(o, depth);
    if (s->creation.pending_count == FV_CREATION_PENDING_MAX) return false;
    if ((s->still.frames >= STILL_FRAMES || parallax < parallax_least_rad) && !turned(&o->map, &T))
        return false;
    if (fraction < kept_fraction_urgent || inliers < MATCHES_LOW / 2) return true;
    if (apart < FRAMES_APART_MIN) return false;
    return fraction < kept_fraction || parallax > parallax_wanted_rad || inliers < MATCHES_LOW;
}

void fv_odometry_queue(struct fv_odometry *o, uint32_t keyframe)
{
    if (o->state->creation.pending_count < FV_CREATION_PENDING_MAX)
        o->state->creation.pending[o->state->creation.pending_count++] = (int32_t)keyframe;
}

void fv_odometry_make_keyframe(struct fv_odometry *o)
{
    struct fv_odometry_state *s = o->state;
    fv_map_make_room(&o->map,
                     LANDMARKS_ROOM < o->map.limits.landmarks / 4 ? LANDMARKS_ROOM
                                                                  : o->map.limits.landmarks / 4,
                     s->frame_number);
    struct fv_map_frame current = fv_map_frame_at(&o->map, fv_map_current(&o->map));
    double depth = fv_odometry_current_depth(o);
    uint32_t slot = fv_map_add_keyframe(&o->map, fv_map_current(&o->map));
    struct fv_keyframe *keyframe = &o->map.keyframes[slot];
    keyframe->depth = depth;
    keyframe->unit_variance = s->covariance.unit_variance;
    fv_covariance_spread_units(o);
    for (uint32_t f = 0; f < current.keyframe->features; f++) {
        int32_t landmark = current.landmark[f];
        /* Making room may have taken landmarks that the frame had matched. */
        if (landmark == FV_MAP_NONE || !o->map.landmarks[landmark].used) continue;
        if (fv_map_link(&o->map, (uint32_t)landmark, slot, f))
            fv_map_refresh_landmark(&o->map, (uint32_t)landmark);
    }
    current.keyframe->parent = (int32_t)slot;
    s->newest = slot;
    s->keyframe_frame = s->frame_number;
    s->keyframe_matches = keyframe->landmarks;
    s->job_wanted = true;
    fv_odometry_queue(o, slot);
}

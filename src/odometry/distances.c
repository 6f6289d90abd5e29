#include "odometry/distances.h"

#include <string.h>

#include "geometry/vec.h"
#include "odometry/odometry.h"

enum {
    JUDGED_MIN = 20 /* distances of landmarks, to judge them all */
};

static const double contradicts2 = 9;     /* squared error in units of its variance */
static const double agreeing_min = 0.5;   /* fraction of the distances that fit the map */
static const double map_parts_max = 0.05; /* what a landmark's own distance may be off by */

void fv_distances_carve(struct fv_distances *d, bool wanted, uint32_t features_max,
                        struct fv_arena *frame)
{
    d->from = wanted ? fv_arena_take_raw(frame, features_max, sizeof *d->from) : NULL;
}

void fv_odometry_take_distances(struct fv_odometry *o, const struct fv_odometry_input *input)
{
    const uint32_t current = fv_map_current(&o->map);
    struct fv_inverse_distance *distances = fv_map_distances(&o->map, current);
    if (distances == NULL) return;
    const uint32_t count = o->map.keyframes[current].features;
    if (input->distances == NULL)
        memset(distances, 0, count * sizeof *distances);
    else
        for (uint32_t f = 0; f < count; f++)
            distances[f] = input->distances[o->distances.from[f]];
}

/* ---- landmarks ------------------------------------------------------------------------------- */

/* Make a landmark of a feature of a keyframe; FV_MAP_NONE when there is no room. */
static int32_t make_landmark(struct fv_odometry *o, uint32_t keyframe, uint32_t feature,
                             const double bearing[3], float value)
{
    const struct fv_se3 *T = &o->map.keyframes[keyframe].T_cam_world;
    double point[3], world[3];
    for (int k = 0; k < 3; k++)
        point[k] = bearing[k] / (double)value;
    fv_se3_apply_inverse(T, point, world);
    const int32_t landmark = fv_map_add_landmark(&o->map, world, o->state->frame_number);
    if (landmark == FV_MAP_NONE) return landmark;
    (void)fv_map_link(&o->map, (uint32_t)landmark, keyframe, feature);
    fv_map_refresh_landmark(&o->map, (uint32_t)landmark);
    return landmark;
}

uint32_t fv_odometry_create_measured(struct fv_odometry *o, uint32_t keyframe, uint32_t first,
                                     uint32_t count)
{
    const struct fv_map_frame frame = fv_map_frame_at(&o->map, keyframe);
    const struct fv_inverse_distance *distances = fv_map_distances(&o->map, keyframe);
    uint32_t f = first;
    for (uint32_t done = 0; f < frame.keyframe->features && done < count; f++) {
        struct fv_keypoint p;
        if (frame.landmark[f] != FV_MAP_NONE ||
            !fv_inverse_distance_known(&distances[f], FV_MAP_KNOWN_PARTS) ||
            !fv_map_keypoint(&o->map, &frame.points[f], &p))
            continue;
        const double bearing[3] = {(double)p.bearing[0], (double)p.bearing[1],
                                   (double)p.bearing[2]};
        (void)make_landmark(o, keyframe, f, bearing, distances[f].value);
        done++;
    }
    return f;
}

/* ---- the first keyframe ---------------------------------------------------------------------- */

static uint32_t count_known(const struct fv_inverse_distance *distances, uint32_t count)
{
    uint32_t known = 0;
    for (uint32_t f = 0; f < count; f++)
        known += fv_inverse_distance_known(&distances[f], FV_MAP_KNOWN_PARTS);
    return known;
}

static void remember(struct fv_odometry *o, uint32_t keyframe)
{
    const uint32_t current = fv_map_current(&o->map);
    const struct fv_map_frame frame = fv_map_frame_at(&o->map, current),
                              made = fv_map_frame_at(&o->map, keyframe);
    o->state->localise.recent_count = 0;
    for (uint32_t f = 0; f < frame.keyframe->features; f++) {
        frame.landmark[f] = made.landmark[f];
        if (frame.landmark[f] == FV_MAP_NONE) continue;
        const struct fv_recent recent = {(uint32_t)frame.landmark[f],
                                         o->map.landmarks[frame.landmark[f]].generation,
                                         frame.points[f].level};
        o->localiser.recent[o->state->localise.recent_count++] = recent;
    }
}

/* Another map; where the hint has carried the pose over from a map in metres, in its world. */
static bool begin_another(struct fv_odometry *o)
{
    const struct fv_odometry_state *s = o->state;
    const struct fv_motion_hint *hint = &s->localise.hint;
    struct fv_se3 T_cam_map, T_map_cam;
    struct fv_sim3 S_world_map, S_map_cam, S;
    if (!hint->continues || !fv_map_metric(&o->map) || s->agreement.dropping ||
        s->agreement.suspect) {
        fv_map_begin_another(&o->map);
        return false;
    }
    fv_se3_compose(&hint->T_now_last, &o->map.keyframes[fv_map_current(&o->map)].T_cam_world,
                   &T_cam_map);
    fv_se3_invert(&T_cam_map, &T_map_cam);
    fv_sim3_from_se3(&T_map_cam, 1, &S_map_cam);
    fv_sim3_invert(&o->map.state->S_map_world, &S_world_map);
    fv_sim3_compose(&S_world_map, &S_map_cam, &S);
    fv_sim3_invert(&S, &S);
    fv_map_continue_in_another(&o->map, &S, hint->turn_variance);
    return true;
}

bool fv_odometry_begin_metric(struct fv_odometry *o, bool *continues)
{
    struct fv_odometry_state *s = o->state;
    const uint32_t current = fv_map_current(&o->map);
    struct fv_keyframe *frame = &o->map.keyframes[current];
    const struct fv_inverse_distance *distances = fv_map_distances(&o->map, current);
    if (distances == NULL || count_known(distances, frame->features) < FV_INITIALISE_POINTS_MIN)
        return false;
    fv_window_abort(&o->window);
    *continues = o->map.state->keyframe_count > 0 && begin_another(o);
    fv_map_make_room(&o->map, frame->features, s->frame_number);
    o->map.state->scale = (struct fv_map_scale){
        FOVEA_SCALE_STEREO, 0, 0, FV_DISTANCES_SCALE_SIGMA * FV_DISTANCES_SCALE_SIGMA};
    s->first_keyframe = o->map.state->keyframe_number;
    fv_agreement_forget(&s->agreement);
    fv_usable_forget(&s->usable);
    fv_motion_forget(&s->localise.motion);
    fv_se3_identity(&frame->T_cam_world);
    frame->parent = FV_MAP_NONE;
    s->newest = fv_map_add_keyframe(&o->map, current);
    (void)fv_odometry_create_measured(o, s->newest, 0, frame->features);
    remember(o, s->newest);
    o->map.keyframes[s->newest].depth = fv_odometry_current_depth(o);
    frame->parent = (int32_t)s->newest;
    s->keyframe_frame = s->frame_number;
    s->keyframe_matches = s->localise.recent_count;
    o->initialiser.state->count = 0;
    s->pose.matches = s->pose.inliers = s->localise.recent_count;
    return true;
}

/* ---- a frame --------------------------------------------------------------------------------- */

bool fv_odometry_judge_distances(struct fv_odometry *o, const struct fv_se3 *T_cam_world)
{
    const uint32_t current = fv_map_current(&o->map);
    struct fv_inverse_distance *distances = fv_map_distances(&o->map, current);
    if (distances == NULL || !fv_map_metric(&o->map)) return false;
    const struct fv_map_frame frame = fv_map_frame_at(&o->map, current);
    uint32_t judged = 0, agreeing = 0;
    for (uint32_t f = 0; f < frame.keyframe->features; f++) {
        if (frame.landmark[f] == FV_MAP_NONE || !(distances[f].weight > 0)) continue;
        double q[3], b[3], e, J[3];
        for (int k = 0; k < 3; k++)
            b[k] = (double)frame.keypoints[f].bearing[k];
        fv_se3_apply(T_cam_world, o->map.landmarks[frame.landmark[f]].point, q);
        if (!fv_inverse_distance_error(&distances[f], b, q, &e, J)) continue;
        const double own = map_parts_max / fv_norm3(q),
                     variance = 1 / (double)distances[f].weight + own * own;
        judged++;
        agreeing += e * e < contradicts2 * variance;
    }
    if (judged < JUDGED_MIN || agreeing >= agreeing_min * judged) return judged > 0;
    memset(distances, 0, frame.keyframe->features * sizeof *distances);
    return false;
}

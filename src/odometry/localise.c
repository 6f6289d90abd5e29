/* The pose of a frame against the local map. */
#include <string.h>

#include "geometry/vec.h"
#include "odometry/covariance.h"
#include "odometry/odometry.h"

enum {
    DISTANCE_PREDICTED_MAX = 80, /* Hamming, where the position is predicted */
    INLIERS_FIRST_MIN = 12,      /* of the first stage, to go on */
    FAR_SAMPLE = 32              /* landmarks whose predicted motion is looked at */
};

static const double radius_first_px = 12, radius_wide_px = 30;     /* times the level's scale */
static const double radius_unmoved_px = 2, unmoved_fraction = 0.5; /* of the last landmarks */
static const double local_widen =
    4; /* of the local map's search, where it makes up for a poor first stage */
static const double found_fraction_low =
    0.2; /* of the visible landmarks: less, and the search is widened */

void fv_localiser_carve(struct fv_localiser *l, uint32_t features_max, bool distances,
                        struct fv_arena *persistent, struct fv_arena *frame)
{
    l->recent = fv_arena_take(persistent, features_max, sizeof *l->recent);
    l->observations = fv_arena_take_raw(frame, features_max, sizeof *l->observations);
    l->observed_feature = fv_arena_take_raw(frame, features_max, sizeof *l->observed_feature);
    l->local = fv_arena_take_raw(frame, FV_LOCAL_LANDMARKS_MAX, sizeof *l->local);
    l->distances = distances ? fv_arena_take_raw(frame, features_max, sizeof *l->distances) : NULL;
}

void fv_matches_carve(struct fv_matches *m, uint32_t features_max, struct fv_arena *frame)
{
    m->distance = fv_arena_take_raw(frame, features_max, sizeof *m->distance);
    m->nearest = fv_arena_take_raw(frame, features_max, sizeof *m->nearest);
    m->second = fv_arena_take_raw(frame, features_max, sizeof *m->second);
}

void fv_matches_clear(const struct fv_matches *m, const struct fv_map_frame *frame)
{
    for (uint32_t f = 0; f < frame->keyframe->features; f++) {
        frame->landmark[f] = FV_MAP_NONE;
        m->distance[f] = UINT16_MAX;
    }
}

/* Take feature `f` for a landmark, unless a nearer one has it. */
static void take(const struct fv_matches *m, const struct fv_map_frame *frame, uint32_t f,
                 uint32_t landmark, uint32_t distance)
{
    if (frame->landmark[f] != FV_MAP_NONE && m->distance[f] <= distance) return;
    frame->landmark[f] = (int16_t)landmark;
    m->distance[f] = (uint16_t)distance;
}

static bool project_landmark(const struct fv_map *map, const struct fv_se3 *T,
                             const struct fv_landmark *l, double q[3], double pixel[2])
{
    fv_se3_apply(T, l->point, q);
    return fv_map_project(map, q, pixel);
}

/* First stage: the landmarks of the last frame around where `T` predicts them. */
static uint32_t match_recent(struct fv_odometry *o, const struct fv_kernels *kernels,
                             const struct fv_map_frame *frame, const struct fv_se3 *T,
                             double radius_px)
{
    uint32_t matches = 0;
    fv_matches_clear(&o->matches, frame);
    for (uint32_t i = 0; i < o->state->localise.recent_count; i++) {
        const struct fv_recent *r = &o->localiser.recent[i];
        const struct fv_landmark *l = &o->map.landmarks[r->landmark];
        double q[3], pixel[2];
        if (!l->used || l->generation != r->generation ||
            !project_landmark(&o->map, T, l, q, pixel))
            continue;
        struct fv_found found =
            fv_map_search(&o->map, kernels, fv_map_current(&o->map), pixel[0], pixel[1],
                          radius_px * fv_level_scale(r->level), (int)r->level - 1,
                          (int)r->level + 1, fv_map_descriptor(&o->map, l), false);
        if (!fv_map_found_one(&found, DISTANCE_PREDICTED_MAX)) continue;
        take(&o->matches, frame, (uint32_t)found.feature, r->landmark, found.distance);
        matches++;
    }
    return matches;
}

static void collect_distances(struct fv_localiser *localiser, const struct fv_map *map,
                              uint32_t count)
{
    const struct fv_inverse_distance *distances = fv_map_distances(map, fv_map_current(map));
    for (uint32_t i = 0; i < count; i++)
        localiser->distances[i] = distances[localiser->observed_feature[i]];
}

/* Observations of all matched features; returns their number. */
uint32_t fv_localiser_collect(struct fv_localiser *localiser, const struct fv_map *map,
                              const struct fv_map_frame *frame)
{
    uint32_t count = 0;
    for (uint32_t f = 0; f < frame->keyframe->features; f++) {
        if (frame->landmark[f] == FV_MAP_NONE) continue;
        fv_observation_from(&frame->keypoints[f], map->landmarks[frame->landmark[f]].point,
                            &localiser->observations[count]);
        localiser->observed_feature[count++] = f;
    }
    if (localiser->measures) collect_distances(localiser, map, count);
    return count;
}

/* Refine over all matches, forget those that do not fit; `to_noise`: then with the limit that the
 * noise found allows. */
static uint32_t refine(struct fv_localiser *localiser, const struct fv_map *map,
                       const struct fv_map_frame *frame, int rounds, int steps, bool to_noise,
                       struct fv_se3 *T, struct fv_pose_fit *fit)
{
    const uint32_t count = fv_localiser_collect(localiser, map, frame);
    const struct fv_inverse_distance *distances = localiser->measures ? localiser->distances : NULL;
    if (count < 6 ||
        !fv_pose_refine(localiser->observations, distances, count, rounds, steps, T, fit))
        return 0;
    if (to_noise && !fv_pose_refine_to_noise(localiser->observations, distances, count, T, fit))
        return 0;
    for (uint32_t i = 0; i < count; i++)
        if (!localiser->observations[i].inlier)
            frame->landmark[localiser->observed_feature[i]] = FV_MAP_NONE;
    return fit->inliers;
}

uint32_t fv_localiser_refine(struct fv_localiser *localiser, const struct fv_map *map,
                             const struct fv_map_frame *frame, int rounds, int steps,
                             struct fv_se3 *T, struct fv_pose_fit *fit)
{
    return refine(localiser, map, frame, rounds, steps, false, T, fit);
}

/* ---- local map ------------------------------------------------------------------------------- */

/* Landmarks of the keyframes with most votes in `shared` (which is used up), except those matched
 * already. */
static uint32_t gather_local(struct fv_localiser *localiser, struct fv_map *map, uint32_t newest,
                             const struct fv_map_frame *frame, uint16_t *shared)
{
    uint32_t count = 0, mark = ++map->state->mark;
    shared[newest] = UINT16_MAX; /* always */
    for (uint32_t f = 0; f < frame->keyframe->features; f++)
        if (frame->landmark[f] != FV_MAP_NONE) map->landmarks[frame->landmark[f]].mark = mark;
    for (int round = 0; round < FV_LOCAL_KEYFRAMES_MAX; round++) {
        const uint32_t best = fv_map_best_shared(map, shared);
        if (shared[best] == 0) break;
        shared[best] = 0;
        struct fv_map_frame from = fv_map_frame_at(map, best);
        for (uint32_t f = 0; f < from.keyframe->features && count < FV_LOCAL_LANDMARKS_MAX; f++) {
            if (from.landmark[f] == FV_MAP_NONE || map->landmarks[from.landmark[f]].mark == mark)
                continue;
            map->landmarks[from.landmark[f]].mark = mark;
            localiser->local[count++] = (uint32_t)from.landmark[f];
        }
    }
    return count;
}

/* Second stage: the rest of the local map, close to where the refined pose sees it. Returns
 * the number of visible landmarks. */
uint32_t fv_odometry_match_local(struct fv_odometry *o, const struct fv_kernels *kernels,
                                 const struct fv_map_frame *frame, const struct fv_se3 *T,
                                 double widen)
{
    uint16_t shared[FOVEA_ODOMETRY_KEYFRAMES_MAX];
    fv_map_count_shared(&o->map, fv_map_current(&o->map), shared);
    uint32_t count = gather_local(&o->localiser, &o->map, o->state->newest, frame, shared),
             visible = 0;
    for (uint32_t i = 0; i < count; i++) {
        struct fv_landmark *l = &o->map.landmarks[o->localiser.local[i]];
        double q[3], pixel[2], ray[3];
        if (!project_landmark(&o->map, T, l, q, pixel)) continue;
        double distance = fv_norm3(q);
        fv_rotate_back3(T->R, q, ray);
        double cosine = fv_map_cosine(l, ray, distance);
        int level = fv_map_predict_level(l, distance);
        if (cosine < 0.5 || level < 0) continue;
        visible++;
        l->expected++;
        double radius = widen * (cosine > 0.998 ? 3 : 5) * fv_level_scale((uint32_t)level);
        struct fv_found found =
            fv_map_search(&o->map, kernels, fv_map_current(&o->map), pixel[0], pixel[1], radius,
                          level - 1, level + 1, fv_map_descriptor(&o->map, l), true);
        if (!fv_map_found_one(&found, DISTANCE_PREDICTED_MAX)) continue;
        take(&o->matches, frame, (uint32_t)found.feature, o->localiser.local[i], found.distance);
    }
    return visible;
}

/* ---- the whole ------------------------------------------------------------------------------- */

/* Remember what this frame saw, for the next one and for the landmarks' records. */
static void remember(struct fv_odometry *o, const struct fv_map_frame *frame)
{
    o->state->localise.recent_count = 0;
    for (uint32_t f = 0; f < frame->keyframe->features; f++) {
        if (frame->landmark[f] == FV_MAP_NONE) continue;
        struct fv_landmark *l = &o->map.landmarks[frame->landmark[f]];
        l->found++;
        l->seen = (uint32_t)o->state->frame_number;
        if (l->expected < l->found) l->expected = l->found;
        if (l->expected > 60000) {
            l->expected /= 2;
            l->found /= 2;
        }
        struct fv_recent recent = {(uint32_t)frame->landmark[f], l->generation,
                                   frame->points[f].level};
        o->localiser.recent[o->state->localise.recent_count++] = recent;
    }
}

/* First stage where the camera is nearly where it is expected. */
static bool pose_about(struct fv_odometry *o, const struct fv_kernels *kernels,
                       const struct fv_map_frame *frame, const struct fv_se3 *expected,
                       struct fv_se3 *T, struct fv_pose_fit *fit)
{
    *T = *expected;
    return match_recent(o, kernels, frame, T, radius_first_px) >= INLIERS_FIRST_MIN &&
           refine(&o->localiser, &o->map, frame, 2, 4, true, T, fit) >= INLIERS_FIRST_MIN;
}

/* Whether the motion predicted takes landmarks farther than the first search would see, were the
 * picture the last one again. */
static bool far_from(const struct fv_odometry *o, const struct fv_se3 *last,
                     const struct fv_se3 *predicted)
{
    uint32_t far = 0, seen = 0;
    const uint32_t count = o->state->localise.recent_count, step = count / FAR_SAMPLE + 1;
    for (uint32_t i = 0; i < count; i += step) {
        const struct fv_recent *r = &o->localiser.recent[i];
        const struct fv_landmark *l = &o->map.landmarks[r->landmark];
        double q[3], from[2], to[2];
        if (!l->used || l->generation != r->generation ||
            !project_landmark(&o->map, last, l, q, from) ||
            !project_landmark(&o->map, predicted, l, q, to))
            continue;
        const double x = to[0] - from[0], y = to[1] - from[1];
        seen++;
        far += x * x + y * y > radius_first_px * radius_first_px / 4;
    }
    return 2 * far > seen;
}

/* The picture may be the last one again: most landmarks are where they were, to the pixel. */
static bool pose_unmoved(struct fv_odometry *o, const struct fv_kernels *kernels,
                         const struct fv_map_frame *frame, const struct fv_se3 *last,
                         struct fv_se3 *T, struct fv_pose_fit *fit)
{
    const uint32_t most = (uint32_t)(unmoved_fraction * o->state->localise.recent_count);
    const uint32_t wanted = most > INLIERS_FIRST_MIN ? most : INLIERS_FIRST_MIN;
    *T = *last;
    return match_recent(o, kernels, frame, T, radius_unmoved_px) >= wanted &&
           refine(&o->localiser, &o->map, frame, 2, 4, true, T, fit) >= wanted;
}

/* First stage: a rough pose with matches to build on. */
static bool rough_pose(struct fv_odometry *o, const struct fv_kernels *kernels,
                       const struct fv_map_frame *frame, const struct fv_se3 *last,
                       struct fv_se3 *T, struct fv_pose_fit *fit)
{
    const struct fv_motion_hint *hint = &o->state->localise.hint;
    const bool lost = o->state->state == FOVEA_TRACKING_LOST;
    /* Not where the pictures have contradicted the map: what follows would undo its giving up. */
    const bool doubted = o->state->agreement.dropping || o->state->agreement.suspect;
    if (!lost || (hint->whole && !doubted)) {
        struct fv_se3 predicted;
        uint32_t matches;
        fv_motion_predict_by(&o->state->localise.motion, hint, last, frame->keyframe->stamp_ns,
                             &predicted);
        if (!lost && (o->state->usable.frozen || far_from(o, last, &predicted)) &&
            pose_unmoved(o, kernels, frame, last, T, fit))
            return true;
        if (pose_about(o, kernels, frame, &predicted, T, fit)) return true;
        *T = predicted;
        matches = match_recent(o, kernels, frame, T, radius_wide_px);
        if (matches >= INLIERS_FIRST_MIN &&
            fv_localiser_refine(&o->localiser, &o->map, frame, 3, 5, T, fit) >= INLIERS_FIRST_MIN)
            return true;
        /* Too few of what the last frame saw is left, as in fast driving: the local map tells more.
         */
        *T = predicted;
        (void)fv_odometry_match_local(o, kernels, frame, T, local_widen);
        if (fv_localiser_refine(&o->localiser, &o->map, frame, 3, 5, T, fit) >= INLIERS_FIRST_MIN)
            return true;
    }
    if (lost) return fv_odometry_relocalise(o, kernels, T, fit);
    return fv_odometry_try_keyframe(o, kernels, o->state->newest, T, fit);
}

void fv_odometry_confirm(struct fv_odometry *o)
{
    struct fv_map_frame frame = fv_map_frame_at(&o->map, fv_map_current(&o->map));
    struct fv_se3 T = frame.keyframe->T_cam_world;
    struct fv_pose_fit fit;
    o->localiser.measures = fv_odometry_judge_distances(o, &T);
    uint32_t inliers = fv_localiser_refine(&o->localiser, &o->map, &frame, 1, 3, &T, &fit);
    if (inliers == 0) return;
    o->state->pose.inliers = inliers;
    o->state->covariance_reliable = fv_covariance_write(o, &frame, &fit);
}

/* A frame that was found again follows no frame. */
static void note_motion(struct fv_odometry *o, const struct fv_se3 *last, const struct fv_se3 *T,
                        int64_t stamp_ns)
{
    struct fv_motion *motion = &o->state->localise.motion;
    fv_motion_note(motion, last, motion->stamp_ns, T, stamp_ns);
    if (o->state->state == FOVEA_TRACKING_LOST) fv_motion_forget(motion);
}

uint32_t fv_odometry_localise(struct fv_odometry *o, const struct fv_kernels *kernels)
{
    struct fv_map_frame frame = fv_map_frame_at(&o->map, fv_map_current(&o->map));
    struct fv_se3 last = frame.keyframe->T_cam_world, T;
    struct fv_pose_fit fit;
    o->localiser.measures = false;
    if (!rough_pose(o, kernels, &frame, &last, &T, &fit)) return 0;
    o->localiser.measures = fv_odometry_judge_distances(o, &T);
    uint32_t known = fit.inliers, visible = fv_odometry_match_local(o, kernels, &frame, &T, 1);
    o->state->pose.matches = fv_localiser_collect(&o->localiser, &o->map, &frame);
    uint32_t inliers = refine(&o->localiser, &o->map, &frame, 2, 4, true, &T, &fit);
    if (inliers <
        found_fraction_low * (visible + known)) { /* a wrong rough pose finds what agrees with it */
        (void)fv_odometry_match_local(o, kernels, &frame, &T, local_widen);
        o->state->pose.matches = fv_localiser_collect(&o->localiser, &o->map, &frame);
        inliers = fv_localiser_refine(&o->localiser, &o->map, &frame, 3, 5, &T, &fit);
    }
    if (inliers < FOVEA_POSED_INLIERS_MIN) return 0;
    fv_odometry_judge_freeze(o, &frame, &last, &T);
    if (!o->state->usable.frozen) note_motion(o, &last, &T, frame.keyframe->stamp_ns);
    frame.keyframe->T_cam_world = T;
    struct fv_se3 held = T;
    fv_odometry_hold_turn(o, &last, &fit, !o->state->usable.frozen, &held);
    o->state->pose.inliers = inliers;
    o->state->pose.quality = (float)inliers / (float)(visible + known);
    if (o->state->pose.quality > 1) o->state->pose.quality = 1;
    o->state->covariance_reliable = fv_covariance_write(o, &frame, &fit);
    fv_odometry_reduce_own(o);
    fv_odometry_add_freeze(o, &frame);
    frame.keyframe->T_cam_world = held; /* the covariance stays that of the picture alone */
    remember(o, &frame);
    return inliers;
}

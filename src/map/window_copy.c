/* Window optimisation: what goes in, and what comes back. */
#include <string.h>

#include "geometry/pose.h"
#include "geometry/vec.h"
#include "map/window.h"
#include "geometry/chi_square.h"

/* Squared error of a measured distance, in units of its variance, beyond which it goes. */
static const double distance_limit2 = 16;

/* ---- start ----------------------------------------------------------------------------------- */

static int32_t pose_of(const struct fv_window_state *s, uint32_t slot)
{
    return s->pose_of[slot];
}

uint32_t fv_window_put_pose(struct fv_window_state *s, const struct fv_map *map, uint32_t slot)
{
    struct fv_window_pose *p = &s->poses[s->pose_count];
    p->T_cam_world = p->before = p->at_start = map->keyframes[slot].T_cam_world;
    p->slot = slot;
    p->generation = map->keyframes[slot].generation;
    p->column = -1;
    p->reserved = 0;
    s->pose_of[slot] = (int8_t)s->pose_count;
    return s->pose_count++;
}

/* Keyframes of the window: the newest one, then those that share most landmarks with it. */
static void pick_keyframes(struct fv_window *w, const struct fv_map *map, uint32_t newest)
{
    struct fv_window_state *s = w->state;
    (void)fv_window_put_pose(s, map, newest);
    struct fv_map_frame frame = fv_map_frame_at(map, newest);
    uint16_t shared[256] = {0};
    for (uint32_t i = 0; i < frame.keyframe->features; i++) {
        if (frame.landmark[i] == FV_MAP_NONE) continue;
        const struct fv_landmark *l = &map->landmarks[frame.landmark[i]];
        for (uint32_t k = 0; k < l->observer_count; k++)
            shared[l->observers[k].keyframe]++;
    }
    shared[newest] = 0;
    while (s->pose_count < w->limits.keyframes) {
        const uint32_t best = fv_map_best_shared_newest(map, shared);
        if (shared[best] < 15 && s->pose_count >= 2) break;
        if (shared[best] == 0) break;
        shared[best] = 0;
        (void)fv_window_put_pose(s, map, best);
    }
}

/* The oldest of the window stays where it is, unless keyframes outside hold the window in place. */
static void number_columns(struct fv_window_state *s, const struct fv_map *map, uint32_t in_window)
{
    uint32_t oldest = 0;
    for (uint32_t i = 1; i < in_window; i++)
        if (map->keyframes[s->poses[i].slot].number < map->keyframes[s->poses[oldest].slot].number)
            oldest = i;
    bool held = s->pose_count > in_window + 1;
    s->moved_count = 0;
    for (uint32_t i = 0; i < in_window; i++)
        if (held || i != oldest) s->poses[i].column = 6 * (int32_t)s->moved_count++;
}

static void add_observations(struct fv_window *w, const struct fv_map *map,
                             const struct fv_landmark *l)
{
    struct fv_window_state *s = w->state;
    const bool metric = fv_map_metric(map);
    for (uint32_t k = 0; k < l->observer_count; k++) {
        uint32_t slot = l->observers[k].keyframe;
        int32_t pose = pose_of(s, slot);
        if (pose < 0 && s->pose_count < FV_WINDOW_POSES_MAX)
            pose = (int32_t)fv_window_put_pose(s, map, slot);
        if (pose < 0) continue;
        struct fv_window_observation *o = &w->observations[s->observation_count++];
        o->seen = fv_map_frame_at(map, slot).points[l->observers[k].feature];
        o->pose = (uint16_t)pose;
        if (w->distances != NULL)
            w->distances[s->observation_count - 1] =
                metric ? fv_map_distances(map, slot)[l->observers[k].feature]
                       : (struct fv_inverse_distance){0, 0};
        w->landmarks[s->landmark_count - 1].count++;
    }
}

static void copy_landmarks(struct fv_window *w, struct fv_map *map, uint32_t in_window,
                           uint32_t observers_min)
{
    struct fv_window_state *s = w->state;
    for (uint32_t i = 0; i < in_window; i++) {
        struct fv_map_frame frame = fv_map_frame_at(map, s->poses[i].slot);
        for (uint32_t f = 0;
             f < frame.keyframe->features && s->landmark_count < w->limits.landmarks; f++) {
            if (frame.landmark[f] == FV_MAP_NONE) continue;
            struct fv_landmark *l = &map->landmarks[frame.landmark[f]];
            if (l->mark == map->state->mark || l->observer_count < observers_min) continue;
            if (s->observation_count + l->observer_count > w->limits.observations) return;
            l->mark = map->state->mark;
            fv_window_put_landmark(w, l->point);
            w->landmarks[s->landmark_count - 1].slot = (uint32_t)frame.landmark[f];
            w->landmarks[s->landmark_count - 1].generation = l->generation;
            add_observations(w, map, l);
        }
    }
}

bool fv_window_start(struct fv_window *w, struct fv_map *map, uint32_t newest)
{
    struct fv_window_state *s = w->state;
    fv_window_clear(w);
    pick_keyframes(w, map, newest);
    uint32_t in_window = s->pose_count;
    if (in_window < 2) return false;
    /* Well-seen landmarks first: they bind the window; the rest fills the room that is left. */
    map->state->mark++;
    copy_landmarks(w, map, in_window, 3);
    copy_landmarks(w, map, in_window, 2);
    number_columns(s, map, in_window);
    fv_window_take_turns(w, map, in_window);
    if (s->moved_count == 0 || s->landmark_count < 10) return false;
    s->packed = true;
    s->keyframe_number = map->keyframes[newest].number;
    fv_window_begin(w, w->limits.passes);
    return true;
}

/* ---- commit ---------------------------------------------------------------------------------- */

/* T_world_world of a moved keyframe: takes world points that hung on it to where they belong now.
 */
static void correction(const struct fv_window_pose *p, struct fv_se3 *C)
{
    struct fv_se3 inverse;
    fv_se3_invert(&p->T_cam_world, &inverse);
    fv_se3_compose(&inverse, &p->at_start, C);
}

static const struct fv_window_pose *moved_by(const struct fv_window_state *s,
                                             const struct fv_map *map, int32_t slot)
{
    int32_t i = slot < 0 ? -1 : pose_of(s, (uint32_t)slot);
    if (i < 0 || s->poses[i].column < 0 ||
        map->keyframes[slot].generation != s->poses[i].generation)
        return 0;
    return &s->poses[i];
}

/* A distance that the optimised map contradicts was measured on a wrong match. */
static void drop_distance(struct fv_window *w, const struct fv_map *map,
                          const struct fv_window_landmark *l, uint32_t observation,
                          const double bearing[3], const double q[3])
{
    const struct fv_window_pose *pose = &w->state->poses[w->observations[observation].pose];
    const struct fv_inverse_distance *measured = &w->distances[observation];
    const struct fv_landmark *target = &map->landmarks[l->slot];
    double e, J[3];
    if (!fv_inverse_distance_error(measured, bearing, q, &e, J) ||
        (double)measured->weight * e * e < distance_limit2 ||
        !fv_map_holds(map, pose->slot, pose->generation))
        return;
    for (uint32_t k = 0; k < target->observer_count; k++)
        if (target->observers[k].keyframe == pose->slot)
            fv_map_distances(map, pose->slot)[target->observers[k].feature].weight = 0;
}

/* Unlink the landmark's observations that do not fit; true when it still stands. */
static bool drop_misfits(struct fv_window *w, struct fv_map *map,
                         const struct fv_window_landmark *l, uint32_t *dropped)
{
    const struct fv_window_state *s = w->state;
    for (uint32_t k = 0; k < l->count; k++) {
        const struct fv_window_observation *o = &w->observations[l->first + k];
        const struct fv_window_pose *pose = &s->poses[o->pose];
        double q[3], e[2], b[3], A[6];
        for (int i = 0; i < 3; i++)
            b[i] = o->bearing[i];
        for (int i = 0; i < 6; i++)
            A[i] = o->A[i];
        fv_se3_apply(&pose->T_cam_world, l->point, q);
        if (fv_observation_error(b, A, q, e, 0) &&
            o->weight * (e[0] * e[0] + e[1] * e[1]) < FV_CHI_SQUARE_95_2) {
            if (w->distances != NULL) drop_distance(w, map, l, l->first + k, b, q);
            continue;
        }
        if (map->keyframes[pose->slot].generation == pose->generation) {
            fv_map_unlink(map, l->slot, pose->slot);
            (*dropped)++;
        }
    }
    return fv_map_landmark_stands(map, &map->landmarks[l->slot]);
}

/* Keyframes and landmarks that were not in the window but hang on a keyframe that was. */
static void move_dependants(const struct fv_window_state *s, struct fv_map *map)
{
    struct fv_se3 C, inverse;
    for (uint32_t slot = 0; slot < map->limits.keyframes + 1;
         slot++) { /* the current frame as well */
        struct fv_keyframe *k = &map->keyframes[slot];
        bool current = slot == fv_map_current(map);
        if ((!k->used && !current) || pose_of(s, slot) >= 0) continue;
        if (!current && k->number <= s->keyframe_number) continue;
        const struct fv_window_pose *parent = moved_by(s, map, k->parent);
        if (!parent) continue;
        correction(parent, &C);
        fv_se3_invert(&C, &inverse);
        fv_se3_compose(&k->T_cam_world, &inverse, &k->T_cam_world);
        fv_so3_orthonormalise(k->T_cam_world.R);
    }
}

static void move_landmarks(const struct fv_window_state *s, struct fv_map *map)
{
    struct fv_se3 corrections[FV_WINDOW_POSES_MAX];
    for (uint32_t i = 0; i < s->pose_count; i++)
        correction(&s->poses[i], &corrections[i]);
    for (uint32_t slot = 0; slot < map->state->landmark_top; slot++) {
        struct fv_landmark *l = &map->landmarks[slot];
        if (!l->used || l->mark == map->state->mark || l->observer_count == 0) continue;
        int32_t i = pose_of(s, l->observers[0].keyframe);
        if (i < 0 || s->poses[i].column < 0 ||
            map->keyframes[s->poses[i].slot].generation != s->poses[i].generation)
            continue;
        double moved[3];
        fv_se3_apply(&corrections[i], l->point, moved);
        fv_copy3(moved, l->point);
    }
}

struct fv_window_result fv_window_commit(struct fv_window *w, struct fv_map *map)
{
    struct fv_window_state *s = w->state;
    struct fv_window_result result = {.cost_at_start = s->cost_at_start, .cost = s->cost_before};
    s->phase = FV_WINDOW_IDLE;
    if (!s->accepted_any) return result;
    map->state->mark++;
    for (uint32_t i = 0; i < s->landmark_count; i++) {
        struct fv_window_landmark *l = &w->landmarks[i];
        struct fv_landmark *target = &map->landmarks[l->slot];
        if (!target->used || target->generation != l->generation) continue;
        fv_copy3(l->before, l->point);
        fv_copy3(l->before, target->point);
        target->mark = map->state->mark;
    }
    for (uint32_t i = 0; i < s->pose_count; i++) {
        s->poses[i].T_cam_world = s->poses[i].before;
        fv_so3_orthonormalise(s->poses[i].T_cam_world.R);
    }
    move_dependants(s, map);
    move_landmarks(s, map);
    for (uint32_t i = 0; i < s->pose_count; i++) {
        if (!moved_by(s, map, (int32_t)s->poses[i].slot)) continue;
        map->keyframes[s->poses[i].slot].T_cam_world = s->poses[i].T_cam_world;
        result.moved_keyframes++;
    }
    for (uint32_t i = 0; i < s->landmark_count; i++) {
        struct fv_landmark *target = &map->landmarks[w->landmarks[i].slot];
        if (target->used && target->generation == w->landmarks[i].generation &&
            !drop_misfits(w, map, &w->landmarks[i], &result.dropped_observations))
            fv_map_remove_landmark(map, w->landmarks[i].slot);
    }
    return result;
}

/* Closures: the landmarks around a candidate, searched for in other keyframes, before and after
 * the correction. */
#include <string.h>

#include "fovea/features.h"
#include "geometry/pose.h"
#include "geometry/vec.h"
#include "map/closure.h"
#include "geometry/chi_square.h"

enum { GROUP_PER_UNIT = 300, FUSE_PER_UNIT = 120, DISTANCE_GUIDED_MAX = 64 };

static const double radius_guided_px = 7, radius_fuse_px = 4; /* times the level's scale */
static const double distance_ratio_max =
    1.3; /* of two landmarks that are the same thing, from the camera */

/* ---- before the correction ------------------------------------------------------------------- */

/* A landmark found at a feature that has a landmark of its own: the two correspond. The candidate
 * need not see the landmark, so its side says only how far it is. False when the two are not at one
 * distance. */
static bool add_correspondence(struct fv_closure *closure, const struct fv_map *map,
                               const struct fv_map_frame *frame, uint32_t feature,
                               const struct fv_landmark *l, const double q[3],
                               const double in_candidate[3])
{
    struct fv_correspondence *m = &closure->correspondences[closure->state->correspondence_count];
    memset(m, 0, sizeof *m);
    fv_closure_side_a(map, frame, feature, m);
    double ratio = fv_norm3(q) / fv_norm3(m->point_a);
    if (ratio > distance_ratio_max || ratio * distance_ratio_max < 1) return false;
    fv_copy3(in_candidate, m->point_b);
    m->sigma_b = fv_closure_distance_sigma(l, m->A_a, m->weight_a);
    m->inlier = true;
    closure->state->correspondence_count++;
    return true;
}

/* Landmarks of the other world as a keyframe should see them. */
struct guided {
    struct fv_map_frame frame;
    struct fv_sim3 S_keyframe_candidate;
    struct fv_se3 T_candidate_world;
    double centre[3]; /* of the keyframe, in the candidate's world */
    uint32_t slot;
};

static void search_one(struct fv_closure *closure, const struct fv_map *map,
                       const struct fv_kernels *kernels, const struct guided *guided,
                       const struct fv_landmark *l)
{
    struct fv_closure_state *s = closure->state;
    double in_candidate[3], q[3], ray[3], pixel[2];
    fv_se3_apply(&guided->T_candidate_world, l->point, in_candidate);
    fv_sim3_apply(&guided->S_keyframe_candidate, in_candidate, q);
    if (!fv_map_project(map, q, pixel)) return;
    fv_subtract3(l->point, guided->centre, ray);
    double distance = fv_norm3(ray);
    double cosine = fv_map_cosine(l, ray, distance);
    int level = fv_map_predict_level(l, distance);
    if (cosine < 0.6 || level < 0) return;
    s->visible++;
    struct fv_found found = fv_map_search(map, kernels, guided->slot, pixel[0], pixel[1],
                                          radius_guided_px * fv_level_scale((uint32_t)level),
                                          level - 1, level + 1, fv_map_descriptor(map, l), false);
    if (!fv_map_found_one(&found, DISTANCE_GUIDED_MAX) || closure->nearest[found.feature] != 0 ||
        fv_map_error2(map, &guided->frame.points[found.feature], q) > 2 * FV_CHI_SQUARE_99_2)
        return;
    uint32_t feature = (uint32_t)found.feature;
    if (guided->frame.landmark[feature] != FV_MAP_NONE &&
        !add_correspondence(closure, map, &guided->frame, feature, l, q, in_candidate))
        return;
    closure->nearest[feature] = 1;
    s->found++;
}

bool fv_closure_search_group(struct fv_closure *closure, const struct fv_map *map,
                             const struct fv_kernels *kernels, uint32_t slot,
                             const struct fv_sim3 *S_keyframe_candidate)
{
    struct fv_closure_state *s = closure->state;
    struct guided guided = {.frame = fv_map_frame_at(map, slot),
                            .S_keyframe_candidate = *S_keyframe_candidate,
                            .slot = slot};
    struct fv_sim3 inverse;
    guided.T_candidate_world = map->keyframes[s->candidates[s->candidate].slot].T_cam_world;
    fv_sim3_invert(S_keyframe_candidate, &inverse);
    fv_se3_apply_inverse(&guided.T_candidate_world, inverse.t, guided.centre);
    if (s->next == 0) {
        memset(closure->nearest, 0,
               map->limits.features * sizeof *closure->nearest); /* features taken */
        s->visible = s->found = s->correspondence_count = 0;
    }
    for (uint32_t done = 0; done < GROUP_PER_UNIT && s->next < s->group_count; done++) {
        struct fv_map_handle handle = closure->group[s->next++];
        const struct fv_landmark *l = &map->landmarks[handle.slot];
        if (l->used && l->generation == handle.generation)
            search_one(closure, map, kernels, &guided, l);
    }
    return s->next >= s->group_count;
}

/* ---- after it: fusing ------------------------------------------------------------------------ */

/* Search for a landmark of the group in a keyframe; link it there, or fuse it with the landmark of
 * the feature found. */
static void fuse_into(struct fv_closure *closure, struct fv_map *map,
                      const struct fv_kernels *kernels, uint32_t landmark, uint32_t keyframe)
{
    struct fv_landmark *l = &map->landmarks[landmark];
    const int32_t feature = fv_map_find_landmark(map, kernels, l, keyframe, radius_fuse_px, false);
    if (feature == FV_MAP_NONE) return;
    const int32_t other = fv_map_frame_at(map, keyframe).landmark[feature];
    closure->state->counts.fused++;
    if (other == FV_MAP_NONE) {
        if (fv_map_link(map, landmark, keyframe, (uint32_t)feature))
            fv_map_refresh_landmark(map, landmark);
    } else if (map->landmarks[other].observer_count > l->observer_count) {
        fv_map_fuse_landmarks(map, (uint32_t)other, landmark);
    } else {
        fv_map_fuse_landmarks(map, landmark, (uint32_t)other);
    }
}

bool fv_closure_fuse_unit(struct fv_closure *closure, struct fv_map *map,
                          const struct fv_kernels *kernels)
{
    struct fv_closure_state *s = closure->state;
    if (s->fuse_at >= s->fuse_count) return true;
    struct fv_map_handle into = s->fuse_into[s->fuse_at];
    for (uint32_t done = 0;
         done < FUSE_PER_UNIT && s->next < s->group_count && fv_closure_holds(map, into); done++) {
        struct fv_map_handle handle = closure->group[s->next++];
        const struct fv_landmark *l = &map->landmarks[handle.slot];
        if (l->used && l->generation == handle.generation)
            fuse_into(closure, map, kernels, handle.slot, into.slot);
    }
    if (s->next < s->group_count && fv_closure_holds(map, into)) return false;
    s->next = 0;
    return ++s->fuse_at >= s->fuse_count;
}

/* New landmarks of a keyframe: features without one are matched along epipolar lines in its
 * neighbours, triangulated, checked, and searched for in the other neighbours. */
#include <string.h>

#include "geometry/triangulate.h"
#include "geometry/vec.h"
#include "odometry/odometry.h"
#include "geometry/chi_square.h"

enum { UNIT_FEATURES = 96, DISTANCE_CREATE_MAX = 50, CULL_EXPECTED_MIN = 8 };

static const double radius_fuse_px = 3;         /* times the level's scale */
static const double cos_parallax_max = 0.99996; /* half a degree */
static const double baseline_fraction_min =
    0.03; /* of the median depth: nearer neighbours give no depth */
static const double depth_near =
    0.15; /* of the median depth: where the search along the line starts */

void fv_creator_carve(struct fv_creator *c, uint32_t features_max, struct fv_arena *job)
{
    c->line = fv_arena_take(job, features_max, sizeof *c->line);
}

/* ---- neighbours ------------------------------------------------------------------------------ */

static bool baseline_serves(const struct fv_map *map, uint32_t a, uint32_t b)
{
    struct fv_se3 T_world_b, T;
    fv_se3_invert(&map->keyframes[b].T_cam_world, &T_world_b);
    fv_se3_compose(&map->keyframes[a].T_cam_world, &T_world_b, &T);
    return fv_norm3(T.t) > baseline_fraction_min * map->keyframes[a].depth;
}

static void begin_creation(struct fv_odometry *o, uint32_t keyframe)
{
    struct fv_creation_state *g = &o->state->creation;
    g->neighbour_count = g->neighbour = g->next = 0;
    uint16_t shared[FOVEA_ODOMETRY_KEYFRAMES_MAX];
    fv_map_count_shared(&o->map, keyframe, shared);
    shared[keyframe] = 0;
    while (g->neighbour_count < FV_CREATION_NEIGHBOURS_MAX) {
        const uint32_t best = fv_map_best_shared(&o->map, shared);
        if (shared[best] == 0) break;
        shared[best] = 0;
        if (!baseline_serves(&o->map, keyframe, best)) continue;
        g->neighbour_generations[g->neighbour_count] = o->map.keyframes[best].generation;
        g->neighbours[g->neighbour_count++] = best;
    }
    g->keyframe = keyframe;
    g->generation = o->map.keyframes[keyframe].generation;
    g->phase = fv_map_metric(&o->map) ? FV_CREATION_MEASURED : FV_CREATION_TRIANGULATE;
}

/* ---- matching along the epipolar line -------------------------------------------------------- */

/* From keyframe a to neighbour b. */
struct line_search {
    struct fv_map_frame a, b;
    struct fv_se3 T_b_a, T_a_b;
    double depth;
};

static void line_begin(const struct fv_map *map, uint32_t a, uint32_t b, struct line_search *search)
{
    struct fv_se3 T_world_a;
    search->a = fv_map_frame_at(map, a);
    search->b = fv_map_frame_at(map, b);
    fv_se3_invert(&search->a.keyframe->T_cam_world, &T_world_a);
    fv_se3_compose(&search->b.keyframe->T_cam_world, &T_world_a, &search->T_b_a);
    fv_se3_invert(&search->T_b_a, &search->T_a_b);
    search->depth = search->a.keyframe->depth;
}

/* Box of the part of the line between the nearest plausible depth and infinity; false when it is
 * outside the image. */
static bool line_box(const struct fv_map *map, const struct line_search *search,
                     const double bearing[3], double box[4])
{
    double q[3], far[2], near[2];
    fv_rotate3(search->T_b_a.R, bearing, q);
    if (fovea_camera_project(map->camera, q, far, 0) != FOVEA_OK) return false;
    double along = depth_near * search->depth;
    bool seen = false;
    for (int attempt = 0; attempt < 4 && !seen; attempt++, along *= 2) {
        double p[3] = {along * bearing[0], along * bearing[1], along * bearing[2]};
        fv_se3_apply(&search->T_b_a, p, q);
        seen = fovea_camera_project(map->camera, q, near, 0) == FOVEA_OK;
    }
    if (!seen) return false;
    box[0] = far[0] < near[0] ? far[0] : near[0];
    box[1] = far[1] < near[1] ? far[1] : near[1];
    box[2] = far[0] < near[0] ? near[0] : far[0];
    box[3] = far[1] < near[1] ? near[1] : far[1];
    return box[2] > 0 && box[3] > 0 && box[0] < map->limits.width && box[1] < map->limits.height;
}

/* Triangulate and check: parallax, errors in both frames, and sizes that agree with the levels.
 * `point` in a's frame. */
static bool new_point(const struct fv_map *map, const struct fv_creator *creator,
                      const struct line_search *search, const double x1[3], uint32_t feature_a,
                      uint32_t feature_b, double point[3])
{
    const struct fv_pixel *p = &search->a.points[feature_a], *r = &search->b.points[feature_b];
    double x2[3], q[3], cosine;
    for (int i = 0; i < 3; i++)
        x2[i] = (double)creator->line[feature_b][i];
    if (!fv_triangulate(&search->T_b_a, x1, x2, point, &cosine) || cosine > cos_parallax_max)
        return false;
    fv_se3_apply(&search->T_b_a, point, q);
    if (fv_map_error2(map, p, point) > FV_CHI_SQUARE_95_2 ||
        fv_map_error2(map, r, q) > FV_CHI_SQUARE_95_2)
        return false;
    double distances = fv_norm3(q) / fv_norm3(point),
           levels = fv_level_scale(r->level) / fv_level_scale(p->level);
    double agreement = distances * levels; /* twice as far should look half as large: product 1 */
    return agreement < 1.8 && agreement > 1 / 1.8;
}

static void create_from_feature(struct fv_odometry *o, const struct fv_kernels *kernels,
                                const struct line_search *search, uint32_t neighbour,
                                uint32_t feature, const struct fv_keypoint *p)
{
    const int level = search->a.points[feature].level;
    double bearing[3], normal[3], box[4], q[3], point[3], world[3];
    for (int i = 0; i < 3; i++)
        bearing[i] = (double)p->bearing[i];
    if (!line_box(&o->map, search, bearing, box)) return;
    fv_rotate3(search->T_b_a.R, bearing, q);
    fv_cross3(search->T_b_a.t, q, normal);
    if (!fv_normalise3(normal)) return;
    struct fv_found found =
        fv_map_search_line(&o->map, kernels, neighbour, (const float(*)[3])o->creator.line, box,
                           normal, 2.0 / o->focal_px, level - 2, level + 2,
                           search->a.descriptors + (size_t)feature * FV_MAP_DESCRIPTOR_BYTES);
    if (!fv_map_found_one(&found, DISTANCE_CREATE_MAX)) return;
    if (!new_point(&o->map, &o->creator, search, bearing, feature, (uint32_t)found.feature, point))
        return;
    fv_se3_apply_inverse(&search->a.keyframe->T_cam_world, point, world);
    int32_t landmark = fv_map_add_landmark(&o->map, world, o->state->frame_number);
    if (landmark == FV_MAP_NONE) return;
    (void)fv_map_link(&o->map, (uint32_t)landmark, o->state->creation.keyframe, feature);
    (void)fv_map_link(&o->map, (uint32_t)landmark, neighbour, (uint32_t)found.feature);
    fv_map_refresh_landmark(&o->map, (uint32_t)landmark);
}

static bool neighbour_holds(const struct fv_map *map, const struct fv_creation_state *creation,
                            uint32_t i)
{
    const struct fv_creation_state *g = creation;
    const struct fv_keyframe *k = &map->keyframes[g->neighbours[i]];
    return k->used && k->generation == g->neighbour_generations[i];
}

/* From the next features without a landmark, a unit's number of them. */
static void create_from_some(struct fv_odometry *o, const struct fv_kernels *kernels,
                             const struct line_search *search, uint32_t neighbour)
{
    struct fv_creation_state *g = &o->state->creation;
    struct fv_pixel points[UNIT_FEATURES];
    struct fv_keypoint keypoints[UNIT_FEATURES];
    uint32_t features[UNIT_FEATURES], count = 0;
    for (; count < UNIT_FEATURES && g->next < search->a.keyframe->features; g->next++) {
        if (search->a.landmark[g->next] != FV_MAP_NONE) continue;
        points[count] = search->a.points[g->next];
        features[count++] = g->next;
    }
    fv_map_keypoints(&o->map, points, count, keypoints);
    for (uint32_t i = 0; i < count; i++)
        if (keypoints[i].weight > 0)
            create_from_feature(o, kernels, search, neighbour, features[i], &keypoints[i]);
}

static void triangulate_unit(struct fv_odometry *o, const struct fv_kernels *kernels)
{
    struct fv_creation_state *g = &o->state->creation;
    if (g->neighbour == g->neighbour_count) {
        g->phase = FV_CREATION_FUSE;
        g->next = 0;
        return;
    }
    struct fv_map_frame frame = fv_map_frame_at(&o->map, g->keyframe);
    if (neighbour_holds(&o->map, &o->state->creation, g->neighbour)) {
        struct line_search search;
        line_begin(&o->map, g->keyframe, g->neighbours[g->neighbour], &search);
        if (g->next == 0) fv_map_bearings(&o->map, g->neighbours[g->neighbour], o->creator.line);
        create_from_some(o, kernels, &search, g->neighbours[g->neighbour]);
    } else {
        g->next = frame.keyframe->features;
    }
    if (g->next == frame.keyframe->features) {
        g->neighbour++;
        g->next = 0;
    }
}

static void measured_unit(struct fv_odometry *o)
{
    struct fv_creation_state *g = &o->state->creation;
    g->next = fv_odometry_create_measured(o, g->keyframe, g->next, UNIT_FEATURES);
    if (g->next < o->map.keyframes[g->keyframe].features) return;
    g->phase = FV_CREATION_TRIANGULATE;
    g->next = 0;
}

/* The keyframe is finished: it, and those that now share its landmarks, have another redundancy. */
static void end_creation(struct fv_odometry *o)
{
    struct fv_neighbour neighbours[FV_LOCAL_KEYFRAMES_MAX];
    uint32_t keyframe = o->state->creation.keyframe,
             count = fv_map_neighbours(&o->map, keyframe, 1, neighbours, FV_LOCAL_KEYFRAMES_MAX);
    fv_map_rate_keyframe(&o->map, keyframe);
    for (uint32_t i = 0; i < count; i++)
        fv_map_rate_keyframe(&o->map, neighbours[i].slot);
    if (keyframe == o->state->newest)
        o->state->keyframe_matches = o->map.keyframes[keyframe].landmarks;
    o->state->creation.phase = FV_CREATION_IDLE;
    fv_odometry_agreement_queue(o, keyframe);
}

/* ---- fusing ---------------------------------------------------------------------------------- */

/* Search for a landmark in a keyframe that does not see it yet. */
static void fuse(struct fv_map *map, const struct fv_kernels *kernels, uint32_t landmark,
                 uint32_t keyframe)
{
    const int32_t feature = fv_map_find_landmark(map, kernels, &map->landmarks[landmark], keyframe,
                                                 radius_fuse_px, true);
    if (feature != FV_MAP_NONE && fv_map_link(map, landmark, keyframe, (uint32_t)feature))
        fv_map_refresh_landmark(map, landmark);
}

static void fuse_unit(struct fv_odometry *o, const struct fv_kernels *kernels)
{
    struct fv_creation_state *g = &o->state->creation;
    struct fv_map_frame frame = fv_map_frame_at(&o->map, g->keyframe);
    for (uint32_t done = 0; done < UNIT_FEATURES && g->next < frame.keyframe->features; g->next++) {
        int32_t landmark = frame.landmark[g->next];
        if (landmark == FV_MAP_NONE || o->map.landmarks[landmark].observer_count >= 4) continue;
        for (uint32_t i = 0; i < g->neighbour_count; i++)
            if (neighbour_holds(&o->map, &o->state->creation, i))
                fuse(&o->map, kernels, (uint32_t)landmark, g->neighbours[i]);
        done++;
    }
    if (g->next == frame.keyframe->features) end_creation(o);
}

/* ---- the job's part -------------------------------------------------------------------------- */

bool fv_odometry_creation_unit(struct fv_odometry *o, const struct fv_kernels *kernels)
{
    struct fv_creation_state *g = &o->state->creation;
    if (g->phase == FV_CREATION_IDLE) {
        if (g->pending_count == 0) return false;
        uint32_t keyframe = (uint32_t)g->pending[0];
        g->pending_count--;
        for (uint32_t i = 0; i < g->pending_count; i++)
            g->pending[i] = g->pending[i + 1];
        if (o->map.keyframes[keyframe].used) begin_creation(o, keyframe);
        return true;
    }
    if (!o->map.keyframes[g->keyframe].used ||
        o->map.keyframes[g->keyframe].generation != g->generation)
        g->phase = FV_CREATION_IDLE;
    else if (g->phase == FV_CREATION_MEASURED)
        measured_unit(o);
    else if (g->phase == FV_CREATION_TRIANGULATE)
        triangulate_unit(o, kernels);
    else
        fuse_unit(o, kernels);
    return g->phase != FV_CREATION_IDLE || g->pending_count > 0;
}

void fv_odometry_cull(struct fv_odometry *o)
{
    for (uint32_t i = 0; i < o->map.state->landmark_top; i++) {
        const struct fv_landmark *l = &o->map.landmarks[i];
        if (!l->used) continue;
        bool lost = l->expected >= CULL_EXPECTED_MIN && l->found * 4u < l->expected;
        bool thin = l->observer_count < 2 && !fv_map_landmark_stands(&o->map, l);
        bool old = (uint32_t)o->state->frame_number - l->born > 15 && l->observer_count < 3 &&
                   l->found < 5;
        if (lost || thin || old) fv_map_remove_landmark(&o->map, i);
    }
}

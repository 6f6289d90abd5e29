/* Of new landmarks. */
#include "odometry/landmark_creation.c"

#include <stdlib.h>

#include "bounds/counter.h"
#include "bounds/full_map.h"
#include "bounds/limits.h"
#include "bounds/pieces.h"

LIMIT(UNIT_FEATURES, CREATION_FEATURES);

struct creating {
    struct fovea *rt;
    struct fv_odometry *o;
    struct line_search search;
    uint32_t keyframe, neighbour, feature, landmark;
};

static void create(void *context)
{
    struct creating *c = context;
    struct fv_keypoint point;
    fv_map_keypoints(&c->o->map, &c->search.a.points[c->feature], 1, &point);
    create_from_feature(c->o, &c->rt->kernels, &c->search, c->neighbour, c->feature, &point);
}

static void bear(void *context)
{
    struct creating *c = context;
    fv_map_bearings(&c->o->map, c->neighbour, c->o->creator.line);
}

static void pass_by(void *context)
{
    struct creating *c = context;
    struct fv_creation_state *g = &c->o->state->creation;
    g->phase = FV_CREATION_FUSE;
    g->next = c->feature;
    fuse_unit(c->o, &c->rt->kernels);
}

static void find(void *context)
{
    struct creating *c = context;
    (void)fv_map_find_landmark(&c->o->map, &c->rt->kernels, &c->o->map.landmarks[c->landmark],
                               c->neighbour, radius_fuse_px, true);
}

static void rate(void *context)
{
    struct creating *c = context;
    fv_map_rate_keyframe(&c->o->map, c->neighbour);
}

static void best_shared(void *context)
{
    struct creating *c = context;
    uint16_t shared[FOVEA_ODOMETRY_KEYFRAMES_MAX];
    for (uint32_t k = 0; k < c->o->map.limits.keyframes; k++)
        shared[k] = (uint16_t)k; /* the best is the last: each is better than those before */
    c->feature = fv_map_best_shared_newest(&c->o->map, shared);
    (void)baseline_serves(&c->o->map, c->keyframe, c->feature);
}

static void cull(void *context)
{
    struct creating *c = context;
    fv_odometry_cull(c->o);
}

/* Two keyframes without landmarks: features of the first find all of the second within the box of
 * their line, and the last of these on it. */
static void of_lines(struct creating *c)
{
    const uint32_t features = c->o->map.limits.features;
    struct crowd crowd = {.levels_high = 0};
    for (uint32_t k = 0; k < 2 * FV_MAP_OBSERVERS_MAX && k + 4 < c->o->map.limits.keyframes; k++)
        fv_map_remove_keyframe(&c->o->map, k);
    full_map_view(c->o, &crowd, 2);
    c->keyframe = fv_map_add_keyframe(&c->o->map, fv_map_current(&c->o->map));
    crowd.off = features > 2 * CROWD_MATCHES ? features - 2 * CROWD_MATCHES : 0;
    crowd.off_px = 9;
    full_map_view(c->o, &crowd, 9);
    c->neighbour = fv_map_add_keyframe(&c->o->map, fv_map_current(&c->o->map));
    c->o->map.keyframes[c->keyframe].depth = c->o->map.keyframes[c->neighbour].depth = 5;
    line_begin(&c->o->map, c->keyframe, c->neighbour, &c->search);
    NOTE(bearings, bear, c, 1);
    c->o->state->creation.keyframe = c->keyframe;
    for (c->feature = 0; c->feature < UNIT_FEATURES; c->feature++)
        NOTE(feature_triangulated, create, c, 1);
}

void pieces_of_creation(struct fovea *rt)
{
    struct creating c = {.rt = rt, .o = &rt->odometry};
    const uint32_t features = rt->odometry.map.limits.features;
    full_map_fill(c.o, FV_MAP_OBSERVERS_MAX);
    c.keyframe = c.o->state->newest;
    NOTE(shared_chosen, best_shared, &c, 1);
    c.o->state->frame_number = 10; /* none is old */
    for (uint32_t i = 0; i < c.o->map.state->landmark_top; i++) {
        c.o->map.landmarks[i].expected = c.o->map.landmarks[i].found = 100;
        c.o->map.landmarks[i].born = 10;
    }
    NOTE(landmark_culled, cull, &c, c.o->map.state->landmark_top);
    c.neighbour = c.o->state->newest - FV_MAP_OBSERVERS_MAX;
    NOTE(keyframe_rated, rate, &c, 1);
    /* A landmark of the newest group, in a keyframe of another whose last features are free. */
    const struct fv_map_frame frame = fv_map_frame_at(&c.o->map, c.neighbour);
    c.landmark = (uint32_t)fv_map_frame_at(&c.o->map, c.keyframe).landmark[0];
    for (uint32_t f = full_map_crowd(c.o).levels_high; f < features; f++)
        fv_map_unlink(&c.o->map, (uint32_t)frame.landmark[f], c.neighbour);
    full_map_far_levels(c.o);
    NOTE(landmark_searched, find, &c, 1);
    c.o->state->creation = (struct fv_creation_state){
        .phase = FV_CREATION_FUSE, .keyframe = c.keyframe, .neighbour_count = 0};
    c.feature = features; /* what it ends with */
    double passed = -(double)counter_of(pass_by, &c);
    c.feature = 0;
    passed += (double)counter_of(pass_by, &c);
    piece_note(PIECE_feature_passed, passed / features);
    full_map_fill(c.o, FV_MAP_OBSERVERS_MAX);
    of_lines(&c);
}

/* Of bundles of the first map. */
#include "odometry/initialise_bundle.c"

#include <stdlib.h>

#include "bounds/counter.h"
#include "bounds/full_map.h"
#include "bounds/limits.h"
#include "bounds/pieces.h"
#include "odometry/odometry.h"

LIMIT(STEPS_MAX, BUNDLE_STEPS);
LIMIT(STAGES, BUNDLE_STAGES);
LIMIT(TIGHT_ROUNDS, BUNDLE_ROUNDS);

struct bundling {
    struct fv_initialiser *in;
    struct fv_initialise_bundle bundle;
    struct fv_initialise_system system;
    struct fv_map_frame views[FV_INITIALISE_VIEWS_MAX];
    struct fv_se3 before[FV_INITIALISE_VIEWS_MAX];
    uint32_t tracks;
};

static void build_all(void *context)
{
    struct bundling *b = context;
    (void)build(b->in, b->tracks, &b->bundle, b->views, 1e-3, 100, &b->system);
}

static void solve(void *context)
{
    struct bundling *b = context;
    MUST(take_step(b->in, b->tracks, &b->bundle, &b->system, b->before));
    for (uint32_t i = 0; i < b->tracks; i++) /* as a step that gains nothing is taken back */
        b->in->depths[i].value = b->in->depths[i].before;
}

static void judge_all(void *context)
{
    struct bundling *b = context;
    judge(b->in, b->tracks, b->views, &b->bundle);
}

static void direct(void *context)
{
    struct bundling *b = context;
    normalise(b->in, b->tracks, &b->bundle);
    (void)direction_sigma(b->in, b->tracks, &b->bundle, b->views, 6, &b->system);
}

static void place(void *context)
{
    struct bundling *b = context;
    MUST(place_view(b->in, b->tracks, b->views, &b->bundle, 1));
}

/* Tracks of features that see the same points in all views, a little off. */
static void make_tracks(struct bundling *b, const struct fv_odometry *o)
{
    b->bundle.view_count = FV_INITIALISE_VIEWS_MAX;
    for (uint32_t v = 0; v < FV_INITIALISE_VIEWS_MAX; v++) {
        b->bundle.slots[v] = fv_map_waiting(&o->map, v);
        b->views[v] = fv_map_frame_at(&o->map, b->bundle.slots[v]);
        struct fv_se3 T_world_first;
        fv_se3_invert(&b->views[0].keyframe->T_cam_world, &T_world_first);
        fv_se3_compose(&b->views[v].keyframe->T_cam_world, &T_world_first,
                       &b->bundle.T_view_first[v]);
    }
    for (uint32_t i = 0; i < b->tracks; i++) {
        for (int v = 0; v < FV_INITIALISE_VIEWS_MAX; v++)
            b->in->tracks[i].feature[v] = (int32_t)i;
        for (int k = 0; k < 3; k++) {
            b->in->pairs[i].x1[k] = (double)b->views[0].keypoints[i].bearing[k];
            b->in->pairs[i].x2[k] =
                (double)b->views[FV_INITIALISE_VIEWS_MAX - 1].keypoints[i].bearing[k];
        }
        b->in->depths[i].value = 0.2 + 1e-4 * (i % 7);
    }
}

/* A cost that grows with the tracks: what one more costs, and the rest. */
static double per_track(struct bundling *b, counter_work *work, uint32_t tracks, double *rest)
{
    b->tracks = tracks;
    build_all(b);
    const double all = (double)counter_of(work, b);
    b->tracks = tracks / 2;
    build_all(b);
    const double half = (double)counter_of(work, b);
    const double each = (all - half) / (tracks - tracks / 2);
    if (rest != NULL) *rest = all - each * tracks;
    b->tracks = tracks;
    return each;
}

/* After pieces_of_initialise, whose views are still held. */
void pieces_of_bundle(struct fovea *rt)
{
    static struct bundling b;
    double rest;
    const uint32_t features = rt->odometry.map.limits.features;
    const struct crowd crowd = {.levels_high = 0};
    b.in = &rt->odometry.initialiser;
    for (uint32_t v = 0; v < FV_INITIALISE_VIEWS_MAX; v++) {
        struct fv_odometry *o = &rt->odometry;
        full_map_view(o, &crowd, 2 * v);
        fv_map_copy_frame(&o->map, fv_map_current(&o->map), fv_map_waiting(&o->map, v));
    }
    b.tracks = features < 800 ? features : 800;
    make_tracks(&b, &rt->odometry);
    piece_note(PIECE_bundle_built, per_track(&b, build_all, b.tracks, NULL));
    const double moved = per_track(&b, solve, b.tracks, &rest);
    piece_note(PIECE_bundle_moved, moved);
    piece_note(PIECE_bundle_solved, rest);
    make_tracks(&b, &rt->odometry);
    NOTE(view_placed, place, &b, 1);
    make_tracks(&b, &rt->odometry);
    NOTE(bundle_judged, judge_all, &b, b.tracks);
    NOTE(bundle_direction, direct, &b, b.tracks);
}

/* Of a frame against the local map. */
#include "odometry/localise.c"

#include "bounds/counter.h"
#include "bounds/full_map.h"
#include "bounds/pieces.h"

/* A frame in work. */
struct localising {
    struct fovea *rt;
    struct fv_map_frame frame;
    struct fv_se3 T;
};

static void recent(void *context)
{
    struct localising *l = context;
    (void)match_recent(&l->rt->odometry, &l->rt->kernels, &l->frame, &l->T, radius_wide_px);
}

static void local(void *context)
{
    struct localising *l = context;
    (void)fv_odometry_match_local(&l->rt->odometry, &l->rt->kernels, &l->frame, &l->T, local_widen);
}

static void collect(void *context)
{
    struct localising *l = context;
    const struct fv_localiser *localiser = &l->rt->odometry.localiser;
    const uint32_t count =
        fv_localiser_collect(&l->rt->odometry.localiser, &l->rt->odometry.map, &l->frame);
    for (uint32_t i = 0; i < count; i++) /* as refine() forgets what does not fit */
        if (localiser->observations[i].inlier)
            l->frame.landmark[localiser->observed_feature[i]] = FV_MAP_NONE;
}

static void remembering(void *context)
{
    struct localising *l = context;
    remember(&l->rt->odometry, &l->frame);
}

static void project(void *context)
{
    struct localising *l = context;
    double q[3], pixel[2];
    (void)project_landmark(&l->rt->odometry.map, &l->T, &l->rt->odometry.map.landmarks[0], q,
                           pixel);
}

static void median_depth(void *context)
{
    struct localising *l = context;
    (void)fv_odometry_current_depth(&l->rt->odometry);
}

/* Every feature sees a landmark of the newest keyframes' group. */
static void link_all(struct localising *l)
{
    const struct fv_odometry *o = &l->rt->odometry;
    const struct fv_map_frame newest = fv_map_frame_at(&o->map, o->state->newest);
    for (uint32_t f = 0; f < l->frame.keyframe->features; f++)
        l->frame.landmark[f] = newest.landmark[f];
}

/* One feature in each group of keyframes, so that all their landmarks are local. */
static void link_groups(struct localising *l)
{
    const struct fv_map *map = &l->rt->odometry.map;
    fv_matches_clear(&l->rt->odometry.matches, &l->frame);
    for (uint32_t k = 0, f = 0; k < map->limits.keyframes && f < l->frame.keyframe->features;
         k += FV_MAP_OBSERVERS_MAX)
        l->frame.landmark[f] = fv_map_frame_at(map, map->limits.keyframes - 1 - k).landmark[f], f++;
}

void pieces_of_localise(struct fovea *rt)
{
    struct fv_odometry *o = &rt->odometry;
    struct crowd crowd = full_map_crowd(o);
    struct localising l = {.rt = rt, .frame = fv_map_frame_at(&o->map, fv_map_current(&o->map))};
    full_map_fill(o, FV_MAP_OBSERVERS_MAX);
    crowd.descriptor = 0xff;
    full_map_view(o, &crowd, FULL_MAP_PLACES / 2);
    l.T = l.frame.keyframe->T_cam_world;
    l.frame.keyframe->parent = (int32_t)o->state->newest;

    link_all(&l);
    NOTE(observations, collect, &l, 1);
    link_all(&l);
    NOTE(remembered, remembering, &l, 1);
    NOTE(projected, project, &l, 1);
    NOTE(depth, median_depth, &l, 1);

    full_map_far_levels(o);
    link_all(&l);
    remember(o, &l.frame);
    for (uint32_t i = 0; i < o->state->localise.recent_count; i++)
        o->localiser.recent[i].level = 0; /* where the crowd does not match but for the last */
    NOTE(recent_matched, recent, &l, 1);
    link_groups(&l);
    NOTE(local_matched, local, &l, 1);
}

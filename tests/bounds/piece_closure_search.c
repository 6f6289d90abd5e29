/* Of closures: landmarks around the candidate, searched for before and after the correction. */
#include "map/closure_search.c"

#include "bounds/counter.h"
#include "bounds/full_map.h"
#include "bounds/limits.h"
#include "bounds/pieces.h"

LIMIT(GROUP_PER_UNIT, CLOSURE_GROUP);
LIMIT(FUSE_PER_UNIT, CLOSURE_FUSED);

struct searching {
    struct fovea *rt;
    struct fv_closure *closure;
    struct fv_map *map;
    struct guided guided;
    uint32_t landmark;
};

static void search(void *context)
{
    struct searching *s = context;
    search_one(s->closure, s->map, &s->rt->kernels, &s->guided, &s->map->landmarks[s->landmark]);
}

static void clear(void *context)
{
    struct searching *s = context;
    s->closure->state->next = s->closure->state->group_count = 0;
    (void)fv_closure_search_group(s->closure, s->map, &s->rt->kernels, s->guided.slot,
                                  &s->guided.S_keyframe_candidate);
}

static void fuse_one(void *context)
{
    struct searching *s = context;
    fuse_into(s->closure, s->map, &s->rt->kernels, s->landmark, s->guided.slot);
}

void pieces_of_closure_search(struct fovea *rt)
{
    struct fv_odometry *o = &rt->odometry;
    struct searching s = {.rt = rt, .closure = &o->closure, .map = &o->map};
    const uint32_t newest = o->map.limits.keyframes - 1;
    full_map_fill(o, FV_MAP_OBSERVERS_MAX);
    full_map_far_levels(o);
    /* The candidate and the keyframe are one in pose. */
    s.guided.slot = newest;
    s.guided.frame = fv_map_frame_at(&o->map, newest);
    fv_sim3_identity(&s.guided.S_keyframe_candidate);
    s.guided.T_candidate_world = s.guided.frame.keyframe->T_cam_world;
    const double origin[3] = {0, 0, 0};
    fv_se3_apply_inverse(&s.guided.T_candidate_world, origin, s.guided.centre);
    o->closure.state->correspondence_count = 0;
    o->closure.state->candidates[0] =
        (struct fv_map_handle){newest, o->map.keyframes[newest].generation};
    NOTE(group_begun, clear, &s, 1);
    const struct fv_map_frame other = fv_map_frame_at(&o->map, newest - FV_MAP_OBSERVERS_MAX);
    for (uint32_t f = 0; f < CROWD_MATCHES && f < o->map.limits.features; f++) {
        s.landmark = (uint32_t)other.landmark[f];
        NOTE(group_searched, search, &s, 1);
    }
    for (uint32_t f = 0; f < CROWD_MATCHES && f < o->map.limits.features; f++) {
        s.landmark = (uint32_t)other.landmark[f];
        if (o->map.landmarks[s.landmark].used) NOTE(landmark_fused, fuse_one, &s, 1);
    }
}

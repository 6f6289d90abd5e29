/* Of the pools: frames, keyframes and landmarks, their links, and room for more. */
#include "map/keep.c"

#include <stdlib.h>

#include "bounds/counter.h"
#include "bounds/full_map.h"
#include "bounds/pieces.h"
#include "geometry/vec.h"
#include "odometry/usable.h"

struct keeping {
    struct fovea *rt;
    struct fv_map *map;
    uint32_t slot, landmark, feature;
    struct fovea_feature *features;
    uint8_t *descriptors;
};

static void fill(void *context)
{
    struct keeping *k = context;
    fv_map_fill_frame(k->map, fv_map_current(k->map), k->features, k->descriptors,
                      k->map->limits.features, k->rt->odometry.distances.from);
}

static void usable(void *context)
{
    struct keeping *k = context;
    fv_usable_picture(&k->rt->odometry.state->usable, k->map->limits.features, k->features,
                      k->descriptors);
}

static void link_one(void *context)
{
    struct keeping *k = context;
    MUST(fv_map_link(k->map, k->landmark, k->slot, k->feature));
}

static void refresh(void *context)
{
    struct keeping *k = context;
    fv_map_refresh_landmark(k->map, k->landmark);
}

static void unlink_first(void *context)
{
    struct keeping *k = context;
    fv_map_unlink(k->map, k->landmark, k->map->landmarks[k->landmark].observers[0].keyframe);
}

static void unlink_last(void *context)
{
    struct keeping *k = context;
    const struct fv_landmark *l = &k->map->landmarks[k->landmark];
    fv_map_unlink(k->map, k->landmark, l->observers[l->observer_count - 1].keyframe);
}

static void remove_landmark(void *context)
{
    struct keeping *k = context;
    fv_map_remove_landmark(k->map, k->landmark);
}

static void sweep_all(void *context)
{
    struct keeping *k = context;
    sweep(k->map, UINT32_MAX, FV_MAP_OBSERVERS_MAX, 1); /* seen just now: all stay */
}

static void choose(void *context)
{
    (void)fv_map_most_redundant(((struct keeping *)context)->map);
}

static void remove_keyframe(void *context)
{
    struct keeping *k = context;
    fv_map_remove_keyframe(k->map, k->slot);
}

static void add_keyframe(void *context)
{
    struct keeping *k = context;
    k->slot = fv_map_add_keyframe(k->map, fv_map_current(k->map));
}

/* Ratings that are too high: each keyframe rated again is worse than the next. */
static void rate_too_high(struct fv_map *map)
{
    for (uint32_t k = 0; k < map->limits.keyframes; k++)
        map->keyframes[k].redundancy = (uint16_t)(2000 - k);
}

static void of_links(struct keeping *k)
{
    const struct fv_map_frame newest = fv_map_frame_at(k->map, k->rt->odometry.state->newest);
    k->landmark = (uint32_t)newest.landmark[0];
    NOTE(landmark_refreshed, refresh, k, 1);
    NOTE(landmark_unlinked, unlink_first, k, 1);
    NOTE(landmark_unlinked, unlink_last, k, 1);
    while (k->map->landmarks[k->landmark].observer_count > 0)
        unlink_first(k);
    NOTE(landmark_removed, remove_landmark, k, 1);
    /* A keyframe of another group sees a landmark of the last. */
    k->landmark = (uint32_t)newest.landmark[1];
    k->slot = k->map->limits.keyframes - 1 - FV_MAP_OBSERVERS_MAX;
    k->feature = 1;
    fv_map_unlink(k->map, (uint32_t)fv_map_frame_at(k->map, k->slot).landmark[1], k->slot);
    NOTE(landmark_linked, link_one, k, 1);
}

static void of_keyframes(struct keeping *k)
{
    NOTE(landmark_swept, sweep_all, k, k->map->limits.landmarks);
    rate_too_high(k->map);
    NOTE(keyframe_chosen, choose, k, 1);
    /* The first of the second last group leads every list of its landmarks; then all others, the
     * last of which takes the landmarks with it. */
    const uint32_t last = k->map->limits.keyframes - FV_MAP_OBSERVERS_MAX;
    for (uint32_t n = 1; n <= FV_MAP_OBSERVERS_MAX && n <= last; n++) {
        k->slot = last - n;
        NOTE(keyframe_removed, remove_keyframe, k, 1);
    }
    k->slot = 0;
    NOTE(keyframe_added, add_keyframe, k, 1);
}

void pieces_of_map(struct fovea *rt)
{
    struct fv_odometry *o = &rt->odometry;
    struct keeping k = {.rt = rt, .map = &o->map};
    const uint32_t features = o->map.limits.features;
    k.features = calloc(features, sizeof *k.features);
    k.descriptors = calloc(features, FV_MAP_DESCRIPTOR_BYTES);
    for (uint32_t f = 0; f < features; f++)
        k.features[f] =
            (struct fovea_feature){.x_px = (float)(f * 7 % (uint32_t)o->map.limits.width),
                                   .y_px = (float)(f * 13 % (uint32_t)o->map.limits.height),
                                   .level = 7,
                                   .score = 200};
    fv_usable_picture(&o->state->usable, features, k.features, k.descriptors);
    NOTE(frame_usable, usable, &k, 1);
    full_map_fill(o, FV_MAP_OBSERVERS_MAX);
    NOTE(frame_filled, fill, &k, 1);
    of_links(&k);
    full_map_fill(o, FV_MAP_OBSERVERS_MAX);
    of_keyframes(&k);
    free(k.descriptors);
    free(k.features);
}

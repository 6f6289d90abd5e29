/* Of the window: what goes in, and what comes back. */
#include "map/window_copy.c"

#include <stdlib.h>

#include "bounds/counter.h"
#include "bounds/full_map.h"
#include "bounds/pieces.h"

struct copying {
    struct fv_window *window;
    struct fv_odometry *o;
    struct fv_map *map;
    uint32_t in_window, landmark, dropped;
};

static void pick(void *context)
{
    struct copying *c = context;
    fv_window_clear(c->window);
    pick_keyframes(c->window, c->map, c->o->state->newest);
    c->in_window = c->window->state->pose_count;
    number_columns(c->window->state, c->map, c->in_window);
}

static void copy_one(void *context)
{
    struct copying *c = context;
    const struct fv_landmark *l = &c->map->landmarks[c->landmark];
    fv_window_put_landmark(c->window, l->point);
    add_observations(c->window, c->map, l);
}

static void scan(void *context)
{
    struct copying *c = context;
    copy_landmarks(c->window, c->map, c->in_window, FV_MAP_OBSERVERS_MAX + 1);
}

static void move_all(void *context)
{
    struct copying *c = context;
    move_landmarks(c->window->state, c->map);
}

static void move_rest(void *context)
{
    struct copying *c = context;
    move_dependants(c->window->state, c->map);
}

static void drop(void *context)
{
    struct copying *c = context;
    (void)drop_misfits(c->window, c->map, &c->window->landmarks[c->landmark], &c->dropped);
}

/* Landmarks all of whose observations lie far off. */
static void of_misfits(struct copying *c)
{
    const struct fv_window_state *s = c->window->state;
    for (c->landmark = 0; c->landmark < s->landmark_count; c->landmark++) {
        struct fv_window_landmark *l = &c->window->landmarks[c->landmark];
        l->point[0] += 1;
        const uint32_t count = l->count;
        NOTE(misfit_dropped, drop, c, count);
    }
}

void pieces_of_window_copy(struct fovea *rt)
{
    struct copying c = {
        .window = &rt->odometry.window, .o = &rt->odometry, .map = &rt->odometry.map};
    full_map_fill(c.o, FV_MAP_OBSERVERS_MAX);
    NOTE(window_picked, pick, &c, 1);
    c.landmark = (uint32_t)fv_map_frame_at(c.map, c.o->state->newest).landmark[0];
    NOTE(observation_copied, copy_one, &c, FV_MAP_OBSERVERS_MAX);
    c.map->state->mark++;
    NOTE(feature_scanned, scan, &c, c.in_window * c.map->limits.features);
    MUST(fv_window_start(c.window, c.map, c.o->state->newest));
    while (fv_window_unit(c.window)) {
    }
    c.map->state->mark++;
    NOTE(landmark_moved, move_all, &c, c.map->state->landmark_top);
    for (uint32_t k = 0; k < c.map->limits.keyframes; k++) {
        c.map->keyframes[k].number += 1000; /* all after the window */
        c.map->keyframes[k].parent = (int32_t)c.o->state->newest;
    }
    memset(c.window->state->pose_of, -1, sizeof c.window->state->pose_of);
    c.window->state->pose_of[c.o->state->newest] = 0;
    NOTE(keyframe_moved, move_rest, &c, c.map->limits.keyframes);
    full_map_fill(c.o, FV_MAP_OBSERVERS_MAX);
    MUST(fv_window_start(c.window, c.map, c.o->state->newest));
    while (fv_window_unit(c.window)) {
    }
    of_misfits(&c);
}

/* Of the window: a pass over its landmarks. */
#include "map/window.c"

#include <stdlib.h>

#include "bounds/counter.h"
#include "bounds/full_map.h"
#include "bounds/limits.h"
#include "bounds/pieces.h"

LIMIT(UNIT_OBSERVATIONS, WINDOW_UNIT_OBSERVATIONS);

struct windowing {
    struct fv_window *window;
    struct fv_odometry *o;
    uint32_t at;
};

static void pass_one(void *context)
{
    struct windowing *w = context;
    pass_landmark(w->window, &w->window->landmarks[w->at]);
}

static void end(void *context)
{
    struct windowing *w = context;
    end_pass(w->window);
}

static void optimise(struct windowing *w)
{
    struct fv_window_state *s = w->window->state;
    MUST(fv_window_start(w->window, &w->o->map, w->o->state->newest));
    for (int pass = 0; pass < 3 && s->phase == FV_WINDOW_PASS; pass++) {
        for (w->at = 0; w->at < s->landmark_count; w->at++)
            NOTE(observation_passed, pass_one, w, w->window->landmarks[w->at].count);
        NOTE(pass_ended, end, w, 1);
    }
}

void pieces_of_window(struct fovea *rt)
{
    struct windowing w = {.window = &rt->odometry.window, .o = &rt->odometry};
    const uint32_t observers[] = {2, 3, rt->config.odometry.window, FV_MAP_OBSERVERS_MAX};
    for (size_t i = 0; i < sizeof observers / sizeof observers[0]; i++) {
        full_map_fill(w.o, observers[i]);
        optimise(&w);
    }
}

/* Of the window that the calibration is judged by. */
#include "odometry/lens_window.c"

#include "bounds/counter.h"
#include "bounds/full_map.h"
#include "bounds/limits.h"
#include "bounds/pieces.h"

LIMIT(UNIT_SLOTS, LENS_SLOTS);
LIMIT(UNIT_POINTS, LENS_POINTS);

struct looking {
    struct fovea *rt;
    struct fv_lens_window *w;
    const struct fv_map *map;
    struct seen seen;
    const struct fv_landmark *landmark;
    struct fv_lens_mismatch found;
};

static void begin(void *context)
{
    struct looking *l = context;
    (void)fv_lens_window_begin(l->w, &l->rt->odometry);
}

static void look(void *context)
{
    struct looking *l = context;
    (void)gather(l->w->state, l->map, l->landmark, &l->seen);
}

static void add(void *context)
{
    struct looking *l = context;
    landmark_add(l->w, &l->seen);
}

static void solve_all(void *context)
{
    struct looking *l = context;
    (void)stands(l->w->state, l->map);
    MUST(solve(l->w, &l->found));
}

static void measure_frame(void *context)
{
    struct looking *l = context;
    fv_calibration_frame(&l->rt->calibration, &l->rt->odometry, &l->rt->state->frame);
}

void pieces_of_lens(struct fovea *rt)
{
    static struct looking l;
    struct fv_odometry *o = &rt->odometry;
    l.rt = rt;
    l.w = &rt->calibration.window;
    l.map = &o->map;
    if (rt->calibration.state == NULL) return;
    full_map_fill(o, FV_MAP_OBSERVERS_MAX);
    NOTE(lens_begun, begin, &l, 1);
    const struct fv_map_frame newest = fv_map_frame_at(l.map, o->state->newest),
                              other = fv_map_frame_at(l.map, 0);
    for (uint32_t f = 0; f < newest.keyframe->features; f += 1 + newest.keyframe->features / 150) {
        l.landmark = &l.map->landmarks[newest.landmark[f]];
        NOTE(lens_looked, look, &l, 1);
        NOTE(lens_added, add, &l, 1);
    }
    NOTE(lens_solved, solve_all, &l, 1);
    if (other.landmark[0] != FV_MAP_NONE) { /* of twelve observers none is in the window */
        l.landmark = &l.map->landmarks[other.landmark[0]];
        NOTE(lens_looked, look, &l, 1);
    }
    const struct crowd crowd = full_map_crowd(o);
    full_map_view(o, &crowd, FULL_MAP_PLACES / 2);
    const struct fv_map_frame frame = fv_map_frame_at(l.map, fv_map_current(l.map));
    for (uint32_t f = 0; f < frame.keyframe->features; f++)
        frame.landmark[f] = newest.landmark[f];
    o->state->pose.posed = true;
    NOTE(lens_frame, measure_frame, &l, 1);
}

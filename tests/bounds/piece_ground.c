/* Of the floor under the robot, measured by landmarks on pixels of floor. */
#include "runtime/ground.c"

#include "bounds/counter.h"
#include "bounds/full_map.h"
#include "bounds/grid_case.h"
#include "bounds/pieces.h"

struct grounding {
    struct fovea *rt;
    struct fv_ground_stage *stage;
    struct fovea_grid_view view;
};

static void gather_begun(void *context)
{
    struct grounding *w = context;
    gather_begin(w->stage, &w->rt->odometry, &w->rt->scale, &w->rt->publish);
}

static void gather_unit(void *context)
{
    struct grounding *w = context;
    gather(w->stage, &w->view, &w->rt->odometry);
}

static void fit_unit(void *context)
{
    struct grounding *w = context;
    fit(w->stage);
}

static void followed(void *context)
{
    struct grounding *w = context;
    fv_ground_stage_follow(w->stage, &w->rt->publish, NULL);
}

/* All landmarks lie on floor, and are seen by as many keyframes as they remember. */
static void of_gathering(struct grounding *w)
{
    struct fv_ground_stage_state *s = w->stage->state;
    full_map_fill(&w->rt->odometry, FV_MAP_OBSERVERS_MAX);
    NOTE(ground_begun, gather_begun, w, 1);
    memcpy(s->T_odom_cam.R, (double[9]){1, 0, 0, 0, 1, 0, 0, 0, 1}, sizeof s->T_odom_cam.R);
    fv_se3_to_rows(&s->T_odom_cam, w->view.T_odom_cam); /* lies over the scene */
    s->metres = 1;
    s->down[0] = s->down[1] = 0;
    s->down[2] = 1;
    while (s->phase == FV_GROUND_GATHERING)
        NOTE(ground_gathered, gather_unit, w, 1);
    MUST(s->gather.met > POINTS);
}

/* A plane, and all points in it: every refinement takes all. */
static void of_fits(struct grounding *w)
{
    enum { TIMES = 12 };
    struct fv_ground_stage_state *s = w->stage->state;
    for (int time = 0; time < TIMES; time++) {
        for (int i = 0; i < POINTS; i++) {
            const int x = i % 16 - 8, y = i / 16 - 8;
            w->stage->points[i] =
                (struct fv_floor_point){.p = {x, y, 5 + 0.001 * ((i + time) % 7)}, .sigma = 0.05};
        }
        s->gather.count = POINTS;
        s->down[0] = s->down[1] = 0;
        s->down[2] = 1;
        s->phase = FV_GROUND_GATHERED;
        NOTE(ground_fitted, fit_unit, w, 1);
        MUST(s->phase == FV_GROUND_SHARPENED);
        NOTE(ground_fitted, fit_unit, w, 1);
    }
}

void pieces_of_ground(struct fovea *rt)
{
    static struct grounding w;
    w.rt = rt;
    w.stage = &rt->ground;
    for (int n = 0; n < 8; n++) { /* placed, then driven on, half a metre each */
        grid_case_pose(rt, 0.5 * n);
        NOTE(ground_followed, followed, &w, 1);
    }
    MUST(w.stage->state->ground.placed);
    grid_case_view(rt, GRID_CASE_FLOOR, false, &w.view);
    of_gathering(&w);
    of_fits(&w);
}

/* Of an update of the grid of free space: of its cells, and of rays over what masks show. */
#include "grid/rays.c"
#include "grid/update.c"

#include <stdlib.h>

#include "bounds/counter.h"
#include "bounds/grid_case.h"
#include "bounds/limits.h"
#include "bounds/pieces.h"

LIMIT(GRID_COARSE, FV_GRID_AHEAD);
LIMIT(GRID_END_LOOKUPS, END_LOOKUPS);

struct gridding {
    struct fovea *rt;
    struct fv_grid *g;
    struct fovea_grid_view view;
    struct fv_grid_look look;
    struct ray ray;
    struct fovea_grid_point *points;
};

/* ---- cells ----------------------------------------------------------------------------------- */

static void laid(void *context)
{
    struct gridding *w = context;
    struct fv_free_space *stage = &w->rt->free_space;
    fv_free_space_lay(stage, NULL, w->view.seen, w->view.camera, w->view.labels);
}

static void forgotten(void *context)
{
    struct gridding *w = context;
    fv_free_space_reset(&w->rt->free_space);
}

static void decayed(void *context)
{
    const struct gridding *w = context;
    decay(w->g, 0, FV_GRID_CELLS);
}

static void applied(void *context)
{
    const struct gridding *w = context;
    apply(w->g, 0, FV_GRID_CELLS);
}

static void stood(void *context)
{
    const struct gridding *w = context;
    stand(w->g);
}

/* The robot goes along both axes by one cell less than the grid has, with the tables to be made and
 * the marks of an update that was not completed. */
static void of_laying(struct gridding *w)
{
    struct fv_free_space_state *s = w->rt->free_space.state;
    const double side = w->g->config.side_cells, cell = w->g->config.resolution_m;
    memcpy(s->pose.T_odom_cam, w->view.T_odom_cam, sizeof s->pose.T_odom_cam);
    for (int time = 0; time < 2; time++) {
        s->frame.stamp_ns = 1 + time * INT64_C(1000000000);
        s->pose.position_m[0] = s->pose.position_m[1] = (time * (side - 1) + 0.5) * cell;
        w->g->state->made = 0;
        w->g->state->phase = FV_GRID_APPLY;
        NOTE(grid_laid, laid, w, 1);
        MUST(s->phase == FV_FREE_SPACE_UPDATING);
    }
    MUST(w->g->state->corner[0] == (int64_t)(side / 2) - 1);
    NOTE(grid_forgotten, forgotten, w, 1);
    MUST(!w->g->state->begun);
    w->g->state->begun = 1;
}

/* Evidence and heights in all cells; they may move in every other one. */
static void fill(struct gridding *w)
{
    const int64_t cells = fv_grid_side(w->g) * fv_grid_side(w->g);
    for (int64_t i = 0; i < cells; i++) {
        w->g->odds[i] = (int16_t)(i % 3 == 0 ? -1234 : 2345);
        w->g->movable[i] = i % 2;
        w->g->heights[i] = (struct fv_grid_height){700, 900, 15 * FV_GRID_HEIGHT_ONE, 1000};
    }
}

static void of_cells(struct gridding *w)
{
    fill(w);
    w->g->state->left[0] = 65000;
    w->g->state->left[1] = 60000;
    NOTE(cell_decayed, decayed, w, FV_GRID_CELLS);
    for (int kinds = 0; kinds < 3; kinds++) { /* floor, obstacles, both */
        fill(w);
        for (int64_t i = 0; i < FV_GRID_CELLS; i++)
            w->g->marks[i] = kinds == 0 || (kinds == 2 && i % 2 == 0)
                                 ? FV_GRID_MARK_FREE
                                 : FV_GRID_MARK_OCCUPIED + (i / 2) % 2;
        NOTE(cell_applied, applied, w, FV_GRID_CELLS);
    }
    const int64_t reach = (int64_t)(w->g->config.robot_radius_m / w->g->config.resolution_m) + 1;
    NOTE(cell_stood, stood, w, (2 * reach + 1) * (2 * reach + 1));
}

/* ---- points ---------------------------------------------------------------------------------- */

static void points_taken(void *context)
{
    const struct gridding *w = context;
    w->g->state->point = fv_grid_take_points(w->g, &w->view, 0);
}

/* Obstacles in cells side by side, or holes in the floor behind them; in later times each has
 * points in all cells around, and a height to join, to exceed, or to take the place of. */
static void of_points(struct gridding *w)
{
    enum { TIMES = 6 };
    static const double heights_m[TIMES] = {0.5, 0.5, 0.52, 0.8, 0.81, -0.5};
    const double cell = w->g->config.resolution_m;
    fv_grid_forget(w->g);
    w->g->state->begun = 1;
    grid_case_view(w->rt, GRID_CASE_FLOOR, false, &w->view);
    w->points = calloc(FV_GRID_POINTS, sizeof *w->points);
    MUST(w->points != NULL);
    for (int time = 0; time < TIMES; time++) {
        const double height = heights_m[time];
        for (int i = 0; i < FV_GRID_POINTS; i++) {
            const int column = i / 32, half_row = i % 32 - 16;
            w->points[i] = (struct fovea_grid_point){.position_m = {(float)(4 + column * cell),
                                                                    (float)(half_row * 0.5 * cell),
                                                                    (float)height},
                                                     .along_m = 1e-3f,
                                                     .across_m = 1e-3f};
        }
        w->view.points = w->points;
        w->view.point_count = FV_GRID_POINTS;
        NOTE(point_taken, points_taken, w, FV_GRID_POINTS);
    }
    const int64_t at = fv_grid_place_at(w->g, 4.5 + 0.5 * cell, 0.05 * cell);
    MUST(at >= 0 && (w->g->marks[at] & FV_GRID_MARK_KIND) == FV_GRID_MARK_OCCUPIED);
    MUST(w->g->heights[at].top >= FV_GRID_HEIGHT_ONE);
    free(w->points);
    memset(w->g->marks, 0, (size_t)(fv_grid_side(w->g) * fv_grid_side(w->g)));
}

/* ---- rays ------------------------------------------------------------------------------------ */

static void look_made(void *context)
{
    struct gridding *w = context;
    w->look = fv_grid_look_of(&w->view);
    w->look.least = 250;
}

static void ray_followed(void *context)
{
    struct gridding *w = context;
    int32_t lookups = 1 << 20;
    (void)follow_ray(w->g, &w->look, &lookups);
}

static void freed(void *context)
{
    struct gridding *w = context;
    w->g->state->free = 0;
    free_up_to(w->g, &w->look, &w->ray, fv_grid_steps(w->g));
}

static int32_t marked; /* steps of a ray nearer than the image */

static void hidden_marked(void *context)
{
    struct gridding *w = context;
    int32_t lookups = 0;
    mark_hidden(w->g, &w->look, &w->ray, &lookups);
    marked = -lookups;
}

/* Over floor that is seen to the end of the range, its height known or not. */
static void of_long_rays(struct gridding *w)
{
    struct fv_grid_state *s = w->g->state;
    const int32_t steps = fv_grid_steps(w->g);
    for (int mask = GRID_CASE_FLOOR; mask <= GRID_CASE_SOME_SURE; mask++)
        for (int unknown = 0; unknown < 3; unknown++) {
            if (mask == GRID_CASE_OBSTACLES) continue;
            grid_case_view(w->rt, (enum grid_case_mask)mask, false, &w->view);
            w->view.floor_covariance[5] = unknown == 2 ? 1 : unknown * 1e-4;
            w->view.floor_covariance[0] = w->view.floor_covariance[3] = unknown * 1e-6;
            NOTE(mask_looked, look_made, w, 1);
            s->ray = 0; /* straight ahead */
            s->step = -1;
            ray_followed(w);
            MUST(s->step == steps + 1);
            const struct ray ray =
                ray_of(&w->look, w->g->rays[0], w->g->config.resolution_m / FV_GRID_RAY_STEPS);
            s->step = s->free = view_begin(&w->look, &ray, steps);
            MUST(s->step < steps / 4);
            const double walked = steps + 1 - s->step;
            NOTE(ray_looked, ray_followed, w, walked);
            w->ray = ray;
            NOTE(ray_freed, freed, w, steps + 1);
            s->begin = (uint16_t)view_begin(&w->look, &ray, steps);
            hidden_marked(w);
            MUST(marked > 0);
            NOTE(ray_looked, hidden_marked, w, marked);
        }
}

/* Over floor that ends after some steps. */
static void of_ended_rays(struct gridding *w)
{
    struct fv_grid_state *s = w->g->state;
    const int32_t steps = fv_grid_steps(w->g);
    for (int unknown = 0; unknown < 2; unknown++) {
        grid_case_view(w->rt, GRID_CASE_ENDS, false, &w->view);
        w->view.floor_covariance[5] = unknown * 1e-4;
        look_made(w);
        s->ray = 0; /* straight ahead */
        const struct ray ray =
            ray_of(&w->look, w->g->rays[0], w->g->config.resolution_m / FV_GRID_RAY_STEPS);
        const int32_t begin = view_begin(&w->look, &ray, steps);
        s->step = -1;
        ray_followed(w);
        MUST(s->floor && s->step > begin && s->step < steps);
        const double walked = s->step - begin + 1;
        s->step = s->free = begin;
        NOTE(ray_looked, ray_followed, w, walked + END_LOOKUPS);
    }
}

/* An obstacle right below the camera, so that each ray ends where it begins. */
static void of_short_rays(struct gridding *w)
{
    struct fv_grid_state *s = w->g->state;
    for (int unknown = 0; unknown < 2; unknown++) {
        grid_case_view(w->rt, GRID_CASE_OBSTACLES, true, &w->view);
        w->view.floor_covariance[5] = unknown * 1.0;
        look_made(w);
        for (s->ray = 0; s->ray < (int32_t)w->g->config.rays; s->ray += 100) {
            s->step = -1;
            NOTE(ray_begun, ray_followed, w, 1);
            MUST(s->step == 0);
        }
    }
}

void pieces_of_grid(struct fovea *rt)
{
    static struct gridding w;
    w.rt = rt;
    w.g = &rt->free_space.grid;
    grid_case_view(rt, GRID_CASE_ALTERNATE, false, &w.view);
    of_laying(&w);
    w.g->state->position_m[0] = w.g->state->position_m[1] = 0.05;
    w.g->state->begun = 0;
    follow(w.g, 0);
    follow(w.g, 1);
    w.g->state->begun = 1;
    of_cells(&w);
    of_points(&w);
    of_long_rays(&w);
    of_ended_rays(&w);
    of_short_rays(&w);
}

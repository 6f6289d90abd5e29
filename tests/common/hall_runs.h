/* Whole runs of the robot with two cameras and the shipped network in a hall of `sim:drive`: a
 * first one that saves its map with its grid, and others whose grids are compared with it.
 * FOVEA_PICTURES=DIR: grids of the runs. For one file of a program. */
#ifndef FOVEA_TESTS_COMMON_HALL_RUNS_H
#define FOVEA_TESTS_COMMON_HALL_RUNS_H

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
/* cmocka needs the above */
#include <cmocka.h>

#include "app/config/model_file.h"
#include "app/run/grid_file.h"
#include "common/sim_rig.h"
#include "geometry/se3.h"
#include "map/archive.h"

#define HALL "sim:drive?seed=7&width=320&height=240&rate=10&baseline=0.12"
enum { SIDE = 128, CELLS = SIDE * SIDE, SAVED_FRAMES = 120, START = 80, DARK = 1000 };
enum { FLOOR = 0, WALL, OBSTACLE, MOVABLE, OTHER };

static struct sim_rig rig;
static struct fv_model_file model;
static uint8_t *saved; /* the first run's map */
static size_t saved_bytes;

/* A grid, and where the truth's world lies against it. */
struct grid {
    int8_t cells[CELLS];
    struct fovea_grid_place place;
    double T_odom_world[12];
};
static struct grid first_run;

/* ---- runs ------------------------------------------------------------------------------------ */

static inline void open_rig(int start, int frames)
{
    sim_rig_open_kept(&rig, HALL, start, frames);
    rig.config.rig = rig.ops->info(rig.source)->rig;
    rig.config.detect.model = model.data;
    rig.config.detect.model_bytes = model.bytes;
    struct fovea_grid_job_config *job = &rig.config.grid_job;
    job->grid.side_cells = SIDE;
    job->enabled = true;
    memset(job->labels, FOVEA_GRID_OBSTACLE, sizeof job->labels);
    job->labels[FLOOR] = FOVEA_GRID_FLOOR;
    job->labels[MOVABLE] = FOVEA_GRID_MOVABLE;
    job->labels[OTHER] = FOVEA_GRID_BEYOND;
    double *rows = rig.config.rig.cameras[0].T_body_cam; /* as one writes it: three digits */
    for (int k = 0; k < 12; k++)
        rows[k] = floor(1000 * rows[k] + 0.5) / 1000;
}

static inline void load(const uint8_t *map, size_t bytes)
{
    rig.config.map = map;
    rig.config.map_bytes = bytes;
}

static int light_again = DARK; /* number of the frame */

/* What a run's network and odometry are granted in a frame; false: it is at its end. */
static inline bool next(int dark)
{
    static uint8_t black[320 * 240];
    if (!sim_rig_next(&rig)) return false;
    for (uint32_t i = 0; i < 2 && rig.frames >= dark && rig.frames < light_again; i++)
        rig.frame.images[i].data = black;
    rig.inputs.grants.units[FOVEA_JOB_DETECT] = 400; /* a mask with every frame */
    sim_rig_process(&rig);
    return true;
}

/* False: there is none. */
static inline bool take(struct grid *grid)
{
    struct fv_se3 B, T, back;
    if (!fovea_free_space_get(rig.rt, grid->cells, &grid->place)) return false;
    const int n = rig.frames - 1;
    if (!rig.pose[n].posed) return false;
    fv_se3_from_rows(rig.config.rig.cameras[0].T_body_cam, &B);
    fv_se3_from_rows(rig.pose[n].T_world_cam, &T);
    fv_se3_compose(&B, &T, &T);
    fv_se3_from_rows(rig.truth[n], &back);
    fv_se3_invert(&back, &back);
    fv_se3_compose(&T, &back, &T);
    fv_se3_to_rows(&T, grid->T_odom_world);
    return true;
}

static inline void draw(const char *name, uint32_t side)
{
    char path[256];
    struct fv_grid_counts counts;
    if (getenv("FOVEA_PICTURES") == NULL) return;
    snprintf(path, sizeof path, "%s/%s.png", getenv("FOVEA_PICTURES"), name);
    assert_int_equal(fv_grid_file_write(path, rig.rt, side, &counts, NULL), FOVEA_OK);
}

/* The sealed map, from malloc. */
static inline uint8_t *save(size_t *bytes)
{
    const size_t capacity = fovea_map_bytes_max(&rig.config);
    uint8_t *map = malloc(capacity);
    *bytes = fovea_map_save(rig.rt, map, capacity);
    assert_true(*bytes > 0);
    return map;
}

/* What a map file says of its grid, whose cells are the last part before the checksum. */
static inline const int8_t *cells_of(const uint8_t *map, size_t bytes, uint32_t side)
{
    return (const int8_t *)map + bytes - FV_ARCHIVE_CHECKSUM_BYTES - (size_t)side * side;
}

static inline int set_up(void **state)
{
    struct fovea_error error;
    (void)state;
    if (fv_model_file_read("src/detect/segmenter.fvm", &model, &error) != FOVEA_OK) return -1;
    open_rig(0, SAVED_FRAMES);
    sim_rig_build(&rig);
    while (next(DARK))
        ;
    if (!take(&first_run)) return -1;
    saved = save(&saved_bytes);
    draw("saved", SIDE);
    sim_rig_close(&rig);
    return 0;
}

static inline int tear_down(void **state)
{
    (void)state;
    free(saved);
    fv_model_file_free(&model);
    return 0;
}

/* ---- comparing ------------------------------------------------------------------------------- */

static inline bool is_free(int8_t percent)
{
    return percent >= 0 && percent < 35;
}

static inline bool is_occupied(int8_t percent)
{
    return percent > 65;
}

static inline int count_known(const int8_t *cells, int count)
{
    int known = 0;
    for (int i = 0; i < count; i++)
        known += is_free(cells[i]) || is_occupied(cells[i]);
    return known;
}

/* Place of a cell of the first run in another; -1: outside. */
static inline int place_in(const struct grid *grid, int cell)
{
    const double at[3] = {first_run.place.origin_m[0] + 0.1 * (cell % SIDE + 0.5),
                          first_run.place.origin_m[1] + 0.1 * ((double)(cell / SIDE) + 0.5), 0};
    struct fv_se3 T;
    double p[3];
    fv_se3_from_rows(first_run.T_odom_world, &T);
    fv_se3_apply_inverse(&T, at, p);
    fv_se3_from_rows(grid->T_odom_world, &T);
    fv_se3_apply(&T, p, p);
    const double x = fv_floor((p[0] - grid->place.origin_m[0]) * 10),
                 y = fv_floor((p[1] - grid->place.origin_m[1]) * 10);
    return x < 0 || y < 0 || x >= SIDE || y >= SIDE ? -1 : (int)y * SIDE + (int)x;
}

/* A cell that says the other thing than all nine of the first run about it. */
static inline int count_contradictions(const struct grid *grid)
{
    int count = 0;
    for (int y = 1; y < SIDE - 1; y++)
        for (int x = 1; x < SIDE - 1; x++) {
            const int at = place_in(grid, y * SIDE + x);
            int free = 0, occupied = 0;
            for (int k = 0; k < 9; k++) {
                const int8_t near = first_run.cells[(y + k / 3 - 1) * SIDE + x + k % 3 - 1];
                free += is_free(near);
                occupied += is_occupied(near);
            }
            if (at < 0) continue;
            count += (free == 9 && is_occupied(grid->cells[at])) ||
                     (occupied > 5 && is_free(grid->cells[at]));
        }
    return count;
}

/* Frames until the first grid, which is left in `grid`; none is there without a pose. */
static inline int first_grid(struct grid *grid)
{
    for (int n = 1; next(DARK); n++) {
        const bool posed = rig.pose[n - 1].posed;
        if (!take(grid)) continue;
        assert_true(posed);
        return n;
    }
    fail_msg("no grid came");
    return 0;
}

#endif

/* Of free space besides the update of its grid: points noted, recall, scan, messages, and saving.
 */
#include <stdlib.h>
#include <string.h>

#include "bounds/counter.h"
#include "bounds/full_map.h"
#include "bounds/grid_case.h"
#include "bounds/pieces.h"
#include "grid/cells.h"
#include "runtime/jobs.h"
#include "runtime/kept_grid.h"

struct spacing {
    struct fovea *rt;
    struct fv_free_space *stage;
    struct fovea_outputs outputs;
};

static void unit(void *context)
{
    struct spacing *w = context;
    (void)fv_jobs[FOVEA_JOB_DETECT]->advance(w->rt, 1, &w->outputs);
}

static int64_t cells_of(const struct spacing *w)
{
    return (int64_t)w->stage->grid.config.side_cells * w->stage->grid.config.side_cells;
}

static void fill_odds(struct spacing *w, int odds, int others)
{
    for (int64_t i = 0; i < cells_of(w); i++)
        w->stage->grid.odds[i] = (int16_t)(i % 2 == 0 ? odds : others);
}

/* ---- the step -------------------------------------------------------------------------------- */

static void note(void *context)
{
    struct spacing *w = context;
    fv_free_space_note(w->stage, &w->rt->publish, &w->rt->odometry, &w->rt->state->frame);
}

/* A frame with a landmark at each feature, all of them known well. */
static void of_noting(struct spacing *w)
{
    struct fv_odometry *o = &w->rt->odometry;
    full_map_fill(o, FV_MAP_OBSERVERS_MAX);
    const uint32_t features = o->map.limits.features;
    const struct fv_map_frame now = fv_map_frame_at(&o->map, fv_map_current(&o->map)),
                              last = fv_map_frame_at(&o->map, o->map.limits.keyframes - 1);
    memcpy(now.landmark, last.landmark, features * sizeof *now.landmark);
    for (uint32_t i = 0; i < o->map.state->landmark_top; i++) {
        o->map.landmarks[i].level = 0;
        o->map.landmarks[i].spread = 1;
    }
    grid_case_pose(w->rt, 0);
    NOTE(space_noted, note, w, 1);
    MUST(w->stage->state->noted.points == w->stage->points_max);
}

/* ---- recall ---------------------------------------------------------------------------------- */

static void recall_begun(void *context)
{
    struct spacing *w = context;
    (void)fv_kept_grid_recall(w->stage);
}

/* Kept cells, as many as the grid has and known all over, of which a cell of the grid takes `along`
 * to each side; finer ones are turned, so that most of a row lies in them. */
static void keep_cells(struct spacing *w, int along)
{
    struct fv_archive_grid *loaded = &w->stage->kept->loaded;
    struct fv_free_space_pose *pose = &w->stage->state->pose;
    const struct fovea_grid_config *grid = &w->stage->grid.config;
    const double cosine = along == 1 ? 1 : 0.70710678118654752, sine = along == 1 ? 0 : cosine,
                 half_m = 0.5 * grid->side_cells * grid->resolution_m / along;
    *loaded = (struct fv_archive_grid){
        .map_id = 1,
        .side = grid->side_cells,
        .resolution_m = grid->resolution_m / along,
        .S_map_grid = {.R = {cosine, -sine, 0, sine, cosine, 0, 0, 0, 1},
                       .t = {-half_m * (cosine - sine), -half_m * (cosine + sine)},
                       .s = 1}};
    pose->S_own_odom = (struct fv_sim3){.R = {1, 0, 0, 0, 1, 0, 0, 0, 1}, .s = 1};
    pose->map_id = 1;
    for (int64_t i = 0; i < cells_of(w); i++)
        w->stage->recall.percent[i] = i % 2 == 0 ? 33 : 67;
    fv_grid_recall_keep(&w->stage->recall, loaded->side, loaded->resolution_m,
                        w->stage->recall.percent);
}

/* Nothing is known yet. */
static void of_recall(struct spacing *w, int along)
{
    keep_cells(w, along);
    fill_odds(w, 0, 100);
    NOTE(recall_begun, recall_begun, w, 1);
    MUST(w->stage->recall.state->busy && w->stage->recall.state->samples == along);
    w->stage->state->phase = FV_FREE_SPACE_RECALLING;
    while (w->stage->state->phase == FV_FREE_SPACE_RECALLING)
        NOTE(grid_recalled, unit, w, 1);
    const int64_t middle = fv_grid_place_at(&w->stage->grid, 0.05, 0.05);
    MUST(w->stage->grid.odds[middle] != 0 && w->stage->grid.odds[middle] != 100);
}

/* ---- the scan, and messages ------------------------------------------------------------------ */

static void ask_scan(struct spacing *w)
{
    fv_grid_scan_begin(&w->stage->grid);
    w->stage->state->phase = FV_FREE_SPACE_SCANNING;
}

/* Free up to the end, not known, occupied all around or from cell to cell. */
static void of_scan(struct spacing *w)
{
    static const int odds[][2] = {{-2000, -2000}, {0, 0}, {3500, 3500}, {-2000, 3500}, {-2000, 0}};
    for (size_t i = 0; i < sizeof odds / sizeof odds[0]; i++) {
        fill_odds(w, odds[i][0], odds[i][1]);
        ask_scan(w);
        while (w->stage->state->phase == FV_FREE_SPACE_SCANNING)
            NOTE(grid_scanned, unit, w, 1);
    }
    ask_scan(w);
    w->stage->grid.state->scanned = (int32_t)w->stage->grid.config.rays;
    NOTE(space_asked, unit, w, 1); /* nothing is left */
}

/* Known cells and heights throughout. */
static void of_messages(struct spacing *w)
{
    fill_odds(w, -2000, 3500);
    for (int64_t i = 0; i < cells_of(w); i++)
        w->stage->grid.heights[i] = (struct fv_grid_height){700, 900, 15 * FV_GRID_HEIGHT_ONE, 0};
    w->stage->state->phase = FV_FREE_SPACE_SENDING_GRID;
    w->stage->state->sent = 0;
    while (w->stage->state->phase != FV_FREE_SPACE_IDLE) {
        const uint32_t phase = w->stage->state->phase;
        memset(&w->outputs, 0, sizeof w->outputs);
        piece_note(phase == FV_FREE_SPACE_SENDING_GRID   ? PIECE_grid_sent
                   : phase == FV_FREE_SPACE_SENDING_SCAN ? PIECE_scan_sent
                                                         : PIECE_heights_sent,
                   (double)counter_of(unit, w));
        MUST(w->outputs.message_count == 1);
    }
}

/* ---- saving ---------------------------------------------------------------------------------- */

static void save_unit(void *context)
{
    struct spacing *w = context;
    (void)fv_kept_grid_save_unit(w->stage, &w->rt->publish, &w->rt->odometry);
}

/* Of which one cell is known, the last; then all. */
static void of_saving(struct spacing *w)
{
    const size_t bytes = fovea_map_bytes_max(&w->rt->config);
    uint8_t *saved = malloc(bytes);
    MUST(saved != NULL);
    w->stage->state->world = fv_free_space_world_of(&w->rt->publish);
    MUST(fv_free_space_vouched(w->stage, &w->rt->publish));
    memset(w->stage->grid.movable, 0, (size_t)cells_of(w));
    fill_odds(w, 0, 0);
    w->stage->grid.odds[cells_of(w) - 1] = 3500;
    fovea_map_save_to(w->rt, saved, bytes);
    fv_odometry_save_begin(&w->rt->odometry);
    fv_kept_grid_save_begin(w->stage, &w->rt->odometry);
    w->rt->odometry.saver.archive->phase = FV_ARCHIVE_GRID;
    NOTE(grid_searched, save_unit, w, 1);
    MUST(w->stage->kept->row == 0 && fv_odometry_save_at_grid(&w->rt->odometry));
    fill_odds(w, -2000, 3500);
    while (w->stage->kept->row < w->stage->grid.config.side_cells)
        NOTE(grid_saved, save_unit, w, 1);
    fv_odometry_save_drop(&w->rt->odometry);
    fovea_map_save_to(w->rt, NULL, 0);
    free(saved);
}

void pieces_of_free_space(struct fovea *rt)
{
    static struct spacing w;
    w.rt = rt;
    w.stage = &rt->free_space;
    of_noting(&w);
    of_recall(&w, 1);
    of_recall(&w, 4);
    of_scan(&w);
    of_messages(&w);
    of_saving(&w);
}

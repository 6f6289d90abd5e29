/* Between the files of the grid: its cells, what an update marks in them, and the labels that it
 * looks up. */
#ifndef FOVEA_GRID_CELLS_H
#define FOVEA_GRID_CELLS_H

#include "grid/grid.h"

/* Log-odds of one view, in thousandths: OctoMap's (section 3.2), 0.85 and -0.4. */
enum { FV_GRID_HIT = 850, FV_GRID_MISS = -400 };

/* What one update says of a cell; the larger number wins. Of an obstacle: twice the eighths of its
 * evidence that are in the cell, and 1 where it may move. Beside it: a point stands in it. */
enum {
    FV_GRID_MARK_NONE = 0,
    FV_GRID_MARK_FREE = 1,
    FV_GRID_MARK_EIGHTHS = 8,
    FV_GRID_MARK_OCCUPIED = 2 * FV_GRID_MARK_EIGHTHS,
    FV_GRID_MARK_KIND = 31,
    FV_GRID_MARK_POINT = 32
};

static inline int64_t fv_grid_whole(double value) /* rounded down */
{
    const int64_t part = (int64_t)value;
    return part - (value < (double)part);
}

static inline int64_t fv_grid_side(const struct fv_grid *g)
{
    return g->config.side_cells;
}

static inline size_t fv_grid_wrapped(int64_t cell, int64_t side)
{
    const int64_t rest = cell % side;
    return (size_t)(rest < 0 ? rest + side : rest);
}

/* Where a cell is kept, by its column and row from the corner. */
static inline int64_t fv_grid_kept(const struct fv_grid *g, int64_t column, int64_t row)
{
    const int64_t side = fv_grid_side(g), x = column + g->state->corner_kept[0],
                  y = row + g->state->corner_kept[1];
    return (y < side ? y : y - side) * side + (x < side ? x : x - side);
}

/* Where cell (x, y) of the odometry frame is kept; -1: the grid does not reach so far. */
static inline int64_t fv_grid_place_of(const struct fv_grid *g, int64_t x, int64_t y)
{
    const int64_t side = fv_grid_side(g);
    const int64_t column = x - g->state->corner[0], row = y - g->state->corner[1];
    if (column < 0 || column >= side || row < 0 || row >= side) return -1;
    return fv_grid_kept(g, column, row);
}

static inline int64_t fv_grid_place_at(const struct fv_grid *g, double x_m, double y_m)
{
    return fv_grid_place_of(g, fv_grid_whole(x_m / g->config.resolution_m),
                            fv_grid_whole(y_m / g->config.resolution_m));
}

/* The marks and where cells are kept, for loops. */
struct fv_grid_window {
    uint8_t *marks;
    int64_t side, corner[2], kept[2];
};

static inline struct fv_grid_window fv_grid_window_of(const struct fv_grid *g)
{
    const struct fv_grid_state *s = g->state;
    return (struct fv_grid_window){g->marks,
                                   fv_grid_side(g),
                                   {s->corner[0], s->corner[1]},
                                   {s->corner_kept[0], s->corner_kept[1]}};
}

static inline void fv_grid_mark_in(const struct fv_grid_window *in, int64_t x, int64_t y,
                                   uint8_t kind)
{
    const int64_t column = x - in->corner[0], row = y - in->corner[1], side = in->side;
    if (column < 0 || column >= side || row < 0 || row >= side) return;
    const int64_t kept_x = column + in->kept[0], kept_y = row + in->kept[1];
    uint8_t *mark = in->marks + (kept_y < side ? kept_y : kept_y - side) * side +
                    (kept_x < side ? kept_x : kept_x - side);
    if ((*mark & FV_GRID_MARK_KIND) < kind) *mark = (uint8_t)((*mark & ~FV_GRID_MARK_KIND) | kind);
}

static inline void fv_grid_mark(struct fv_grid *g, double x_m, double y_m, uint8_t kind)
{
    const struct fv_grid_window in = fv_grid_window_of(g);
    fv_grid_mark_in(&in, fv_grid_whole(x_m / g->config.resolution_m),
                    fv_grid_whole(y_m / g->config.resolution_m), kind);
}

/* Height of the floor in the odometry frame, and the variance of it. */
static inline double fv_grid_floor_at(const struct fovea_grid_view *view, double x_m, double y_m)
{
    return view->floor_m + view->floor_slope[0] * (x_m - view->position_m[0]) +
           view->floor_slope[1] * (y_m - view->position_m[1]);
}

static inline double fv_grid_floor_variance(const struct fovea_grid_view *view, double x_m,
                                            double y_m)
{
    const double *C = view->floor_covariance, x = x_m - view->position_m[0],
                 y = y_m - view->position_m[1];
    return x * (C[0] * x + 2 * C[1] * y + 2 * C[2]) + y * (C[3] * y + 2 * C[4]) + C[5];
}

/* Steps of a ray, half a cell each: up to the range. */
enum { FV_GRID_RAY_STEPS = 2 };
static inline int32_t fv_grid_steps(const struct fv_grid *g)
{
    return (int32_t)(g->config.range_m / (g->config.resolution_m / FV_GRID_RAY_STEPS));
}

/* Where the mask has a point of the camera's frame, in its pixels; false: it is not in the image
 * (labels.c). */
bool fv_grid_in_mask(const struct fv_grid_look *look, const double point[3], double at[2]);
/* fv_grid_label of the floor's points after `first` steps of `along`, and the next ones. */
enum { FV_GRID_AHEAD = 2 * FV_PROJECT_PAIRS };
void fv_grid_labels(const struct fv_grid_look *look, const double along[3], int32_t first,
                    int16_t labels[FV_GRID_AHEAD]);

/* Follow the next rays, up to FV_GRID_LOOKUPS labels (rays.c); true: all have been. */
bool fv_grid_follow_rays(struct fv_grid *grid, const struct fovea_grid_view *view);

/* Take points from `first` on, at most FV_GRID_POINTS (landmarks.c); returns the next one. */
enum { FV_GRID_POINTS = 448 };
uint32_t fv_grid_take_points(struct fv_grid *grid, const struct fovea_grid_view *view,
                             uint32_t first);

/* Heights (heights.c). Another point says that a surface in the cell kept at `at` is so high. */
void fv_grid_height_add(struct fv_grid *grid, int64_t at, double height_m);
/* What stays of a count after a decay, in 65536ths. */
static inline void fv_grid_height_decay(struct fv_grid_height *h, int32_t left)
{
    h->top = (uint16_t)(((uint32_t)h->top * (uint32_t)left + 32768) >> 16);
    h->next = (uint16_t)(((uint32_t)h->next * (uint32_t)left + 32768) >> 16);
}
/* A mask shows floor in the cell. */
static inline void fv_grid_height_floor(struct fv_grid_height *h)
{
    const uint16_t miss = FV_GRID_HEIGHT_ONE / 2;
    if (h->top_mm > 50) h->top = h->top > miss ? (uint16_t)(h->top - miss) : 0;
    if (h->next_mm > 50) h->next = h->next > miss ? (uint16_t)(h->next - miss) : 0;
}

#endif

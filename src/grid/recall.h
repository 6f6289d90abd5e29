/* What an earlier run knew of the floor, taken back by a grid where this run knows nothing yet.
 *
 * The kept cells are those of a saved map. After an update, cells of the grid that are neither free
 * nor occupied get the kept evidence added: what two views of floor would say, or one of an
 * obstacle, so that it is known at once and gives way to what is seen: an obstacle that was taken
 * away is free after four views of the floor there, a new one occupied after two. It is forgotten
 * with time as all evidence is. A cell is offered its evidence once, when it is first in the grid
 * with the kept cells applying; one that the grid has left and meets again, again.
 *
 * The kept cells may be of another size, resolution, position and direction. A cell of the grid
 * takes what is kept at its middle; where the kept cells are finer, at up to 4 x 4 points of it, an
 * obstacle before floor, and floor only where all of them are. Kept cells of less than a quarter of
 * a cell's side are not used, nor a kept floor that is tilted by more than 16 degrees against this
 * one; cells with a kept floor that is more than 0.3 m above or below take nothing.
 *
 * The state has no addresses and no padding. All but carve is real-time safe. */
#ifndef FOVEA_GRID_RECALL_H
#define FOVEA_GRID_RECALL_H

#include "grid/grid.h"

#ifdef __cplusplus
extern "C" {
#endif

struct fv_grid_recall_state {
    double resolution_m; /* of the kept cells */
    /* Of the recall under way: kept columns, kept rows and metres above the kept floor, each by
     * cells of the odometry frame along x and y, and at the corner of its cell (0, 0). */
    double along[3][3];
    int64_t offered[2]; /* corner of the grid when cells were last offered theirs */
    int64_t row;        /* of the recall under way: the next one */
    uint32_t side;      /* of the kept cells; 0: there are none */
    int32_t samples;    /* along each side of a cell */
    uint32_t busy, any_offered;
};

struct fv_grid_recall {
    uint32_t side_max;
    struct fv_grid_recall_state *state;
    int8_t *percent; /* kept cells, row by row, as those of a message that are known */
};

/* Room for as many kept cells as the grid has. Init-only. */
void fv_grid_recall_carve(struct fv_grid_recall *recall, const struct fovea_grid_config *config,
                          struct fv_arena *arena);

/* Keep `side` x `side` cells, side at most side_max, instead of what was kept; 0: none. They may be
 * at `percent` of the recall already. */
void fv_grid_recall_keep(struct fv_grid_recall *recall, uint32_t side, double resolution_m,
                         const int8_t *percent);
/* The grid has forgotten: all cells may be offered anew. */
void fv_grid_recall_forget(struct fv_grid_recall *recall);

/* After an update: begin to offer the kept evidence to the cells that have come in. `kept_odom`:
 * three rows that take points of the odometry frame to the kept cells' own, metres from the outer
 * corner of the first one, z up from their floor; `floor_m` is that of this frame. False: there is
 * nothing to do. */
bool fv_grid_recall_begin(struct fv_grid_recall *recall, const struct fv_grid *grid,
                          const double kept_odom[12], double floor_m);
/* A piece of it, some FV_GRID_RECALL_SAMPLES kept cells read. True: it is complete. */
enum { FV_GRID_RECALL_SAMPLES = 4096 };
bool fv_grid_recall_advance(struct fv_grid_recall *recall, struct fv_grid *grid);

/* Whether a cell is known and stays where it is. */
bool fv_grid_recall_any(const struct fv_grid *grid);
/* Rows of cells for a map's file: those that are known and stay where they are, else
 * FOVEA_GRID_UNKNOWN. Of the grid as it was with its corner at `corner` (cells of the odometry
 * frame): what has left it since is not known. */
void fv_grid_recall_rows(const struct fv_grid *grid, const int64_t corner[2], int64_t row_first,
                         int64_t row_count, int8_t *cells);

#ifdef __cplusplus
}
#endif
#endif

/* The grid of free space at the end of a run, as a picture. */
#ifndef FOVEA_APP_RUN_GRID_FILE_H
#define FOVEA_APP_RUN_GRID_FILE_H

#include "fovea/fovea.h"

/* Cells that are known to be free, and known to be occupied. */
struct fv_grid_counts {
    uint32_t free, occupied;
};

/* Count the cells of the grid now, and write them to `path` (NULL: do not write) as a PNG of a
 * pixel for each cell with the greys of ROS's map files: 254 is free, 0 occupied, 205 not known; x
 * of the odometry frame is to the right, y up. Uses the heap. FOVEA_ERROR_*: `error` names the
 * file. */
enum fovea_status fv_grid_file_write(const char *path, const struct fovea *rt, uint32_t side_cells,
                                     struct fv_grid_counts *counts, struct fovea_error *error);

enum { FV_GRID_FILE_PATH_BYTES = 4096 };

/* Where heights are written beside a grid: its path with -heights before the ending. False: that is
 * too long. */
bool fv_grid_file_heights(const char *path, char heights[FV_GRID_FILE_PATH_BYTES]);

/* Where heights are kept, write them there: 0 is not known, 64 the floor, 255 grid.heights_max_m
 * above it, 1 as far below. Likewise. */
enum fovea_status fv_grid_file_write_heights(const char *path, const struct fovea *rt,
                                             const struct fovea_grid_config *config,
                                             struct fovea_error *error);

#endif

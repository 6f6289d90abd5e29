/* The grid that a map's file holds: what was known of the floor, where the map is.
 *
 * Saving: after the map's own parts, units write those cells of the grid that are known and static,
 * and where they lie in the map's own frame, which corrections of the map have moved against
 * `odom`. A grid that knows nothing is not saved; a grid that was loaded with the map, or that a
 * loss of the pose ended, is saved in its place.
 *
 * Loading: the cells stay in the run's memory, with their place in the map; of a grid with more
 * cells than the run's own, the middle. Once a frame is posed in metres in that map, its grid is
 * offered them after each update (grid/recall.h).
 *
 * A loss: nothing is known while the pose is lost, but what the grid knew as of its last update
 * takes the place of what was loaded with the same map. So it is offered again where the camera is
 * found in that map, and saved with the map where it is not. */
#ifndef FOVEA_RUNTIME_KEPT_GRID_H
#define FOVEA_RUNTIME_KEPT_GRID_H

#include "map/archive.h"
#include "odometry/odometry.h"
#include "runtime/free_space.h"
#include "runtime/publish.h"

/* What a run with grids of `side_max` cells keeps of a file's grid: as many cells of its middle.
 * Also for a file without one. Init-only. */
void fv_kept_grid_crop(const struct fv_archive_info *info, const uint8_t *data, uint32_t side_max,
                       struct fv_archive_grid *grid, int8_t *cells);

/* All that follows is real-time safe, and does nothing where the grid is off. */

/* The map was replaced by one that brings this, its map numbered as in this run; side 0: none. */
void fv_kept_grid_take(struct fv_free_space *stage, const struct fv_archive_grid *grid,
                       const int8_t *cells);

/* Lengths of a map were multiplied by `factor`: what is kept lies in it as before. */
void fv_kept_grid_stretch(struct fv_free_space *stage, uint32_t map_id, double factor);

/* The grid is about to forget: keep what it knows. In proportion to its cells. */
void fv_kept_grid_keep(struct fv_free_space *stage);

/* From `odom` in metres to the own frame and unit of the map that the last frame was posed in, as
 * that frame's messages state it. */
struct fv_sim3 fv_kept_grid_own(const struct fv_publish *publish);
/* Begin to offer the loaded cells after an update; false: there are none for it. */
bool fv_kept_grid_recall(struct fv_free_space *stage);

/* A save of the map begins. */
void fv_kept_grid_save_begin(struct fv_free_space *stage, struct fv_odometry *odometry);
/* A unit of the save, if it is at the grid: true. */
bool fv_kept_grid_save_unit(struct fv_free_space *stage, const struct fv_publish *publish,
                            struct fv_odometry *odometry);

#endif

/* The truth of the simulated camera for tests of free space: of the floor's cells, found from the
 * surfaces of the world alone, and of an image's pixels as a network's mask. */
#ifndef FOVEA_TESTS_COMMON_SIM_CELLS_H
#define FOVEA_TESTS_COMMON_SIM_CELLS_H

#include <stdbool.h>
#include <stdint.h>

#include "../../drivers/sim/sim.h"
#include "fovea/segmentation.h"

/* What is over a cell of the floor, seen from above: nothing at all; floor under all of it; or a
 * surface between 5 cm and 1 m above the floor. */
enum sim_cell { SIM_CELL_NONE = 0, SIM_CELL_FLOOR = 1, SIM_CELL_OCCUPIED = 2 };
#define SIM_CELL_LOW_M 0.05
#define SIM_CELL_HIGH_M 1.0

struct sim_cells {
    double origin_m[2]; /* corner of cell (0, 0) in the world */
    double cell_m;
    int32_t width, height;
};

/* Fill width x height cells, row by row, x first: of what stands still, or of what moves, as it was
 * placed last (fv_sim_world_place), where there is then no floor. For a level floor at height 0. */
void sim_cells_find(const struct fv_sim_world *world, const struct sim_cells *grid, bool moving,
                    uint8_t *cells);

/* The classes of an image's pixels (enum fovea_truth_class) as the mask that a network of just
 * these classes would give; it uses memory of its own and that of `truth`. */
struct fovea_segmentation sim_mask_of(const struct fovea_truth *truth,
                                      const struct fovea_camera *camera);

/* What each of these classes is to a robot (enum fovea_grid_label). */
extern const uint8_t sim_labels[256];

#endif

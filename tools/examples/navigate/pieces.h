/* Grids as they come: a large one in several messages of one stamp, by rows. */
#ifndef FOVEA_EXAMPLES_NAVIGATE_PIECES_H
#define FOVEA_EXAMPLES_NAVIGATE_PIECES_H

#include "plan.h"

#include "fovea_grid_t.h"
#include "fovea_pose_t.h"

/* The frame of a grid, which poses of another map do not share. */
struct navigate_frame {
    int32_t reset_counter, map_id;
};

struct navigate_grid {
    struct navigate_frame frame;
    int32_t width, height;
    double cell_m, origin[2];
    int8_t cells[NAVIGATE_CELLS_MAX];
    int64_t sequence, time_ns; /* of its frame */
    int32_t rows;              /* that have come, from the first on */
};

/* Take a message; true when it completes a grid. A piece that does not follow the one before, or
 * with numbers that no grid has, is left out with the rest of its grid. */
bool navigate_take(struct navigate_grid *grid, const fovea_grid_t *piece);

bool navigate_is_for(const struct navigate_frame *frame, const fovea_pose_t *pose);

#endif

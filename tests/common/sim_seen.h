/* Which cells of a hall of `sim:drive` frames have shown, and what is in them: what a grid of free
 * space is judged by. */
#ifndef FOVEA_TESTS_COMMON_SIM_SEEN_H
#define FOVEA_TESTS_COMMON_SIM_SEEN_H

#include "common/sim_cells.h"

enum { SIM_SEEN_CELLS_MAX = 128 * 128 };

struct sim_seen {
    struct sim_cells place; /* cells of 10 cm, of the whole hall */
    uint8_t still[SIM_SEEN_CELLS_MAX], moving[SIM_SEEN_CELLS_MAX], was[SIM_SEEN_CELLS_MAX],
        touched[SIM_SEEN_CELLS_MAX];
    /* frames since the cell is as it is */
    uint16_t floor[SIM_SEEN_CELLS_MAX], surface[SIM_SEEN_CELLS_MAX];
    float (*ray)[2]; /* of each pixel: x and y per z */
};

/* Of a source that has begun; `end` frees what it takes. */
void sim_seen_begin(struct sim_seen *seen, const struct fv_sim_world *world,
                    const struct fovea_camera *camera);
void sim_seen_end(struct sim_seen *seen);

/* What one frame shows from at most 3 m: a point on the floor, under it, or on a surface within the
 * heights that count. */
void sim_seen_frame(struct sim_seen *seen, const struct fv_sim_world *world,
                    const struct fovea_camera *camera, const struct fovea_truth *truth);

int32_t sim_seen_cells(const struct sim_seen *seen);
enum sim_cell sim_seen_truth(const struct sim_seen *seen, int32_t cell);
/* In 3 frames. Of an occupied cell its surface: where the floor beside it alone was, as beyond the
 * corner of a box, it is not seen. */
bool sim_seen_is(const struct sim_seen *seen, int32_t cell);
/* Of the nine cells about one, those that are floor. */
int sim_seen_floor_about(const struct sim_seen *seen, int32_t cell);

#endif

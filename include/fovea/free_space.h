/* Free space in the loop (fovea/fovea.h): the grid of the floor around the robot, the heights
 * beside it, and where the floor lies. */
#ifndef FOVEA_FREE_SPACE_H
#define FOVEA_FREE_SPACE_H

#include <stdbool.h>
#include <stdint.h>

#include "fovea/grid.h"

#ifdef __cplusplus
extern "C" {
#endif

struct fovea;

/* Configuration: a grid of the floor (fovea/grid.h) from the masks of the first network
 * that labels pixels, detect.model or else detect2.model, and the poses that the masks were seen
 * from; sent as grid_t and scan_t (and height_grid_t) after each mask. The floor begins as z = 0 of
 * the body, under the robot: T_body_cam states the height of the camera over it. From there on it
 * is estimated (struct fovea_ground). Lengths must be metres: until the scale is known there is no
 * grid. It shares the units of FOVEA_JOB_DETECT. */
struct fovea_grid_job_config {
    bool enabled; /* default false */
    /* default true: points of landmarks that are tracked, and of two cameras' distances, mark cells
     * as well (struct fovea_grid_point) */
    bool landmarks;
    struct fovea_grid_config grid;
    /* One standard deviation of what T_body_cam says of the floor, about each axis and in height */
    double tilt_sigma_deg; /* [0.01, 10], default 1 */
    double height_sigma_m; /* [0.0001, 1], default 0.03 */
    /* enum fovea_grid_label of each class of the network, default FOVEA_GRID_OBSTACLE for all; the
     * command takes the classes of grid.floor, grid.movable, grid.beyond and grid.ignored */
    uint8_t labels[256];
};

/* The grid of free space as of the last mask, width x height cells row by row as
 * fovea_grid_cells; `cells` holds config.grid_job.grid.side_cells squared. False: there is none
 * yet, or the pose is lost, and nothing is written. Any time between calls. */
bool fovea_free_space_get(const struct fovea *rt, int8_t *cells, struct fovea_grid_place *place);
/* The same of heights, as fovea_grid_heights; `counts` may be NULL. False also where they are off.
 */
bool fovea_free_space_heights(const struct fovea *rt, int16_t *heights_mm, uint8_t *counts,
                              struct fovea_grid_place *place);

/* The floor under the robot: a plane of `odom`, z = height_m + slope (p - position_m), and what of
 * it goes with the robot, its mount: the same plane in the axes of the body (x forward, y left) as
 * the robot stands on average. It is 0 where T_body_cam is right. Measured by landmarks on pixels
 * that the mask calls floor, by gravity where an inertial sensor shows it, and by how the robot
 * stands; followed over ramps. */
struct fovea_ground {
    int64_t stamp_ns;     /* of the mask that was laid on it last */
    double position_m[2]; /* of the body then */
    double height_m, slope[2];
    double covariance[6]; /* of slope x, slope y, height: upper triangle by rows */
    double mount_height_m, mount_slope[2];
    double mount_sigma[3];      /* of its slopes x, y and height: one standard deviation */
    uint32_t landmarks_taken;   /* planes of landmarks that were taken */
    uint32_t landmarks_refused; /* and that were too far from what was expected */
};

/* The floor that the last mask was laid on (stamp_ns 0: none was), and the mount as of now, which
 * stays known while the pose is lost. False: there was no pose in metres yet, or there is no grid
 * in this run; nothing is written. Any time between calls. */
bool fovea_ground_get(const struct fovea *rt, struct fovea_ground *ground);

#ifdef __cplusplus
}
#endif
#endif

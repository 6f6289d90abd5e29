/* The derivation: bounds of the stages of the step (stages.c) and of each kind of unit (units.c),
 * from the capacities of a configuration and what pieces cost. */
#ifndef FOVEA_TESTS_BOUNDS_STAGES_H
#define FOVEA_TESTS_BOUNDS_STAGES_H

#include "runtime/state.h"

/* Capacities, by the names that docs/bounds.md has. */
struct capacities {
    double width, height;            /* of the image */
    double level_pixels, level_rows; /* of all levels together */
    double features;                 /* features.count_max */
    double keyframes, landmarks;     /* odometry.keyframes, odometry.landmarks */
    double window;                   /* odometry.window */
    double per_cell;                 /* features.per_cell */
    double model;                    /* bytes of detect.model, 0: none */
    double grid_side, grid_rays;     /* grid.side_cells, grid.rays */
    double grid_steps;               /* of a ray */
    double grid_robot;               /* cells around the robot */
};

/* `grid`: the runtime that has one. */
struct capacities capacities_of(const struct fovea *rt, const struct fovea *grid);
void stages_derive(const struct capacities *capacities);
void units_derive(const struct capacities *capacities);

#endif

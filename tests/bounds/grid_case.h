/* A runtime with the largest grid of free space that a configuration may ask for, heights and
 * landmarks in it, and masks that are unkind to it. */
#ifndef FOVEA_TESTS_BOUNDS_GRID_CASE_H
#define FOVEA_TESTS_BOUNDS_GRID_CASE_H

#include "fovea/fovea.h"
#include "runtime/state.h"

/* The address of its camera's frames, for a film. */
void grid_case_uri(char *uri, size_t capacity, int32_t width, int32_t height);
/* The default configuration for the robot of the simulated camera of a size, with the small
 * network as one that labels pixels. */
void grid_case_config(struct fovea_config *config, int32_t width, int32_t height);

/* What the mask shows; floor is sure but where it says otherwise. */
enum grid_case_mask {
    GRID_CASE_FLOOR = 0,
    GRID_CASE_OBSTACLES,
    GRID_CASE_UNSURE,    /* floor */
    GRID_CASE_SOME_SURE, /* floor, surely in every other row */
    GRID_CASE_ALTERNATE, /* all classes, from pixel to pixel */
    GRID_CASE_ENDS,      /* floor in the lowest tenth of the rows, and what lies beyond it above */
    GRID_CASE_MASKS
};

/* A mask of the image's size as the robot sees it from the origin, or, `below`, straight down. It
 * stays valid until the next. */
void grid_case_view(const struct fovea *rt, enum grid_case_mask mask, bool below,
                    struct fovea_grid_view *view);
/* The last frame becomes posed in metres, `ahead_m` of the origin. */
void grid_case_pose(struct fovea *rt, double ahead_m);

#endif

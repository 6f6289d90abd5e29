/* What odometry's stage does for an inertial sensor, counted apart from the rest of it: the linker
 * puts functions of these in place of those that the step calls (Makefile). */
#ifndef FOVEA_TESTS_BOUNDS_INERTIAL_PARTS_H
#define FOVEA_TESTS_BOUNDS_INERTIAL_PARTS_H

#include <stdint.h>

/* Instructions of each since the last call. */
struct inertial_parts {
    uint64_t predicted, placed, stepped;
};
struct inertial_parts inertial_parts_take(void);

#endif

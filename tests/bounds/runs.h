/* Whole runs that are unkind to the runtime, through its public interface: what every stage and
 * unit takes there is noted for its bound (table.h). Units are granted one by one. */
#ifndef FOVEA_TESTS_BOUNDS_RUNS_H
#define FOVEA_TESTS_BOUNDS_RUNS_H

#include <stdbool.h>
#include <stdint.h>

struct runs_size {
    int32_t width, height;
    uint32_t features, keyframes, landmarks; /* capacities; 0: the defaults */
    int frames;                              /* of each run; long ones have a multiple of it */
    bool brief;                              /* only some of them */
    const char *only;                        /* name of the one that is played; NULL: all */
};

struct fovea_config;

/* Capacities as the size asks for them. */
void runs_limit(struct fovea_config *config, const struct runs_size *size);
/* The configuration of the runs, with a detector. */
void runs_configure(struct fovea_config *config, const struct runs_size *size);
void runs_play(const struct runs_size *size);

#endif

/* A short run of the runtime on a painted scene, recorded: what replay and its fuzzer start from.
 */
#ifndef FOVEA_TESTS_SHORT_RUN_H
#define FOVEA_TESTS_SHORT_RUN_H

#include <stdbool.h>
#include <stdint.h>

struct short_run {
    int32_t width, height;
    uint32_t turns;    /* every eleventh has no frame; the 20th resets */
    bool detect;       /* with the detector of the tests */
    bool two_cameras;  /* the second is absent in every third frame */
    uint32_t features; /* most per frame; granted are 50 fewer at first, one more each turn */
};

/* Record a run to a file; ends the program with a line on stderr when that fails. */
void short_run_record(const char *path, const struct short_run *run);

#endif

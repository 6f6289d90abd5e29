/* A short run of the runtime on a painted scene, recorded: what replay and its fuzzer start from.
 */
#ifndef FOVEA_TESTS_SHORT_RUN_H
#define FOVEA_TESTS_SHORT_RUN_H

#include <stdbool.h>
#include <stdint.h>

#include "fovea/features.h"
#include "fovea/sensor.h"

enum {
    SHORT_RUN_IMU = 10,
    SHORT_RUN_SAMPLES = SHORT_RUN_IMU + FOVEA_SAMPLE_KIND_COUNT - 1 /* one of every other kind */
};

struct short_run {
    int32_t width, height;
    uint32_t iterations; /* every eleventh has no frame; the 20th resets */
    bool detect;         /* with the detector of the tests */
    /* two cameras, each with a mask, of which the second has images of 3/4 of the width and height
     * and is absent in every third frame; samples of
     * every kind per iteration (short_run_samples) */
    bool rig;
    uint32_t features; /* most per frame; granted are 50 fewer at first, one more each iteration */
    enum fovea_feature_method method;
    /* the iteration that the recording begins before, in the middle of the run; 0: with it. Two
     * before it features.threshold becomes 25 */
    uint32_t begin;
};

/* The samples of iteration n, SHORT_RUN_SAMPLES of them: no two have the same values. */
void short_run_samples(uint32_t n, struct fovea_sample *samples);

/* Record a run to a file; ends the program with a line on stderr when that fails. */
void short_run_record(const char *path, const struct short_run *run);

#endif

/* One source through the whole runtime: the application's loop with odometry, map, the shipped
 * detector whose objects keep features away, a second network that labels pixels, and the grid of
 * free space. What each frame gave is kept. In the calling process; ends it with a line where
 * something cannot be set up. */
#ifndef FOVEA_TESTS_CAMPAIGN_FAULTS_PLAY_H
#define FOVEA_TESTS_CAMPAIGN_FAULTS_PLAY_H

#include <stdbool.h>
#include <stdint.h>

#include "fovea/fovea.h"

enum { FAULTS_GIVEN_MAX = 1024 };

struct faults_frame {
    uint64_t index;         /* in the source */
    int64_t stamp_ns;       /* as it was given: faults may have moved it */
    bool image;             /* any camera saw something */
    bool processed;         /* the step took it */
    bool has_truth;         /* `truth` is known */
    double truth[12];       /* T_world_cam */
    struct fovea_pose pose; /* of a processed frame */
};

struct faults_play {
    /* What to do. */
    const char *uri;
    const char *twin; /* source that knows the truth of a recording by the number of its frames;
                         "": the source itself knows it, if anybody */
    uint64_t start, frames;
    bool wheels;        /* wheel odometry gives the scale */
    bool alone;         /* odometry and map only: no networks, no grid */
    const uint8_t *map; /* to start with; NULL: none */
    size_t map_bytes;
    bool localise_only;

    /* What came of it. */
    uint32_t count;
    struct faults_frame frame[FAULTS_GIVEN_MAX];
    uint64_t heap_calls; /* of the loop */
    int descriptors;     /* open after closing, less those before opening */
    bool endless;        /* more frames came than the source and its faults can give */
    uint64_t detections, masks, grids, messages;
    uint64_t hash;  /* of the state at the end */
    uint8_t *saved; /* the map at the end, to be given to free(); NULL: none */
    size_t saved_bytes;
};

void faults_play(struct faults_play *play);
_Noreturn void faults_die(const char *what);

#endif

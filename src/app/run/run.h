/* One run of `fovea run`, shared by the files of the command: run_command.c opens and runs it,
 * run_end.c tells and writes what came of it. */
#ifndef FOVEA_APP_RUN_H
#define FOVEA_APP_RUN_H

#include <pthread.h>
#include <stdio.h>

#include "app/command.h"
#include "app/final_path.h"
#include "app/keeper.h"
#include "app/loop.h"
#include "app/recorder.h"
#include "app/results.h"
#include "app/setup.h"
#include "app/trails.h"
#include "app/trajectory.h"
#include "app/transport.h"

#define FV_RUN_PICTURE_FILE "fovea-run.png" /* drawn where nothing else is asked for */

struct fv_run {
    struct fv_setup_options options;
    struct fovea_source_selection selection;
    const char *stats_path, *trajectory_path, *final_path, *picture_path, *detections_path,
        *tracks_path;
    bool quiet, all_boxes;

    struct fv_settings settings;
    struct fv_setup setup;
    FILE *stats;
    void *memory;
    size_t bytes;
    struct fovea_error unlocked; /* why the memory is not, though it was to be */
    struct fv_transport *transport;
    struct fv_recorder *recorder;
    struct fv_trajectory *trajectory;
    struct fv_results *results;
    uint64_t looks;           /* of the detector, whose results were handed on */
    uint64_t objects, tracks; /* found in them; confirmed */
    struct fv_trails trails;
    struct fv_final *final;
    struct fv_keeper keeper;
    struct fv_loop_shared shared;
    struct fv_timings timings;
    struct fv_loop loop;
    pthread_t watcher;
};

/* After the loop's last call: the summary on stdout, the statistics, the ends of trajectories and
 * results, and the picture, for whose memory the source is closed. What could not be written is
 * told on stderr. */
enum fv_exit fv_run_report(struct fv_run *run);
/* Close the recording, if there is one, and tell what is in it. */
void fv_run_end_recording(struct fv_run *run);

#endif

/* One run of `fovea run`, shared by the files of the command: run_command.c opens and runs it,
 * run_status.c keeps the terminal meanwhile, run_end.c reports and writes its results. */
#ifndef FOVEA_APP_RUN_RUN_H
#define FOVEA_APP_RUN_RUN_H

#include <semaphore.h>
#include <stdatomic.h>
#include <stdio.h>

#include "app/run/answers.h"
#include "app/run/backup.h"
#include "app/run/commands.h"
#include "app/run/fast_pose.h"
#include "app/run/final_path.h"
#include "app/run/grid_file.h"
#include "app/run/imu_input.h"
#include "app/run/keeper.h"
#include "app/run/map_loads.h"
#include "app/run/parameters.h"
#include "app/run/loop.h"
#include "app/run/pose_watch.h"
#include "app/record/recorder.h"
#include "app/run/recordings.h"
#include "app/run/requests.h"
#include "app/run/results.h"
#include "app/run/run_health.h"
#include "app/run/service.h"
#include "app/config/setup.h"
#include "app/run/snapshot.h"
#include "app/run/trails.h"
#include "app/run/trajectory.h"
#include "app/run/velocity_input.h"
#include "app/network/feed.h"
#include "app/network/identity.h"
#include "app/network/transport.h"
#include "support/output.h"

#define FV_RUN_PICTURE_FILE "fovea-run.png" /* drawn where nothing else is asked for */

/* What a run writes, by kind. */
enum fv_run_output {
    FV_RUN_MAP,
    FV_RUN_RECORDING,
    FV_RUN_STATS,
    FV_RUN_TRAJECTORY,
    FV_RUN_FINAL,
    FV_RUN_PICTURE,
    FV_RUN_DETECTIONS,
    FV_RUN_OBJECTS,
    FV_RUN_TRUTH,
    FV_RUN_GRID,
    FV_RUN_OUTPUT_COUNT
};

struct fv_run {
    struct fv_setup_options options;
    struct fovea_source_selection selection;
    const char *stats_path, *trajectory_path, *final_path, *picture_path, *detections_path,
        *objects_path, *truth_path, *grid_path;
    const char *web_port; /* of the page; NULL: none, "": its own */
    pid_t web_page;       /* its process; 0: none */
    bool quiet, all_boxes;

    struct fv_settings settings;
    struct fv_settings *as_read; /* before set-up changed anything; NULL: SIGHUP ends the run */
    atomic_bool reload;          /* SIGHUP has come */
    struct fv_setup setup;
    struct fv_output stats;
    void *memory;
    size_t bytes;
    struct fovea_error unlocked; /* why the memory is not, though it was to be */
    int64_t run_id;              /* network/run_id.h */
    struct fv_identity identity; /* says so */
    struct fv_identity_watch others;
    struct fv_transport *transport;
    struct fv_feed *feed;
    struct fv_imu_input imu; /* beside the source */
    struct fv_fast_pose fast_pose;
    struct fv_recorder *recorder;
    char recording[FV_OUTPUT_PATH_BYTES]; /* the file that it writes */
    struct fv_recordings recordings;      /* by commands */
    struct fv_trajectory *trajectory, *truth;
    struct fv_results *results;
    uint64_t inferences;               /* of the first network, whose results were taken */
    uint64_t detections, objects;      /* found in them; confirmed */
    uint64_t inferences2, detections2; /* of the second network */
    struct fv_grid_counts grid;        /* at the end */
    struct fv_trails trails;
    struct fv_watch watch;
    uint32_t calibration_said; /* verdicts on the calibration */
    int imu_said;              /* enum fovea_imu_state */
    bool imu_turned_said;      /* that its mount is wrong */
    int64_t imu_moved_said;    /* nanoseconds, of the clocks' offset that is used */
    struct fv_snapshot snapshot;
    struct fv_final *final;
    struct fv_keeper keeper;
    struct fv_answers answers;
    struct fv_requests requests;
    struct fv_velocity_input velocities;
    struct fv_parameters parameters;
    struct fv_backup backup;
    struct fv_map_loads map_loads;
    struct fv_loop_shared shared;
    struct fv_service service;
    struct fv_run_health health;
    struct fv_timings timings;
    struct fv_loop loop;
    struct fovea_sample samples[FOVEA_INPUT_SAMPLES_MAX]; /* of the step under way; the loop's */
    sem_t ended;                                          /* posted by the loop */
    const char *outputs[FV_RUN_OUTPUT_COUNT];             /* paths, NULL or "" for none */
    atomic_uint unwritten; /* bits 1 << enum fv_run_output: what is not whole yet */
};

/* run_files.c, in this order. Before the source is opened: no output is another's, or one of the
 * files that the settings name, and the map can be saved. FOVEA_ERROR_INPUT says which. */
enum fovea_status fv_run_files_apart(struct fv_run *run, struct fovea_error *error);
/* Whether all outputs can be written; said before an hour's run, and before any file is replaced.
 * Complaints go to stderr. */
enum fv_exit fv_run_files_check(const struct fv_run *run);
/* With the source open, before any file is replaced: no output is a file that the source reads,
 * and pictures have names of PNG. */
enum fovea_status fv_run_files_source(struct fv_run *run, struct fovea_error *error);

/* run_status.c, on the thread that watches the loop: one line per change of the pose's state, and
 * the status that a terminal shows. */
struct fv_run_pace {
    int64_t wall_ns; /* when the status was last shown */
    uint64_t frames; /* taken by then */
};
void fv_run_changes_say(struct fv_run *run);
/* The file that states where the inertial sensor is, or the source that does. */
const char *fv_run_imu_calibration(const struct fv_run *run);
void fv_run_status_show(struct fv_run *run, struct fv_run_pace *pace);

/* run_reload.c. Before set-up: keep the settings, where a service manager may ask to read them
 * again.
 */
enum fovea_status fv_run_keep_settings(struct fv_run *run, struct fovea_error *error);
/* Do so where it was asked for; on the thread that watches the loop. */
void fv_run_reload(struct fv_run *run);

/* run_end.c, in this order. After the loop's last call: end the recordings that commands began,
 * save the map where all went well so far (`status`, of which `error` says why), and answer who
 * still waits. Returns `status`, or what became of the map. */
enum fovea_status fv_run_end_requests(struct fv_run *run, enum fovea_status status,
                                      struct fovea_error *error);
/* After that: the summary on stdout, the statistics, the ends of trajectories and
 * results, and the picture, for whose memory the source is closed. A file that could not be written
 * is named on stderr. */
enum fv_exit fv_run_report(struct fv_run *run);
/* Whether a picture is to be drawn at the end. */
bool fv_run_draws(const struct fv_run *run);
/* The outputs that are not whole, as text, for struct fv_signals; `run` is a struct fv_run. */
void fv_run_lost(const void *run, char *text, size_t bytes);
/* Close the recording, if there is one, and say what is in it. FV_EXIT_FAILED: it is not whole. */
enum fv_exit fv_run_end_recording(struct fv_run *run);

#endif

/* What an operator must know about a run: the state of the pose and for how long it has been in it,
 * the map, closures, detections. The loop thread notes them; the thread that keeps the terminal
 * reads the newest values and takes every change of state, in order, from a wait-free ring.
 *
 * Times are of CLOCK_MONOTONIC when frames come by the clock, else of the frames' stamps, so that a
 * recording at full speed reports the time of the recording. */
#ifndef FOVEA_APP_RUN_POSE_WATCH_H
#define FOVEA_APP_RUN_POSE_WATCH_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

#include "base/ring.h"
#include "fovea/fovea.h"

enum fv_watch_state {
    FV_WATCH_WAITING = 0, /* no frame was processed yet */
    FV_WATCH_RUNNING,     /* odometry is off: there is no pose */
    FV_WATCH_STARTING,
    FV_WATCH_TRACKING,
    FV_WATCH_WEAK,
    FV_WATCH_LOST,
    FV_WATCH_PAUSED,
    FV_WATCH_COASTING,
    FV_WATCH_STATES
};

struct fv_watch_change {
    enum fv_watch_state from, to;
    uint64_t frame;    /* of the source, from 1, with which it changed */
    int64_t at_ns;     /* since the first frame */
    int64_t lasted_ns; /* how long `from` had lasted */
};

enum { FV_WATCH_CHANGES_MAX = 512, FV_WATCH_BINS = 1024, FV_WATCH_REASONS = 8 };

/* The states over the run, for its picture. A bin holds `stride` frames and shows the worst of
 * their states; when all bins are full, neighbours merge. */
struct fv_watch_ribbon {
    uint32_t bins, stride, in_last; /* bins in use, frames per bin, frames in the last one */
    uint8_t state[FV_WATCH_BINS];
};

struct fv_watch {
    /* The loop thread's. */
    bool odometry, by_clock, begun, paused;
    enum fv_watch_state state;
    int64_t first_ns, since_ns, last_ns;
    uint64_t refused_paused;
    int64_t total_ns[FV_WATCH_STATES]; /* time spent in each state that has ended */
    uint64_t frames, starting_frames, starting_features, starting_matched;
    struct fv_watch_ribbon ribbon;

    /* Between the two threads. */
    struct fv_ring ring;
    _Alignas(8) uint8_t changes[FV_WATCH_CHANGES_MAX * sizeof(struct fv_watch_change)];
    _Atomic uint64_t changes_lost; /* that found no room */
    _Atomic int now_state, source_state, imu_state;
    _Atomic int64_t imu_moved_ns, imu_moved_sigma_ns; /* samples, against what the rig states */
    _Atomic int64_t imu_turned_mdeg, imu_turned_sigma_mdeg; /* of its mount, where wrong; or 0 */
    _Atomic int64_t lasts_ns;                               /* how long the state has lasted */
    _Atomic uint32_t landmarks, keyframes, closures, merges, detections;
    _Atomic int calibration;               /* enum fovea_calibration_state */
    _Atomic uint32_t calibration_verdicts; /* other than OK, so far */
    char calibration_reasons[FV_WATCH_REASONS][FOVEA_CALIBRATION_REASON_BYTES]; /* the newest */
};

void fv_watch_open(struct fv_watch *watch, bool odometry, bool by_clock);

/* After every step, with or without a frame; `processed`: the step took it. Loop thread, real-time
 * safe. */
void fv_watch_step(struct fv_watch *watch, const struct fovea *rt,
                   const struct fovea_inputs *inputs, bool processed);

/* The oldest change of state that was not taken yet. False: there is none. The watching thread. */
bool fv_watch_take(struct fv_watch *watch, struct fv_watch_change *change);

/* The newest verdict on the calibration, when it is not number `*taken`, which is then renewed;
 * else NULL. Valid for FV_WATCH_REASONS - 1 further verdicts. The watching thread. */
const char *fv_watch_calibration(struct fv_watch *watch, uint32_t *taken);

const char *fv_watch_name(enum fv_watch_state state);

/* After the loop's last call: add the time of the state in which the run ended. */
void fv_watch_close(struct fv_watch *watch);

/* Why no frame had a pose, one line; NULL when there was one or odometry is off. `localise_only`:
 * no map was to be started. After fv_watch_close. */
const char *fv_watch_why_no_pose(const struct fv_watch *watch, bool localise_only);

#endif

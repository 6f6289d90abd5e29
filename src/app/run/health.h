/* The health of a run and of its parts, as health_t: one word for each, and the reason where it is
 * not `ok`. Judged from facts that the watching thread has gathered; pure.
 *
 * Parts, in this order; those that the run does not have are left out:
 *
 *   self_test  failed: the checks of self_test.h did not hold at the start
 *   source     failed: the watchdog: no frame for `silence_ns`, or the camera is gone; degraded: it
 *              is late, stalled or returning, or one camera of a rig gives no images for
 *              `silence_ns`
 *   imu        degraded: anything but `ok`
 *   odometry   failed: lost for longer than `silence_ns`; degraded: weak, lost, coasting, starting
 *              for more than 10 s, paused, or a calibration that does not fit
 *   network    degraded: no inference for 5 s, though there was one and frames come
 *   loop       failed: a step has hung for `silence_ns`; degraded: frames were dropped since health
 *              was last sent, as the loop was busy
 *   publisher  failed: no message can be sent at all; degraded: some were dropped since
 *   recorder   failed: a recording, also one begun by command, ended by itself, the run goes on
 *   memory     degraded: it was to be locked and is not
 *   host       degraded: hot or short of voltage, and what is done about it */
#ifndef FOVEA_APP_RUN_HEALTH_H
#define FOVEA_APP_RUN_HEALTH_H

#include <stdbool.h>
#include <stdint.h>

#include "app/run/host.h"
#include "app/run/pose_watch.h"
#include "fovea/fovea.h"

enum { FV_HEALTH_PARTS_MAX = 10, FV_HEALTH_REASON_BYTES = 128, FV_HEALTH_BYTES_MAX = 4096 };

/* As in health_t. */
enum fv_health_state { FV_HEALTH_OK, FV_HEALTH_DEGRADED, FV_HEALTH_FAILED };

struct fv_health_part {
    const char *name; /* constant */
    enum fv_health_state state;
    char reason[FV_HEALTH_REASON_BYTES];
};

struct fv_health {
    uint32_t count;
    struct fv_health_part parts[FV_HEALTH_PARTS_MAX];
};

struct fv_health_facts {
    const char *self_test; /* what is wrong; "": nothing */
    int64_t silence_ns;    /* of the watchdog */

    int source_state;       /* enum fovea_source_state */
    int64_t silent_ns;      /* since the last picture that was processed */
    uint32_t silent_camera; /* of a rig the camera that has been silent for longest; 0: no rig */
    int64_t camera_silent_ns;
    int imu_state; /* enum fovea_imu_state; FOVEA_IMU_NONE: no part */

    enum fv_watch_state pose; /* FV_WATCH_RUNNING: odometry is off */
    int64_t pose_ns;          /* for how long */
    int calibration;          /* enum fovea_calibration_state */

    bool has_network;
    uint64_t inferences;
    int64_t inference_ns; /* since the last one */

    int64_t stood_ns;      /* since the loop last moved */
    uint64_t late;         /* frames dropped since health was last sent */
    bool publishes, sends; /* messages are to be sent; a way to send them is open */
    uint64_t unsent;       /* messages dropped since */
    int64_t sent_ns;       /* since a message was last sent */
    bool records, recording_ended;
    const char *unlocked; /* why the memory is not locked; "": it is, or was not to be */

    struct fv_host host;
    double heat_limit_c;
    uint32_t share; /* percent of the period in use */
};

void fv_health_judge(const struct fv_health_facts *facts, struct fv_health *health);
/* The worst of the parts. */
enum fv_health_state fv_health_worst(const struct fv_health *health);
/* Whether any part's state is another. */
bool fv_health_differs(const struct fv_health *a, const struct fv_health *b);

#endif

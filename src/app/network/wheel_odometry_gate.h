/* Which samples of wheel odometry are taken: well-formed poses, in the order of their stamps, that
 * the robot can have reached from the last one within its limits of speed and turn. A forged sample
 * cannot move the robot faster than that, so it cannot rescale the metres by more.
 *
 * Stamps and positions jitter; a tenth of a second of the greatest motion may come at once.
 *
 * No heap, no system call; one thread at a time, but counts may be read from any. */
#ifndef FOVEA_APP_NETWORK_WHEEL_ODOMETRY_GATE_H
#define FOVEA_APP_NETWORK_WHEEL_ODOMETRY_GATE_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

#include "fovea/fovea.h"

#include "bot_core_pose_t.h"

struct fv_wheel_odometry_limits {
    double speed_m_s, turn_rad_s; /* 0: without limit */
};

enum fv_wheel_odometry_verdict {
    FV_WHEEL_ODOMETRY_TAKEN,
    FV_WHEEL_ODOMETRY_MALFORMED, /* not finite, no rotation, no time that fits nanoseconds */
    FV_WHEEL_ODOMETRY_OLD,       /* not after the last sample */
    FV_WHEEL_ODOMETRY_TOO_FAST,  /* farther from the last sample than the limits allow */
    FV_WHEEL_ODOMETRY_BUSY,      /* the loop has not yet taken those before */
    FV_WHEEL_ODOMETRY_VERDICTS
};
/* "too fast"; for reports. */
const char *fv_wheel_odometry_verdict_name(enum fv_wheel_odometry_verdict verdict);

struct fv_wheel_odometry_gate {
    struct fv_wheel_odometry_limits limits;
    bool any;
    struct fovea_wheel_odometry_sample last; /* that was taken */
    double room_m, room_rad;                 /* motion that may still come at once */
    atomic_uint_fast64_t counts[FV_WHEEL_ODOMETRY_VERDICTS];
};

void fv_wheel_odometry_gate_init(struct fv_wheel_odometry_gate *gate,
                                 const struct fv_wheel_odometry_limits *limits);

/* Judge a pose, and count what is refused. FV_WHEEL_ODOMETRY_TAKEN: `*sample` is it, its stamp that
 * of the message in nanoseconds; what was taken must be counted by the caller. */
enum fv_wheel_odometry_verdict
fv_wheel_odometry_gate_judge(struct fv_wheel_odometry_gate *gate, const bot_core_pose_t *pose,
                             struct fovea_wheel_odometry_sample *sample);

void fv_wheel_odometry_gate_count(struct fv_wheel_odometry_gate *gate,
                                  enum fv_wheel_odometry_verdict verdict);

#endif

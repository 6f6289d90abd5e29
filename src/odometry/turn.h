/* The camera's turn, held by the gyro: what it measured since the frame before, beside what the
 * frame shows.
 *
 * A camera that moves sideways sees nearly what one that turns sees, so the errors of turn and
 * position are correlated, and landmarks carry them from frame to frame. A gyro tells turns from
 * ways: over a second it errs by a tenth of what the pictures do (EuRoC: .015 and .12 to .17
 * degrees). So a frame's pose is the best one by both: the pose that its matches give, with their
 * information, moved by the linear update of a Kalman filter towards the turn of the frame before,
 * turned on as measured. The variance of that turn comes of the frame before, of the samples'
 * noise, of the bias that is known, and of what a wrong mount, clock or scale could do
 * (geometry/turn.h). Where the two contradict each other, as while a picture stands or where the
 * mount is wrong, the frame's own counts alone. A gyro whose scale is off by more than 1 % bends
 * the map; its calibration belongs into the rig.
 *
 * Keyframes are held likewise by the window (map/window.h), which gets the turns between them here.
 * What the frame alone showed stays known, so that clocks and mount can still be judged by it.
 *
 * State holds no addresses. Without a gyro nothing of this happens. Real-time safe: some 500
 * multiplications a frame. */
#ifndef FOVEA_ODOMETRY_TURN_H
#define FOVEA_ODOMETRY_TURN_H

#include <stdbool.h>
#include <stdint.h>

#include "geometry/pose.h"
#include "geometry/se3.h"

#ifdef __cplusplus
extern "C" {
#endif

struct fv_turn_state {
    double variance; /* of the last frame's turn, of an axis, rad^2; 0: not known */
    double rate[3];  /* at the last frame, */
    uint64_t rated;  /* which is known */
    double held[3];  /* by which small turn its pose was moved, R_cam_world <- exp(held) R */
    double position_fraction; /* of the sigma of its position by its pixels alone, what is left */
};

struct fv_odometry;

/* The frame's pose by its matches, `T`, and by the gyro together. `last`: of the frame before.
 * `trusted`: the frame's pose is what its picture shows (usable.h). */
void fv_odometry_hold_turn(struct fv_odometry *odometry, const struct fv_se3 *last,
                           const struct fv_pose_fit *fit, bool trusted, struct fv_se3 *T);
/* A pose that is held errs by less of its own (covariance.h, own_position). */
void fv_odometry_reduce_own(struct fv_odometry *odometry);
/* After each frame: the turn that leads there, for the window. */
void fv_odometry_follow_turn(struct fv_odometry *odometry);

#ifdef __cplusplus
}
#endif
#endif

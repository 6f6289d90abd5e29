/* Motion model: the camera goes on as it moved between the last two posed frames, at constant speed
 * by their time stamps, so a dropped frame or an uneven rate changes the step and not the speed.
 *
 * The way is taken as a turn and a straight line, each by the same fraction; for the small turns
 * between frames that is the screw motion to first order. T_cam_world throughout, in the map's
 * unit. Stamps are in nanoseconds on the source's clock. Plain data; real-time safe. */
#ifndef FOVEA_ODOMETRY_MOTION_H
#define FOVEA_ODOMETRY_MOTION_H

#include <stdbool.h>
#include <stdint.h>

#include "geometry/se3.h"
#include "map/turns.h"

#ifdef __cplusplus
extern "C" {
#endif

struct fv_motion {
    struct fv_se3 T_now_before; /* between the last two posed frames */
    int64_t interval_ns;        /* between these; positive where `known` */
    int64_t stamp_ns;           /* of the last posed frame */
    bool known;                 /* T_now_before and interval_ns hold */
};

/* What an inertial sensor says of the motion since the last posed frame. */
struct fv_motion_hint {
    bool turn;  /* T_now_last.R is known, */
    bool whole; /* and its translation, in the map's unit */
    /* Whatever `whole` is: the translation is known well enough for poses to go on in the same
     * world where another map begins. With the variance of the turn about an axis, rad^2. */
    bool continues;
    double turn_variance;
    struct fv_se3 T_now_last; /* the camera */
    /* The turn is a measurement (turn.h), not a guess for searching alone; with the rate at this
     * frame, rad/s in the camera's axes. */
    bool measured;
    struct fv_turn turned;
    double rate[3];
    struct fv_gyro_known gyro;
};

/* The last two posed frames, not farther apart than they should be. `before` is not known after a
 * loss. */
void fv_motion_note(struct fv_motion *motion, const struct fv_se3 *T_before,
                    int64_t stamp_before_ns, const struct fv_se3 *T_now, int64_t stamp_ns);
void fv_motion_forget(struct fv_motion *motion);

/* Pose at `stamp_ns`, from that of the last posed frame; the same pose while the motion is not
 * known. At most 40 intervals ahead are followed. */
void fv_motion_predict(const struct fv_motion *motion, const struct fv_se3 *T_last,
                       int64_t stamp_ns, struct fv_se3 *T);

/* The same from the pose of any frame, taken at `from_ns`. */
void fv_motion_predict_from(const struct fv_motion *motion, const struct fv_se3 *T_from,
                            int64_t from_ns, int64_t stamp_ns, struct fv_se3 *T);

/* The same with a hint; where it holds no translation, the camera goes on in a straight line. */
void fv_motion_predict_by(const struct fv_motion *motion, const struct fv_motion_hint *hint,
                          const struct fv_se3 *T_last, int64_t stamp_ns, struct fv_se3 *T);

#ifdef __cplusplus
}
#endif
#endif

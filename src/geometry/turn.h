/* How a gyro says that a camera turned between two instants, as one measurement.
 *
 * The gyro's part of preintegration (C. Forster, L. Carlone, F. Dellaert, D. Scaramuzza,
 * "On-manifold preintegration for real-time visual-inertial odometry", T-RO 2017), in the camera's
 * axes: with R_world_cam at the two instants, R_world_end = R_world_begin R exp(error).
 * Measurements that follow each other are joined, a bias that is estimated anew corrects one to
 * first order.
 *
 * Noise of the samples is in `variance`. What is wrong with all samples alike is not, and how much
 * of it is possible is the caller's to say (struct fv_turn_doubt): a mount that is off by a small
 * rotation d turns the axis of the turn by it, so that the turn w errs by w x d; a clock that is
 * off by dt takes the turn of other instants, so that it errs by the change of the rate times dt;
 * and a gyro whose scale is off errs by that fraction of the turn.
 *
 * rad, rad/s, seconds. Plain data, no addresses. Real-time safe, any thread. */
#ifndef FOVEA_GEOMETRY_TURN_H
#define FOVEA_GEOMETRY_TURN_H

#include <stdbool.h>

#ifdef __cplusplus
extern "C" {
#endif

struct fv_turn {
    double time_s;
    double R[9];           /* axes of the end in those of the beginning */
    double by_bias[9];     /* derivative of its error by `bias`, row-major */
    double bias[3];        /* that the samples were rid of */
    double rate_change[3]; /* rate at the end less that at the beginning, in the axes of the end */
    double variance;       /* of an axis, rad^2 */
};

/* What may be wrong with all samples alike: the mean square of the mount's error, camera's axes,
 * row-major, rad^2, and the standard deviations of the clocks' offset and of the gyro's scale. */
struct fv_turn_doubt {
    double mount[9];
    double clock_s;
    double scale; /* 1 is the whole */
};

/* No turn yet, by samples that will be rid of this bias. */
void fv_turn_begin(struct fv_turn *turn, const double bias[3]);
/* `next` follows `turn`: both together, by the bias of `turn`. */
void fv_turn_join(struct fv_turn *turn, const struct fv_turn *next);
/* R by another bias. */
void fv_turn_correct(const struct fv_turn *turn, const double bias[3], double R[9]);
/* By which small turn, in the axes of the end, the camera turned farther than measured.
 * `between`: R_begin_end as poses have it. */
void fv_turn_error(const struct fv_turn *turn, const double bias[3], const double between[9],
                   double error[3]);
/* What the mount adds, rad^2 of an axis, over the square of the turn; 0 without a turn. An error of
 * the mount about the axis that the camera turns about adds nothing. */
double fv_turn_mount_fraction(const struct fv_turn *turn, const struct fv_turn_doubt *doubt);
/* Of an axis, noise and doubt, rad^2. */
double fv_turn_variance(const struct fv_turn *turn, const struct fv_turn_doubt *doubt);
/* What a bias that is known to `sigma`, rad/s, adds to that. */
double fv_turn_bias_variance(const struct fv_turn *turn, double sigma);
/* True: the error exceeds 4 sigmas of this variance (an axis, rad^2) and of 2 mrad that attitudes
 * by pictures may err by. Then the picture, the mount or a sample is wrong. */
bool fv_turn_contradicts(const double error[3], double variance);

#ifdef __cplusplus
}
#endif
#endif

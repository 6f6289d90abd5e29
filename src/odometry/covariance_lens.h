/* What another focal length adds to the covariance of a pose, and whether the pose is to be relied
 * on with it.
 *
 * A lens that zooms, or that its focus changes, shows the map as by another focal length. With
 * depth in view that is not the same as a step ahead: the measure of the calibration's watch says
 * by how much (fv_lens_frame_current). On good runs such changes vary by twice what independent
 * errors make of them, since landmarks share the errors of their keyframes, and by .1 % that frames
 * of a map have in common. A young map is bent, and shows that as another lens: 2 % of its bend
 * (covariance.h) more. A change of twice the spread of these together is counted as what the pose
 * would move by with it, and one of three times as four times that, since the inliers of a fit
 * without it show a part of it alone. A small change is seen in the mean of several frames, which
 * counts likewise from twice its own spread on. A lens that has clearly changed by .4 % may change
 * again, and by less: for 300 frames two fifths of twice the spread are enough.
 *
 * What was added of the reference keyframe, when it was the current frame, is added of all frames
 * that refer to it; and since turns are measured by the focal length, that change times the turn
 * since. A map that is made anew by the other lens no longer shows it and takes turns by it: what
 * was clear is held for them, and halves in 70 frames. On good runs the focal length is another by
 * .05 to .2 %, in the handheld recording, whose calibration is a guess, by .4 %. (The watch asks
 * over many frames, to find a calibration that is wrong for good.) */
#ifndef FOVEA_ODOMETRY_COVARIANCE_LENS_H
#define FOVEA_ODOMETRY_COVARIANCE_LENS_H

#include <stdbool.h>

#include "geometry/pose.h"

struct fv_odometry;

/* Adds to the covariance what the pose of the current frame would move by with another focal
 * length, where its picture or those before show the map as by one, and notes it in
 * state->covariance. `variance`: of the frame's errors, px^2 of level 0; `bend`: of a young map,
 * else 0. True: the picture has another by more than a good pose has. Real-time safe. */
bool fv_covariance_add_lens(struct fv_odometry *odometry, double variance, double bend,
                            double covariance[21]);

/* Adds what another focal length moved the reference keyframe by, and what it makes of the turn
 * since. `T_frame_ref`: the reference seen from the frame. Real-time safe. */
void fv_covariance_add_reference_lens(const struct fv_odometry *odometry,
                                      const struct fv_se3 *T_frame_ref, double covariance[21]);

#endif

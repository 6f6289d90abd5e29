/* Covariance of a frame's pose relative to its reference keyframe (the newest), and whether it is
 * to be relied on.
 *
 * The joint problem of the frame, its landmarks and the keyframes that see them is linearised where
 * it stands: the reference is held, landmarks are eliminated by the Schur complement, and the
 * frame's block of the inverse is what is left (B. Triggs et al., "Bundle adjustment: a modern
 * synthesis", 2000, 9). So the errors that landmarks have in common, because keyframes that they
 * were seen from are off, count as what they are. A sample of 48 landmarks stands for all, and the
 * 7 keyframes that see most of them for the rest. The unit of length, which is free, is held by the
 * path of these poses to 1 %.
 *
 * Errors are taken to have the variance that the frame's inliers show a posteriori, and where their
 * errors hang together, more: each part of the image (6 x 4) pulls at the pose, and at the minimum
 * all of that adds up to nothing. Of independent errors, the mean square of the pulls, in sigmas of
 * the pose, is the variance. It is larger where a part of the map is off or moves, and pulls
 * against all the rest (the sandwich estimate over clusters: K.-Y. Liang and S. Zeger,
 * "Longitudinal data analysis using generalized linear models", 1986). The larger of both variances
 * counts.
 *
 * What the frame leaves open is long in few directions, as where a turn looks like a step aside,
 * and a linearised problem with a sample of the landmarks knows these to some degrees only. So a
 * fifth of each variance counts as uncorrelated with the others: without, 3.8 % of the poses of
 * euroc_mh05_a were outside their 99.9 % bound, translation and rotation each being as stated.
 *
 * Noise over the mean parallax of the visible landmarks tells how far the map may be bent, and with
 * it the unit of length from place to place; a fraction of that, over the way from the reference,
 * is added. It fades as parallax grows. In a metric map nothing is: measured distances are errors
 * of the joint problem, and hold each landmark from its first keyframe on.
 *
 * So is a twentieth of the way where the pictures leave the map in doubt (agreement.h).
 *
 * Not to be relied on, whatever its size: while the map is young (fewer than ten keyframes) and
 * that bend is 10 % or more; and where the parts' variance is three times that of the errors or
 * more, unless five keyframes or more agree with the map (agreement.h): then what pulls is a thing
 * that moves or a lens, and is counted above. */
#ifndef FOVEA_ODOMETRY_COVARIANCE_H
#define FOVEA_ODOMETRY_COVARIANCE_H

#include "base/arena.h"
#include "geometry/pose.h"
#include "map/map.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { FV_COVARIANCE_POSES_MAX = 8 };

struct fv_covariance {
    double *joint; /* frame part: normal equations of at most FV_COVARIANCE_POSES_MAX poses */
};

struct fv_odometry;

void fv_covariance_carve(struct fv_covariance *covariance, struct fv_arena *frame);

/* Write the covariance to state->pose, lengths in the map's unit. False: it is not to be relied on.
 * Real-time safe. */
bool fv_covariance_write(struct fv_odometry *odometry, const struct fv_map_frame *frame,
                         const struct fv_pose_fit *fit);

#ifdef __cplusplus
}
#endif
#endif

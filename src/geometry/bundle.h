/* Bundle adjustment of a window: camera poses and landmarks that together explain where the landmarks were
 * seen.
 *
 * Levenberg-Marquardt (Marquardt's diagonal scaling, Nielsen's damping update: Madsen, Nielsen, Tingleff,
 * "Methods for non-linear least squares problems", 2004) on the Schur complement of the landmarks (Triggs et
 * al., "Bundle adjustment: a modern synthesis", 2000), with Huber's robust weights. Everything is doubles,
 * scalar, in a fixed order.
 *
 * An observation is a unit bearing b with the 2x3 derivative A = d(pixel)/d(point) of the camera model at b,
 * divided by the feature's standard deviation in pixels. The residual of a point p in the camera frame is r =
 * A p / (b . p): zero on the bearing, since A b = 0, and equal to the pixel error to first order for every
 * lens. Its derivative is dr/dp = (A - r b^T) / (b . p).
 *
 * Poses are T_cam_world = [R | t]; a step (w, v) takes p to p + w x p + v. Gauge: at least one pose must be
 * fixed; with one, scale is held by the damping alone.
 *
 * Resumable: fv_bundle_unit does a bounded piece (FV_BUNDLE_UNIT_PAIRS block products, or one reduced
 * solution) and can be called again whenever there is time. No addresses but those that carving sets.
 * Real-time safe but for carving. */
#ifndef FOVEA_GEOMETRY_BUNDLE_H
#define FOVEA_GEOMETRY_BUNDLE_H

#include <stdbool.h>
#include <stdint.h>

#include "base/arena.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    FV_BUNDLE_FREE_POSES_MAX = 16, /* cost of the reduced system grows with the cube */
    FV_BUNDLE_SEEN_MAX = 32, /* observations of one landmark that count; more are passed over */
    FV_BUNDLE_UNIT_PAIRS = 800
};

struct fv_bundle_pose {
    double R[9], t[3]; /* T_cam_world, R row-major */
    int32_t free;      /* index among the free poses, or -1: fixed */
    int32_t reserved;
};

struct fv_bundle_observation {
    double bearing[3]; /* unit, camera frame */
    double A[6];       /* row-major 2x3, standard deviations per unit of the point at distance 1 */
    uint32_t pose;     /* index of the pose that saw it */
    float chi2;        /* out: squared residual after the last accepted step; infinite behind the camera */
};

struct fv_bundle_landmark {
    double X[3];           /* world */
    uint32_t first, count; /* its observations */
};

enum fv_bundle_phase {
    FV_BUNDLE_IDLE = 0,
    FV_BUNDLE_LINEARISE,
    FV_BUNDLE_SOLVE,
    FV_BUNDLE_TRY,
    FV_BUNDLE_DONE
};

struct fv_bundle {
    /* The problem, filled by the caller before fv_bundle_start and read back when done. */
    uint32_t pose_count, landmark_count, observation_count;
    struct fv_bundle_pose *poses;
    struct fv_bundle_landmark *landmarks;
    struct fv_bundle_observation *observations; /* grouped by landmark */

    /* What the arrays hold at most. */
    uint32_t poses_max, landmarks_max, observations_max;

    /* Progress. */
    enum fv_bundle_phase phase;
    uint32_t free_poses, next_landmark;
    uint32_t iterations, iterations_max, rejected;
    double lambda, nu;       /* damping and its growth */
    double cost, cost_tried; /* half the sum of robust squared residuals */
    double gain_predicted;

    double *S, *g, *step;         /* reduced system: (6 n)^2 lower triangle, 6 n, 6 n */
    double *diagonal;             /* of the undamped pose blocks, 6 n */
    struct fv_bundle_pose *tried; /* poses after the step under trial */
    double *tried_X;              /* landmarks likewise, 3 each */
    float *tried_chi2;
};

/* Take memory for a window of at most so many poses (all, fixed ones included), landmarks and observations.
 */
void fv_bundle_carve(struct fv_bundle *bundle, uint32_t poses_max, uint32_t landmarks_max,
                     uint32_t observations_max, struct fv_arena *job);

/* Begin on the problem that the caller has filled in: at least one fixed pose, at most
 * FV_BUNDLE_FREE_POSES_MAX free ones, numbered from 0 in `free`. Does at most `iterations` accepted or
 * rejected steps. */
void fv_bundle_start(struct fv_bundle *bundle, uint32_t iterations);

/* Do one unit. Returns true when finished: iterations used up, converged, or no step lowers the cost. The
 * poses and landmarks then hold the best found, observations their chi2. */
bool fv_bundle_unit(struct fv_bundle *bundle);

/* Residual of an observation for a point in the camera frame, and its derivative J (2x3) where that is not
 * NULL. False: the point is behind the camera or too close to it, outputs untouched. For pose refinement and
 * tests too. */
bool fv_bundle_residual(const struct fv_bundle_observation *observation, const double p[3], double r[2],
                        double J[6]);

#ifdef __cplusplus
}
#endif
#endif

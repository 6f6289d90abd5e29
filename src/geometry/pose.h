/* Pose of a calibrated camera from points and their bearings: minimal solver, sampling, and
 * refinement.
 *
 * T_cam_world takes points of the world to the camera. Minimal solver: M. Persson and K. Nordberg,
 * "Lambda twist: an accurate fast robust perspective three point (P3P) solver" (ECCV 2018); the
 * pencil is split as by Y. Ding et al., "Revisiting the P3P problem" (CVPR 2023). Sampling: MSAC
 * with local optimisation. Refinement minimises pixel errors, on bearings with the lens's Jacobian.
 * Real-time safe, any thread; no heap. */
#ifndef FOVEA_GEOMETRY_POSE_H
#define FOVEA_GEOMETRY_POSE_H

#include <stdbool.h>
#include <stdint.h>

#include "base/elementary.h"
#include "geometry/essential.h"
#include "geometry/inverse_distance.h"
#include "geometry/se3.h"
#include "geometry/vec.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { FV_P3P_SOLUTIONS_MAX = 4 };

/* A point of the world, where it was seen, and how sure that is. Pixel errors need no projection
 * through the lens: near the bearing b, a point q of the camera frame lies e = A q / (b q) pixels
 * from the key point, A = d(pixel)/d(point) at b, A b = 0. That is exact to first order, and
 * outliers need no more. */
struct fv_observation {
    double point[3];   /* world */
    double bearing[3]; /* unit, camera */
    double A[6];       /* 2x3 row-major, px */
    double weight;     /* 1 / sigma_px^2 of the key point */
    bool inlier; /* in: use it (refinement starts from all that are set); out: fits the pose */
};

/* Pixel error of a point q of the camera frame, and, when `J` is not NULL, its 2x3 derivative by q.
 * False: behind. Inlined: it is the innermost of every refinement. */
static inline bool fv_observation_error(const double bearing[3], const double A[6],
                                        const double q[3], double error[2], double J[6])
{
    const double along = fv_dot3(bearing, q);
    if (!(along > 1e-9)) return false;
    const double inverse = 1 / along;
    error[0] = fv_dot3(A, q) * inverse;
    error[1] = fv_dot3(A + 3, q) * inverse;
    if (J)
        for (int i = 0; i < 3; i++) {
            J[i] = (A[i] - error[0] * bearing[i]) * inverse;
            J[3 + i] = (A[3 + i] - error[1] * bearing[i]) * inverse;
        }
    return true;
}

/* Poses from three observations (bearings only); returns their number, at most 4. */
int fv_p3p(const double bearings[3][3], const double points[3][3],
           struct fv_se3 T_cam_world[FV_P3P_SOLUTIONS_MAX]);

/* Robust pose by P3P samples on bearings. Residual: angle between bearing and point. Sets `inlier`
 * of every observation and `T_cam_world` on success; returns the number of inliers, 0 (all
 * untouched) when none was found.
 */
uint32_t fv_pose_sample(struct fv_observation *observations, uint32_t count,
                        const struct fv_sampling *sampling, struct fv_random *random,
                        struct fv_se3 *T_cam_world);

struct fv_pose_fit {
    uint32_t inliers; /* observations with weighted squared error below the chi-square bound (95 %,
                         2 dof) */
    double cost;      /* sum of their weighted squared errors, px^2 */
    /* of the inliers, row-major, order as in fv_se3_move (camera side, translation
     * first) */
    double information[36];
};

/* Refine T_cam_world over all observations by Gauss-Newton with Huber weights, in `rounds` of
 * `steps`; after each round observations are sorted anew into inliers and outliers, so that none is
 * lost for good. Observations behind the camera or past the field are outliers. `distances`, unless
 * NULL, are measured inverse distances of the observations: third errors of those that are inliers,
 * in the information but not in the cost. False when the system is singular (pose untouched). */
bool fv_pose_refine(struct fv_observation *observations,
                    const struct fv_inverse_distance *distances, uint32_t count, int rounds,
                    int steps, struct fv_se3 *T_cam_world, struct fv_pose_fit *fit);

/* Variance of an observation's error by what a fit leaves (a posteriori), weighted px^2; 1 where
 * nothing is left to tell. */
double fv_pose_variance(const struct fv_pose_fit *fit);

/* What some of a fit's errors say of the pose; begins as zeros. */
struct fv_pose_part {
    double pull[6], information[36]; /* lower triangle, order as in fv_pose_fit */
};

/* An error of a part and its derivative by the pose. */
void fv_pose_part_add(struct fv_pose_part *part, double weight, double error, const double row[6]);

/* What the parts of a fit show of its errors, which need not be independent within one. */
struct fv_pose_shown {
    double covariance[21]; /* of the pose: upper triangle by rows */
    /* the mean square of that in sigmas of an error of variance 1: the variance of the errors,
     * where these are independent */
    double variance;
    double counted; /* parts that it comes from, as many as if all that count counted alike */
};

/* The sum of the squares of what the pose would move by, were each part left out (R. Bell and D.
 * McCaffrey, "Bias reduction in standard errors for linear regression with multi-stage samples",
 * Survey Methodology 28, 2002). `counted` is (sum of shares)^2 / sum of (shares^2), of each part's
 * share in the variance. False: without one of the parts the pose would not be determined. */
bool fv_pose_jackknife(const struct fv_pose_fit *fit, const struct fv_pose_part *parts,
                       uint32_t count, struct fv_pose_shown *shown);
/* Add what few parts leave open. What they show beyond errors of `variance` they show in the
 * directions that they happen to pull in; it is spread over all six as if that many more parts had
 * shown it evenly, in the metric of the fit: the prior of a covariance that is estimated from few
 * samples (O. Ledoit and M. Wolf, "A well-conditioned estimator for large-dimensional covariance
 * matrices", 2004). Nothing is taken from the directions that they pull in. */
void fv_pose_spread(const struct fv_pose_fit *fit, double variance, struct fv_pose_shown *shown);
/* Add to a covariance (upper triangle by rows) that of the fit alone, by errors of `variance`.
 * False, and nothing is added: the pose is not determined. */
bool fv_pose_add_alone(const struct fv_pose_fit *fit, double variance, double covariance[21]);

/* Go on from fv_pose_refine's pose and fit, with the limit that the noise found allows: 9.21
 * (chi-square, 99 %, 2 dof) times its variance, and never more than before. Where matches are good
 * to a third of a pixel, what is a pixel off is a thing that moves. Two steps. False when the
 * system is singular (pose untouched). */
bool fv_pose_refine_to_noise(struct fv_observation *observations,
                             const struct fv_inverse_distance *distances, uint32_t count,
                             struct fv_se3 *T_cam_world, struct fv_pose_fit *fit);

#ifdef __cplusplus
}
#endif
#endif

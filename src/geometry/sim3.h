/* Similarity: rigid motion with a scale. `struct fv_sim3` named S_a_b takes points of frame b to
 * frame a: p_a = s R p_b + t.
 *
 * Small similarities are 7-vectors: translation, rotation (axis times angle, rad), logarithm of the
 * scale. Exponential and logarithm follow H. Strasdat, J. Montiel, A. Davison, "Scale drift-aware
 * large scale monocular SLAM" (RSS 2010). Alignment of points: B. Horn, "Closed-form solution of
 * absolute orientation using unit quaternions" (JOSA A 1987), with the scale of S. Umeyama (PAMI
 * 1991). Real-time safe, any thread; no heap. */
#ifndef FOVEA_GEOMETRY_SIM3_H
#define FOVEA_GEOMETRY_SIM3_H

#include <stdbool.h>
#include <stdint.h>

#include "base/elementary.h"
#include "geometry/essential.h"
#include "geometry/se3.h"

#ifdef __cplusplus
extern "C" {
#endif

struct fv_sim3 {
    double R[9]; /* row-major */
    double t[3];
    double s;
};

void fv_sim3_identity(struct fv_sim3 *S);
void fv_sim3_from_se3(const struct fv_se3 *T, double s, struct fv_sim3 *S);
/* out = A B. `out` may be either input. */
void fv_sim3_compose(const struct fv_sim3 *A, const struct fv_sim3 *B, struct fv_sim3 *out);
void fv_sim3_invert(const struct fv_sim3 *S, struct fv_sim3 *out);
/* `out` may be the point. */
void fv_sim3_apply(const struct fv_sim3 *S, const double point[3], double out[3]);

/* Exponential of (translation part, rotation, log scale), and its inverse with angles in [0, pi].
 */
void fv_sim3_exp(const double x[7], struct fv_sim3 *S);
void fv_sim3_log(const struct fv_sim3 *S, double x[7]);
/* A pose T_cam_old whose world was taken to another by S_new_old; lengths in the camera frame grow
 * by S's scale. */
void fv_sim3_move_pose(const struct fv_sim3 *S_new_old, struct fv_se3 *T_cam);

/* ---- alignment ------------------------------------------------------------------------------- */

/* Best S_a_b for pairs of points, in the sense of least squares on a. At least 3; false when they
 * lie on a line. */
bool fv_sim3_align(const double (*a)[3], const double (*b)[3], uint32_t count,
                   struct fv_sim3 *S_a_b);

/* A landmark as two cameras know it: its point in the frame of each camera (in the unit of its
 * map), and where each saw it (bearing and d(pixel)/d(point), weight 1 / sigma_px^2; 0: that camera
 * did not see it). How far off a point is, is less certain than where it was seen: its error along
 * its ray shows as pixels from elsewhere. */
struct fv_correspondence {
    double point_a[3], point_b[3];
    double sigma_a, sigma_b; /* of their distances, relative, above 0 */
    double bearing_a[3], bearing_b[3];
    double A_a[6], A_b[6];
    double weight_a, weight_b;
    bool inlier;
};

/* Squared pixel errors of a correspondence in camera a and in camera b, over their variances
 * (observations and distances); false when a point lies behind. */
bool fv_sim3_errors(const struct fv_correspondence *m, const struct fv_sim3 *S_a_b,
                    const struct fv_sim3 *S_b_a, double square[2]);

/* Robust sampling, resumable: call with `samples` more until *done reaches the bound; keeps the
 * best in `best`. Marks nothing. A correspondence agrees when both errors are below `limit`
 * (chi-square).
 */
struct fv_sim3_search {
    struct fv_sim3 best; /* S_a_b */
    uint32_t best_inliers, done, bound;
};
void fv_sim3_search_begin(struct fv_sim3_search *search, uint32_t samples_max);
/* True when more samples are needed. */
bool fv_sim3_search_more(struct fv_sim3_search *search,
                         const struct fv_correspondence *correspondences, uint32_t count,
                         uint32_t samples, double limit, struct fv_random *random);

/* Refine S_a_b on the errors of both cameras, pixels and (they alone give the scale, where both
 * stand at one position) distances, by Gauss-Newton with Huber weights, `steps` times, over those
 * marked as inliers; afterwards all are sorted anew with `limit`. `rigid`: both maps have one unit,
 * so the scale is 1. Returns the number of inliers, 0 when the system is singular.
 */
uint32_t fv_sim3_refine(struct fv_correspondence *correspondences, uint32_t count, double limit,
                        int steps, bool rigid, struct fv_sim3 *S_a_b);

/* Where gravity is known: turn S_a_b, as little as may be, so that it takes the unit vector down_b
 * to down_a, then refine what that leaves open, a turn about down_a, the translation and unless
 * `rigid` the scale, on those marked as inliers, which stay marked. False: the system is singular.
 */
bool fv_sim3_level(const struct fv_correspondence *correspondences, uint32_t count, int steps,
                   bool rigid, const double down_a[3], const double down_b[3],
                   struct fv_sim3 *S_a_b);

/* How sure S_a_b is, by the weights of the inliers' pixels and distances. */
struct fv_sim3_certainty {
    double turn_sigma; /* rad, all axes together: large where all that meets lies far off in one
                          direction; pi when nothing fixes it */
    /* Natural logarithm of the factor by which the scale would fit better were it left open, to
     * first order, and its standard deviation; 0 and infinite when nothing fixes it. */
    double log_scale, scale_sigma;
};
void fv_sim3_judge(const struct fv_correspondence *correspondences, uint32_t count,
                   const struct fv_sim3 *S_a_b, struct fv_sim3_certainty *certainty);

#ifdef __cplusplus
}
#endif
#endif

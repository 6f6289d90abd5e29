#include "geometry/two_views.h"

#include <string.h>

#include "geometry/fundamental.h"
#include "geometry/homography.h"
#include "geometry/linear.h"
#include "geometry/vec.h"

enum { TURN_ROUNDS = 8, INLIERS_MIN = 5, ONLY_MIN = 8 };

/* Of a squared threshold: what a squared distance between bearings may be. The threshold is of one
 * coordinate, Sampson's distance from a line; a distance has two, of which each holds the noise of
 * both images (a factor of 2), and 95 % of its squares are below 5.99 variances instead of 3.84. */
#define POINT_LIMIT (2 * 5.99 / 3.84)

/* Square of the angle between two bearings that are near each other; large where they are not. */
static double apart2(const double a[3], const double b[3])
{
    double square = 0;
    for (int i = 0; i < 3; i++)
        square += (a[i] - b[i]) * (a[i] - b[i]);
    return square;
}

/* Whether the second bearing is on the side of R x1 on which the point would be seen at a positive
 * distance from both cameras. */
static bool in_front(const struct fv_se3 *T, const double q[3], const double x2[3])
{
    const double c = fv_dot3(q, x2), a = fv_dot3(q, T->t), b = fv_dot3(x2, T->t);
    return c * b - a > 0 && b - c * a > 0;
}

uint32_t fv_two_views_mark(const struct fv_pair *pairs, uint32_t count, double threshold_rad,
                           const struct fv_se3 *T, uint8_t *inlier)
{
    const double limit2 = threshold_rad * threshold_rad;
    uint32_t inliers = 0;
    double E[9], q[3];
    fv_essential_from_motion(T, E);
    for (uint32_t i = 0; i < count; i++) {
        fv_rotate3(T->R, pairs[i].x1, q);
        inlier[i] = apart2(q, pairs[i].x2) < POINT_LIMIT * limit2 ||
                    (fv_essential_residual2(E, &pairs[i]) < limit2 && in_front(T, q, pairs[i].x2));
        inliers += inlier[i];
    }
    return inliers;
}

/* ---- the simple models ----------------------------------------------------------------------- */

/* Pairs that agree with x2 ~ H x1, to `limit2`; returns their number. */
static uint32_t mark_simple(const struct fv_pair *pairs, uint32_t count, double limit2,
                            const double H[9], uint8_t *inlier)
{
    uint32_t inliers = 0;
    double q[3];
    for (uint32_t i = 0; i < count; i++) {
        fv_rotate3(H, pairs[i].x1, q);
        inlier[i] = fv_normalise3(q) && apart2(q, pairs[i].x2) < limit2;
        inliers += inlier[i];
    }
    return inliers;
}

/* A Gauss-Newton step over the marked pairs: sum of q x x2 = sum of (I - q q^T) turn. */
static bool turn_once(const struct fv_pair *pairs, uint32_t count, const uint8_t *inlier,
                      double R[9])
{
    double A[9] = {0}, turn[3] = {0}, q[3], off[3], step[9], turned[9];
    for (uint32_t i = 0; i < count; i++) {
        if (!inlier[i]) continue;
        fv_rotate3(R, pairs[i].x1, q);
        fv_cross3(q, pairs[i].x2, off);
        for (int r = 0; r < 3; r++) {
            turn[r] += off[r];
            for (int c = 0; c < 3; c++)
                A[3 * r + c] += (r == c) - q[r] * q[c];
        }
    }
    if (!fv_ldlt_solve(A, 3, turn)) return false;
    fv_so3_exp(turn, step);
    fv_multiply33(step, R, turned);
    memcpy(R, turned, sizeof turned);
    fv_so3_orthonormalise(R);
    return true;
}

/* The rotation near R that pairs agree with; returns their number. */
static uint32_t fit_turn(const struct fv_pair *pairs, uint32_t count, double threshold_rad,
                         double R[9], uint8_t *inlier)
{
    const double limit2 = POINT_LIMIT * threshold_rad * threshold_rad;
    for (int round = 0; round < TURN_ROUNDS; round++) {
        const double width = round < TURN_ROUNDS / 2 ? 9 : 1; /* wide first */
        if (mark_simple(pairs, count, width * limit2, R, inlier) < INLIERS_MIN ||
            !turn_once(pairs, count, inlier, R))
            return 0;
    }
    return mark_simple(pairs, count, limit2, R, inlier);
}

/* The rotation nearest to a homography, where it is near one. */
static bool turn_of(const double H[9], double R[9])
{
    double square = 0;
    for (int i = 0; i < 9; i++)
        square += H[i] * H[i];
    const double length = __builtin_sqrt(square / 3);
    if (!(length > 1e-9)) return false;
    const double scale = (fv_determinant33(H) < 0 ? -1 : 1) / length;
    for (int i = 0; i < 9; i++)
        R[i] = scale * H[i];
    for (int i = 0; i < 3; i++)
        fv_so3_orthonormalise(R);
    return fv_determinant33(R) > .99;
}

/* ---- which model ----------------------------------------------------------------------------- */

static void take_simple(uint32_t count, uint8_t *inlier, const uint8_t *simple,
                        const double model[9], uint32_t inliers, struct fv_two_views *found)
{
    memcpy(inlier, simple, count);
    memcpy(found->model, model, sizeof found->model);
    found->simple = true;
    found->inliers = inliers;
}

/* Share of wrong pairs that agree with some epipolar geometry of a family [e]x H by chance. Its two
 * degrees of freedom are fitted to them: a band of twice the threshold holds 2 thresholds over the
 * extent of the image of them, the best of 300 sets of synthetic pairs up to four times that. */
static double chance(const struct fv_pair *pairs, uint32_t count, double threshold_rad)
{
    double sum[2] = {0, 0}, squares[2] = {0, 0}, least = 1e9;
    for (uint32_t i = 0; i < count; i++)
        for (int k = 0; k < 2; k++) {
            sum[k] += pairs[i].x2[k];
            squares[k] += pairs[i].x2[k] * pairs[i].x2[k];
        }
    for (int k = 0; k < 2; k++) {
        const double mean = sum[k] / count, variance = squares[k] / count - mean * mean;
        if (variance < least) least = variance;
    }
    if (!(least > 1e-12)) return .5;
    const double extent = __builtin_sqrt(12 * least); /* of even places */
    const double share = 8 * threshold_rad / extent;
    return share < .5 ? share : .5;
}

/* Whether more pairs agree with what was asked for alone than by chance. */
static bool is_determined(const struct fv_pair *pairs, uint32_t count, double threshold_rad,
                          const uint8_t *asked, const uint8_t *simple)
{
    uint32_t only = 0, others = 0;
    for (uint32_t i = 0; i < count; i++) {
        only += asked[i] && !simple[i];
        others += !simple[i];
    }
    return only >= ONLY_MIN + chance(pairs, count, threshold_rad) * others;
}

void fv_two_views_essential(const struct fv_pair *pairs, uint32_t count,
                            const struct fv_sampling *sampling, struct fv_random *random,
                            uint8_t *inlier, uint8_t *work, struct fv_two_views *found)
{
    struct fv_se3 T;
    double H[9], turn[2][9];
    const double threshold_rad = sampling->threshold_rad;
    uint32_t turned[2] = {0, 0};
    *found = (struct fv_two_views){.model = {0}};
    found->inliers = fv_essential_estimate(pairs, count, sampling, random, &T, inlier);
    if (found->inliers > 0) {
        fv_essential_from_motion(&T, found->model);
        memcpy(turn[0], T.R, sizeof turn[0]);
        turned[0] = fit_turn(pairs, count, threshold_rad, turn[0], work);
        found->inliers = fv_two_views_mark(pairs, count, threshold_rad, &T, inlier);
    }
    if (fv_homography_estimate(pairs, count, sampling, random, H, work) > 0 && turn_of(H, turn[1]))
        turned[1] = fit_turn(pairs, count, threshold_rad, turn[1], work);
    const int better = turned[1] > turned[0];
    if (turned[better] < INLIERS_MIN) return;
    (void)mark_simple(pairs, count, POINT_LIMIT * threshold_rad * threshold_rad, turn[better],
                      work);
    if (found->inliers == 0 || !is_determined(pairs, count, threshold_rad, inlier, work))
        take_simple(count, inlier, work, turn[better], turned[better], found);
}

void fv_two_views_fundamental(const struct fv_pair *pairs, uint32_t count,
                              const struct fv_sampling *sampling, struct fv_random *random,
                              uint8_t *inlier, uint8_t *work, struct fv_two_views *found)
{
    double H[9];
    *found = (struct fv_two_views){.model = {0}};
    found->inliers = fv_fundamental_estimate(pairs, count, sampling, random, found->model, inlier);
    if (fv_homography_estimate(pairs, count, sampling, random, H, work) == 0) return;
    const double limit2 = POINT_LIMIT * sampling->threshold_rad * sampling->threshold_rad;
    if (fv_determinant33(H) < 0) /* of either sign; bearings have one */
        for (int i = 0; i < 9; i++)
            H[i] = -H[i];
    const uint32_t flat = mark_simple(pairs, count, limit2, H, work);
    if (found->inliers == 0 || !is_determined(pairs, count, sampling->threshold_rad, inlier, work))
        take_simple(count, inlier, work, H, flat, found);
}

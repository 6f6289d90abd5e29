/* Motions that may explain the matches of two views. Sampling finds the essential matrix that most
 * of them fit; a plane or a shallow scene leaves others that fit about as well, so the motions of
 * the homography are followed to their own minimum, too. */
#include "geometry/essential.h"
#include "geometry/sample.h"
#include "geometry/homography.h"
#include "geometry/vec.h"
#include "odometry/initialise.h"

enum { FIT_MIN = 40, REFINE_STEPS = 6, PAIRS_FOLLOWED = 150 };

static const double threshold_px = 2.0;
static const double tight_px = 0.6;
static const double refine_px = 0.5;    /* of a good match: what moves lies beyond */
static const double place_limit_px = 4; /* in the last view, which takes the error of both */
static const double same_rotation_rad = 0.01, same_direction_cosine = 0.99;
static const double mismatch_fraction_max = 0.5;
static const double cost_fraction_max =
    1.5; /* of the best one's cost, above which a motion is out of the question */

bool fv_initialise_inverse_depth(const struct fv_initialiser *in, const struct fv_pair *pair,
                                 const struct fv_se3 *T, double *inverse_depth)
{
    const double limit = place_limit_px / in->focal_px;
    double ray[3], q[3], off[3], across[3];
    fv_rotate3(T->R, pair->x1, ray);
    fv_cross3(pair->x2, ray, off);
    fv_cross3(pair->x2, T->t, across);
    const double square = fv_dot3(across, across), along = -fv_dot3(off, across);
    *inverse_depth = along > 0 && square > 1e-12 ? along / square : 0;
    for (int k = 0; k < 3; k++) {
        q[k] = ray[k] + *inverse_depth * T->t[k];
        off[k] += *inverse_depth * across[k];
    }
    return fv_dot3(q, pair->x2) > 0 && fv_dot3(off, off) <= limit * limit * fv_dot3(q, q);
}

double fv_initialise_parallax_px(const struct fv_initialiser *in, const struct fv_pair *pair,
                                 const struct fv_se3 *T, double inverse_depth)
{
    double ray[3], q[3], cross[3];
    fv_rotate3(T->R, pair->x1, ray);
    for (int k = 0; k < 3; k++)
        q[k] = ray[k] + inverse_depth * T->t[k];
    fv_cross3(ray, q, cross);
    return in->focal_px * fv_norm3(cross) / (fv_norm3(q) + 1e-12);
}

/* Truncated squares of the residuals; a point that cannot be placed counts as a mismatch.
 * `parallax`: points with enough of it to be landmarks. */
static double motion_cost(const struct fv_initialiser *in, uint32_t count, const struct fv_se3 *T,
                          uint32_t *parallax)
{
    double E[9], cost = 0, limit = threshold_px / in->focal_px, limit2 = limit * limit;
    fv_essential_from_motion(T, E);
    *parallax = 0;
    for (uint32_t i = 0; i < count; i++) {
        double inverse_depth = 0, r2 = fv_essential_residual2(E, &in->pairs[i]);
        if (r2 > limit2 || !fv_initialise_inverse_depth(in, &in->pairs[i], T, &inverse_depth))
            r2 = limit2;
        cost += r2;
        *parallax +=
            r2 < limit2 && fv_initialise_parallax_px(in, &in->pairs[i], T, inverse_depth) >=
                               FV_INITIALISE_PARALLAX_PX;
    }
    return cost / limit2;
}

static bool same_motion(const struct fv_se3 *A, const struct fv_se3 *B)
{
    double R[9], turn[3], Bt[9];
    for (int i = 0; i < 9; i++)
        Bt[i] = B->R[3 * (i % 3) + i / 3];
    fv_multiply33(A->R, Bt, R);
    fv_so3_log(R, turn);
    return fv_norm3(turn) < same_rotation_rad && fv_dot3(A->t, B->t) > same_direction_cosine;
}

bool fv_initialise_same(const struct fv_initialise_bundle *a, const struct fv_initialise_bundle *b)
{
    struct fv_se3 A = a->T_view_first[a->view_count - 1], B = b->T_view_first[b->view_count - 1];
    return fv_normalise3(A.t) && fv_normalise3(B.t) && same_motion(&A, &B);
}

/* Keep the list sorted by cost and free of repetitions. */
static uint32_t add_motion(struct fv_initialiser *in, uint32_t pairs, const struct fv_se3 *T,
                           uint32_t count, struct fv_se3 *list, double *costs)
{
    uint32_t parallax;
    double cost = motion_cost(in, pairs, T, &parallax);
    if (cost > mismatch_fraction_max * pairs || parallax < FV_INITIALISE_POINTS_MIN / 2)
        return count;
    if (count == FV_INITIALISE_MOTIONS_MAX && cost < costs[count - 1])
        count--; /* the worst gives way */
    for (uint32_t i = 0; i < count; i++)
        if (same_motion(&list[i], T)) {
            if (cost < costs[i]) {
                costs[i] = cost;
                list[i] = *T;
            }
            return count;
        }
    if (count == FV_INITIALISE_MOTIONS_MAX) return count;
    uint32_t at = count;
    for (; at > 0 && costs[at - 1] > cost; at--) {
        list[at] = list[at - 1];
        costs[at] = costs[at - 1];
    }
    list[at] = *T;
    costs[at] = cost;
    return count + 1;
}

/* Of a motion and its opposite, which fit alike, the one that has more points before it. */
static void face_points(const struct fv_pair *pairs, uint32_t count, struct fv_se3 *T)
{
    int32_t before = 0;
    for (uint32_t i = 0; i < count; i++) {
        double ray[3], off[3], across[3];
        fv_rotate3(T->R, pairs[i].x1, ray);
        fv_cross3(pairs[i].x2, ray, off);
        fv_cross3(pairs[i].x2, T->t, across);
        before += fv_dot3(off, across) < 0 ? 1 : -1;
    }
    if (before >= 0) return;
    for (int k = 0; k < 3; k++)
        T->t[k] = -T->t[k];
}

/* Follow a motion to its own minimum over some of the pairs, then judge it on all. */
static uint32_t try_motion(struct fv_initialiser *in, uint32_t pairs, struct fv_se3 *T,
                           uint32_t found, struct fv_se3 *list, double *costs)
{
    const uint32_t some = pairs < PAIRS_FOLLOWED ? pairs : PAIRS_FOLLOWED;
    fv_essential_refine(in->pairs, some, 2 * threshold_px / in->focal_px, REFINE_STEPS, T);
    face_points(in->pairs, some, T);
    return add_motion(in, pairs, T, found, list, costs);
}

uint32_t fv_initialise_motions(struct fv_initialiser *in, struct fv_random *random, uint32_t count,
                               struct fv_se3 T[FV_INITIALISE_MOTIONS_MAX])
{
    const struct fv_sampling sampling = {threshold_px / in->focal_px, FV_SAMPLE_CONFIDENCE, 300};
    double H[9], ratio, costs[FV_INITIALISE_MOTIONS_MAX];
    struct fv_se3 motion, planes[4];
    uint32_t found = 0,
             fit_plane = fv_homography_estimate(in->pairs, count, &sampling, random, H, in->inlier);
    uint32_t fit = fv_essential_estimate(in->pairs, count, &sampling, random, &motion, in->inlier);
    if (fit < FIT_MIN) return 0;
    fv_essential_refine(in->pairs, count, refine_px / in->focal_px, REFINE_STEPS, &motion);
    found = add_motion(in, count, &motion, found, T, costs);
    if (found == 0) return 0; /* no parallax to speak of */
    /* Between two motions, as of the world and of what moves in it, a bent one fits more of the
     * matches to a pixel or two; to the noise of a good match the right one does. */
    const struct fv_sampling tight = {tight_px / in->focal_px, FV_SAMPLE_CONFIDENCE, 300};
    struct fv_se3 sharp;
    if (fv_essential_estimate(in->pairs, count, &tight, random, &sharp, in->inlier) >= FIT_MIN / 2)
        found = add_motion(in, count, &sharp, found, T, costs);
    int plane_count = fit_plane >= FIT_MIN ? fv_homography_motions(H, planes, &ratio) : 0;
    for (int k = 0; k < plane_count; k++)
        found = try_motion(in, count, &planes[k], found, T, costs);
    /* A small rotation and a small translation look almost the same: every direction is followed to
     * where it leads.
     */
    for (int k = 14; k < 27; k++) { /* its opposite comes by itself: see try_motion */
        struct fv_se3 other = motion;
        const int across = k % 3 - 1, down = k / 3 % 3 - 1, along = k / 9 - 1;
        other.t[0] = across;
        other.t[1] = down;
        other.t[2] = along;
        if (fv_normalise3(other.t)) found = try_motion(in, count, &other, found, T, costs);
    }
    uint32_t kept = 0;
    while (kept < found && costs[kept] <= cost_fraction_max * costs[0] + 10)
        kept++;
    return kept;
}

#include "geometry/homography.h"

#include <string.h>

#include "geometry/linear.h"
#include "geometry/sample.h"
#include "geometry/vec.h"

/* Least-squares H (Frobenius norm 1) of `count` >= 4 pairs picked by `index` (NULL: the first ones)
 * whose `weight` (NULL: 1) is above 0. False when the pairs do not determine it. */
static bool homography_fit(const struct fv_pair *pairs, const uint32_t *index, uint32_t count,
                           const uint8_t *weight, double H[9])
{
    /* x2 x (H x1) = 0: with P = I - x2 x2^T, A sums P (x) x1 x1^T. */
    double A[81] = {0};
    for (uint32_t k = 0; k < count; k++) {
        const struct fv_pair *p = &pairs[index ? index[k] : k];
        if (weight && !weight[k]) continue;
        for (int r = 0; r < 3; r++)
            for (int s = 0; s <= r; s++) {
                double P = (r == s) - p->x2[r] * p->x2[s];
                for (int a = 0; a < 3; a++)
                    for (int b = 0; b < 3; b++)
                        A[9 * (3 * r + a) + 3 * s + b] += P * p->x1[a] * p->x1[b];
            }
    }
    return fv_smallest_vector9(A, H);
}

/* Squared angle (rad^2, small-angle) between x2 and H x1. */
static double homography_residual2(const double H[9], const struct fv_pair *pair)
{
    double q[3], r[3];
    fv_rotate3(H, pair->x1, q);
    fv_cross3(q, pair->x2, r);
    double square = fv_dot3(q, q);
    return square > 1e-18 ? fv_dot3(r, r) / square : 1;
}

static double homography_cost(const double H[9], const struct fv_pair *pairs, uint32_t count,
                              double limit2, double best)
{
    double cost = 0;
    for (uint32_t i = 0; i < count; i++) {
        double r2 = homography_residual2(H, &pairs[i]);
        cost += r2 < limit2 ? r2 : limit2;
        if ((i & 15) == 15 && cost >= best) return cost;
    }
    return cost;
}

/* Refit over the inliers; true when the cost fell. */
static bool homography_optimise(const struct fv_pair *pairs, uint32_t count, double limit2,
                                uint8_t *inlier, double H[9], double *cost)
{
    double fitted[9];
    for (uint32_t i = 0; i < count; i++)
        inlier[i] = homography_residual2(H, &pairs[i]) < limit2;
    if (!homography_fit(pairs, 0, count, inlier, fitted)) return false;
    double now = homography_cost(fitted, pairs, count, limit2, *cost);
    if (now >= *cost) return false;
    *cost = now;
    memcpy(H, fitted, sizeof fitted);
    return true;
}

uint32_t fv_homography_estimate(const struct fv_pair *pairs, uint32_t count,
                                const struct fv_sampling *sampling, struct fv_random *random,
                                double H[9], uint8_t *inlier)
{
    if (count < 5) return 0;
    double limit2 = sampling->threshold_rad * sampling->threshold_rad, whole = limit2 * count,
           cost = whole;
    double best[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1}, candidate[9];
    uint32_t bound = sampling->iterations_max;
    for (uint32_t iteration = 0; iteration < bound; iteration++) {
        uint32_t index[4];
        fv_sample_distinct(random, count, 4, index);
        if (!homography_fit(pairs, index, 4, 0, candidate)) continue;
        double now = homography_cost(candidate, pairs, count, limit2, cost);
        if (now >= cost) continue;
        cost = now;
        memcpy(best, candidate, sizeof best);
        (void)homography_optimise(pairs, count, limit2, inlier, best, &cost);
        uint32_t needed = fv_sample_bound(1 - cost / whole, 4, sampling->confidence);
        if (needed < bound) bound = needed;
    }
    for (int k = 0; k < 3 && homography_optimise(pairs, count, limit2, inlier, best, &cost); k++)
        ;
    uint32_t inliers = 0;
    for (uint32_t i = 0; i < count; i++) {
        inlier[i] = homography_residual2(best, &pairs[i]) < limit2;
        inliers += inlier[i];
    }
    if (inliers < 5) return 0;
    memcpy(H, best, sizeof best);
    return inliers;
}

/* One motion from H (middle singular value 1, positive determinant) and two directions of the
 * plane. */
static void plane_motion(const double H[9], const double v[3], const double u[3], struct fv_se3 *T)
{
    double Hv[3], Hu[3], n[3], m[3];
    fv_rotate3(H, v, Hv);
    fv_rotate3(H, u, Hu);
    fv_cross3(v, u, n);
    fv_cross3(Hv, Hu, m);
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++)
            T->R[3 * r + c] = Hv[r] * v[c] + Hu[r] * u[c] + m[r] * n[c];
    fv_so3_orthonormalise(T->R);
    double D[9];
    for (int i = 0; i < 9; i++)
        D[i] = H[i] - T->R[i];
    fv_rotate3(D, n, T->t);
}

int fv_homography_motions(const double H[9], struct fv_se3 T[4], double *baseline_ratio)
{
    double G[9], S[9], values[3], V[9], scaled[9];
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++)
            G[3 * r + c] = H[3 * c + r];
    fv_multiply33(G, H, S);
    fv_eigen_symmetric(S, 3, values, V);
    if (!(values[2] > 1e-12 * values[0])) return 0;
    double scale = 1 / __builtin_sqrt(values[1]);
    if (fv_determinant33(H) < 0) scale = -scale;
    for (int i = 0; i < 9; i++)
        scaled[i] = H[i] * scale;
    double above = values[0] / values[1] - 1, below = 1 - values[2] / values[1];
    above = above > 0 ? above : 0;
    below = below > 0 ? below : 0;
    *baseline_ratio = __builtin_sqrt(above + 1) - __builtin_sqrt(1 - below);
    if (!(above + below > 1e-8)) return 0;
    double share1 = __builtin_sqrt(below / (above + below)),
           share3 = __builtin_sqrt(above / (above + below));
    for (int k = 0; k < 2; k++) {
        double u[3];
        for (int i = 0; i < 3; i++)
            u[i] = share1 * V[i] + (k ? -share3 : share3) * V[6 + i];
        plane_motion(scaled, V + 3, u, &T[2 * k]);
        if (!fv_normalise3(T[2 * k].t)) return 0;
        T[2 * k + 1] = T[2 * k];
        for (int i = 0; i < 3; i++)
            T[2 * k + 1].t[i] = -T[2 * k].t[i];
    }
    return 4;
}

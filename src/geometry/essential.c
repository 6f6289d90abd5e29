#include "geometry/essential.h"

#include <string.h>

#include "geometry/linear.h"
#include "geometry/sample.h"
#include "geometry/vec.h"

enum { REFINE_STEPS = 4, REFINE_SAMPLES_MAX = 512 };

double fv_essential_residual2(const double E[9], const struct fv_pair *pair)
{
    double a[3], b[3];
    fv_rotate3(E, pair->x1, a);
    fv_rotate_back3(E, pair->x2, b);
    double c = fv_dot3(pair->x2, a), c2 = c * c;
    /* Derivatives by motions on the sphere: what of a and b is tangent to the bearings. */
    double slope2 = fv_dot3(a, a) + fv_dot3(b, b) - 2 * c2;
    return slope2 > 1e-18 ? c2 / slope2 : 1;
}

void fv_essential_from_motion(const struct fv_se3 *T, double E[9])
{
    const double *t = T->t;
    const double X[9] = {0, -t[2], t[1], t[2], 0, -t[0], -t[1], t[0], 0};
    fv_multiply33(X, T->R, E);
}

void fv_essential_motions(const double E[9], struct fv_se3 T[4])
{
    /* Columns are b x (columns of R), so their cross products are parallel to b; cofactors give the
     * rest. */
    double columns[3][3], cofactor[3][3], b[3] = {0}, best = 0;
    for (int c = 0; c < 3; c++)
        for (int r = 0; r < 3; r++)
            columns[c][r] = E[3 * r + c];
    for (int c = 0; c < 3; c++) { /* cofactor[c] is column c of the cofactor matrix */
        fv_cross3(columns[(c + 1) % 3], columns[(c + 2) % 3], cofactor[c]);
        double square = fv_dot3(cofactor[c], cofactor[c]);
        if (square > best) {
            best = square;
            fv_copy3(cofactor[c], b);
        }
    }
    double half_trace = 0;
    for (int i = 0; i < 9; i++)
        half_trace += 0.5 * E[i] * E[i];
    if (!fv_normalise3(b)) b[2] = 1;
    double length = __builtin_sqrt(half_trace);
    for (int sign = 0; sign < 2; sign++) {
        double t[3], scale = sign ? -length : length;
        for (int i = 0; i < 3; i++)
            t[i] = b[i] * scale;
        const double X[9] = {0, -t[2], t[1], t[2], 0, -t[0], -t[1], t[0], 0};
        double P[9];
        fv_multiply33(X, E, P);
        for (int i = 0; i < 9; i++)
            T[2 * sign].R[i] = (cofactor[i % 3][i / 3] - P[i]) / (length * length);
        fv_so3_orthonormalise(T[2 * sign].R);
        for (int i = 0; i < 3; i++)
            T[2 * sign].t[i] = sign ? -b[i] : b[i];
        T[2 * sign + 1] = T[2 * sign];
        for (int i = 0; i < 3; i++)
            T[2 * sign + 1].t[i] = -T[2 * sign].t[i];
    }
}

/* Two directions orthogonal to the unit vector t. */
static void tangent_basis(const double t[3], double u[3], double v[3])
{
    int axis = fv_abs(t[0]) < fv_abs(t[1]) ? (fv_abs(t[0]) < fv_abs(t[2]) ? 0 : 2)
                                           : (fv_abs(t[1]) < fv_abs(t[2]) ? 1 : 2);
    double e[3] = {axis == 0, axis == 1, axis == 2};
    fv_cross3(t, e, u);
    (void)fv_normalise3(u);
    fv_cross3(t, u, v);
}

/* Residual with its derivative by (rotation on the left of R, two tangents of t),
 * Sampson-normalised. */
static double residual_row(const struct fv_se3 *T, const double E[9], const double u[3],
                           const double v[3], const struct fv_pair *pair, double row[5])
{
    double q[3], m[3], w[3], a[3], b[3];
    fv_rotate3(T->R, pair->x1, q);
    fv_cross3(pair->x2, T->t, m);
    fv_cross3(q, m, w);
    fv_cross3(T->t, q, a);
    fv_rotate_back3(E, pair->x2, b);
    double c = fv_dot3(pair->x2, a);
    double slope2 = fv_dot3(a, a) + fv_dot3(b, b) - 2 * c * c;
    double inverse = 1 / __builtin_sqrt(slope2 > 1e-18 ? slope2 : 1e-18);
    double moment[3];
    fv_cross3(q, pair->x2, moment); /* x2 . (d x q) = d . (q x x2) */
    for (int i = 0; i < 3; i++)
        row[i] = w[i] * inverse;
    row[3] = fv_dot3(moment, u) * inverse;
    row[4] = fv_dot3(moment, v) * inverse;
    return c * inverse;
}

/* Normal equations of the pairs below the threshold (Tukey weights), and the tangents of t that
 * they are in. */
static void normal_equations(const struct fv_pair *pairs, uint32_t count, double threshold_rad,
                             const struct fv_se3 *T, double u[3], double v[3], double A[25],
                             double g[5])
{
    double limit2 = threshold_rad * threshold_rad, E[9], row[5];
    fv_essential_from_motion(T, E);
    tangent_basis(T->t, u, v);
    memset(A, 0, 25 * sizeof *A);
    memset(g, 0, 5 * sizeof *g);
    for (uint32_t i = 0; i < count; i++) {
        double r = residual_row(T, E, u, v, &pairs[i], row), r2 = r * r;
        if (r2 > limit2) continue;
        double fraction = r2 / limit2, weight = (1 - fraction) * (1 - fraction);
        for (int a = 0; a < 5; a++) {
            double scaled = weight * row[a];
            g[a] += scaled * r;
            for (int b = a; b < 5; b++)
                A[5 * a + b] += scaled * row[b];
        }
    }
    for (int a = 0; a < 5; a++) {
        for (int b = 0; b < a; b++)
            A[5 * a + b] = A[5 * b + a];
        A[6 * a] *= 1 + 1e-9;
    }
}

void fv_essential_refine(const struct fv_pair *pairs, uint32_t count, double threshold_rad,
                         int steps, struct fv_se3 *T)
{
    for (int step = 0; step < steps; step++) {
        double u[3], v[3], A[25], g[5];
        normal_equations(pairs, count, threshold_rad, T, u, v, A, g);
        if (!fv_ldlt_solve(A, 5, g)) return;
        double turn[3] = {-g[0], -g[1], -g[2]}, exp[9], R[9];
        fv_so3_exp(turn, exp);
        fv_multiply33(exp, T->R, R);
        memcpy(T->R, R, sizeof R);
        for (int i = 0; i < 3; i++)
            T->t[i] -= g[3] * u[i] + g[4] * v[i];
        (void)fv_normalise3(T->t);
    }
}

/* MSAC cost: truncated squares, given up as soon as `best` is passed. */
static double cost_of(const double E[9], const struct fv_pair *pairs, uint32_t count, double limit2,
                      double best)
{
    double cost = 0;
    for (uint32_t i = 0; i < count; i++) {
        double r2 = fv_essential_residual2(E, &pairs[i]);
        cost += r2 < limit2 ? r2 : limit2;
        if ((i & 15) == 15 && cost >= best) return cost;
    }
    return cost;
}

static bool in_front(const struct fv_se3 *T, const struct fv_pair *pair)
{
    /* Depths d1, d2 of d2 x2 = d1 R x1 + t in the least-squares sense, signs only. */
    double q[3];
    fv_rotate3(T->R, pair->x1, q);
    double c = fv_dot3(q, pair->x2), a = fv_dot3(q, T->t), b = fv_dot3(pair->x2, T->t);
    return c * b - a > 0 && b - c * a > 0;
}

/* The motion of E with most inliers in front of both cameras. */
static uint32_t pick_motion(const double E[9], const struct fv_pair *pairs, uint32_t count,
                            double limit2, struct fv_se3 *best)
{
    struct fv_se3 T[4];
    uint32_t most = 0, votes[4] = {0};
    fv_essential_motions(E, T);
    for (uint32_t i = 0; i < count; i++)
        if (fv_essential_residual2(E, &pairs[i]) < limit2)
            for (int k = 0; k < 4; k++)
                votes[k] += in_front(&T[k], &pairs[i]);
    for (int k = 0; k < 4; k++)
        if (votes[k] > most) {
            most = votes[k];
            *best = T[k];
        }
    return most;
}

/* Local optimisation: refine over a wide and then the proper threshold; true when the cost fell. */
static bool optimise(const struct fv_pair *pairs, uint32_t count, double threshold_rad, double E[9],
                     double *cost, struct fv_se3 *T)
{
    double limit2 = threshold_rad * threshold_rad, candidate[9];
    struct fv_se3 moved;
    if (!pick_motion(E, pairs, count, limit2, &moved)) return false;
    uint32_t used = count < REFINE_SAMPLES_MAX ? count : REFINE_SAMPLES_MAX;
    fv_essential_refine(pairs, used, 3 * threshold_rad, REFINE_STEPS, &moved);
    fv_essential_from_motion(&moved, candidate);
    double now = cost_of(candidate, pairs, count, limit2, *cost);
    if (now >= *cost) return false;
    *cost = now;
    *T = moved;
    memcpy(E, candidate, sizeof candidate);
    return true;
}

uint32_t fv_essential_estimate(const struct fv_pair *pairs, uint32_t count,
                               const struct fv_sampling *sampling, struct fv_random *random,
                               struct fv_se3 *T_2_1, uint8_t *inlier)
{
    if (count < 6) return 0;
    double limit2 = sampling->threshold_rad * sampling->threshold_rad, best[9],
           cost = limit2 * count;
    double whole = cost;
    struct fv_se3 motion;
    fv_se3_identity(&motion);
    uint32_t bound = sampling->iterations_max;
    bool any = false;
    for (uint32_t iteration = 0; iteration < bound; iteration++) {
        uint32_t index[5];
        struct fv_pair sample[5];
        double E[FV_ESSENTIAL_SOLUTIONS_MAX][9];
        fv_sample_distinct(random, count, 5, index);
        for (int i = 0; i < 5; i++)
            sample[i] = pairs[index[i]];
        int solutions = fv_essential_five_point(sample, E);
        bool improved = false;
        for (int k = 0; k < solutions; k++) {
            double now = cost_of(E[k], pairs, count, limit2, cost);
            if (now < cost) {
                cost = now;
                memcpy(best, E[k], sizeof best);
                improved = any = true;
            }
        }
        if (!improved) continue;
        (void)optimise(pairs, count, sampling->threshold_rad, best, &cost, &motion);
        uint32_t fit = (uint32_t)((1 - cost / whole) * count);
        uint32_t needed = fv_sample_bound((double)fit / count, 5, sampling->confidence);
        if (needed < bound) bound = needed;
    }
    if (!any || !pick_motion(best, pairs, count, limit2, &motion)) return 0;
    fv_essential_refine(pairs, count, 2 * sampling->threshold_rad, 3, &motion);
    fv_essential_from_motion(&motion, best);
    uint32_t inliers = 0;
    for (uint32_t i = 0; i < count; i++) {
        inlier[i] =
            fv_essential_residual2(best, &pairs[i]) < limit2 && in_front(&motion, &pairs[i]);
        inliers += inlier[i];
    }
    *T_2_1 = motion;
    return inliers;
}

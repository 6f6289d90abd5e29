#include "geometry/fundamental.h"

#include <stdbool.h>
#include <string.h>

#include "geometry/linear.h"
#include "geometry/polynomial.h"
#include "geometry/sample.h"
#include "geometry/vec.h"

enum { SAMPLE = 7, INLIERS_MIN = 9, ROUNDS = 3 };

/* ---- seven points ---------------------------------------------------------------------------- */

static void set_row(const struct fv_pair *pair, double row[9])
{
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++)
            row[3 * r + c] = pair->x2[r] * pair->x1[c];
}

/* Largest element of what is left, whose row and column change places with those of `k`. False
 * where all are nothing. */
static bool pivot(double A[SAMPLE][9], int column[9], int k)
{
    int best_row = k, best = k;
    for (int r = k; r < SAMPLE; r++)
        for (int c = k; c < 9; c++)
            if (fv_abs(A[r][c]) > fv_abs(A[best_row][best])) {
                best_row = r;
                best = c;
            }
    if (!(fv_abs(A[best_row][best]) > 1e-10)) return false;
    for (int c = 0; c < 9; c++) {
        const double kept = A[k][c];
        A[k][c] = A[best_row][c];
        A[best_row][c] = kept;
    }
    for (int r = 0; r < SAMPLE; r++) {
        const double kept = A[r][k];
        A[r][k] = A[r][best];
        A[r][best] = kept;
    }
    const int kept = column[k];
    column[k] = column[best];
    column[best] = kept;
    return true;
}

/* Two vectors that span what is orthogonal to seven rows of nine: Gauss-Jordan elimination with
 * full pivoting. */
static bool null_space(double A[SAMPLE][9], double basis[2][9])
{
    int column[9];
    for (int c = 0; c < 9; c++)
        column[c] = c;
    for (int k = 0; k < SAMPLE; k++) {
        if (!pivot(A, column, k)) return false;
        const double inverse = 1 / A[k][k];
        for (int c = k; c < 9; c++)
            A[k][c] *= inverse;
        for (int r = 0; r < SAMPLE; r++) {
            const double factor = A[r][k];
            if (r == k) continue;
            for (int c = k; c < 9; c++)
                A[r][c] -= factor * A[k][c];
        }
    }
    for (int b = 0; b < 2; b++) {
        for (int k = 0; k < SAMPLE; k++)
            basis[b][column[k]] = -A[k][SAMPLE + b];
        basis[b][column[SAMPLE]] = b == 0;
        basis[b][column[SAMPLE + 1]] = b == 1;
    }
    return true;
}

static bool scale_to_one(double F[9])
{
    double square = 0;
    for (int i = 0; i < 9; i++)
        square += F[i] * F[i];
    if (!(square > 1e-300 && square < 1e300)) return false;
    const double scale = 1 / __builtin_sqrt(square);
    for (int i = 0; i < 9; i++)
        F[i] *= scale;
    return true;
}

static double determinant_at(const double G[9], const double D[9], double a)
{
    double M[9];
    for (int i = 0; i < 9; i++)
        M[i] = G[i] + a * D[i];
    return fv_determinant33(M);
}

/* Singular matrices G + a D with a from -1 to 1, after `count` others. */
static int singular(const double G[9], const double D[9], int count,
                    double F[FV_FUNDAMENTAL_SOLUTIONS_MAX][9])
{
    const double plus = determinant_at(G, D, 1), minus = determinant_at(G, D, -1);
    double terms[4] = {fv_determinant33(G), 0, 0, fv_determinant33(D)}, roots[3];
    terms[1] = .5 * (plus - minus) - terms[3];
    terms[2] = .5 * (plus + minus) - terms[0];
    const int found = fv_polynomial_roots(terms, 3, -1, 1, roots);
    for (int k = 0; k < found && count < FV_FUNDAMENTAL_SOLUTIONS_MAX; k++) {
        for (int i = 0; i < 9; i++)
            F[count][i] = G[i] + roots[k] * D[i];
        count += scale_to_one(F[count]);
    }
    return count;
}

int fv_fundamental_seven_point(const struct fv_pair pairs[7],
                               double F[FV_FUNDAMENTAL_SOLUTIONS_MAX][9])
{
    double A[SAMPLE][9], basis[2][9];
    for (int i = 0; i < SAMPLE; i++)
        set_row(&pairs[i], A[i]);
    if (!null_space(A, basis) || !scale_to_one(basis[0]) || !scale_to_one(basis[1])) return 0;
    /* All multiples: one matrix plus at most one of the other, either way round. */
    const int count = singular(basis[0], basis[1], 0, F);
    return singular(basis[1], basis[0], count, F);
}

/* ---- the fit over inliers -------------------------------------------------------------------- */

/* Place and scale of points on the plane at depth 1, by which their mean becomes 0 and their mean
 * square distance from it 2. */
struct frame {
    double x, y, scale;
};

static struct frame frame_of(const struct fv_pair *pairs, uint32_t count, const uint8_t *inlier,
                             bool second)
{
    double n = 0, sum[2] = {0, 0}, squares = 0;
    for (uint32_t i = 0; i < count; i++) {
        const double *p = second ? pairs[i].x2 : pairs[i].x1;
        if (!inlier[i]) continue;
        const double x = p[0] / p[2], y = p[1] / p[2];
        n += 1;
        sum[0] += x;
        sum[1] += y;
        squares += x * x + y * y;
    }
    const double mx = sum[0] / n, my = sum[1] / n, variance = squares / n - mx * mx - my * my;
    return (struct frame){mx, my, variance > 1e-18 ? __builtin_sqrt(2 / variance) : 1};
}

static void into(const struct frame *frame, const double p[3], double out[3])
{
    out[0] = (p[0] / p[2] - frame->x) * frame->scale;
    out[1] = (p[1] / p[2] - frame->y) * frame->scale;
    out[2] = 1;
}

/* F of the normalised points back to bearings: T2^T F T1. */
static void out_of(const struct frame *first, const struct frame *second, double F[9])
{
    const double T1[9] = {first->scale,
                          0,
                          -first->x * first->scale,
                          0,
                          first->scale,
                          -first->y * first->scale,
                          0,
                          0,
                          1};
    const double T2t[9] = {second->scale,
                           0,
                           0,
                           0,
                           second->scale,
                           0,
                           -second->x * second->scale,
                           -second->y * second->scale,
                           1};
    double half[9], whole[9];
    fv_multiply33(F, T1, half);
    fv_multiply33(T2t, half, whole);
    memcpy(F, whole, sizeof whole);
}

/* Take the least singular value away. */
static void make_singular(double F[9])
{
    double S[9], values[3], V[9], image[3];
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++)
            S[3 * r + c] = F[r] * F[c] + F[3 + r] * F[3 + c] + F[6 + r] * F[6 + c];
    fv_eigen_symmetric(S, 3, values, V);
    fv_rotate3(F, V + 6, image);
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++)
            F[3 * r + c] -= image[r] * V[6 + c];
}

/* Weight of a pair by the slope of its constraint in F, so that Sampson's distance is what becomes
 * least. */
static double weight_of(const double F[9], const double a[3], const double b[3])
{
    double there[3], back[3];
    fv_rotate3(F, a, there);
    fv_rotate_back3(F, b, back);
    const double slope2 =
        there[0] * there[0] + there[1] * there[1] + back[0] * back[0] + back[1] * back[1];
    return 1 / (slope2 > 1e-12 ? slope2 : 1e-12);
}

/* The matrix of the normalised points that fits best; `weighted`: by F as it comes. */
static bool fit_once(const struct fv_pair *pairs, uint32_t count, const uint8_t *inlier,
                     const struct frame frames[2], bool weighted, double F[9])
{
    double A[81] = {0};
    for (uint32_t i = 0; i < count; i++) {
        struct fv_pair p;
        double row[9];
        if (!inlier[i]) continue;
        into(&frames[0], pairs[i].x1, p.x1);
        into(&frames[1], pairs[i].x2, p.x2);
        set_row(&p, row);
        const double weight = weighted ? weight_of(F, p.x1, p.x2) : 1;
        for (int r = 0; r < 9; r++)
            for (int c = 0; c <= r; c++)
                A[9 * r + c] += weight * row[r] * row[c];
    }
    if (!fv_smallest_vector9(A, F)) return false;
    make_singular(F);
    return scale_to_one(F);
}

static bool fit(const struct fv_pair *pairs, uint32_t count, const uint8_t *inlier, double F[9])
{
    const struct frame frames[2] = {frame_of(pairs, count, inlier, false),
                                    frame_of(pairs, count, inlier, true)};
    for (int round = 0; round < ROUNDS; round++)
        if (!fit_once(pairs, count, inlier, frames, round > 0, F)) return false;
    out_of(&frames[0], &frames[1], F);
    return scale_to_one(F);
}

/* ---- sampling -------------------------------------------------------------------------------- */

static double cost_of(const double F[9], const struct fv_pair *pairs, uint32_t count, double limit2,
                      double best)
{
    double cost = 0;
    for (uint32_t i = 0; i < count; i++) {
        const double r2 = fv_essential_residual2(F, &pairs[i]);
        cost += r2 < limit2 ? r2 : limit2;
        if ((i & 15) == 15 && cost >= best) return cost;
    }
    return cost;
}

static uint32_t mark(const double F[9], const struct fv_pair *pairs, uint32_t count, double limit2,
                     uint8_t *inlier)
{
    uint32_t inliers = 0;
    for (uint32_t i = 0; i < count; i++) {
        inlier[i] = fv_essential_residual2(F, &pairs[i]) < limit2;
        inliers += inlier[i];
    }
    return inliers;
}

/* Fit over the inliers, of a wide limit first, which finds those that a model of seven noisy pairs
 * misses; true when the cost fell. */
static bool optimise(const struct fv_pair *pairs, uint32_t count, double limit2, uint8_t *inlier,
                     double F[9], double *cost)
{
    static const double widths[ROUNDS] = {9, 3, 1}; /* of squared residuals */
    double fitted[9];
    memcpy(fitted, F, sizeof fitted);
    for (int round = 0; round < ROUNDS; round++)
        if (mark(fitted, pairs, count, widths[round] * limit2, inlier) < INLIERS_MIN ||
            !fit(pairs, count, inlier, fitted))
            return false;
    const double now = cost_of(fitted, pairs, count, limit2, *cost);
    if (now >= *cost) return false;
    *cost = now;
    memcpy(F, fitted, sizeof fitted);
    return true;
}

uint32_t fv_fundamental_estimate(const struct fv_pair *pairs, uint32_t count,
                                 const struct fv_sampling *sampling, struct fv_random *random,
                                 double F[9], uint8_t *inlier)
{
    const double limit2 = sampling->threshold_rad * sampling->threshold_rad, whole = limit2 * count;
    double cost = whole, best[9] = {0}, found[FV_FUNDAMENTAL_SOLUTIONS_MAX][9];
    uint32_t bound = sampling->iterations_max;
    if (count < INLIERS_MIN) return 0;
    for (uint32_t iteration = 0; iteration < bound; iteration++) {
        uint32_t index[SAMPLE];
        struct fv_pair sample[SAMPLE];
        fv_sample_distinct(random, count, SAMPLE, index);
        for (int i = 0; i < SAMPLE; i++)
            sample[i] = pairs[index[i]];
        const int solutions = fv_fundamental_seven_point(sample, found);
        for (int s = 0; s < solutions; s++) {
            const double now = cost_of(found[s], pairs, count, limit2, cost);
            if (now >= cost) continue;
            cost = now;
            memcpy(best, found[s], sizeof best);
            (void)optimise(pairs, count, limit2, inlier, best, &cost);
            const uint32_t needed = fv_sample_bound(1 - cost / whole, SAMPLE, sampling->confidence);
            if (needed < bound) bound = needed;
        }
    }
    for (int k = 0; k < ROUNDS && optimise(pairs, count, limit2, inlier, best, &cost); k++)
        ;
    const uint32_t inliers = mark(best, pairs, count, limit2, inlier);
    if (inliers < INLIERS_MIN) return 0;
    memcpy(F, best, sizeof best);
    return inliers;
}

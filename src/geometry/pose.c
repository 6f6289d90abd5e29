#include "geometry/pose.h"

#include <string.h>

#include "geometry/normal_equations.h"
#include "geometry/sample.h"
#include "geometry/vec.h"
#include "geometry/chi_square.h"

static const double noise_variance_min =
    0.08; /* px^2 of level 0: matches are not better than that */

/* ---- sampling -------------------------------------------------------------------------------- */

/* Squared sine of the angle between bearing and point (1 when behind): what MSAC adds up. */
static double angle2(const struct fv_se3 *T, const struct fv_observation *s)
{
    double q[3];
    fv_se3_apply(T, s->point, q);
    double along = fv_dot3(q, s->bearing), square = fv_dot3(q, q);
    return along > 0 ? 1 - along * along / square : 1;
}

static double sample_cost(const struct fv_se3 *T, const struct fv_observation *observations,
                          uint32_t count, double limit2, double best)
{
    double cost = 0;
    for (uint32_t i = 0; i < count; i++) {
        double r2 = angle2(T, &observations[i]);
        cost += r2 < limit2 ? r2 : limit2;
        if ((i & 15) == 15 && cost >= best) return cost;
    }
    return cost;
}

/* Angular Gauss-Newton over the observations below the threshold: the local optimisation. */
static void angular_refine(const struct fv_observation *observations, uint32_t count, double limit2,
                           int steps, struct fv_se3 *T)
{
    for (int step = 0; step < steps; step++) {
        double H[36] = {0}, g[6] = {0};
        const struct fv_normal normal = {H, g, 6};
        for (uint32_t i = 0; i < count; i++) {
            if (angle2(T, &observations[i]) >= limit2) continue;
            /* Residual b x q / |q|, whose length is the sine; its derivative by q, the length held,
             * is [b]x / |q|. */
            double q[3], r[3];
            const double *b = observations[i].bearing;
            fv_se3_apply(T, observations[i].point, q);
            double inverse = 1 / fv_norm3(q);
            fv_cross3(b, q, r);
            const double S[9] = {0, -b[2], b[1], b[2], 0, -b[0], -b[1], b[0], 0};
            for (int k = 0; k < 3; k++) {
                double row[6], residual = r[k] * inverse;
                for (int c = 0; c < 3; c++)
                    row[c] = S[3 * k + c] * inverse;
                fv_cross3(q, row, row + 3); /* s . (w x q) = w . (q x s) */
                fv_normal_add_one(&normal, 0, 6, row, row, &residual, 1, NULL);
            }
        }
        fv_normal_damp(&normal, 1e-9, 0);
        if (!fv_normal_solve(&normal, g)) return;
        fv_se3_move(T, g);
    }
}

uint32_t fv_pose_sample(struct fv_observation *observations, uint32_t count,
                        const struct fv_sampling *sampling, struct fv_random *random,
                        struct fv_se3 *T_cam_world)
{
    if (count < 4) return 0;
    double limit2 = sampling->threshold_rad * sampling->threshold_rad, whole = limit2 * count,
           cost = whole;
    struct fv_se3 best;
    fv_se3_identity(&best);
    uint32_t bound = sampling->iterations_max;
    for (uint32_t iteration = 0; iteration < bound; iteration++) {
        uint32_t index[3];
        double bearings[3][3], points[3][3];
        struct fv_se3 T[FV_P3P_SOLUTIONS_MAX];
        fv_sample_distinct(random, count, 3, index);
        for (int k = 0; k < 3; k++) {
            fv_copy3(observations[index[k]].bearing, bearings[k]);
            fv_copy3(observations[index[k]].point, points[k]);
        }
        int solutions = fv_p3p(bearings, points, T), improved = -1;
        for (int k = 0; k < solutions; k++) {
            double now = sample_cost(&T[k], observations, count, limit2, cost);
            if (now < cost) {
                cost = now;
                best = T[k];
                improved = k;
            }
        }
        if (improved < 0) continue;
        struct fv_se3 moved = best;
        angular_refine(observations, count, 4 * limit2, 1, &moved);
        angular_refine(observations, count, limit2, 1, &moved);
        double now = sample_cost(&moved, observations, count, limit2, cost);
        if (now < cost) {
            cost = now;
            best = moved;
        }
        uint32_t needed = fv_sample_bound(1 - cost / whole, 3, sampling->confidence);
        if (needed < bound) bound = needed;
    }
    uint32_t inliers = 0;
    for (uint32_t i = 0; i < count; i++)
        inliers += angle2(&best, &observations[i]) < limit2;
    if (inliers < 4) return 0;
    for (uint32_t i = 0; i < count; i++)
        observations[i].inlier = angle2(&best, &observations[i]) < limit2;
    *T_cam_world = best;
    return inliers;
}

/* ---- refinement ------------------------------------------------------------------------------ */

/* Weighted squared pixel error; derivative rows by the small motion when `rows` is not NULL.
 * Negative: behind. */
static double pixel_error(const struct fv_se3 *T, const struct fv_observation *s,
                          double residual[2], double rows[12])
{
    double q[3], J[6];
    fv_se3_apply(T, s->point, q);
    if (!fv_observation_error(s->bearing, s->A, q, residual, rows ? J : 0)) return -1;
    if (rows)
        for (int r = 0; r < 2; r++) {
            fv_copy3(J + 3 * r, rows + 6 * r);
            fv_cross3(q, J + 3 * r, rows + 6 * r + 3);
        }
    return s->weight * (residual[0] * residual[0] + residual[1] * residual[1]);
}

static void accumulate(const struct fv_normal *normal, const double rows[12],
                       const double residual[2], double weight)
{
    double weighted[12];
    fv_block_weigh(rows, 12, weight, weighted);
    fv_normal_add_one(normal, 0, 6, rows, weighted, residual, 2, NULL);
}

/* The third error of an observation. */
static void accumulate_distance(const struct fv_normal *normal, const struct fv_se3 *T,
                                const struct fv_observation *s,
                                const struct fv_inverse_distance *measured)
{
    double q[3], e, row[6], weighted[6];
    fv_se3_apply(T, s->point, q);
    if (!fv_inverse_distance_error(measured, s->bearing, q, &e, row)) return;
    fv_cross3(q, row, row + 3);
    fv_block_weigh(row, 6, fv_inverse_distance_robust(measured, e), weighted);
    fv_normal_add_one(normal, 0, 6, row, weighted, &e, 1, NULL);
}

static bool refine_step(const struct fv_observation *observations,
                        const struct fv_inverse_distance *distances, uint32_t count,
                        struct fv_se3 *T, double *moved)
{
    double H[36] = {0}, g[6] = {0};
    const struct fv_normal normal = {H, g, 6};
    for (uint32_t i = 0; i < count; i++) {
        double residual[2], rows[12];
        if (!observations[i].inlier) continue;
        double error2 = pixel_error(T, &observations[i], residual, rows);
        if (error2 < 0) continue;
        double robust = error2 > FV_CHI_SQUARE_95_2 ? __builtin_sqrt(FV_CHI_SQUARE_95_2 / error2)
                                                    : 1; /* Huber */
        accumulate(&normal, rows, residual, robust * observations[i].weight);
        if (distances != NULL) accumulate_distance(&normal, T, &observations[i], &distances[i]);
    }
    fv_normal_damp(&normal, 1e-9, 0);
    if (!fv_normal_solve(&normal, g)) return false;
    fv_se3_move(T, g);
    *moved = fv_dot3(g + 3, g + 3) + fv_dot3(g, g) / (fv_dot3(T->t, T->t) + 1);
    return true;
}

/* Inliers are observations with weighted squared errors below `limit2`. */
static void sort_observations(struct fv_observation *observations, uint32_t count,
                              const struct fv_se3 *T, double limit2)
{
    double residual[2];
    for (uint32_t i = 0; i < count; i++) {
        double error2 = pixel_error(T, &observations[i], residual, 0);
        observations[i].inlier = error2 >= 0 && error2 < limit2;
    }
}

static void fit_of(const struct fv_observation *observations,
                   const struct fv_inverse_distance *distances, uint32_t count, struct fv_se3 *T,
                   struct fv_pose_fit *fit)
{
    double residual[2], rows[12];
    const struct fv_normal normal = {fit->information, NULL, 6};
    fv_so3_orthonormalise(T->R);
    memset(fit, 0, sizeof *fit);
    for (uint32_t i = 0; i < count; i++) {
        double error2 =
            observations[i].inlier ? pixel_error(T, &observations[i], residual, rows) : -1;
        if (error2 < 0) continue;
        fit->inliers++;
        fit->cost += error2;
        accumulate(&normal, rows, residual, observations[i].weight);
        if (distances != NULL) accumulate_distance(&normal, T, &observations[i], &distances[i]);
    }
    for (int a = 0; a < 6; a++)
        for (int c = a + 1; c < 6; c++)
            fit->information[6 * a + c] = fit->information[6 * c + a];
}

double fv_pose_variance(const struct fv_pose_fit *fit)
{
    return fit->inliers > 3 ? fit->cost / (2 * (double)fit->inliers - 6) : 1;
}

bool fv_pose_refine(struct fv_observation *observations,
                    const struct fv_inverse_distance *distances, uint32_t count, int rounds,
                    int steps, struct fv_se3 *T_cam_world, struct fv_pose_fit *fit)
{
    struct fv_se3 T = *T_cam_world;
    for (int round = 0; round < rounds; round++) {
        double moved = 1;
        for (int step = 0; step < steps && moved > 1e-14; step++)
            if (!refine_step(observations, distances, count, &T, &moved)) return false;
        sort_observations(observations, count, &T, FV_CHI_SQUARE_95_2);
    }
    fit_of(observations, distances, count, &T, fit);
    *T_cam_world = T;
    return true;
}

bool fv_pose_refine_to_noise(struct fv_observation *observations,
                             const struct fv_inverse_distance *distances, uint32_t count,
                             struct fv_se3 *T_cam_world, struct fv_pose_fit *fit)
{
    struct fv_se3 T = *T_cam_world;
    double variance = fv_pose_variance(fit), moved;
    if (variance < noise_variance_min) variance = noise_variance_min;
    const double limit2 = variance * FV_CHI_SQUARE_99_2;
    if (limit2 >= FV_CHI_SQUARE_95_2) return true;
    for (int step = 0; step < 2; step++) {
        sort_observations(observations, count, &T, limit2);
        if (!refine_step(observations, distances, count, &T, &moved)) return false;
    }
    sort_observations(observations, count, &T, limit2);
    fit_of(observations, distances, count, &T, fit);
    *T_cam_world = T;
    return true;
}

void fv_pose_part_add(struct fv_pose_part *part, double weight, double error, const double row[6])
{
    for (int k = 0; k < 6; k++) {
        part->pull[k] += weight * error * row[k];
        for (int i = 0; i <= k; i++)
            part->information[6 * k + i] += weight * row[k] * row[i];
    }
}

bool fv_pose_jackknife(const struct fv_pose_fit *fit, const struct fv_pose_part *parts,
                       uint32_t count, struct fv_pose_shown *shown)
{
    double squares = 0;
    memset(shown, 0, sizeof *shown);
    for (uint32_t p = 0; p < count; p++) {
        double rest[36], moved[6], share = 0;
        for (int k = 0; k < 36; k++)
            rest[k] = fit->information[k] - parts[p].information[k];
        memcpy(moved, parts[p].pull, sizeof moved);
        if (!fv_ldlt_solve(rest, 6, moved)) return false;
        for (int row = 0, k = 0; row < 6; row++)
            for (int column = row; column < 6; column++, k++) {
                const double product = moved[row] * moved[column];
                shown->covariance[k] += product;
                share += (column == row ? 1 : 2) * product * fit->information[6 * row + column] / 6;
            }
        shown->variance += share;
        squares += share * share;
    }
    shown->counted = squares > 0 ? shown->variance * shown->variance / squares : 0;
    return true;
}

bool fv_pose_add_alone(const struct fv_pose_fit *fit, double variance, double covariance[21])
{
    double A[36];
    memcpy(A, fit->information, sizeof A);
    if (!fv_ldlt_factor(A, 6)) return false;
    for (int row = 0, k = 0; row < 6; row++) {
        double solved[6] = {0};
        solved[row] = variance;
        fv_ldlt_back(A, 6, solved);
        for (int column = row; column < 6; column++, k++)
            covariance[k] += solved[column];
    }
    return true;
}

void fv_pose_spread(const struct fv_pose_fit *fit, double variance, struct fv_pose_shown *shown)
{
    enum { DIRECTIONS = 6 };
    const double beyond = shown->variance - variance;
    if (beyond > 0)
        (void)fv_pose_add_alone(fit, DIRECTIONS / (shown->counted + DIRECTIONS) * beyond,
                                shown->covariance);
}

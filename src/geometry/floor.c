#include "geometry/floor.h"

#include "geometry/linear.h"
#include "geometry/sample.h"
#include "geometry/vec.h"

enum { REFINEMENTS = 6 };

static const double sigma_best = 0.02; /* relative: no floor is flatter, no point better */
static const double gate = 2.5;        /* standard deviations */
static const double sigma_max = 0.1;   /* of the height: worse is no answer */
/* Of the plane over what stands on it: less is none, and up to the second the height gets surer by
 * so much. */
static const double density_least = 1.8, density_sure = 2.6, sigma_unsure = 0.08;

/* Of a point over or under the plane, in its standard deviations; positive: below the plane. What
 * errs evenly to both sides is the inverse of a triangulated distance: distances themselves err
 * farther outward, and would draw the plane down. */
static double floor_residual(const double down[3], double height,
                             const struct fv_floor_point *point)
{
    const double depth = fv_dot3(down, point->p);
    return depth > 1e-9 * height ? (1 - height / depth) / point->sigma : -1e9;
}

/* Points weigh by how well they are known, the best count 1. */
static double floor_weight(const struct fv_floor_point *point)
{
    return point->sigma > sigma_best ? sigma_best / point->sigma : 1;
}

static double floor_score(const struct fv_floor_point *points, uint32_t count, const double down[3],
                          double height)
{
    double score = 0;
    for (uint32_t i = 0; i < count; i++) {
        double e = floor_residual(down, height, &points[i]), fraction = e * e / (gate * gate);
        if (fraction < 1)
            score += floor_weight(&points[i]) * (1 - fraction);
        else if (e > 0)
            score -= floor_weight(&points[i]);
    }
    return score;
}

/* Weight in the plane over that in the layer of the same thickness above it: a floor is
 * denser than what stands on it, the lower edge of a cloud is not. */
static double floor_density(const struct fv_floor_point *points, uint32_t count,
                            const double down[3], double height)
{
    double in = 0, above = 0;
    for (uint32_t i = 0; i < count; i++) {
        double e = floor_residual(down, height, &points[i]);
        if (e * e < gate * gate)
            in += floor_weight(&points[i]);
        else if (e < 0 && e > -3 * gate)
            above += floor_weight(&points[i]);
    }
    return in / (above + 1e-9);
}

/* A hypothesis; false for points that give none, or one too far from what is expected. */
static bool floor_hypothesis(const struct fv_floor_point *points, uint32_t count,
                             const struct fv_floor_prior *prior, bool three,
                             struct fv_random *random, double down[3], double *height)
{
    uint32_t index[3];
    double a[3], b[3];
    fv_sample_distinct(random, count, 3, index);
    const double *p = points[index[0]].p;
    fv_copy3(prior->down, down);
    if (three) {
        fv_subtract3(points[index[1]].p, p, a);
        fv_subtract3(points[index[2]].p, p, b);
        fv_cross3(a, b, down);
        if (!fv_normalise3(down)) return false;
        if (fv_dot3(down, prior->down) < 0)
            for (int i = 0; i < 3; i++)
                down[i] = -down[i];
    }
    *height = fv_dot3(down, p);
    return *height > 1e-9 && fv_dot3(down, prior->down) > fv_cos(prior->off_max_rad);
}

/* Weighted least squares over the inliers. The plane is x p = 1 with x = down / height: along the
 * ray p / |p| its inverse distance is x p / |p|, which is held to 1 / |p|, relative to what the
 * plane says; the prior holds x to prior->down / height across the direction. `information`: of x;
 * `alone`: the same without the prior. False when the system is singular. */
static bool floor_refine(const struct fv_floor_point *points, uint32_t count,
                         const struct fv_floor_prior *prior, double down[3], double *height,
                         double information[9], double alone[6], uint32_t *inliers)
{
    double A[9] = {0}, b[3] = {0}, held[9],
           weight = 1 / (prior->sigma_rad * prior->sigma_rad) * *height * *height;
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++)
            A[3 * r + c] = held[3 * r + c] = weight * ((r == c) - prior->down[r] * prior->down[c]);
    *inliers = 0;
    for (uint32_t i = 0; i < count; i++) {
        const double *p = points[i].p;
        double e = floor_residual(down, *height, &points[i]);
        if (e * e > gate * gate) continue;
        const double said = fv_dot3(down, p) / *height,
                     w = 1 / (points[i].sigma * points[i].sigma * said * said);
        for (int r = 0; r < 3; r++) {
            for (int c = 0; c < 3; c++)
                A[3 * r + c] += w * p[r] * p[c];
            b[r] += w * p[r];
        }
        (*inliers)++;
    }
    for (int i = 0; i < 9; i++)
        information[i] = A[i];
    for (int r = 0, k = 0; r < 3; r++)
        for (int c = r; c < 3; c++, k++)
            alone[k] = A[3 * r + c] - held[3 * r + c];
    if (!fv_ldlt_solve(A, 3, b)) return false;
    double norm = fv_norm3(b);
    if (!(norm > 1e-12)) return false;
    for (int i = 0; i < 3; i++)
        down[i] = b[i] / norm;
    *height = 1 / norm;
    return true;
}

/* Relative deviation of the height: that of |x| = 1 / height, by the inverse of the information. */
static double floor_sigma(const double information[9], const double down[3], double height)
{
    double A[9], v[3];
    for (int i = 0; i < 9; i++)
        A[i] = information[i];
    fv_copy3(down, v);
    if (!fv_ldlt_solve(A, 3, v)) return 1;
    double variance = fv_dot3(down, v);
    return variance > 0 ? height * __builtin_sqrt(variance) : 1;
}

bool fv_floor_estimate(const struct fv_floor_point *points, uint32_t count,
                       const struct fv_floor_prior *prior, uint32_t samples, uint32_t inliers_min,
                       struct fv_random *random, struct fv_floor *plane)
{
    double best = 0, down[3], height, information[9];
    struct fv_floor found = {.height = 0};
    if (count < inliers_min || count < 3) return false;
    for (uint32_t k = 0; k < samples; k++) {
        if (!floor_hypothesis(points, count, prior, k % 2 == 1, random, down, &height)) continue;
        double score = floor_score(points, count, down, height);
        if (score <= best) continue;
        best = score;
        fv_copy3(down, found.down);
        found.height = height;
    }
    if (!(found.height > 0)) return false;
    for (int k = 0; k < REFINEMENTS; k++)
        if (!floor_refine(points, count, prior, found.down, &found.height, information,
                          found.information, &found.inliers))
            return false;
    if (fv_dot3(found.down, prior->down) < fv_cos(prior->off_max_rad)) return false;
    found.support = floor_score(points, count, found.down, found.height);
    found.sigma = floor_sigma(information, found.down, found.height);
    double density = floor_density(points, count, found.down, found.height);
    if (density < density_least) return false;
    if (density < density_sure)
        found.sigma += sigma_unsure * (density_sure - density) / (density_sure - density_least);
    if (found.inliers < inliers_min || !(found.support > 0) || !(found.sigma < sigma_max))
        return false;
    *plane = found;
    return true;
}

double fv_floor_spread(const struct fv_floor_point *points, uint32_t count,
                       const struct fv_floor *plane)
{
    enum { HALVINGS = 16 };
    double low = 0, high = gate;
    uint32_t in = 0;
    for (int step = 0; step <= HALVINGS; step++) {
        const double middle = step == 0 ? gate : 0.5 * (low + high);
        uint32_t below = 0;
        for (uint32_t i = 0; i < count; i++)
            below += fv_abs(floor_residual(plane->down, plane->height, &points[i])) < middle;
        if (step == 0)
            in = below;
        else
            *(2 * below > in ? &high : &low) = middle;
    }
    return in == 0 ? 0 : 1.4826 * 0.5 * (low + high);
}

void fv_floor_in_metres(struct fv_floor *plane, double metres)
{
    plane->height *= metres;
    for (int i = 0; i < 6; i++)
        plane->information[i] *= metres * metres;
}

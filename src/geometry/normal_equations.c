#include "geometry/normal_equations.h"

#include <string.h>

void fv_normal_clear(const struct fv_normal *n)
{
    memset(n->H, 0, (size_t)(n->size * n->size) * sizeof *n->H);
    if (n->g) memset(n->g, 0, (size_t)n->size * sizeof *n->g);
}

void fv_normal_damp(const struct fv_normal *n, double fraction, double extra)
{
    for (int k = 0; k < n->size; k++) {
        double *diagonal = n->H + (n->size + 1) * k;
        *diagonal = *diagonal * (1 + fraction) + extra;
    }
}

/* ---- landmarks ------------------------------------------------------------------------------- */

static bool only_poses(const struct fv_coupling *couplings, int count)
{
    bool poses = true;
    for (int i = 0; i < count; i++)
        poses = poses && couplings[i].size == 6;
    return poses;
}

/* Y = inverse cross. */
FV_BLOCK_INLINE void times_inverse(const double *cross, int size, const double *v, double *Y)
{
    for (int c = 0; c < size; c++) {
        const double x[3] = {cross[c], cross[size + c], cross[2 * size + c]};
        Y[c] = x[0] * v[0] + x[1] * v[1] + x[2] * v[2];
        Y[size + c] = x[0] * v[1] + x[1] * v[3] + x[2] * v[4];
        Y[2 * size + c] = x[0] * v[2] + x[1] * v[4] + x[2] * v[5];
    }
}

/* Landmarks of three values: one coupling against those whose rows are not below it. `size`: that
 * of all couplings, or 0 when they differ. */
FV_BLOCK_INLINE void eliminate_three(const struct fv_normal *n, int size, const double *inverse,
                                     const double *gradient, const struct fv_coupling *couplings,
                                     int count)
{
    for (int i = 0; i < count; i++) {
        double Y[FV_COUPLING_VALUES_MAX];
        const struct fv_coupling *a = &couplings[i];
        const int rows = size ? size : a->size;
        times_inverse(a->cross, rows, inverse, Y);
        if (n->g) fv_block_add_vector(n->g + a->first, Y, rows, gradient, 3, -1);
        for (int k = 0; k < count; k++) {
            const struct fv_coupling *b = &couplings[k];
            if (b->first > a->first) continue;
            double *H = n->H + a->first * n->size + b->first;
            if (k == i)
                fv_block_add_inner(H, n->size, Y, rows, b->cross, rows, 3, -1, true);
            else
                fv_block_add_inner(H, n->size, Y, rows, b->cross, size ? size : b->size, 3, -1,
                                   false);
        }
    }
}

/* Landmarks of one value: every coupling is a column. */
static void eliminate_one(const struct fv_normal *n, double inverse, const double *gradient,
                          const struct fv_coupling *couplings, int count)
{
    for (int i = 0; i < count; i++) {
        const struct fv_coupling *a = &couplings[i];
        const double *__restrict cross = a->cross;
        double *__restrict H = n->H + a->first * (n->size + 1);
        for (int r = 0; r < a->size; r++) {
            const double y = cross[r] * inverse;
            if (n->g) n->g[a->first + r] -= y * gradient[0];
            for (int c = 0; c <= r; c++)
                H[r * n->size + c] -= y * cross[c];
        }
        for (int k = 0; k < count; k++)
            if (couplings[k].first < a->first)
                for (int r = 0; r < a->size; r++)
                    fv_block_add_inner(H + r * n->size + couplings[k].first - a->first, 0,
                                       &(const double){cross[r] * inverse}, 1, couplings[k].cross,
                                       couplings[k].size, 1, -1, false);
    }
}

void fv_normal_eliminate(const struct fv_normal *n, int landmark_size, const double *inverse,
                         const double *gradient, const struct fv_coupling *couplings, int count)
{
    if (landmark_size == 3 && only_poses(couplings, count))
        eliminate_three(n, 6, inverse, gradient, couplings, count);
    else if (landmark_size == 3)
        eliminate_three(n, 0, inverse, gradient, couplings, count);
    else
        eliminate_one(n, inverse[0], gradient, couplings, count);
}

/* gradient - cross x; `size` as above. */
FV_BLOCK_INLINE void landmark_rest(int landmark_size, int size, const double *gradient,
                                   const struct fv_coupling *couplings, int count, const double *x,
                                   double *g)
{
    for (int k = 0; k < landmark_size; k++)
        g[k] = gradient[k];
    for (int i = 0; i < count; i++) {
        const double *cross = couplings[i].cross, *part = x + couplings[i].first;
        const int rows = size ? size : couplings[i].size;
        for (int r = 0; r < rows; r++)
            for (int k = 0; k < landmark_size; k++)
                g[k] -= cross[rows * k + r] * part[r];
    }
}

void fv_landmark_step(int landmark_size, const double *v, const double *gradient,
                      const struct fv_coupling *couplings, int count, const double *x, double *step)
{
    double g[FV_LANDMARK_SIZE_MAX];
    if (landmark_size == 1) {
        landmark_rest(1, 0, gradient, couplings, count, x, g);
        step[0] = v[0] * g[0];
        return;
    }
    if (only_poses(couplings, count))
        landmark_rest(3, 6, gradient, couplings, count, x, g);
    else
        landmark_rest(3, 0, gradient, couplings, count, x, g);
    step[0] = v[0] * g[0] + v[1] * g[1] + v[2] * g[2];
    step[1] = v[1] * g[0] + v[3] * g[1] + v[4] * g[2];
    step[2] = v[2] * g[0] + v[4] * g[1] + v[5] * g[2];
}

/* ---- solution -------------------------------------------------------------------------------- */

bool fv_normal_solve(const struct fv_normal *n, double *x)
{
    if (!fv_ldlt_factor(n->H, n->size)) return false;
    for (int k = 0; k < n->size; k++)
        if (!__builtin_isfinite(n->g[k])) return false;
    if (x != n->g) memcpy(x, n->g, (size_t)n->size * sizeof *x);
    fv_ldlt_back(n->H, n->size, x);
    return true;
}

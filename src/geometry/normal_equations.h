/* Normal equations H x = g of a least-squares problem whose variables are blocks of different
 * sizes: 6 for a pose, 9 for velocity and biases, 7 for a similarity, 3 or 1 for a landmark.
 *
 * A step of Gauss-Newton minimises the sum of e^T W e over residuals e(x) ~ e + J x, so
 * H = sum of J^T W J and g = -sum of J^T W e. A residual of any kind (pixel, inertial, prior,
 * relative pose, wheel) enters by its rows: e, J and W J for each block that it depends on. Units
 * are those of the caller's variables and errors. Many small blocks that hang together through the
 * others only (landmarks) are eliminated one at a time by the Schur complement, and their own steps
 * follow from the solution of the rest (B. Triggs et al., "Bundle adjustment: a modern synthesis",
 * 2000, section 6). The reduced system is dense and is solved by LDL^T (linear.h), in one go or
 * some columns per unit. Levenberg-Marquardt's damping adds a fraction of the diagonal.
 *
 * The caller owns all storage; struct fv_normal is a view of it, made where it is used, so that
 * state holds no addresses. The order of operations is fixed: results have the same bits on every
 * machine, and whether a system is factored in one go or in units. Only the lower triangle of H is
 * meaningful. A singular or non-finite system is reported by the factorisation.
 *
 * Real-time safe, any thread. Time: an added residual of m rows costs m size^2 multiplications, an
 * eliminated landmark seen by n blocks 3 (6 n)^2 / 2, a factorisation size^3 / 6. */
#ifndef FOVEA_GEOMETRY_NORMAL_EQUATIONS_H
#define FOVEA_GEOMETRY_NORMAL_EQUATIONS_H

#include <stdbool.h>

#include "geometry/linear.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    FV_NORMAL_SIZE_MAX = FV_LDLT_SIZE_MAX,
    FV_LANDMARK_SIZE_MAX = 3,
    /* Values of a coupling: 16 x 3, or 48 x 1. */
    FV_COUPLING_VALUES_MAX = 48
};

/* ---- products of blocks ---------------------------------------------------------------------- */

/* Inlined wherever they are used, so that constant sizes unroll. Neighbouring columns go two at a
 * time, which changes no value's own operations or their order; compilers left to themselves take
 * values of two rows together. */
#define FV_BLOCK_INLINE static inline __attribute__((always_inline))

typedef double fv_columns __attribute__((vector_size(16), aligned(8), may_alias));

FV_BLOCK_INLINE fv_columns fv_columns_at(const double *values)
{
    return *(const fv_columns *)values;
}

/* out += factor A^T B. A is m x rows, B is m x columns, both row-major; rows of `out` are `stride`
 * values apart. With `lower`, only column <= row is written. m >= 1. */
FV_BLOCK_INLINE void fv_block_add_inner(double *__restrict out, int stride,
                                        const double *__restrict A, int rows,
                                        const double *__restrict B, int columns, int m,
                                        double factor, bool lower)
{
    for (int r = 0; r < rows; r++) {
        const int end = lower ? r + 1 : columns;
        for (int c = 0; c + 1 < end; c += 2) {
            fv_columns sum = A[r] * fv_columns_at(B + c);
            for (int k = 1; k < m; k++)
                sum += A[k * rows + r] * fv_columns_at(B + k * columns + c);
            *(fv_columns *)(out + r * stride + c) += factor * sum;
        }
        if (end % 2 == 0) continue;
        double sum = A[r] * B[end - 1];
        for (int k = 1; k < m; k++)
            sum += A[k * rows + r] * B[k * columns + end - 1];
        out[r * stride + end - 1] += factor * sum;
    }
}

/* out += factor M^T e. M is m x size. */
FV_BLOCK_INLINE void fv_block_add_vector(double *out, const double *M, int size, const double *e,
                                         int m, double factor)
{
    for (int c = 0; c + 1 < size; c += 2) {
        fv_columns sum = fv_columns_at(M + c) * e[0];
        for (int k = 1; k < m; k++)
            sum += fv_columns_at(M + k * size + c) * e[k];
        *(fv_columns *)(out + c) += factor * sum;
    }
    if (size % 2 == 0) return;
    double sum = M[size - 1] * e[0];
    for (int k = 1; k < m; k++)
        sum += M[k * size + size - 1] * e[k];
    out[size - 1] += factor * sum;
}

/* W J for a weight that all rows share. */
FV_BLOCK_INLINE void fv_block_weigh(const double *J, int values, double weight, double *WJ)
{
    for (int i = 0; i < values; i++)
        WJ[i] = weight * J[i];
}

/* ---- the reduced system ---------------------------------------------------------------------- */

struct fv_normal {
    double *H; /* size x size, row-major; lower triangle */
    double *g; /* size; NULL: not wanted, as for a covariance */
    int size;  /* [1, FV_NORMAL_SIZE_MAX] */
};

/* H = 0, g = 0. */
void fv_normal_clear(const struct fv_normal *normal);

/* Add a residual of m rows that depends on the variables [first, first + size), by J and W J (m x
 * size, row-major), inlined. One that depends on several blocks is added to each; the block of H
 * between two, a after b, is fv_block_add_inner of W J of a and J of b. Unless `damping` is NULL,
 * its product with what the residual adds to the diagonal is added as well: a system that is built
 * so needs no fv_normal_damp. */
FV_BLOCK_INLINE void fv_normal_add_one(const struct fv_normal *normal, int first, int size,
                                       const double *J, const double *WJ, const double *error,
                                       int m, const double *damping)
{
    double *H = normal->H + first * (normal->size + 1);
    if (normal->g) fv_block_add_vector(normal->g + first, WJ, size, error, m, -1);
    for (int r = 0; r < size; r++) {
        double *row = H + r * normal->size, own = WJ[r] * J[r];
        for (int c = 0; c < r; c += 2) {
            fv_columns sum = WJ[r] * (fv_columns){J[c], J[c + 1]};
            for (int k = 1; k < m; k++)
                sum += WJ[k * size + r] * (fv_columns){J[k * size + c], J[k * size + c + 1]};
            fv_columns value = fv_columns_at(row + c) + sum;
            if (damping && c + 1 == r) value[1] += *damping * sum[1];
            *(fv_columns *)(row + c) = value;
        }
        if (r % 2 == 1) continue;
        for (int k = 1; k < m; k++)
            own += WJ[k * size + r] * J[k * size + r];
        row[r] += own;
        if (damping) row[r] += *damping * own;
    }
}

/* The same, each row's product added on its own instead of their sum: rounds differently. */
FV_BLOCK_INLINE void fv_normal_add_rows(const struct fv_normal *normal, int first, int size,
                                        const double *J, const double *WJ, const double *error,
                                        int m)
{
    for (int r = 0; r < size; r++) {
        double *row = normal->H + (first + r) * normal->size + first, g = normal->g[first + r];
        for (int k = 0; k < m; k++)
            g -= WJ[k * size + r] * error[k];
        normal->g[first + r] = g;
        for (int c = 0; c <= r; c++) {
            double sum = row[c];
            for (int k = 0; k < m; k++)
                sum += WJ[k * size + r] * J[k * size + c];
            row[c] = sum;
        }
    }
}

/* diagonal = (1 + fraction) diagonal + extra. */
void fv_normal_damp(const struct fv_normal *normal, double fraction, double extra);

/* ---- landmarks: eliminated by the Schur complement ------------------------------------------- */

/* Block of H between a landmark and rows [first, first + size): landmark size x size, row-major. */
struct fv_coupling {
    const double *cross;
    int first, size; /* size times landmark size: at most FV_COUPLING_VALUES_MAX */
};

/* Subtract what elimination of a landmark takes from H and g. `inverse` is that of its own damped
 * block: 6 values xx xy xz yy yz zz of a landmark of 3, one value of a landmark of 1; `gradient`
 * its part of g. Couplings do not overlap; any order. */
void fv_normal_eliminate(const struct fv_normal *normal, int landmark_size, const double *inverse,
                         const double *gradient, const struct fv_coupling *couplings, int count);

/* Step of an eliminated landmark (`landmark_size` values) after `x`, the solution of the reduced
 * system. */
void fv_landmark_step(int landmark_size, const double *inverse, const double *gradient,
                      const struct fv_coupling *couplings, int count, const double *x,
                      double *step);

/* ---- solution -------------------------------------------------------------------------------- */

/* Factor H in place (fv_ldlt_factor; fv_ldlt_columns does it in units) and solve: x = H^-1 g.
 * False: the system is singular, not positive definite or not finite; x is then untouched. x may be
 * g. */
bool fv_normal_solve(const struct fv_normal *normal, double *x);

/* ---- damping --------------------------------------------------------------------------------- */

/* How Levenberg-Marquardt's damping changes: a step that lowers the cost multiplies it by `fall`
 * down to `floor`, one that does not makes it rise * damping + extra. */
struct fv_damping {
    double fall, floor, rise, extra;
};

static inline double fv_damping_lower(const struct fv_damping *d, double damping)
{
    const double lowered = damping * d->fall;
    return lowered > d->floor ? lowered : d->floor;
}

static inline double fv_damping_raise(const struct fv_damping *d, double damping)
{
    return damping * d->rise + d->extra;
}

#ifdef __cplusplus
}
#endif
#endif

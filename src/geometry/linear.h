/* Small dense symmetric systems, our own LDL^T: no pivoting, fixed order of operations. Real-time
 * safe. */
#ifndef FOVEA_GEOMETRY_LINEAR_H
#define FOVEA_GEOMETRY_LINEAR_H

#include <stdbool.h>

#ifdef __cplusplus
extern "C" {
#endif

enum { FV_LDLT_SIZE_MAX = 192, FV_EIGEN_SIZE_MAX = 4 };

/* Factor the symmetric positive definite n x n matrix A (row-major, lower triangle read) in place:
 * unit lower triangle L below the diagonal, D on it. False where a pivot is not safely positive. */
bool fv_ldlt_factor(double *A, int n);
/* The same for columns [first, end) after those before them, so that a factorisation can be cut
 * into units: column j costs (j + 1) (n - j) multiplications. */
bool fv_ldlt_columns(double *A, int n, int first, int end);
/* Solve with the factors, in place. */
void fv_ldlt_back(const double *A, int n, double *b);
/* Both: b becomes A^-1 b; A is overwritten. */
bool fv_ldlt_solve(double *A, int n, double *b);

/* Inverse of a symmetric 3x3 given as xx xy xz yy yz zz. False when it is not safely positive
 * definite. */
bool fv_invert_symmetric3(const double S[6], double inverse[6]);

/* The eigenvector h of length 1 of the least eigenvalue of a positive symmetric 9x9 matrix (lower
 * triangle read), by inverse iteration from a fixed start; A is overwritten. */
bool fv_smallest_vector9(double A[81], double h[9]);

/* Eigenvectors (rows of V, by falling eigenvalue) of a symmetric n x n matrix, n at most
 * FV_EIGEN_SIZE_MAX, by cyclic Jacobi rotations. */
void fv_eigen_symmetric(const double *S, int n, double *values, double *V);

#ifdef __cplusplus
}
#endif
#endif

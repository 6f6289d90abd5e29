#include "geometry/linear.h"

#include <string.h>

#include "geometry/vec.h"

bool fv_ldlt_columns(double *A, int n, int first, int end)
{
    double scaled[FV_LDLT_SIZE_MAX];
    for (int j = first; j < end; j++) {
        double *row = A + j * n;
        double before = row[j], d = before;
        for (int k = 0; k < j; k++) {
            scaled[k] = row[k] * A[k * n + k];
            d -= row[k] * scaled[k];
        }
        if (!(d > 1e-14 * before) || !(d > 0)) return false;
        row[j] = d;
        double inverse = 1 / d;
        for (int i = j + 1; i < n; i++) {
            double *below = A + i * n, sum = below[j];
            for (int k = 0; k < j; k++)
                sum -= below[k] * scaled[k];
            below[j] = sum * inverse;
        }
    }
    return true;
}

bool fv_ldlt_factor(double *A, int n)
{
    return fv_ldlt_columns(A, n, 0, n);
}

void fv_ldlt_back(const double *A, int n, double *b)
{
    for (int i = 0; i < n; i++)
        for (int k = 0; k < i; k++)
            b[i] -= A[i * n + k] * b[k];
    for (int i = 0; i < n; i++)
        b[i] /= A[i * n + i];
    for (int i = n - 1; i >= 0; i--)
        for (int k = i + 1; k < n; k++)
            b[i] -= A[k * n + i] * b[k];
}

bool fv_ldlt_solve(double *A, int n, double *b)
{
    if (!fv_ldlt_factor(A, n)) return false;
    fv_ldlt_back(A, n, b);
    return true;
}

bool fv_invert_symmetric3(const double S[6], double inverse[6])
{
    double a = S[3] * S[5] - S[4] * S[4], b = S[2] * S[4] - S[1] * S[5],
           c = S[1] * S[4] - S[2] * S[3];
    double determinant = S[0] * a + S[1] * b + S[2] * c;
    if (!(determinant > 1e-12 * fv_abs(S[0] * S[3] * S[5])) || !(determinant > 0)) return false;
    double d = 1 / determinant;
    inverse[0] = a * d;
    inverse[1] = b * d;
    inverse[2] = c * d;
    inverse[3] = (S[0] * S[5] - S[2] * S[2]) * d;
    inverse[4] = (S[1] * S[2] - S[0] * S[4]) * d;
    inverse[5] = (S[0] * S[3] - S[1] * S[1]) * d;
    return true;
}

/* Cosine and sine of the turn whose double has the cotangent theta. Beyond 2^27 and below 2^500 the
 * ones added to the squares of theta and t are rounded off, and the root of a rounded square is its
 * number again: what follows then without roots has the same bits. */
static inline void jacobi_turn(double theta, double *c, double *s)
{
    const double size = fv_abs(theta);
    if (size > 0x1p27 && size < 0x1p500) {
        *c = 1;
        *s = 1 / (theta + theta);
        return;
    }
    const double root = __builtin_sqrt(theta * theta + 1);
    const double t = 1 / (theta >= 0 ? theta + root : theta - root);
    *c = 1 / __builtin_sqrt(t * t + 1);
    *s = t * *c;
}

/* Rotate rows p and q of S and V so that S[p][q] vanishes. */
static inline __attribute__((always_inline)) void jacobi_rotate(double *S, double *V, int n, int p,
                                                                int q)
{
    double off = S[n * p + q], c, s;
    if (off == 0) return;
    jacobi_turn((S[n * q + q] - S[n * p + p]) / (2 * off), &c, &s);
    for (int k = 0; k < n; k++) {
        double a = S[n * k + p], b = S[n * k + q];
        S[n * k + p] = c * a - s * b;
        S[n * k + q] = s * a + c * b;
    }
    for (int k = 0; k < n; k++) {
        double a = S[n * p + k], b = S[n * q + k], x = V[n * p + k], y = V[n * q + k];
        S[n * p + k] = c * a - s * b;
        S[n * q + k] = s * a + c * b;
        V[n * p + k] = c * x - s * y;
        V[n * q + k] = s * x + c * y;
    }
}

/* Inlined, so that constant sizes unroll. */
static inline __attribute__((always_inline)) void jacobi_sweeps(double *S, double *V, int n)
{
    for (int sweep = 0; sweep < 8; sweep++)
        for (int p = 0; p < n - 1; p++)
            for (int q = p + 1; q < n; q++)
                jacobi_rotate(S, V, n, p, q);
}

void fv_eigen_symmetric(const double *input, int n, double *values, double *V)
{
    double S[FV_EIGEN_SIZE_MAX * FV_EIGEN_SIZE_MAX], W[FV_EIGEN_SIZE_MAX * FV_EIGEN_SIZE_MAX] = {0};
    memcpy(S, input, (size_t)(n * n) * sizeof *S);
    for (int k = 0; k < n; k++)
        W[(n + 1) * k] = 1;
    if (n == 3)
        jacobi_sweeps(S, W, 3);
    else if (n == 4)
        jacobi_sweeps(S, W, 4);
    else
        jacobi_sweeps(S, W, n);
    bool taken[FV_EIGEN_SIZE_MAX] = {false};
    for (int row = 0; row < n; row++) { /* equal ones in the order in which they stand */
        int best = -1;
        for (int k = 0; k < n; k++)
            if (!taken[k] && (best < 0 || S[(n + 1) * k] > S[(n + 1) * best])) best = k;
        taken[best] = true;
        values[row] = S[(n + 1) * best];
        memcpy(V + n * row, W + n * best, (size_t)n * sizeof *V);
    }
}

bool fv_smallest_vector9(double A[81], double h[9])
{
    double trace = 0;
    for (int i = 0; i < 9; i++)
        trace += A[10 * i];
    for (int i = 0; i < 9; i++) {
        A[10 * i] += 1e-12 * trace;
        h[i] = i % 4 == 0 ? 1 : 0.1;
    }
    if (!fv_ldlt_factor(A, 9)) return false;
    for (int step = 0; step < 5; step++) {
        double square = 0;
        fv_ldlt_back(A, 9, h);
        for (int i = 0; i < 9; i++)
            square += h[i] * h[i];
        if (!(square > 0 && square < 1e300)) return false;
        double scale = 1 / __builtin_sqrt(square);
        for (int i = 0; i < 9; i++)
            h[i] *= scale;
    }
    return true;
}

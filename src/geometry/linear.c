#include "geometry/linear.h"

#include <string.h>

#include "geometry/vec.h"

bool fv_ldlt_factor(double *A, int n)
{
    double scaled[FV_LDLT_SIZE_MAX];
    for (int j = 0; j < n; j++) {
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
    double a = S[3] * S[5] - S[4] * S[4], b = S[2] * S[4] - S[1] * S[5], c = S[1] * S[4] - S[2] * S[3];
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

/* Rotate rows p and q of S and V so that S[p][q] vanishes. */
static void fv_jacobi_rotate(double S[9], double V[9], int p, int q)
{
    double off = S[3 * p + q];
    if (off == 0) return;
    double theta = (S[4 * q] - S[4 * p]) / (2 * off), root = __builtin_sqrt(theta * theta + 1);
    double t = 1 / (theta >= 0 ? theta + root : theta - root), c = 1 / __builtin_sqrt(t * t + 1), s = t * c;
    for (int k = 0; k < 3; k++) {
        double a = S[3 * k + p], b = S[3 * k + q];
        S[3 * k + p] = c * a - s * b;
        S[3 * k + q] = s * a + c * b;
    }
    for (int k = 0; k < 3; k++) {
        double a = S[3 * p + k], b = S[3 * q + k], x = V[3 * p + k], y = V[3 * q + k];
        S[3 * p + k] = c * a - s * b;
        S[3 * q + k] = s * a + c * b;
        V[3 * p + k] = c * x - s * y;
        V[3 * q + k] = s * x + c * y;
    }
}

void fv_eigen_symmetric3(const double input[9], double values[3], double V[9])
{
    double S[9], W[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    memcpy(S, input, sizeof S);
    for (int sweep = 0; sweep < 8; sweep++) {
        fv_jacobi_rotate(S, W, 0, 1);
        fv_jacobi_rotate(S, W, 0, 2);
        fv_jacobi_rotate(S, W, 1, 2);
    }
    int order[3] = {0, 1, 2};
    for (int a = 0; a < 2; a++)
        for (int b = 0; b < 2 - a; b++)
            if (S[4 * order[b]] < S[4 * order[b + 1]]) {
                int swap = order[b];
                order[b] = order[b + 1];
                order[b + 1] = swap;
            }
    for (int k = 0; k < 3; k++) {
        values[k] = S[4 * order[k]];
        memcpy(V + 3 * k, W + 3 * order[k], 3 * sizeof *V);
    }
}

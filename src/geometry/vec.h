/* Vectors of 3 and row-major 3x3 matrices in double precision, as small functions that compilers
 * inline. Outputs may not be the same storage as inputs unless a line says so. Real-time safe, any
 * thread. */
#ifndef FOVEA_GEOMETRY_VEC_H
#define FOVEA_GEOMETRY_VEC_H

#include <stdbool.h>

static inline double fv_dot3(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static inline double fv_norm3(const double a[3])
{
    return __builtin_sqrt(fv_dot3(a, a));
}

static inline void fv_cross3(const double a[3], const double b[3], double out[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

static inline void fv_copy3(const double a[3], double out[3])
{
    out[0] = a[0];
    out[1] = a[1];
    out[2] = a[2];
}

static inline void fv_subtract3(const double a[3], const double b[3], double out[3])
{
    out[0] = a[0] - b[0];
    out[1] = a[1] - b[1];
    out[2] = a[2] - b[2];
}

/* In place: the part of v along a unit vector. */
static inline void fv_keep_along3(const double axis[3], double v[3])
{
    const double along = fv_dot3(axis, v);
    for (int i = 0; i < 3; i++)
        v[i] = along * axis[i];
}

/* In place; false (and untouched) for a vector too short to have a direction. */
static inline bool fv_normalise3(double a[3])
{
    double n = fv_norm3(a);
    if (!(n > 1e-150)) return false;
    a[0] /= n;
    a[1] /= n;
    a[2] /= n;
    return true;
}

/* out = M v */
static inline void fv_rotate3(const double M[9], const double v[3], double out[3])
{
    out[0] = M[0] * v[0] + M[1] * v[1] + M[2] * v[2];
    out[1] = M[3] * v[0] + M[4] * v[1] + M[5] * v[2];
    out[2] = M[6] * v[0] + M[7] * v[1] + M[8] * v[2];
}

/* out = M^T v */
static inline void fv_rotate_back3(const double M[9], const double v[3], double out[3])
{
    out[0] = M[0] * v[0] + M[3] * v[1] + M[6] * v[2];
    out[1] = M[1] * v[0] + M[4] * v[1] + M[7] * v[2];
    out[2] = M[2] * v[0] + M[5] * v[1] + M[8] * v[2];
}

static inline void fv_multiply33(const double A[9], const double B[9], double out[9])
{
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++)
            out[3 * r + c] = A[3 * r] * B[c] + A[3 * r + 1] * B[3 + c] + A[3 * r + 2] * B[6 + c];
}

/* out = A^T B */
static inline void fv_multiply_back33(const double A[9], const double B[9], double out[9])
{
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++)
            out[3 * r + c] = A[r] * B[c] + A[3 + r] * B[3 + c] + A[6 + r] * B[6 + c];
}

/* out = A B^T */
static inline void fv_multiply33_transposed(const double A[9], const double B[9], double out[9])
{
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++)
            out[3 * r + c] = fv_dot3(A + 3 * r, B + 3 * c);
}

static inline double fv_determinant33(const double M[9])
{
    return M[0] * (M[4] * M[8] - M[5] * M[7]) - M[1] * (M[3] * M[8] - M[5] * M[6]) +
           M[2] * (M[3] * M[7] - M[4] * M[6]);
}

static inline double fv_abs(double a)
{
    return a < 0 ? -a : a;
}

#endif

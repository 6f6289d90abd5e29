/* The radial-tangential lens on the plane at distance 1 (fovea/camera.h), and the steps of its
 * inversion, as small functions that compilers inline: for one point (camera.c), or for as many as
 * a vector holds (drivers/sim/rays.c), with the same bits. Coefficients `k` as in struct
 * fovea_camera. Real-time safe, any thread. */
#ifndef FOVEA_GEOMETRY_RADTAN_H
#define FOVEA_GEOMETRY_RADTAN_H

#include <stdbool.h>

/* Most steps to the radius, and on the plane from there. */
enum { FV_RADTAN_RADIAL_STEPS = 60, FV_RADTAN_PLANE_STEPS = 20 };

#define FV_RADTAN_INLINE static inline __attribute__((always_inline))

/* Radial factor at the squared radius r2 and its derivative by r2, of lenses without the rational
 * terms k4 k5 k6: the upper polynomial. */
FV_RADTAN_INLINE void fv_radtan_above(const double *k, double r2, double *scale, double *derivative)
{
    *scale = 1 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]));
    *derivative = k[0] + r2 * (2 * k[1] + r2 * 3 * k[4]);
}

/* Distorted place of (x, y), whose squared radius is r2, given the radial factor there. */
FV_RADTAN_INLINE void fv_radtan_place(const double *k, double x, double y, double r2, double scale,
                                      double *u, double *v)
{
    const double p1 = k[2], p2 = k[3];
    *u = x * scale + 2 * p1 * x * y + p2 * (r2 + 2 * x * x);
    *v = y * scale + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y;
}

/* Derivative of that place by (x, y), which is symmetric. */
FV_RADTAN_INLINE void fv_radtan_slopes(const double *k, double x, double y, double scale,
                                       double derivative, double *xx, double *xy, double *yy)
{
    const double p1 = k[2], p2 = k[3];
    *xx = scale + 2 * x * x * derivative + 2 * p1 * y + 6 * p2 * x;
    *xy = 2 * x * y * derivative + 2 * p1 * x + 2 * p2 * y;
    *yy = scale + 2 * y * y * derivative + 6 * p1 * y + 2 * p2 * x;
}

/* How far the radial distortion of r is from `distorted`, and its derivative by r. */
FV_RADTAN_INLINE void fv_radtan_radial_error(double r, double distorted, double scale,
                                             double derivative, double *error, double *slope)
{
    *error = r * scale - distorted;
    *slope = scale + 2 * r * r * derivative;
}

/* Whether a step of `moved` to the radius r was the last. */
FV_RADTAN_INLINE bool fv_radtan_radius_found(double moved, double r)
{
    return (moved < 1e-13 * (1 + r)) & (moved > -1e-13 * (1 + r));
}

/* Whether a point of the plane is the one that is sought: its place is `miss` squared from the one
 * at the distance `distorted`. */
FV_RADTAN_INLINE bool fv_radtan_point_found(double miss, double distorted)
{
    return miss <= 1e-28 * (1 + distorted * distorted);
}

/* Newton's step by the miss (a, b) and the determinant of the slopes. */
FV_RADTAN_INLINE void fv_radtan_move(double a, double b, double xx, double xy, double yy,
                                     double determinant, double *x, double *y)
{
    *x += (yy * a - xy * b) / determinant;
    *y += (xx * b - xy * a) / determinant;
}

#endif

/* A measured inverse distance: what a second camera at a known place says of a feature of the
 * first.
 *
 * The point that the feature with the unit bearing b shows lies at b / value. Inverse distance is
 * what a disparity measures linearly: its error is Gaussian where that of the distance is not, and
 * a point too far to be measured has a value near 0 with an ordinary error (J. Civera, A. Davison
 * and J. Montiel, "Inverse depth parametrization for monocular SLAM", T-RO 2008). The second
 * camera compares the same patch of the picture, so this error is independent of that of the
 * feature's own position, and one number is all that the second observation adds. Real-time safe,
 * any thread. */
#ifndef FOVEA_GEOMETRY_INVERSE_DISTANCE_H
#define FOVEA_GEOMETRY_INVERSE_DISTANCE_H

#include <stdbool.h>

#include "geometry/vec.h"

struct fv_inverse_distance {
    float value;  /* 1 / metres along the bearing; may be slightly negative */
    float weight; /* 1 / variance; 0: not measured */
};

/* Squared errors, in units of their variance, that 95 % of good measurements stay below
 * (chi-square, 1 degree of freedom). */
#define FV_CHI_SQUARE_95_1 3.841

/* Error of a measurement of the point q (camera frame, metres), and its derivative by q. False:
 * nothing is measured, or the point lies behind. */
static inline bool fv_inverse_distance_error(const struct fv_inverse_distance *m,
                                             const double bearing[3], const double q[3],
                                             double *error, double J[3])
{
    const double along = fv_dot3(bearing, q);
    if (!(m->weight > 0) || !(along > 1e-9)) return false;
    const double inverse = 1 / along;
    *error = inverse - (double)m->value;
    for (int i = 0; i < 3; i++)
        J[i] = -inverse * inverse * bearing[i];
    return true;
}

/* Key points are weighted as if they erred by one pixel of their level, which leaves their unit to
 * what a fit finds: 0.1 to 0.3 px^2 in simulation and on recordings. Weights of measured distances
 * are true ones; this brings them to that unit where both meet. */
#define FV_INVERSE_DISTANCE_UNIT 0.2

/* Weight of an error beside those of key points, after Huber: full up to the bound above. */
static inline double fv_inverse_distance_robust(const struct fv_inverse_distance *m, double error)
{
    const double square = (double)m->weight * error * error;
    return FV_INVERSE_DISTANCE_UNIT * (double)m->weight *
           (square > FV_CHI_SQUARE_95_1 ? __builtin_sqrt(FV_CHI_SQUARE_95_1 / square) : 1);
}

/* Its cost beside theirs, likewise. */
static inline double fv_inverse_distance_cost(const struct fv_inverse_distance *m, double error)
{
    const double square = (double)m->weight * error * error;
    return FV_INVERSE_DISTANCE_UNIT *
           (square > FV_CHI_SQUARE_95_1
                ? 2 * __builtin_sqrt(FV_CHI_SQUARE_95_1 * square) - FV_CHI_SQUARE_95_1
                : square);
}

/* Whether the distance is known to one part in `parts` (1 sigma). */
static inline bool fv_inverse_distance_known(const struct fv_inverse_distance *m, double parts)
{
    const double value = (double)m->value;
    return m->weight > 0 && value > 0 && value * value * (double)m->weight > parts * parts;
}

#endif

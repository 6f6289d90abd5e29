/* The quadratic through the 27 values around a place in position and scale (Brown and Lowe,
 * "Invariant features from interest point groups", BMVC 2002). */
#ifndef FOVEA_FEATURES_QUADRATIC_H
#define FOVEA_FEATURES_QUADRATIC_H

#include <stdbool.h>

struct fv_quadratic {
    double gradient[3]; /* along x, y, layer */
    double xx, yy, ss, xy, xs, ys;
};

/* values[layer][row][column]. Real-time safe. */
void fv_quadratic_fit(const double values[3][3][3], struct fv_quadratic *q);

/* Where it has its extreme, from the middle: x, y, layer; false where it has none. Real-time safe.
 */
bool fv_quadratic_extreme(const struct fv_quadratic *q, double at[3]);

#endif

#include "features/quadratic.h"

void fv_quadratic_fit(const double values[3][3][3], struct fv_quadratic *q)
{
    const double(*a)[3] = values[0], (*b)[3] = values[1], (*c)[3] = values[2];
    const double centre = 2 * b[1][1];
    q->gradient[0] = (b[1][2] - b[1][0]) / 2;
    q->gradient[1] = (b[2][1] - b[0][1]) / 2;
    q->gradient[2] = (c[1][1] - a[1][1]) / 2;
    q->xx = b[1][2] + b[1][0] - centre;
    q->yy = b[2][1] + b[0][1] - centre;
    q->ss = c[1][1] + a[1][1] - centre;
    q->xy = (b[2][2] - b[2][0] - b[0][2] + b[0][0]) / 4;
    q->xs = (c[1][2] - c[1][0] - a[1][2] + a[1][0]) / 4;
    q->ys = (c[2][1] - c[0][1] - a[2][1] + a[0][1]) / 4;
}

bool fv_quadratic_extreme(const struct fv_quadratic *q, double at[3])
{
    const double c00 = q->yy * q->ss - q->ys * q->ys, c01 = q->xs * q->ys - q->xy * q->ss;
    const double c02 = q->xy * q->ys - q->xs * q->yy, c11 = q->xx * q->ss - q->xs * q->xs;
    const double c12 = q->xy * q->xs - q->xx * q->ys, c22 = q->xx * q->yy - q->xy * q->xy;
    const double determinant = q->xx * c00 + q->xy * c01 + q->xs * c02;
    const double *g = q->gradient;
    if (determinant > -1e-12 && determinant < 1e-12) return false;
    at[0] = -(c00 * g[0] + c01 * g[1] + c02 * g[2]) / determinant;
    at[1] = -(c01 * g[0] + c11 * g[1] + c12 * g[2]) / determinant;
    at[2] = -(c02 * g[0] + c12 * g[1] + c22 * g[2]) / determinant;
    return true;
}

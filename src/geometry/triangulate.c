#include "geometry/triangulate.h"

#include "geometry/vec.h"

bool fv_triangulate(const struct fv_se3 *T, const double x1[3], const double x2[3], double point[3],
                    double *cos_parallax)
{
    double q[3];
    fv_rotate3(T->R, x1, q);
    double c = fv_dot3(q, x2), a = fv_dot3(q, T->t), b = fv_dot3(x2, T->t), square = 1 - c * c;
    if (!(square > 1e-12)) return false;
    /* Depths of the shortest segment between the rays d1 q + t and d2 x2. */
    double d1 = (c * b - a) / square, d2 = (b - c * a) / square;
    if (!(d1 > 0 && d2 > 0)) return false;
    /* On it, errors e1 + e2 = gap with e1/d1, e2/d2 the angles: e1^2/d1^2 + e2^2/d2^2 is least at
     * e1 ~ d1^2.
     */
    double fraction = d1 * d1 / (d1 * d1 + d2 * d2), in_2[3], moved[3];
    for (int i = 0; i < 3; i++) {
        double on_1 = d1 * q[i] + T->t[i], on_2 = d2 * x2[i];
        in_2[i] = on_1 + fraction * (on_2 - on_1);
        moved[i] = in_2[i] - T->t[i];
    }
    fv_rotate_back3(T->R, moved, point);
    *cos_parallax = c;
    return true;
}

/* Best similarity transform between two point sets, from sums (Umeyama, PAMI 1991). */
#include <string.h>

#include "app/run/trajectory.h"
#include "geometry/linear.h"
#include "geometry/vec.h"

/* u = H v, normalised and made orthogonal to `other` (or NULL); any such direction where H v
 * vanishes. Returns |H v|. */
static double image_of(const double H[9], const double v[3], const double other[3],
                       double floor_norm, double u[3])
{
    for (int i = 0; i < 3; i++)
        u[i] = fv_dot3(H + 3 * i, v);
    const double length = __builtin_sqrt(fv_dot3(u, u));
    if (length <= floor_norm) {
        const double axis[3] = {other == NULL || other[0] * other[0] < 0.5,
                                other != NULL && other[0] * other[0] >= 0.5, 0};
        memcpy(u, axis, sizeof axis);
    }
    const double along = other != NULL ? fv_dot3(u, other) : 0.0;
    for (int i = 0; i < 3; i++)
        u[i] -= other != NULL ? along * other[i] : 0.0;
    const double norm = __builtin_sqrt(fv_dot3(u, u));
    for (int i = 0; i < 3; i++)
        u[i] /= norm;
    return length;
}

void fv_similarity_add(struct fv_similarity_sums *sums, const double p[3], const double q[3])
{
    for (int i = 0; i < 3; i++) {
        sums->p[i] += p[i];
        sums->q[i] += q[i];
        sums->pp += p[i] * p[i];
        sums->qq += q[i] * q[i];
        for (int j = 0; j < 3; j++)
            sums->qp[3 * i + j] += q[i] * p[j];
    }
    sums->n += 1.0;
}

bool fv_similarity_fit(const struct fv_similarity_sums *sums, double *scale, double rotation[9],
                       double translation[3], double *rms)
{
    const double n = sums->n;
    if (!(n >= 1.0)) return false;
    double H[9], S[9], values[3], V[9], u[3][3], v3[3];
    const double pp = sums->pp / n - fv_dot3(sums->p, sums->p) / (n * n),
                 qq = sums->qq / n - fv_dot3(sums->q, sums->q) / (n * n);
    if (!(pp > 1e-18 * sums->pp) || !(pp > 0.0)) return false;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            H[3 * i + j] = sums->qp[3 * i + j] / n - sums->q[i] * sums->p[j] / (n * n);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            S[3 * i + j] = H[i] * H[j] + H[3 + i] * H[3 + j] + H[6 + i] * H[6 + j];
    fv_eigen_symmetric(S, 3, values, V);
    /* The two largest directions fix the rotation; the third follows as the right-handed one on
     * both sides.
     */
    const double first = image_of(H, V, NULL, 0.0, u[0]);
    const double second = image_of(H, V + 3, u[0], 1e-12 * first, u[1]);
    fv_cross3(u[0], u[1], u[2]);
    fv_cross3(V, V + 3, v3);
    double third = 0.0;
    for (int i = 0; i < 3; i++)
        third += u[2][i] * fv_dot3(H + 3 * i, v3); /* negative for a reflection */
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            rotation[3 * i + j] = u[0][i] * V[j] + u[1][i] * V[3 + j] + u[2][i] * v3[j];
    const double trace = first + second + third;
    *scale = trace / pp;
    for (int i = 0; i < 3; i++)
        translation[i] = sums->q[i] / n - *scale * fv_dot3(rotation + 3 * i, sums->p) / n;
    const double left = qq - trace * trace / pp;
    *rms = __builtin_sqrt(left > 0.0 ? left : 0.0);
    return true;
}

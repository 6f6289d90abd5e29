/* Three depths from the law of cosines in three triangles, as homogeneous cones: one root of a
 * cubic makes a member of their pencil degenerate, which splits into two planes, each of which
 * leaves a quadratic. */
#include "geometry/pose.h"

#include <string.h>

#include "geometry/polynomial.h"
#include "geometry/vec.h"

struct triangle {
    double b12, b13, b23; /* cosines between bearings */
    double a12, a13, a23; /* squared distances between points */
};

/* Gauss-Newton on the three law-of-cosines equations: the depths come out to full precision. */
static bool polish(const struct triangle *g, double d[3])
{
    for (int i = 0; i < 3; i++) {
        double r1 = d[0] * d[0] - 2 * g->b12 * d[0] * d[1] + d[1] * d[1] - g->a12;
        double r2 = d[0] * d[0] - 2 * g->b13 * d[0] * d[2] + d[2] * d[2] - g->a13;
        double r3 = d[1] * d[1] - 2 * g->b23 * d[1] * d[2] + d[2] * d[2] - g->a23;
        double j11 = 2 * (d[0] - g->b12 * d[1]), j12 = 2 * (d[1] - g->b12 * d[0]);
        double j21 = 2 * (d[0] - g->b13 * d[2]), j23 = 2 * (d[2] - g->b13 * d[0]);
        double j32 = 2 * (d[1] - g->b23 * d[2]), j33 = 2 * (d[2] - g->b23 * d[1]);
        double determinant = -j11 * j23 * j32 - j12 * j21 * j33;
        if (!(fv_abs(determinant) > 1e-30)) return i > 0;
        double inverse = 1 / determinant;
        d[0] -= inverse * (-j23 * j32 * r1 - j12 * j33 * r2 + j12 * j23 * r3);
        d[1] -= inverse * (-j21 * j33 * r1 + j11 * j33 * r2 - j11 * j23 * r3);
        d[2] -= inverse * (j21 * j32 * r1 - j11 * j32 * r2 - j12 * j21 * r3);
    }
    return d[0] > 0 && d[1] > 0 && d[2] > 0;
}

/* Rigid motion that takes the triangle of world points onto the one of camera points. */
static bool align(const double points[3][3], const double bearings[3][3], const double d[3],
                  struct fv_se3 *T)
{
    double Y[3][3], w1[3], w2[3], w3[3], c1[3], c2[3], c3[3];
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < 3; i++)
            Y[k][i] = d[k] * bearings[k][i];
    fv_subtract3(points[1], points[0], w1);
    fv_subtract3(points[2], points[0], w2);
    fv_subtract3(Y[1], Y[0], c1);
    fv_subtract3(Y[2], Y[0], c2);
    fv_cross3(w1, w2, w3);
    fv_cross3(c1, c2, c3);
    /* Orthonormal frames along the first edge and the normal. */
    if (!fv_normalise3(w1) || !fv_normalise3(w3) || !fv_normalise3(c1) || !fv_normalise3(c3))
        return false;
    fv_cross3(w3, w1, w2);
    fv_cross3(c3, c1, c2);
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++)
            T->R[3 * r + c] = c1[r] * w1[c] + c2[r] * w2[c] + c3[r] * w3[c];
    double q[3];
    fv_rotate3(T->R, points[0], q);
    fv_subtract3(Y[0], q, T->t);
    return true;
}

/* Depths for one plane d1 = w0 d2 + w1 d3, by a quadratic in tau = d3 / d2. */
static int plane_depths(const struct triangle *g, double w0, double w1, double depths[][3])
{
    double difference = g->a13 - g->a12;
    double a = difference * w1 * w1 + 2 * g->a12 * g->b13 * w1 - g->a12;
    double b = 2 * (difference * w0 * w1 - g->a13 * g->b12 * w1 + g->a12 * g->b13 * w0);
    double c = difference * w0 * w0 - 2 * g->a13 * g->b12 * w0 + g->a13;
    double discriminant = b * b - 4 * a * c;
    if (!(discriminant >= 0)) return 0;
    double root = __builtin_sqrt(discriminant), q = -0.5 * (b >= 0 ? b + root : b - root);
    const double taus[2] = {a != 0 ? q / a : 0, q != 0 ? c / q : 0};
    int count = 0;
    for (int k = 0; k < 2; k++) {
        double tau = taus[k], below = tau * (tau - 2 * g->b23) + 1;
        if (!(tau > 0 && below > 0)) continue;
        double d2 = __builtin_sqrt(g->a23 / below), d1 = (w0 + w1 * tau) * d2;
        if (!(d1 > 0)) continue;
        depths[count][0] = d1;
        depths[count][1] = d2;
        depths[count][2] = tau * d2;
        count++;
    }
    return count;
}

/* Adjugate of a symmetric matrix. */
static void adjugate(const double S[9], double out[9])
{
    fv_cross3(S + 3, S + 6, out);
    fv_cross3(S + 6, S, out + 3);
    fv_cross3(S, S + 3, out + 6);
}

/* The two planes of a degenerate cone S (J. Richter-Gebert, "Perspectives on projective geometry",
 * 2011, 11.1): its adjugate is -p p^T with p their common line, and S + [p]x has rank one. False
 * when they are not real. */
static bool split(const double S[9], double plane1[3], double plane2[3])
{
    double B[9];
    adjugate(S, B);
    int at = B[0] < B[4] ? (B[0] < B[8] ? 0 : 2) : (B[4] < B[8] ? 1 : 2);
    if (!(B[4 * at] < 0)) return false;
    double beta = 1 / __builtin_sqrt(-B[4 * at]), p[3];
    for (int i = 0; i < 3; i++)
        p[i] = B[3 * i + at] * beta;
    const double C[9] = {S[0],        S[1] - p[2], S[2] + p[1], S[3] + p[2], S[4],
                         S[5] - p[0], S[6] - p[1], S[7] + p[0], S[8]};
    int largest = 0;
    for (int i = 1; i < 9; i++)
        if (fv_abs(C[i]) > fv_abs(C[largest])) largest = i;
    for (int i = 0; i < 3; i++) {
        plane1[i] = C[3 * (largest / 3) + i];
        plane2[i] = C[3 * i + largest % 3];
    }
    return true;
}

/* Real roots of the cubic c3 g^3 + c2 g^2 + c1 g + c0. */
static int cubic_roots(double c3, double c2, double c1, double c0, double roots[3])
{
    if (!(fv_abs(c3) > 1e-300)) return 0;
    double b = c2 / c3, c = c1 / c3, d = c0 / c3, g = fv_cubic_root(b, c, d);
    roots[0] = g;
    double half = 0.5 * (b + g), rest = c + g * (b + g), discriminant = half * half - rest;
    if (!(discriminant >= 0)) return 1;
    double root = __builtin_sqrt(discriminant);
    roots[1] = -half - root;
    roots[2] = -half + root;
    return 3;
}

/* Cones D1 = a23 M12 - a12 M23 and D2 = a23 M13 - a13 M23 that hold the depths, and a plane pair of
 * their pencil. */
static bool pencil_planes(const struct triangle *g, double plane1[3], double plane2[3])
{
    const double D1[9] = {g->a23,          -g->b12 * g->a23, 0, -g->b12 * g->a23,
                          g->a23 - g->a12, g->b23 * g->a12,  0, g->b23 * g->a12,
                          -g->a12};
    const double D2[9] = {g->a23,           0,
                          -g->b13 * g->a23, 0,
                          -g->a13,          g->b23 * g->a13,
                          -g->b13 * g->a23, g->b23 * g->a13,
                          g->a23 - g->a13};
    double adj1[9], adj2[9], c1 = 0, c2 = 0, roots[3], S[9];
    adjugate(D1, adj1);
    adjugate(D2, adj2);
    for (int i = 0; i < 9; i++) {
        c1 += adj1[i] * D2[i];
        c2 += D1[i] * adj2[i];
    }
    int count = cubic_roots(fv_determinant33(D2), c2, c1, fv_determinant33(D1), roots);
    for (int k = 0; k < count; k++) {
        for (int i = 0; i < 9; i++)
            S[i] = D1[i] + roots[k] * D2[i];
        if (split(S, plane1, plane2)) return true;
    }
    return false;
}

static double distance2(const double a[3], const double b[3])
{
    double d[3];
    fv_subtract3(a, b, d);
    return fv_dot3(d, d);
}

int fv_p3p(const double y[3][3], const double x[3][3], struct fv_se3 T[FV_P3P_SOLUTIONS_MAX])
{
    const struct triangle g = {fv_dot3(y[0], y[1]),   fv_dot3(y[0], y[2]),   fv_dot3(y[1], y[2]),
                               distance2(x[0], x[1]), distance2(x[0], x[2]), distance2(x[1], x[2])};
    double planes[2][3], depths[4][3];
    if (!(g.a12 > 0 && g.a13 > 0 && g.a23 > 0) || !pencil_planes(&g, planes[0], planes[1]))
        return 0;
    int candidates = 0, found = 0;
    for (int k = 0; k < 2; k++)
        if (planes[k][0] != 0)
            candidates += plane_depths(&g, -planes[k][1] / planes[k][0],
                                       -planes[k][2] / planes[k][0], depths + candidates);
    for (int k = 0; k < candidates; k++)
        found += polish(&g, depths[k]) && align(x, y, depths[k], &T[found]);
    return found;
}

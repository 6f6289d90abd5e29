/* Nister's five-point solver: null space of the five epipolar constraints, ten cubic constraints on
 * its four coordinates, elimination to a polynomial of degree ten in one of them. */
#include "geometry/essential.h"

#include <string.h>

#include "geometry/polynomial.h"
#include "geometry/vec.h"

/* Monomials of degree up to three in x, y, z in the order of the elimination. */
enum monomial {
    XXX,
    YYY,
    XXY,
    XYY,
    XXZ,
    XX,
    YYZ,
    YY,
    XYZ,
    XY,
    XZZ,
    XZ,
    X,
    YZZ,
    YZ,
    Y,
    ZZZ,
    ZZ,
    Z,
    ONE,
    MONOMIALS
};

/* Degree-one (x y z 1), degree-two (xx xy xz x yy yz y zz z 1) index tables for products. */
static const uint8_t product_11[4][4] = {{0, 1, 2, 3}, {1, 4, 5, 6}, {2, 5, 7, 8}, {3, 6, 8, 9}};
static const uint8_t product_21[10][4] = {
    {XXX, XXY, XXZ, XX}, {XXY, XYY, XYZ, XY}, {XXZ, XYZ, XZZ, XZ}, {XX, XY, XZ, X},
    {XYY, YYY, YYZ, YY}, {XYZ, YYZ, YZZ, YZ}, {XY, YY, YZ, Y},     {XZZ, YZZ, ZZZ, ZZ},
    {XZ, YZ, ZZ, Z},     {X, Y, Z, ONE}};

static void add_product_11(const double a[4], const double b[4], double factor, double out[10])
{
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 4; j++)
            out[product_11[i][j]] += factor * a[i] * b[j];
}

static void add_product_21(const double a[10], const double b[4], double out[MONOMIALS])
{
    for (int i = 0; i < 10; i++)
        for (int j = 0; j < 4; j++)
            out[product_21[i][j]] += a[i] * b[j];
}

/* Orthonormal basis of the vectors orthogonal to five rows of nine: Householder reflections.
 * basis[k] is a column. */
static bool null_space(const struct fv_pair pairs[5], double basis[4][9])
{
    double A[5][9];
    for (int i = 0; i < 5; i++)
        for (int r = 0; r < 3; r++)
            for (int c = 0; c < 3; c++)
                A[i][3 * r + c] = pairs[i].x2[r] * pairs[i].x1[c];
    double v[5][9], scale[5]; /* reflections */
    for (int k = 0; k < 5; k++) {
        double norm2 = 0;
        for (int i = k; i < 9; i++)
            norm2 += A[k][i] * A[k][i];
        if (!(norm2 > 1e-18)) return false;
        double norm = __builtin_sqrt(norm2), alpha = A[k][k] > 0 ? -norm : norm;
        for (int i = 0; i < 9; i++)
            v[k][i] = i < k ? 0 : A[k][i];
        v[k][k] -= alpha;
        scale[k] = 1 / (norm2 - alpha * A[k][k]);
        for (int row = k + 1; row < 5; row++) {
            double dot = 0;
            for (int i = k; i < 9; i++)
                dot += v[k][i] * A[row][i];
            dot *= scale[k];
            for (int i = k; i < 9; i++)
                A[row][i] -= dot * v[k][i];
        }
    }
    for (int b = 0; b < 4; b++) {
        for (int i = 0; i < 9; i++)
            basis[b][i] = i == 5 + b;
        for (int k = 4; k >= 0; k--) {
            double dot = 0;
            for (int i = k; i < 9; i++)
                dot += v[k][i] * basis[b][i];
            dot *= scale[k];
            for (int i = k; i < 9; i++)
                basis[b][i] -= dot * v[k][i];
        }
    }
    return true;
}

/* The ten cubic constraints: det E = 0 and E E^T E - tr(E E^T) E / 2 = 0; e[i] holds E's entry i as
 * (x y z 1). */
static void constraints(const double e[9][4], double C[10][MONOMIALS])
{
    memset(C, 0, 10 * sizeof *C);
    for (int i = 0; i < 3; i++) { /* determinant by cofactors of the first row */
        int a = (i + 1) % 3, b = (i + 2) % 3;
        double minor[10] = {0};
        add_product_11(e[3 + a], e[6 + b], 1, minor);
        add_product_11(e[3 + b], e[6 + a], -1, minor);
        add_product_21(minor, e[i], C[0]);
    }
    double G[3][3][10] = {{{0}}}; /* E E^T */
    for (int r = 0; r < 3; r++)
        for (int c = r; c < 3; c++)
            for (int k = 0; k < 3; k++)
                add_product_11(e[3 * r + k], e[3 * c + k], 1, G[r][c]);
    for (int i = 0; i < 10; i++) {
        double half_trace = 0.5 * (G[0][0][i] + G[1][1][i] + G[2][2][i]);
        for (int r = 0; r < 3; r++)
            G[r][r][i] -= half_trace;
        G[1][0][i] = G[0][1][i];
        G[2][0][i] = G[0][2][i];
        G[2][1][i] = G[1][2][i];
    }
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++)
            for (int k = 0; k < 3; k++)
                add_product_21(G[r][k], e[3 * k + c], C[1 + 3 * r + c]);
}

/* Gauss-Jordan with row pivoting; rows 4..9 end up as leading monomial plus the last ten columns.
 */
static bool eliminate(double C[10][MONOMIALS])
{
    for (int k = 0; k < 10; k++) {
        int pivot = k;
        for (int r = k + 1; r < 10; r++)
            if (fv_abs(C[r][k]) > fv_abs(C[pivot][k])) pivot = r;
        if (!(fv_abs(C[pivot][k]) > 1e-14)) return false;
        if (pivot != k)
            for (int c = k; c < MONOMIALS; c++) {
                double swap = C[k][c];
                C[k][c] = C[pivot][c];
                C[pivot][c] = swap;
            }
        double inverse = 1 / C[k][k];
        for (int c = k; c < MONOMIALS; c++)
            C[k][c] *= inverse;
        /* Rows 0..3 are never read, so they need no clearing above the diagonal. */
        for (int r = k < 4 ? k + 1 : 4; r < 10; r++) {
            double factor = C[r][k];
            if (r == k || factor == 0) continue;
            for (int c = k; c < MONOMIALS; c++)
                C[r][c] -= factor * C[k][c];
        }
    }
    return true;
}

/* One row of Nister's B(z): row `a` minus z times row `b`, as polynomials in z for x, y (degree 3)
 * and 1 (degree 4). */
static void reduced_row(const double *a, const double *b, double out[3][5])
{
    for (int v = 0; v < 2; v++) {
        const double *p = a + (v ? YZZ : XZZ), *q = b + (v ? YZZ : XZZ); /* z^2, z, 1 */
        out[v][0] = p[2];
        out[v][1] = p[1] - q[2];
        out[v][2] = p[0] - q[1];
        out[v][3] = -q[0];
        out[v][4] = 0;
    }
    const double *p = a + ZZZ, *q = b + ZZZ; /* z^3, z^2, z, 1 */
    out[2][0] = p[3];
    out[2][1] = p[2] - q[3];
    out[2][2] = p[1] - q[2];
    out[2][3] = p[0] - q[1];
    out[2][4] = -q[0];
}

static void polynomial_multiply(const double *a, int degree_a, const double *b, int degree_b,
                                double factor, double *out)
{
    for (int i = 0; i <= degree_a; i++)
        for (int j = 0; j <= degree_b; j++)
            out[i + j] += factor * a[i] * b[j];
}

static void determinant(double B[3][3][5], double out[11])
{
    memset(out, 0, 11 * sizeof *out);
    for (int i = 0; i < 3; i++) { /* along the column of constants */
        int a = (i + 1) % 3, b = (i + 2) % 3;
        double minor[7] = {0};
        polynomial_multiply(B[a][0], 3, B[b][1], 3, 1, minor);
        polynomial_multiply(B[a][1], 3, B[b][0], 3, -1, minor);
        polynomial_multiply(minor, 6, B[i][2], 4, 1, out);
    }
}

/* x and y from B(z) (x y 1)^T = 0: the longest cross product of two rows. */
static bool back_substitute(double B[3][3][5], double z, double *x, double *y)
{
    double rows[3][3], best[3] = {0}, best_square = 0;
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++)
            rows[r][c] = B[r][c][0] +
                         z * (B[r][c][1] + z * (B[r][c][2] + z * (B[r][c][3] + z * B[r][c][4])));
    for (int r = 0; r < 3; r++) {
        double cross[3];
        fv_cross3(rows[r], rows[(r + 1) % 3], cross);
        double square = fv_dot3(cross, cross);
        if (square > best_square) {
            best_square = square;
            fv_copy3(cross, best);
        }
    }
    if (!(best[2] * best[2] > 1e-20 * best_square)) return false;
    *x = best[0] / best[2];
    *y = best[1] / best[2];
    return true;
}

int fv_essential_five_point(const struct fv_pair pairs[5], double E[FV_ESSENTIAL_SOLUTIONS_MAX][9])
{
    double basis[4][9], e[9][4], C[10][MONOMIALS], B[3][3][5], polynomial[11], roots[10];
    if (!null_space(pairs, basis)) return 0;
    for (int i = 0; i < 9; i++)
        for (int b = 0; b < 4; b++)
            e[i][b] = basis[b][i];
    constraints(e, C);
    if (!eliminate(C)) return 0;
    for (int i = 0; i < 3; i++)
        reduced_row(C[4 + 2 * i], C[5 + 2 * i], B[i]);
    determinant(B, polynomial);
    int count = fv_polynomial_roots(polynomial, 10, -1000, 1000, roots), found = 0;
    for (int k = 0; k < count; k++) {
        double x, y, z = roots[k];
        if (!back_substitute(B, z, &x, &y)) continue;
        double square = x * x + y * y + z * z + 1, scale = __builtin_sqrt(2 / square);
        for (int i = 0; i < 9; i++)
            E[found][i] = scale * (x * e[i][0] + y * e[i][1] + z * e[i][2] + e[i][3]);
        found++;
    }
    return found;
}

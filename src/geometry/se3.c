#include "geometry/se3.h"

#include <string.h>

#include "base/elementary.h"
#include "geometry/vec.h"

void fv_se3_from_rows(const double rows[12], struct fv_se3 *T)
{
    for (int r = 0; r < 3; r++) {
        for (int c = 0; c < 3; c++)
            T->R[3 * r + c] = rows[4 * r + c];
        T->t[r] = rows[4 * r + 3];
    }
}

void fv_se3_to_rows(const struct fv_se3 *T, double rows[12])
{
    for (int r = 0; r < 3; r++) {
        for (int c = 0; c < 3; c++)
            rows[4 * r + c] = T->R[3 * r + c];
        rows[4 * r + 3] = T->t[r];
    }
}

void fv_se3_identity(struct fv_se3 *T)
{
    memset(T, 0, sizeof *T);
    T->R[0] = T->R[4] = T->R[8] = 1;
}

void fv_se3_compose(const struct fv_se3 *A, const struct fv_se3 *B, struct fv_se3 *out)
{
    struct fv_se3 C;
    fv_multiply33(A->R, B->R, C.R);
    fv_se3_apply(A, B->t, C.t);
    *out = C;
}

void fv_se3_invert(const struct fv_se3 *T, struct fv_se3 *out)
{
    struct fv_se3 C;
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++)
            C.R[3 * r + c] = T->R[3 * c + r];
    fv_rotate3(C.R, T->t, C.t);
    for (int i = 0; i < 3; i++)
        C.t[i] = -C.t[i];
    *out = C;
}

void fv_se3_apply_inverse(const struct fv_se3 *T, const double point[3], double out[3])
{
    double d[3];
    fv_subtract3(point, T->t, d);
    fv_rotate_back3(T->R, d, out);
}

void fv_so3_exp(const double w[3], double R[9])
{
    double square = fv_dot3(w, w), a, b; /* sin(x)/x and (1 - cos(x))/x^2 */
    if (square < 1e-8) {
        a = 1 - square / 6;
        b = 0.5 - square / 24;
    } else {
        double angle = __builtin_sqrt(square), half = fv_sin(0.5 * angle);
        a = fv_sin(angle) / angle;
        b = 2 * half * half / square;
    }
    R[0] = 1 - b * (w[1] * w[1] + w[2] * w[2]);
    R[4] = 1 - b * (w[0] * w[0] + w[2] * w[2]);
    R[8] = 1 - b * (w[0] * w[0] + w[1] * w[1]);
    double xy = b * w[0] * w[1], xz = b * w[0] * w[2], yz = b * w[1] * w[2];
    R[1] = xy - a * w[2];
    R[3] = xy + a * w[2];
    R[2] = xz + a * w[1];
    R[6] = xz - a * w[1];
    R[5] = yz - a * w[0];
    R[7] = yz + a * w[0];
}

void fv_so3_log(const double R[9], double w[3])
{
    double q[4];
    fv_so3_to_quaternion(R, q);
    double sine = fv_norm3(q + 1);
    double factor = sine < 1e-9 ? 2 : 2 * fv_atan2(sine, q[0]) / sine;
    for (int i = 0; i < 3; i++)
        w[i] = factor * q[1 + i];
}

void fv_se3_move(struct fv_se3 *T, const double step[6])
{
    double E[9], R[9], t[3];
    fv_so3_exp(step + 3, E);
    fv_multiply33(E, T->R, R);
    fv_rotate3(E, T->t, t);
    memcpy(T->R, R, sizeof R);
    for (int i = 0; i < 3; i++)
        T->t[i] = t[i] + step[i];
}

void fv_se3_part(const struct fv_se3 *whole, double fraction, struct fv_se3 *part)
{
    double turn[3];
    fv_so3_log(whole->R, turn);
    for (int k = 0; k < 3; k++) {
        turn[k] *= fraction;
        part->t[k] = whole->t[k] * fraction;
    }
    fv_so3_exp(turn, part->R);
}

void fv_so3_between(const double from[3], const double to[3], double R[9])
{
    double turn[3];
    fv_cross3(from, to, turn);
    const double sine = fv_norm3(turn);
    const double factor = sine > 0 ? fv_atan2(sine, fv_dot3(from, to)) / sine : 0;
    for (int i = 0; i < 3; i++)
        turn[i] *= factor;
    fv_so3_exp(turn, R);
}

void fv_so3_orthonormalise(double R[9])
{
    for (int step = 0; step < 2; step++) {
        /* R <- R (3 I - R^T R) / 2 */
        double G[9], N[9];
        for (int r = 0; r < 3; r++)
            for (int c = 0; c < 3; c++)
                G[3 * r + c] = (r == c ? 1.5 : 0) -
                               0.5 * (R[r] * R[c] + R[3 + r] * R[3 + c] + R[6 + r] * R[6 + c]);
        fv_multiply33(R, G, N);
        memcpy(R, N, sizeof N);
    }
}

void fv_so3_to_quaternion(const double R[9], double q[4])
{
    /* The largest of the four squares is the one to take the root of (Shepperd 1978). */
    double trace = R[0] + R[4] + R[8];
    double squares[4] = {trace, 2 * R[0] - trace, 2 * R[4] - trace, 2 * R[8] - trace};
    int largest = 0;
    for (int i = 1; i < 4; i++)
        if (squares[i] > squares[largest]) largest = i;
    const double pairs[4][4] = {{1 + trace, R[7] - R[5], R[2] - R[6], R[3] - R[1]},
                                {R[7] - R[5], 1 + squares[1], R[1] + R[3], R[2] + R[6]},
                                {R[2] - R[6], R[1] + R[3], 1 + squares[2], R[5] + R[7]},
                                {R[3] - R[1], R[2] + R[6], R[5] + R[7], 1 + squares[3]}};
    double norm = 0, sign = pairs[largest][0] < 0 ? -1 : 1;
    for (int i = 0; i < 4; i++)
        norm += pairs[largest][i] * pairs[largest][i];
    norm = sign / __builtin_sqrt(norm);
    for (int i = 0; i < 4; i++)
        q[i] = pairs[largest][i] * norm;
}

void fv_so3_from_quaternion(const double q[4], double R[9])
{
    double w = q[0], x = q[1], y = q[2], z = q[3];
    R[0] = 1 - 2 * (y * y + z * z);
    R[1] = 2 * (x * y - w * z);
    R[2] = 2 * (x * z + w * y);
    R[3] = 2 * (x * y + w * z);
    R[4] = 1 - 2 * (x * x + z * z);
    R[5] = 2 * (y * z - w * x);
    R[6] = 2 * (x * z - w * y);
    R[7] = 2 * (y * z + w * x);
    R[8] = 1 - 2 * (x * x + y * y);
}

void fv_se3_add_along(const double way[3], double variance, double covariance[21])
{
    for (int row = 0, k = 0; row < 3; k += 6 - row, row++)
        for (int column = row; column < 3; column++)
            covariance[k + column - row] += variance * way[row] * way[column];
}

void fv_se3_carry_covariance(const struct fv_se3 *T_a_b, const double b[21], double a[21])
{
    double A[36] = {0}, C[36], AC[36] = {0};
    const double *t = T_a_b->t, cross[9] = {0, -t[2], t[1], t[2], 0, -t[0], -t[1], t[0], 0};
    double shifted[9];
    fv_multiply33(cross, T_a_b->R, shifted);
    for (int r = 0; r < 3; r++) {
        for (int c = 0; c < 3; c++) {
            A[6 * r + c] = A[6 * (r + 3) + c + 3] = T_a_b->R[3 * r + c];
            A[6 * r + c + 3] = shifted[3 * r + c];
        }
    }
    for (int r = 0, k = 0; r < 6; r++)
        for (int c = r; c < 6; c++, k++)
            C[6 * r + c] = C[6 * c + r] = b[k];
    for (int r = 0; r < 6; r++)
        for (int c = 0; c < 6; c++)
            for (int i = 0; i < 6; i++)
                AC[6 * r + c] += A[6 * r + i] * C[6 * i + c];
    for (int r = 0, k = 0; r < 6; r++) {
        for (int c = r; c < 6; c++, k++) {
            a[k] = 0;
            for (int i = 0; i < 6; i++)
                a[k] += AC[6 * r + i] * A[6 * c + i];
        }
    }
}

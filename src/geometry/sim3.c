/* Algebra of similarities. */
#include "geometry/sim3.h"

#include <string.h>

#include "geometry/vec.h"

void fv_sim3_identity(struct fv_sim3 *S)
{
    memset(S, 0, sizeof *S);
    S->R[0] = S->R[4] = S->R[8] = S->s = 1;
}

void fv_sim3_from_se3(const struct fv_se3 *T, double s, struct fv_sim3 *S)
{
    memcpy(S->R, T->R, sizeof S->R);
    fv_copy3(T->t, S->t);
    S->s = s;
}

void fv_sim3_apply(const struct fv_sim3 *S, const double point[3], double out[3])
{
    double q[3];
    fv_rotate3(S->R, point, q);
    for (int i = 0; i < 3; i++)
        out[i] = S->s * q[i] + S->t[i];
}

void fv_sim3_compose(const struct fv_sim3 *A, const struct fv_sim3 *B, struct fv_sim3 *out)
{
    struct fv_sim3 C;
    fv_multiply33(A->R, B->R, C.R);
    fv_sim3_apply(A, B->t, C.t);
    C.s = A->s * B->s;
    *out = C;
}

void fv_sim3_invert(const struct fv_sim3 *S, struct fv_sim3 *out)
{
    struct fv_sim3 I;
    double t[3];
    I.s = 1 / S->s;
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++)
            I.R[3 * r + c] = S->R[3 * c + r];
    fv_rotate3(I.R, S->t, t);
    for (int i = 0; i < 3; i++)
        I.t[i] = -I.s * t[i];
    *out = I;
}

void fv_sim3_move_pose(const struct fv_sim3 *S, struct fv_se3 *T_cam)
{
    /* x_cam = R p + t and p_new = s Q p + u give s x_cam = R Q^T p_new + s t - R Q^T u. */
    struct fv_se3 moved;
    double shift[3];
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++)
            moved.R[3 * r + c] = T_cam->R[3 * r] * S->R[3 * c] +
                                 T_cam->R[3 * r + 1] * S->R[3 * c + 1] +
                                 T_cam->R[3 * r + 2] * S->R[3 * c + 2];
    fv_rotate3(moved.R, S->t, shift);
    for (int i = 0; i < 3; i++)
        moved.t[i] = S->s * T_cam->t[i] - shift[i];
    fv_so3_orthonormalise(moved.R);
    *T_cam = moved;
}

/* ---- exponential ----------------------------------------------------------------------------- */

/* Coefficients of W = A [w]x + B [w]x^2 + C I, the integral of exp(tau (sigma I + [w]x)) over tau
 * in [0, 1]. With z = sigma + i theta and f = (exp z - 1) / z: C = f at theta = 0, A = Im f /
 * theta, B = (C - Re f) / theta^2. Near zero by the power series of f, z^k / (k + 1)!. */
static void sim3_coefficients(double sigma, double theta2, double *A, double *B, double *C)
{
    double theta = __builtin_sqrt(theta2), factor = 1;
    *A = *B = *C = 0;
    /* z^k = p + i theta q, where p = sigma^k - theta^2 r. */
    double power = 1, p = 1, q = 0, r = 0;
    for (int k = 0; k < 12; k++) {
        factor /= k + 1;
        *C += power * factor;
        *A += q * factor;
        *B += r * factor;
        r = sigma * r + q;
        q = p + sigma * q;
        power *= sigma;
        p = power - theta2 * r;
    }
    bool near = fv_abs(sigma) < 0.1;
    if (near && theta < 0.1) return;
    double grown = fv_exp(sigma), square = sigma * sigma + theta2;
    if (!near) *C = (grown - 1) / sigma;
    if (theta < 1e-5) { /* limits for small angles */
        *A = (sigma * grown - grown + 1) / (sigma * sigma);
        *B = (grown * (sigma * sigma / 2 - sigma + 1) - 1) / (sigma * sigma * sigma);
        return;
    }
    double re = grown * fv_cos(theta) - 1, im = grown * fv_sin(theta);
    double f_re = (re * sigma + im * theta) / square, f_im = (im * sigma - re * theta) / square;
    *A = f_im / theta;
    *B = (*C - f_re) / theta2;
}

static void sim3_matrix(const double w[3], double sigma, double W[9])
{
    double A, B, C, theta2 = fv_dot3(w, w);
    sim3_coefficients(sigma, theta2, &A, &B, &C);
    const double X[9] = {0, -w[2], w[1], w[2], 0, -w[0], -w[1], w[0], 0};
    double XX[9];
    fv_multiply33(X, X, XX);
    for (int i = 0; i < 9; i++)
        W[i] = A * X[i] + B * XX[i] + (i % 4 == 0 ? C : 0);
}

void fv_sim3_exp(const double x[7], struct fv_sim3 *S)
{
    double W[9];
    sim3_matrix(x + 3, x[6], W);
    fv_so3_exp(x + 3, S->R);
    fv_rotate3(W, x, S->t);
    S->s = fv_exp(x[6]);
}

void fv_sim3_log(const struct fv_sim3 *S, double x[7])
{
    double W[9], cofactor[9];
    fv_so3_log(S->R, x + 3);
    x[6] = fv_log(S->s);
    sim3_matrix(x + 3, x[6], W);
    for (int r = 0; r < 3; r++) {
        const double *a = W + 3 * ((r + 1) % 3), *b = W + 3 * ((r + 2) % 3);
        fv_cross3(a, b, cofactor + 3 * r);
    }
    double inverse = 1 / fv_dot3(W, cofactor);
    fv_rotate_back3(cofactor, S->t, x);
    for (int i = 0; i < 3; i++)
        x[i] *= inverse;
}

/* Rigid motion. `struct fv_se3` named T_a_b takes points of frame b to frame a: p_a = R p_b + t.
 * Small motions are 6-vectors: translation first, rotation (axis times angle, rad) last, as in the
 * pose message. Real-time safe, any thread. */
#ifndef FOVEA_GEOMETRY_SE3_H
#define FOVEA_GEOMETRY_SE3_H

#include "geometry/vec.h"

#ifdef __cplusplus
extern "C" {
#endif

struct fv_se3 {
    double R[9]; /* row-major */
    double t[3];
};

/* From and to the rows of a 3x4 matrix, as public structs hold transforms. */
void fv_se3_from_rows(const double rows[12], struct fv_se3 *T);
void fv_se3_to_rows(const struct fv_se3 *T, double rows[12]);

void fv_se3_identity(struct fv_se3 *T);
/* out = A B. `out` may be either input. */
void fv_se3_compose(const struct fv_se3 *A, const struct fv_se3 *B, struct fv_se3 *out);
void fv_se3_invert(const struct fv_se3 *T, struct fv_se3 *out);

/* R p + t. `out` may be `point`. */
static inline void fv_se3_apply(const struct fv_se3 *T, const double point[3], double out[3])
{
    double r[3];
    fv_rotate3(T->R, point, r);
    for (int i = 0; i < 3; i++)
        out[i] = r[i] + T->t[i];
}

/* R p + t undone. */
void fv_se3_apply_inverse(const struct fv_se3 *T, const double point[3], double out[3]);

/* Rodrigues' formula, and its inverse with angles in [0, pi]. */
void fv_so3_exp(const double rotation_rad[3], double R[9]);
void fv_so3_log(const double R[9], double rotation_rad[3]);
/* The least turn that takes one unit vector to another, which is not against it. */
void fv_so3_between(const double from[3], const double to[3], double R[9]);

/* T <- (exp(rotation), translation) T: a small motion on the left, not coupled (retraction for
 * optimisers).
 */
void fv_se3_move(struct fv_se3 *T, const double step[6]);

/* Part of a motion: its turn and its translation, each by the same fraction. `part` may be `whole`.
 */
void fv_se3_part(const struct fv_se3 *whole, double fraction, struct fv_se3 *part);

/* Covariance of a small motion on b's side (T_x_b exp(motion)) as that of the same motion on a's
 * side, T_a_b fixed: by the adjoint of T_a_b. Upper triangles by rows, translation first. `a` may
 * be `b`. */
void fv_se3_carry_covariance(const struct fv_se3 *T_a_b, const double b[21], double a[21]);

/* Add to a covariance as above an error of the place along `way`: `variance`, of a share of it. */
void fv_se3_add_along(const double way[3], double variance, double covariance[21]);

/* Nearest rotation of a matrix that is nearly one (two steps of Newton's iteration for the polar
 * factor). */
void fv_so3_orthonormalise(double R[9]);

/* Unit quaternion w x y z, w >= 0, and back. */
void fv_so3_to_quaternion(const double R[9], double q[4]);
void fv_so3_from_quaternion(const double q[4], double R[9]);

#ifdef __cplusplus
}
#endif
#endif

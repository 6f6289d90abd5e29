/* Alignment of two cameras' landmarks by a similarity: closed form, robust sampling, refinement. */
#include <string.h>

#include "geometry/linear.h"
#include "geometry/pose.h"
#include "geometry/sample.h"
#include "geometry/sim3.h"
#include "geometry/vec.h"
#include "geometry/chi_square.h"

static const double distance_ratio_max = 1.5;

/* ---- closed form ----------------------------------------------------------------------------- */

bool fv_sim3_align(const double (*a)[3], const double (*b)[3], uint32_t count, struct fv_sim3 *S)
{
    if (count < 3) return false;
    double ma[3] = {0}, mb[3] = {0}, M[9] = {0}, spread[9] = {0}, values[4], V[16];
    for (uint32_t i = 0; i < count; i++)
        for (int k = 0; k < 3; k++) {
            ma[k] += a[i][k] / count;
            mb[k] += b[i][k] / count;
        }
    for (uint32_t i = 0; i < count; i++) {
        double x[3], y[3];
        fv_subtract3(a[i], ma, x);
        fv_subtract3(b[i], mb, y);
        for (int r = 0; r < 3; r++)
            for (int c = 0; c < 3; c++) {
                M[3 * r + c] += y[r] * x[c];
                spread[3 * r + c] += y[r] * y[c];
            }
    }
    fv_eigen_symmetric(spread, 3, values, V);
    if (!(values[1] > 1e-6 * values[0])) return false; /* on a line, or at one position */
    double N[16] = {M[0] + M[4] + M[8], M[5] - M[7],        M[6] - M[2],        M[1] - M[3],
                    M[5] - M[7],        M[0] - M[4] - M[8], M[1] + M[3],        M[6] + M[2],
                    M[6] - M[2],        M[1] + M[3],        M[4] - M[0] - M[8], M[5] + M[7],
                    M[1] - M[3],        M[6] + M[2],        M[5] + M[7],        M[8] - M[0] - M[4]};
    double along = 0;
    fv_eigen_symmetric(N, 4, values, V);
    fv_so3_from_quaternion(V, S->R); /* that of the largest eigenvalue */
    for (int r = 0; r < 3; r++)      /* sum of x . R y */
        for (int c = 0; c < 3; c++)
            along += S->R[3 * r + c] * M[3 * c + r];
    S->s = along / (spread[0] + spread[4] + spread[8]);
    if (!(S->s > 1e-6 && S->s < 1e6)) return false;
    double turned[3];
    fv_rotate3(S->R, mb, turned);
    for (int k = 0; k < 3; k++)
        S->t[k] = ma[k] - S->s * turned[k];
    return true;
}

/* ---- errors and sampling --------------------------------------------------------------------- */

static bool distances_agree(const double q[3], const double p[3])
{
    double ratio2 = fv_dot3(q, q) / fv_dot3(p, p), bound = distance_ratio_max * distance_ratio_max;
    return ratio2 < bound && ratio2 * bound > 1;
}

/* Squared error of a point q of the camera's frame, whose own error along its ray is `along`, over
 * the variance of both. */
static bool square_error(const double bearing[3], const double A[6], double weight,
                         const double q[3], const double along[3], double *square)
{
    double e[2], J[6];
    *square = 0;
    if (!fv_observation_error(bearing, A, q, e, J)) return false;
    const double u[2] = {fv_dot3(J, along), fv_dot3(J + 3, along)},
                 by_u = weight * (u[0] * e[0] + u[1] * e[1]);
    *square = weight * (e[0] * e[0] + e[1] * e[1]) -
              by_u * by_u / (1 + weight * (u[0] * u[0] + u[1] * u[1]));
    return true;
}

/* A point of one camera in the other's frame, and its error along its ray there. */
static void move_point(const struct fv_sim3 *S, const double point[3], double sigma, double q[3],
                       double along[3])
{
    fv_sim3_apply(S, point, q);
    for (int k = 0; k < 3; k++)
        along[k] = sigma * (q[k] - S->t[k]);
}

bool fv_sim3_errors(const struct fv_correspondence *m, const struct fv_sim3 *S_a_b,
                    const struct fv_sim3 *S_b_a, double square[2])
{
    double q[3], along[3];
    square[1] = 0;
    move_point(S_a_b, m->point_b, m->sigma_b, q, along);
    if (!distances_agree(q, m->point_a) ||
        !square_error(m->bearing_a, m->A_a, m->weight_a, q, along, &square[0]))
        return false;
    if (m->weight_b == 0) return true;
    move_point(S_b_a, m->point_a, m->sigma_a, q, along);
    return square_error(m->bearing_b, m->A_b, m->weight_b, q, along, &square[1]);
}

static bool correspondence_agrees(const struct fv_correspondence *m, const struct fv_sim3 *S_a_b,
                                  const struct fv_sim3 *S_b_a, double limit)
{
    double square[2];
    return fv_sim3_errors(m, S_a_b, S_b_a, square) && square[0] < limit && square[1] < limit;
}

void fv_sim3_search_begin(struct fv_sim3_search *search, uint32_t samples_max)
{
    memset(search, 0, sizeof *search);
    fv_sim3_identity(&search->best);
    search->bound = samples_max;
}

bool fv_sim3_search_more(struct fv_sim3_search *search,
                         const struct fv_correspondence *correspondences, uint32_t count,
                         uint32_t samples, double limit, struct fv_random *random)
{
    if (count < 3) return false;
    for (uint32_t n = 0; n < samples && search->done < search->bound; n++, search->done++) {
        uint32_t index[3], inliers = 0;
        double a[3][3], b[3][3];
        struct fv_sim3 S, inverse;
        fv_sample_distinct(random, count, 3, index);
        for (int k = 0; k < 3; k++) {
            fv_copy3(correspondences[index[k]].point_a, a[k]);
            fv_copy3(correspondences[index[k]].point_b, b[k]);
        }
        if (!fv_sim3_align((const double(*)[3])a, (const double(*)[3])b, 3, &S)) continue;
        fv_sim3_invert(&S, &inverse);
        for (uint32_t i = 0; i < count; i++) {
            inliers += correspondence_agrees(&correspondences[i], &S, &inverse, limit);
            if (inliers + (count - 1 - i) <= search->best_inliers) break;
        }
        if (inliers <= search->best_inliers) continue;
        search->best = S;
        search->best_inliers = inliers;
        uint32_t bound = fv_sample_bound((double)inliers / count, 3, FV_SAMPLE_CONFIDENCE);
        if (bound < search->bound) search->bound = bound;
    }
    return search->done < search->bound;
}

/* ---- refinement ------------------------------------------------------------------------------ */

static void add_row(double e, double weight, const double row[7], double H[49], double g[7])
{
    for (int a = 0; a < 7; a++) {
        double u = weight * row[a];
        g[a] -= u * e;
        for (int c = 0; c <= a; c++)
            H[7 * a + c] += u * row[c];
    }
}

/* Rows of one camera: pixels, and (in a) how far its own point is. */
struct camera_rows {
    double e[3], row[3][7], weight[3]; /* of errors independent of each other */
    double u[3]; /* what the error of the other's point along its ray does to each */
    int count;
};

/* Their sum into the system: the inverse of diag(1 / weight) + u u^T by Sherman and Morrison, under
 * a Huber weight. */
static void add_rows(const struct camera_rows *r, double H[49], double g[7])
{
    double together[7] = {0}, by_u = 0, of_u = 1, square = 0;
    for (int i = 0; i < r->count; i++) {
        const double w = r->weight[i] * r->u[i];
        for (int k = 0; k < 7; k++)
            together[k] += w * r->row[i][k];
        by_u += w * r->e[i];
        of_u += w * r->u[i];
        square += r->weight[i] * r->e[i] * r->e[i];
    }
    square -= by_u * by_u / of_u;
    const double robust =
        square > FV_CHI_SQUARE_95_2 ? __builtin_sqrt(FV_CHI_SQUARE_95_2 / square) : 1;
    for (int i = 0; i < r->count; i++)
        add_row(r->e[i], robust * r->weight[i], r->row[i], H, g);
    add_row(by_u, -robust / of_u, together, H, g);
}

/* The row of an error whose derivative by q is J. A step moves `position` by u + w x position +
 * sigma position; q goes with it, or, with `back`, against it through the inverse transform. */
static void step_row(const double J[3], const double position[3], const struct fv_sim3 *back,
                     double row[7])
{
    double by_position[3];
    if (back) {
        fv_rotate_back3(back->R, J, by_position);
        for (int k = 0; k < 3; k++)
            by_position[k] *= -back->s;
    } else {
        fv_copy3(J, by_position);
    }
    fv_copy3(by_position, row);
    fv_cross3(position, by_position, row + 3);
    row[6] = fv_dot3(by_position, position);
}

/* The step x moves S_a_b to (u, exp w, exp sigma) applied after it: q' = exp(sigma) exp(w) q + u.
 * Seen from b, it moves the points of a by its inverse. */
static void correspondence_system(const struct fv_correspondence *m, const struct fv_sim3 *S_a_b,
                                  const struct fv_sim3 *S_b_a, double H[49], double g[7])
{
    struct camera_rows r = {.weight = {m->weight_a, m->weight_a, 1}, .count = 3};
    double q[3], along[3], J[9];
    move_point(S_a_b, m->point_b, m->sigma_b, q, along);
    if (!fv_observation_error(m->bearing_a, m->A_a, q, r.e, J)) return;
    /* Pixels alone leave the scale open when both cameras stand at one position: the distances are
     * held against each other. */
    const double per_sigma = 1 / m->sigma_a, length = fv_norm3(m->point_a);
    r.e[2] = (fv_dot3(m->bearing_a, q) / length - 1) * per_sigma;
    for (int k = 0; k < 3; k++)
        J[6 + k] = m->bearing_a[k] / length * per_sigma;
    for (int i = 0; i < 3; i++) {
        r.u[i] = fv_dot3(J + 3 * i, along);
        step_row(J + 3 * i, q, 0, r.row[i]);
    }
    add_rows(&r, H, g);
    if (m->weight_b == 0) return;
    r.count = 2;
    r.weight[0] = r.weight[1] = m->weight_b;
    move_point(S_b_a, m->point_a, m->sigma_a, q, along);
    if (!fv_observation_error(m->bearing_b, m->A_b, q, r.e, J)) return;
    for (int i = 0; i < 2; i++) {
        r.u[i] = fv_dot3(J + 3 * i, along);
        step_row(J + 3 * i, m->point_a, S_b_a, r.row[i]);
    }
    add_rows(&r, H, g);
}

/* Over the inliers; H is filled below its diagonal, and damped by next to nothing. */
static void correspondences_system(const struct fv_correspondence *correspondences, uint32_t count,
                                   const struct fv_sim3 *S_a_b, double H[49], double g[7])
{
    struct fv_sim3 S_b_a;
    memset(H, 0, 49 * sizeof *H);
    memset(g, 0, 7 * sizeof *g);
    fv_sim3_invert(S_a_b, &S_b_a);
    for (uint32_t i = 0; i < count; i++)
        if (correspondences[i].inlier)
            correspondence_system(&correspondences[i], S_a_b, &S_b_a, H, g);
    for (int a = 0; a < 7; a++)
        H[8 * a] *= 1 + 1e-9;
}

/* The last variable, that of the scale, does not move. */
static void hold_scale(double H[49], double g[7])
{
    for (int k = 0; k < 6; k++)
        H[42 + k] = 0;
    H[48] = 1;
    g[6] = 0;
}

/* Turns go about `down` alone; H is filled below its diagonal. */
static void hold_tilt(const double down[3], double H[49], double g[7])
{
    double by[7];
    for (int k = 0; k < 7; k++) { /* H down, for the rows of the turn and of the rest */
        by[k] = 0;
        for (int i = 0; i < 3; i++)
            by[k] += H[k > 3 + i ? 7 * k + 3 + i : 7 * (3 + i) + k] * down[i];
    }
    const double own = down[0] * by[3] + down[1] * by[4] + down[2] * by[5];
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++)
            H[7 * (3 + i) + k] = down[i] * by[k];
        for (int k = 0; k <= i; k++)
            H[7 * (3 + i) + 3 + k] = own * down[i] * down[k] + (i == k) - down[i] * down[k];
        H[42 + 3 + i] = down[i] * by[6];
    }
    fv_keep_along3(down, g + 3);
}

/* `down`: the only axis of turns, in the axes of a; NULL: all are free. */
static bool sim3_step(const struct fv_correspondence *correspondences, uint32_t count, bool rigid,
                      const double *down, struct fv_sim3 *S_a_b)
{
    double H[49], g[7];
    struct fv_sim3 step, moved;
    correspondences_system(correspondences, count, S_a_b, H, g);
    if (rigid) hold_scale(H, g);
    if (down != NULL) hold_tilt(down, H, g);
    if (!fv_ldlt_solve(H, 7, g)) return false;
    if (down != NULL) fv_keep_along3(down, g + 3); /* but for rounding it is */
    fv_so3_exp(g + 3, step.R);
    fv_copy3(g, step.t);
    step.s = fv_exp(g[6] > 1 ? 1 : g[6] < -1 ? -1 : g[6]);
    fv_sim3_compose(&step, S_a_b, &moved);
    fv_so3_orthonormalise(moved.R);
    *S_a_b = moved;
    return true;
}

uint32_t fv_sim3_refine(struct fv_correspondence *correspondences, uint32_t count, double limit,
                        int steps, bool rigid, struct fv_sim3 *S_a_b)
{
    struct fv_sim3 S = *S_a_b, inverse;
    if (rigid) S.s = 1;
    for (int step = 0; step < steps; step++)
        if (!sim3_step(correspondences, count, rigid, NULL, &S)) return 0;
    uint32_t inliers = 0;
    fv_sim3_invert(&S, &inverse);
    for (uint32_t i = 0; i < count; i++) {
        correspondences[i].inlier = correspondence_agrees(&correspondences[i], &S, &inverse, limit);
        inliers += correspondences[i].inlier;
    }
    *S_a_b = S;
    return inliers;
}

bool fv_sim3_level(const struct fv_correspondence *correspondences, uint32_t count, int steps,
                   bool rigid, const double down_a[3], const double down_b[3],
                   struct fv_sim3 *S_a_b)
{
    struct fv_sim3 S = *S_a_b;
    double turned[3], R[9];
    fv_rotate3(S.R, down_b, turned);
    fv_so3_between(turned, down_a, R);
    fv_multiply33(R, S_a_b->R, S.R);
    for (int step = 0; step < steps; step++)
        if (!sim3_step(correspondences, count, rigid, down_a, &S)) return false;
    *S_a_b = S;
    return true;
}

void fv_sim3_judge(const struct fv_correspondence *correspondences, uint32_t count,
                   const struct fv_sim3 *S_a_b, struct fv_sim3_certainty *certainty)
{
    double H[49], g[7], variance[7];
    *certainty = (struct fv_sim3_certainty){FV_PI, 0, __builtin_inf()};
    correspondences_system(correspondences, count, S_a_b, H, g);
    if (!fv_ldlt_factor(H, 7)) return;
    for (int axis = 3; axis < 7; axis++) {
        double column[7] = {0};
        column[axis] = 1;
        fv_ldlt_back(H, 7, column);
        variance[axis] = column[axis];
    }
    fv_ldlt_back(H, 7, g);
    certainty->turn_sigma = __builtin_sqrt(variance[3] + variance[4] + variance[5]);
    certainty->log_scale = g[6];
    certainty->scale_sigma = __builtin_sqrt(variance[6]);
}

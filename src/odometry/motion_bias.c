#include "odometry/motion_bias.h"

#include <string.h>

#include "geometry/linear.h"
#include "geometry/vec.h"

enum { PASSES_PER_UNIT = FV_MOTION_BIAS_PASSES / 4, HELD_PAIRS = 12 };

static const double sigma_px = 0.5, cost_max = 9; /* of one match, sigma^2 */
static const double fade = 0.7, tried_fraction = 0.5;
static const double damping = 1e-3, turn_max_rad = 0.1; /* of a pass */
static const double evidence_min = 25, evidence_min_held = 75, evidence_clear = 12;
static const double way_min = 0.035; /* rad */
/* Errors (sigmas) at which a match counts a quarter (S. Geman and D. McClure, 1987), by pass. */
static const double scales[FV_MOTION_BIAS_PASSES] = {6, 4, 3, 2, 2, 2, 2, 2};

/* A match as a motion sees it. */
struct view {
    double q[3], n[3]; /* x1 turned; unit normal of the epipolar plane */
    double length;     /* of t x q */
    double error;      /* sigmas, with its sign */
    bool front;
};

/* False: x1 lies in the direction of motion, where no plane is known. */
static bool see(const struct fv_se3 *T, const struct fv_motion_bias_match *m, double focal_px,
                double x2[3], struct view *v)
{
    double x1[3], off[3], across[3];
    for (int k = 0; k < 3; k++) {
        x1[k] = (double)m->x1[k];
        x2[k] = (double)m->x2[k];
    }
    fv_rotate3(T->R, x1, v->q);
    fv_cross3(T->t, v->q, v->n);
    v->length = fv_norm3(v->n);
    if (!(v->length > 1e-6)) return false;
    for (int k = 0; k < 3; k++)
        v->n[k] /= v->length;
    fv_cross3(x2, v->q, off);
    fv_cross3(x2, T->t, across);
    v->front = fv_dot3(off, across) < 0;
    const double scale = focal_px / sigma_px * __builtin_sqrt((double)m->weight);
    v->error = scale * (v->front ? fv_dot3(v->n, x2) : fv_norm3(off));
    return true;
}

static double cost_of(const struct fv_se3 *T, const struct fv_motion_bias_match *matches,
                      uint32_t count, double focal_px)
{
    double cost = 0, x2[3];
    for (uint32_t i = 0; i < count; i++) {
        struct view v;
        if (!see(T, &matches[i], focal_px, x2, &v)) continue;
        const double error2 = v.error * v.error;
        cost += error2 < cost_max ? error2 : cost_max;
    }
    return cost;
}

/* Two unit vectors across a unit vector and each other. */
static void across_of(const double t[3], double u[3], double v[3])
{
    const double axis[3] = {fv_abs(t[0]) < 0.6, fv_abs(t[0]) >= 0.6, 0};
    fv_cross3(t, axis, u);
    (void)fv_normalise3(u);
    fv_cross3(t, u, v);
}

/* Turn by a rotation vector on the left, move the direction by `way`. */
static void move(struct fv_se3 *T, const double turn[3], const double way[3])
{
    double exp[9], R[9];
    fv_so3_exp(turn, exp);
    fv_multiply33(exp, T->R, R);
    memcpy(T->R, R, sizeof R);
    for (int k = 0; k < 3; k++)
        T->t[k] += way[k];
    (void)fv_normalise3(T->t);
}

/* One pass of Gauss-Newton; `scale` in sigmas. `held`: the turn stays. */
static void pass(struct fv_se3 *T, const struct fv_motion_bias_match *matches, uint32_t count,
                 double focal_px, double scale, bool held)
{
    double A[25] = {0}, g[5] = {0}, u[3], w[3], x2[3];
    across_of(T->t, u, w);
    for (uint32_t i = 0; i < count; i++) {
        struct view v;
        double a[3], c[3], row[5];
        if (!see(T, &matches[i], focal_px, x2, &v) || !v.front) continue;
        const double ratio = v.error / scale, part = 1 / (1 + ratio * ratio), weight = part * part,
                     pixels = focal_px / sigma_px * __builtin_sqrt((double)matches[i].weight),
                     e = v.error / pixels, along = fv_dot3(T->t, v.q);
        for (int k = 0; k < 3; k++)
            a[k] = (x2[k] - e * v.n[k]) * pixels / v.length; /* d(error)/d(t x q) */
        fv_cross3(v.q, a, c);
        const double aq = fv_dot3(a, v.q);
        for (int k = 0; k < 3; k++)
            row[k] = a[k] * along - T->t[k] * aq;
        row[3] = fv_dot3(u, c);
        row[4] = fv_dot3(w, c);
        for (int r = 0; r < 5; r++) {
            g[r] -= weight * row[r] * v.error;
            for (int k = 0; k <= r; k++)
                A[5 * r + k] += weight * row[r] * row[k];
        }
    }
    for (int r = 0; r < 5; r++) {
        A[6 * r] *= 1 + damping;
        for (int k = r + 1; k < 5; k++)
            A[5 * r + k] = A[5 * k + r];
    }
    for (int r = 0; r < 3 && held; r++) {
        for (int k = 0; k < 5; k++)
            A[5 * r + k] = A[5 * k + r] = r == k;
        g[r] = 0;
    }
    if (!fv_ldlt_solve(A, 5, g)) return;
    const double turn = fv_norm3(g), factor = turn > turn_max_rad ? turn_max_rad / turn : 1;
    double way[3];
    for (int k = 0; k < 3; k++) {
        way[k] = factor * (g[3] * u[k] + g[4] * w[k]);
        g[k] *= factor;
    }
    move(T, g, way);
}

void fv_motion_bias_forget(struct fv_motion_bias_state *s)
{
    memset(s, 0, sizeof *s);
}

bool fv_motion_bias_begin(struct fv_motion_bias_state *s, const struct fv_se3 *T_2_1, bool held)
{
    s->map = *T_2_1;
    s->pass = 0;
    s->held = held;
    if (!fv_normalise3(s->map.t)) return false;
    s->fit = s->map;
    return true;
}

/* Try half of what the pairs before asked for. */
static void take_evidence(struct fv_motion_bias_state *s,
                          const struct fv_motion_bias_match *matches, uint32_t count,
                          double focal_px)
{
    s->cost = cost_of(&s->map, matches, count, focal_px);
    s->evidence *= fade;
    if (!(s->pairs > 0)) return;
    struct fv_se3 tried = s->map;
    double turn[3], way[3];
    const double factor = tried_fraction / s->pairs, along = fv_dot3(s->way, s->map.t);
    for (int k = 0; k < 3; k++) {
        turn[k] = s->held ? 0 : factor * s->turn[k];
        way[k] = factor * (s->way[k] - along * s->map.t[k]);
    }
    move(&tried, turn, way);
    s->evidence += s->cost - cost_of(&tried, matches, count, focal_px);
    if (s->evidence < 0) s->evidence = 0;
}

/* What the fit moved the motion by; nothing where it did not lower the cost. */
static void note(struct fv_motion_bias_state *s, double cost)
{
    const bool better = cost < s->cost;
    double moved[9], turn[3];
    fv_multiply33_transposed(s->fit.R, s->map.R, moved);
    fv_so3_log(moved, turn);
    for (int k = 0; k < 3; k++) {
        s->turn[k] = fade * s->turn[k] + (better ? turn[k] : 0);
        s->way[k] = fade * s->way[k] + (better ? s->fit.t[k] - s->map.t[k] : 0);
    }
    s->pairs = fade * s->pairs + 1;
    s->seen++;
}

bool fv_motion_bias_unit(struct fv_motion_bias_state *s, const struct fv_motion_bias_match *matches,
                         uint32_t count, double focal_px)
{
    if (s->pass == 0) take_evidence(s, matches, count, focal_px);
    for (int k = 0; k < PASSES_PER_UNIT; k++, s->pass++)
        pass(&s->fit, matches, count, focal_px, scales[s->pass], s->held);
    if (s->pass < FV_MOTION_BIAS_PASSES) return false;
    note(s, cost_of(&s->fit, matches, count, focal_px));
    return true;
}

bool fv_motion_bias_found(const struct fv_motion_bias_state *s)
{
    const double least = s->seen > HELD_PAIRS ? evidence_min_held : evidence_min;
    return s->evidence >= least && fv_norm3(s->way) >= way_min * s->pairs;
}

bool fv_motion_bias_clear(const struct fv_motion_bias_state *s)
{
    return s->evidence < evidence_clear;
}

#include "map/window.h"

#include <string.h>

#include "base/elementary.h"
#include "geometry/linear.h"
#include "geometry/pose.h"
#include "geometry/vec.h"
#include "geometry/chi_square.h"

enum { UNIT_OBSERVATIONS = 350 };

void fv_window_carve(struct fv_window *window, const struct fv_window_limits *limits,
                     const struct fv_map *map, struct fv_arena *job)
{
    window->limits = *limits;
    window->map = map;
    window->state = fv_arena_take(job, 1, sizeof *window->state);
    window->landmarks = fv_arena_take(job, limits->landmarks, sizeof *window->landmarks);
    window->observations = fv_arena_take(job, limits->observations, sizeof *window->observations);
}

void fv_window_abort(struct fv_window *window)
{
    window->state->phase = FV_WINDOW_IDLE;
}

/* ---- a pass: apply the pending step, linearise, eliminate ------------------------------------ */

/* Point moved by what the poses' step leaves for it. */
static void move_point(struct fv_window *w, struct fv_window_landmark *l)
{
    const struct fv_window_state *s = w->state;
    double g[3], d[3];
    fv_copy3(l->gradient, g);
    for (uint32_t k = 0; k < l->count; k++) {
        const struct fv_window_observation *o = &w->observations[l->first + k];
        int32_t column = s->poses[o->pose].column;
        if (column < 0) continue;
        for (int r = 0; r < 6; r++)
            for (int c = 0; c < 3; c++)
                g[c] -= (double)o->cross[3 * r + c] * s->step[column + r];
    }
    const double *v = l->inverse;
    d[0] = v[0] * g[0] + v[1] * g[1] + v[2] * g[2];
    d[1] = v[1] * g[0] + v[3] * g[1] + v[4] * g[2];
    d[2] = v[2] * g[0] + v[4] * g[1] + v[5] * g[2];
    for (int i = 0; i < 3; i++)
        l->point[i] += d[i];
}

/* Add one observation to the system and to its landmark's block. Returns its robust cost. */
static double linearise(struct fv_window_state *s, int n, struct fv_window_observation *o,
                        const double point[3], double H[6], double g[3])
{
    const struct fv_window_pose *pose = &s->poses[o->pose];
    double q[3], e[2], J[6], b[3], A[6], rows[12], by_point[6];
    for (int i = 0; i < 3; i++)
        b[i] = o->bearing[i];
    for (int i = 0; i < 6; i++)
        A[i] = o->A[i];
    fv_se3_apply(&pose->T_cam_world, point, q);
    if (!fv_sight_error(b, A, q, e, J)) {
        memset(o->cross, 0, sizeof o->cross);
        return 1e3 * FV_CHI_SQUARE_95_2; /* behind the camera: as bad as a far outlier, without a
                                            direction */
    }
    double weight = o->weight, square = weight * (e[0] * e[0] + e[1] * e[1]), cost = square;
    if (square > FV_CHI_SQUARE_95_2) {
        double ratio = __builtin_sqrt(FV_CHI_SQUARE_95_2 / square);
        cost = 2 * FV_CHI_SQUARE_95_2 / ratio - FV_CHI_SQUARE_95_2;
        weight *= ratio;
    }
    for (int r = 0; r < 2; r++)
        fv_rotate_back3(pose->T_cam_world.R, J + 3 * r, by_point + 3 * r);
    for (int a = 0, k = 0; a < 3; a++) {
        g[a] -= weight * (by_point[a] * e[0] + by_point[3 + a] * e[1]);
        for (int c = a; c < 3; c++, k++)
            H[k] += weight * (by_point[a] * by_point[c] + by_point[3 + a] * by_point[3 + c]);
    }
    if (pose->column < 0) return cost;
    for (int r = 0; r < 2; r++) {
        fv_copy3(J + 3 * r, rows + 6 * r);
        fv_cross3(q, J + 3 * r, rows + 6 * r + 3);
    }
    double *S = s->system + (size_t)pose->column * (size_t)(n + 1);
    for (int a = 0; a < 6; a++) {
        double u = weight * rows[a], v = weight * rows[6 + a];
        s->gradient[pose->column + a] -= u * e[0] + v * e[1];
        for (int c = 0; c <= a; c++)
            S[a * n + c] += u * rows[c] + v * rows[6 + c];
        S[a * n + a] += s->damping * (u * rows[a] + v * rows[6 + a]);
        for (int c = 0; c < 3; c++)
            o->cross[3 * a + c] = (float)(u * by_point[c] + v * by_point[3 + c]);
    }
    return cost;
}

/* Subtract what the landmark's elimination takes from the poses' system. */
static void eliminate_landmark(struct fv_window *w, const struct fv_window_landmark *l, int n)
{
    struct fv_window_state *s = w->state;
    const double *v = l->inverse;
    for (uint32_t i = 0; i < l->count; i++) {
        const struct fv_window_observation *oi = &w->observations[l->first + i];
        int32_t ci = s->poses[oi->pose].column;
        if (ci < 0) continue;
        double Y[18];
        for (int r = 0; r < 6; r++) {
            const double x[3] = {(double)oi->cross[3 * r], (double)oi->cross[3 * r + 1],
                                 (double)oi->cross[3 * r + 2]};
            Y[3 * r] = x[0] * v[0] + x[1] * v[1] + x[2] * v[2];
            Y[3 * r + 1] = x[0] * v[1] + x[1] * v[3] + x[2] * v[4];
            Y[3 * r + 2] = x[0] * v[2] + x[1] * v[4] + x[2] * v[5];
            s->gradient[ci + r] -= fv_dot3(Y + 3 * r, l->gradient);
        }
        for (uint32_t j = 0; j < l->count; j++) {
            const struct fv_window_observation *oj = &w->observations[l->first + j];
            int32_t cj = s->poses[oj->pose].column;
            if (cj < 0 || cj > ci) /* lower triangle */
                continue;
            double *S = s->system + ci * n + cj;
            for (int r = 0; r < 6; r++)
                for (int c = 0; c < 6; c++)
                    S[r * n + c] -= Y[3 * r] * (double)oj->cross[3 * c] +
                                    Y[3 * r + 1] * (double)oj->cross[3 * c + 1] +
                                    Y[3 * r + 2] * (double)oj->cross[3 * c + 2];
        }
    }
}

/* Pixels become bearings in the first pass, so that copying the window stays one unit. */
static void unpack(struct fv_window *w, const struct fv_window_landmark *l)
{
    for (uint32_t k = 0; k < l->count; k++) {
        struct fv_window_observation *o = &w->observations[l->first + k];
        struct fv_keypoint p;
        if (!fv_map_keypoint(w->map, &o->seen, &p)) memset(&p, 0, sizeof p); /* weighs nothing */
        memcpy(o->bearing, p.bearing, sizeof o->bearing);
        memcpy(o->A, p.A, sizeof o->A);
        o->weight = p.weight;
    }
}

static void pass_landmark(struct fv_window *w, struct fv_window_landmark *l)
{
    struct fv_window_state *s = w->state;
    int n = 6 * (int)s->moved_count;
    if (s->packed) unpack(w, l);
    if (s->step_pending) move_point(w, l);
    double H[6] = {0}, g[3] = {0};
    for (uint32_t k = 0; k < l->count; k++)
        s->cost += linearise(s, n, &w->observations[l->first + k], l->point, H, g);
    H[0] += s->damping * H[0] + 1e-12;
    H[3] += s->damping * H[3] + 1e-12;
    H[5] += s->damping * H[5] + 1e-12;
    fv_copy3(g, l->gradient);
    if (!fv_invert_symmetric3(H, l->inverse))
        memset(l->inverse, 0,
               sizeof l->inverse); /* depth not determined: the point stays, and says nothing */
    else
        eliminate_landmark(w, l, n);
}

static void begin_pass(struct fv_window_state *s)
{
    int n = 6 * (int)s->moved_count;
    memset(s->gradient, 0, (size_t)n * sizeof *s->gradient);
    memset(s->system, 0, (size_t)n * (size_t)n * sizeof *s->system);
    s->cost = 0;
    s->next = 0;
    s->phase = FV_WINDOW_PASS;
}

/* Solve for the next step and start the pass that applies it; false when the system cannot be
 * solved. */
static bool take_step(struct fv_window_state *s)
{
    int n = 6 * (int)s->moved_count;
    if (!fv_ldlt_factor(s->system, n)) return false;
    memcpy(s->step, s->gradient, (size_t)n * sizeof *s->step);
    fv_ldlt_back(s->system, n, s->step);
    for (uint32_t i = 0; i < s->pose_count; i++)
        if (s->poses[i].column >= 0)
            fv_se3_move(&s->poses[i].T_cam_world, s->step + s->poses[i].column);
    s->step_pending = true;
    begin_pass(s);
    return true;
}

static void keep(struct fv_window *w, bool accept)
{
    struct fv_window_state *s = w->state;
    for (uint32_t i = 0; i < s->pose_count; i++) {
        if (accept)
            s->poses[i].before = s->poses[i].T_cam_world;
        else
            s->poses[i].T_cam_world = s->poses[i].before;
    }
    for (uint32_t i = 0; i < s->landmark_count; i++) {
        struct fv_window_landmark *l = &w->landmarks[i];
        if (accept)
            fv_copy3(l->point, l->before);
        else
            fv_copy3(l->before, l->point);
    }
}

/* All landmarks are through: judge the step that led here, and take the next. */
static void end_pass(struct fv_window *w)
{
    struct fv_window_state *s = w->state;
    bool first = s->pass == 0, better = first || s->cost < s->cost_before || !s->step_pending;
    s->pass++;
    s->packed = false;
    if (first) s->cost_at_start = s->cost;
    bool last = s->pass >= s->passes;
    if (better) {
        bool converged = s->pass > FV_WINDOW_STEPS_MIN && s->step_pending &&
                         s->cost > s->cost_before * (1 - w->limits.settled);
        s->accepted_any = s->accepted_any || (!first && s->step_pending);
        if (s->step_pending) s->damping = s->damping * 0.2 > 1e-9 ? s->damping * 0.2 : 1e-9;
        s->cost_before = s->cost;
        keep(w, true);
        if (last || converged || !take_step(s)) s->phase = FV_WINDOW_DONE;
        return;
    }
    keep(w, false);
    s->damping *= 10;
    s->step_pending = false;
    if (last)
        s->phase = FV_WINDOW_DONE;
    else
        begin_pass(s); /* at the old place, with more damping */
}

bool fv_window_unit(struct fv_window *w)
{
    struct fv_window_state *s = w->state;
    if (s->phase != FV_WINDOW_PASS) return false;
    uint32_t done = 0;
    while (s->next < s->landmark_count && done < UNIT_OBSERVATIONS) {
        done += w->landmarks[s->next].count;
        pass_landmark(w, &w->landmarks[s->next++]);
    }
    if (s->next == s->landmark_count) end_pass(w);
    return s->phase == FV_WINDOW_PASS;
}

/* ---- filling --------------------------------------------------------------------------------- */

void fv_window_clear(struct fv_window *w)
{
    memset(w->state, 0, sizeof *w->state);
    memset(w->state->pose_of, -1, sizeof w->state->pose_of);
    w->state->damping = 1e-4;
}

void fv_window_put_landmark(struct fv_window *w, const double point[3])
{
    struct fv_window_landmark *l = &w->landmarks[w->state->landmark_count++];
    memset(l, 0, sizeof *l);
    fv_copy3(point, l->point);
    fv_copy3(point, l->before);
    l->first = w->state->observation_count;
}

void fv_window_begin(struct fv_window *w, uint32_t passes)
{
    w->state->passes = passes;
    begin_pass(w->state);
}

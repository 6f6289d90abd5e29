#include "map/window.h"

#include <string.h>

#include "base/elementary.h"
#include "geometry/linear.h"
#include "geometry/normal_equations.h"
#include "geometry/pose.h"
#include "geometry/vec.h"
#include "geometry/chi_square.h"

enum { UNIT_OBSERVATIONS = 350 };

static const struct fv_damping damping_rule = {.fall = 0.2, .floor = 1e-9, .rise = 10};

void fv_window_carve(struct fv_window *window, const struct fv_window_limits *limits,
                     const struct fv_map *map, bool gyro, struct fv_arena *job)
{
    window->limits = *limits;
    window->map = map;
    window->state = fv_arena_take(job, 1, sizeof *window->state);
    window->landmarks = fv_arena_take(job, limits->landmarks, sizeof *window->landmarks);
    window->observations = fv_arena_take(job, limits->observations, sizeof *window->observations);
    window->distances = map != NULL && map->limits.distances
                            ? fv_arena_take(job, limits->observations, sizeof *window->distances)
                            : NULL;
    window->turns = NULL;
    window->gyro = gyro ? fv_arena_take(job, 1, sizeof *window->gyro) : NULL;
}

void fv_window_abort(struct fv_window *window)
{
    window->state->phase = FV_WINDOW_IDLE;
}

/* ---- a pass: apply the pending step, linearise, eliminate ------------------------------------ */

/* Blocks between a landmark and the poses that move. */
struct couplings {
    struct fv_coupling list[FV_WINDOW_KEYFRAMES_MAX];
    double cross[FV_WINDOW_KEYFRAMES_MAX][18];
    int count;
};

static struct fv_normal normal_of(struct fv_window_state *s)
{
    return (struct fv_normal){s->system, s->gradient, 6 * (int)s->moved_count};
}

static void add_coupling(struct couplings *c, const float cross[18], int32_t column)
{
    double *kept = c->cross[c->count];
    for (int i = 0; i < 18; i++)
        kept[i] = (double)cross[i];
    c->list[c->count++] = (struct fv_coupling){kept, column, 6};
}

/* The landmark's own step after that of the poses. */
static void move_point(struct fv_window *w, struct fv_window_landmark *l)
{
    struct couplings c;
    double d[3];
    c.count = 0;
    for (uint32_t k = 0; k < l->count; k++) {
        const struct fv_window_observation *o = &w->observations[l->first + k];
        const int32_t column = w->state->poses[o->pose].column;
        if (column >= 0) add_coupling(&c, o->cross, column);
    }
    fv_landmark_step(3, l->inverse, l->gradient, c.list, c.count, w->state->step, d);
    for (int i = 0; i < 3; i++)
        l->point[i] += d[i];
}

/* The same for its measured distance, which hangs on the same pose: `cross` grows. */
static double linearise_distance(const struct fv_window_pose *pose, double damping,
                                 const struct fv_normal *normal,
                                 const struct fv_inverse_distance *measured, const double b[3],
                                 const double q[3], double H[6], double g[3], float cross[18])
{
    double e, J[3], row[6], weighted[6], by_point[3];
    if (!fv_inverse_distance_error(measured, b, q, &e, J)) return 0;
    const double weight = fv_inverse_distance_robust(measured, e);
    fv_rotate_back3(pose->T_cam_world.R, J, by_point);
    for (int a = 0, k = 0; a < 3; a++) {
        g[a] -= weight * by_point[a] * e;
        for (int c = a; c < 3; c++, k++)
            H[k] += weight * by_point[a] * by_point[c];
    }
    if (pose->column >= 0) {
        fv_copy3(J, row);
        fv_cross3(q, J, row + 3);
        fv_block_weigh(row, 6, weight, weighted);
        fv_normal_add_one(normal, pose->column, 6, row, weighted, &e, 1, &damping);
        for (int r = 0; r < 3; r++)
            for (int c = 0; c < 6; c++)
                cross[6 * r + c] += (float)(by_point[r] * weighted[c]);
    }
    return fv_inverse_distance_cost(measured, e);
}

/* Add one observation to the system and to its landmark's block. `measured`: its distance, or NULL.
 * Returns its robust cost. */
static double linearise(const struct fv_window_state *s, const struct fv_normal *normal,
                        struct fv_window_observation *o, const struct fv_inverse_distance *measured,
                        const double point[3], double H[6], double g[3],
                        struct couplings *couplings)
{
    const struct fv_window_pose *pose = &s->poses[o->pose];
    double q[3], e[2], J[6], b[3], A[6], rows[12], weighted[12], by_point[6];
    for (int i = 0; i < 3; i++)
        b[i] = o->bearing[i];
    for (int i = 0; i < 6; i++)
        A[i] = o->A[i];
    fv_se3_apply(&pose->T_cam_world, point, q);
    if (!fv_observation_error(b, A, q, e, J)) {
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
    if (pose->column < 0)
        return measured == NULL ? cost
                                : cost + linearise_distance(pose, s->damping, normal, measured, b,
                                                            q, H, g, NULL);
    for (int r = 0; r < 2; r++) {
        fv_copy3(J + 3 * r, rows + 6 * r);
        fv_cross3(q, J + 3 * r, rows + 6 * r + 3);
    }
    fv_block_weigh(rows, 12, weight, weighted);
    fv_normal_add_one(normal, pose->column, 6, rows, weighted, e, 2, &s->damping);
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 6; c++)
            o->cross[6 * r + c] =
                (float)(by_point[r] * weighted[c] + by_point[3 + r] * weighted[6 + c]);
    if (measured != NULL)
        cost += linearise_distance(pose, s->damping, normal, measured, b, q, H, g, o->cross);
    add_coupling(couplings, o->cross, pose->column);
    return cost;
}

/* Pixels become bearings in the first pass, so that copying the window stays one unit. */
static void unpack(struct fv_window *w, const struct fv_window_landmark *l)
{
    struct fv_window_observation *observations = &w->observations[l->first];
    for (uint32_t first = 0, some; first < l->count; first += some) {
        struct fv_pixel seen[FV_MAP_OBSERVERS_MAX];
        struct fv_keypoint points[FV_MAP_OBSERVERS_MAX];
        some = l->count - first < FV_MAP_OBSERVERS_MAX ? l->count - first : FV_MAP_OBSERVERS_MAX;
        for (uint32_t k = 0; k < some; k++)
            seen[k] = observations[first + k].seen;
        fv_map_keypoints(w->map, seen, some, points);
        for (uint32_t k = 0; k < some; k++) {
            struct fv_window_observation *o = &observations[first + k];
            memcpy(o->bearing, points[k].bearing, sizeof o->bearing);
            memcpy(o->A, points[k].A, sizeof o->A);
            o->weight = points[k].weight;
        }
    }
}

static void pass_landmark(struct fv_window *w, struct fv_window_landmark *l)
{
    struct fv_window_state *s = w->state;
    const struct fv_normal normal = normal_of(s);
    if (s->packed) unpack(w, l);
    if (s->step_pending) move_point(w, l);
    double H[6] = {0}, g[3] = {0};
    struct couplings couplings;
    couplings.count = 0;
    for (uint32_t k = 0; k < l->count; k++)
        s->cost += linearise(s, &normal, &w->observations[l->first + k],
                             w->distances == NULL ? NULL : &w->distances[l->first + k], l->point, H,
                             g, &couplings);
    H[0] += s->damping * H[0] + 1e-12;
    H[3] += s->damping * H[3] + 1e-12;
    H[5] += s->damping * H[5] + 1e-12;
    fv_copy3(g, l->gradient);
    if (!fv_invert_symmetric3(H, l->inverse))
        memset(l->inverse, 0,
               sizeof l->inverse); /* depth not determined: the point stays, and says nothing */
    else
        fv_normal_eliminate(&normal, 3, l->inverse, l->gradient, couplings.list, couplings.count);
}

static void begin_pass(struct fv_window_state *s)
{
    const struct fv_normal normal = normal_of(s);
    fv_normal_clear(&normal);
    s->cost = 0;
    s->next = 0;
    s->phase = FV_WINDOW_PASS;
}

/* Solve for the next step and start the pass that applies it; false when the system cannot be
 * solved. */
static bool take_step(struct fv_window_state *s)
{
    const struct fv_normal normal = normal_of(s);
    if (!fv_normal_solve(&normal, s->step)) return false;
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
    fv_window_keep_turns(w, accept);
}

/* All landmarks are through: judge the step that led here, and take the next. */
static void end_pass(struct fv_window *w)
{
    struct fv_window_state *s = w->state;
    s->cost += fv_window_add_turns(w);
    bool first = s->pass == 0, better = first || s->cost < s->cost_before || !s->step_pending;
    s->pass++;
    s->packed = false;
    if (first) s->cost_at_start = s->cost;
    bool last = s->pass >= s->passes;
    if (better) {
        bool converged = s->pass > FV_WINDOW_STEPS_MIN && s->step_pending &&
                         s->cost > s->cost_before * (1 - w->limits.converged);
        s->accepted_any = s->accepted_any || (!first && s->step_pending);
        if (s->step_pending) s->damping = fv_damping_lower(&damping_rule, s->damping);
        s->cost_before = s->cost;
        keep(w, true);
        if (last || converged || !take_step(s)) s->phase = FV_WINDOW_DONE;
        return;
    }
    keep(w, false);
    s->damping = fv_damping_raise(&damping_rule, s->damping);
    s->step_pending = false;
    if (last)
        s->phase = FV_WINDOW_DONE;
    else
        begin_pass(s); /* at the old position, with more damping */
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
    if (w->gyro != NULL) memset(w->gyro, 0, sizeof *w->gyro);
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

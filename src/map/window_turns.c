/* Window optimisation: the turns that a gyro measured between its keyframes. */
#include <string.h>

#include "geometry/chi_square.h"
#include "geometry/linear.h"
#include "geometry/normal_equations.h"
#include "geometry/vec.h"
#include "map/window.h"

/* The bias of a gyro walks: longer turns say little, and they need not say it. */
static const double turn_seconds_max = 10;

/* ---- filling --------------------------------------------------------------------------------- */

static uint64_t number_of(const struct fv_window_state *s, const struct fv_map *map, uint32_t pose)
{
    return map->keyframes[s->poses[pose].slot].number;
}

/* Poses of the window by their keyframes' numbers. */
static void sort_poses(const struct fv_window_state *s, const struct fv_map *map,
                       uint32_t in_window, uint32_t order[FV_WINDOW_KEYFRAMES_MAX])
{
    for (uint32_t i = 0; i < in_window; i++) {
        uint32_t at = i;
        for (; at > 0 && number_of(s, map, order[at - 1]) > number_of(s, map, i); at--)
            order[at] = order[at - 1];
        order[at] = i;
    }
}

/* The keyframe of this map before one; false: there is none, or no room for it. */
static bool pose_before(struct fv_window_state *s, const struct fv_map *map, uint64_t number,
                        uint32_t *pose)
{
    bool found = false;
    uint32_t best = 0;
    for (uint32_t k = 0; k < map->limits.keyframes; k++) {
        const struct fv_keyframe *keyframe = &map->keyframes[k];
        if (!keyframe->used || keyframe->map_id != fv_map_current_id(map) ||
            keyframe->number >= number || (found && keyframe->number < map->keyframes[best].number))
            continue;
        found = true;
        best = k;
    }
    if (!found) return false;
    const bool in = s->pose_of[best] >= 0;
    if (!in && s->pose_count == FV_WINDOW_POSES_MAX) return false;
    *pose = in ? (uint32_t)s->pose_of[best] : fv_window_put_pose(s, map, best);
    return true;
}

/* R_a_b of two poses. */
static void turn_between(const struct fv_window_state *s, uint64_t a, uint64_t b, double R[9])
{
    fv_multiply33_transposed(s->poses[a].T_cam_world.R, s->poses[b].T_cam_world.R, R);
}

/* Unless poses and gyro contradict each other. */
static void take_turn(struct fv_window *w, const struct fv_map *map, uint32_t a, uint32_t b)
{
    const struct fv_window_state *s = w->state;
    const struct fv_gyro_known *known = &w->turns->gyro;
    struct fv_window_turn *t = &w->gyro->turns[w->gyro->count];
    double between[9], e[3];
    if (!fv_turns_between(w->turns, number_of(s, map, a), number_of(s, map, b), &t->turn)) return;
    if (t->turn.time_s > turn_seconds_max) return;
    const double variance = fv_turn_variance(&t->turn, &known->doubt);
    turn_between(s, a, b, between);
    fv_turn_error(&t->turn, known->bias, between, e);
    if (fv_turn_contradicts(e, variance + fv_turn_bias_variance(&t->turn, known->bias_sigma)))
        return;
    t->a = a;
    t->b = b;
    t->weight = 1 / variance;
    w->gyro->count++;
}

void fv_window_take_turns(struct fv_window *w, const struct fv_map *map, uint32_t in_window)
{
    uint32_t order[FV_WINDOW_KEYFRAMES_MAX] = {0}, first;
    if (w->gyro == NULL || w->turns == NULL || !(w->turns->gyro.bias_sigma > 0)) return;
    const double sigma = w->turns->gyro.bias_sigma;
    fv_copy3(w->turns->gyro.bias, w->gyro->mean);
    fv_copy3(w->turns->gyro.bias, w->gyro->bias);
    fv_copy3(w->turns->gyro.bias, w->gyro->before);
    w->gyro->weight = 1 / (sigma * sigma);
    sort_poses(w->state, map, in_window, order);
    if (pose_before(w->state, map, number_of(w->state, map, order[0]), &first))
        take_turn(w, map, first, order[0]);
    for (uint32_t i = 1; i < in_window; i++)
        take_turn(w, map, order[i - 1], order[i]);
}

/* ---- a pass ---------------------------------------------------------------------------------- */

static int couple(const struct fv_window *w, struct fv_coupling list[FV_WINDOW_KEYFRAMES_MAX])
{
    for (uint32_t i = 0; i < w->state->moved_count; i++)
        list[i] = (struct fv_coupling){w->gyro->cross[i], 6 * (int)i, 6};
    return (int)w->state->moved_count;
}

static void add_diagonal(const struct fv_normal *normal, int column, double value)
{
    for (int i = column + 3; i < column + 6; i++)
        normal->H[i * (normal->size + 1)] += value;
}

/* The block between the turns of two poses, J_a^T W J_b = -weight `between`. */
static void add_between(const struct fv_normal *normal, int a, int b, double weight,
                        const double between[9])
{
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++) {
            const int row = a + 3 + r, column = b + 3 + c;
            normal->H[a > b ? row * normal->size + column : column * normal->size + row] -=
                weight * between[3 * r + c];
        }
}

/* Of the bias: its own block, and that with a pose whose turn is derived by J (row-major). */
static void add_to_bias(const struct fv_turn *turn, double weight, const double error[3],
                        double H[6], double g[3])
{
    const double *by = turn->by_bias;
    for (int r = 0, k = 0; r < 3; r++) {
        for (int i = 0; i < 3; i++)
            g[r] += weight * by[3 * i + r] * error[i];
        for (int c = r; c < 3; c++, k++)
            for (int i = 0; i < 3; i++)
                H[k] += weight * by[3 * i + r] * by[3 * i + c];
    }
}

static void add_cross(double cross[18], const struct fv_turn *turn, double weight,
                      const double J[9])
{
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++)
            for (int i = 0; i < 3; i++)
                cross[6 * r + 3 + c] -= weight * turn->by_bias[3 * i + r] * J[3 * i + c];
}

/* One turn: errors e of T_b's turn after T_a's, de = between^T d_a - d_b - by_bias d_bias. Returns
 * its robust cost. */
static double add_turn(struct fv_window *w, const struct fv_normal *normal,
                       const struct fv_window_turn *t, double H[6], double g[3])
{
    static const double minus[9] = {-1, 0, 0, 0, -1, 0, 0, 0, -1};
    const struct fv_window_pose *a = &w->state->poses[t->a], *b = &w->state->poses[t->b];
    const double more = 1 + w->state->damping;
    double between[9], J[9], e[3], weight = t->weight;
    turn_between(w->state, t->a, t->b, between);
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++)
            J[3 * c + r] = between[3 * r + c];
    fv_turn_error(&t->turn, w->gyro->bias, between, e);
    const double square = weight * fv_dot3(e, e);
    double cost = square;
    if (square > FV_CHI_SQUARE_99_3) {
        const double ratio = __builtin_sqrt(FV_CHI_SQUARE_99_3 / square);
        cost = 2 * FV_CHI_SQUARE_99_3 / ratio - FV_CHI_SQUARE_99_3;
        weight *= ratio;
    }
    if (a->column >= 0) {
        add_diagonal(normal, a->column, weight * more);
        for (int i = 0; i < 3; i++)
            normal->g[a->column + 3 + i] -= weight * fv_dot3(between + 3 * i, e);
        add_cross(w->gyro->cross[a->column / 6], &t->turn, weight, J);
    }
    if (b->column >= 0) {
        add_diagonal(normal, b->column, weight * more);
        for (int i = 0; i < 3; i++)
            normal->g[b->column + 3 + i] += weight * e[i];
        add_cross(w->gyro->cross[b->column / 6], &t->turn, weight, minus);
    }
    if (a->column >= 0 && b->column >= 0)
        add_between(normal, a->column, b->column, weight, between);
    add_to_bias(&t->turn, weight, e, H, g);
    return cost;
}

double fv_window_add_turns(struct fv_window *w)
{
    struct fv_window_gyro *gyro = w->gyro;
    struct fv_window_state *s = w->state;
    if (gyro == NULL || gyro->count == 0) return 0;
    const struct fv_normal normal = {s->system, s->gradient, 6 * (int)s->moved_count};
    struct fv_coupling list[FV_WINDOW_KEYFRAMES_MAX];
    double H[6] = {0}, g[3], d[3], cost = 0;
    if (s->step_pending) {
        fv_landmark_step(3, gyro->inverse, gyro->gradient, list, couple(w, list), s->step, d);
        for (int i = 0; i < 3; i++)
            gyro->bias[i] += d[i];
    }
    memset(gyro->cross, 0, sizeof gyro->cross);
    for (int i = 0; i < 3; i++) {
        const double off = gyro->bias[i] - gyro->mean[i];
        g[i] = -gyro->weight * off;
        cost += gyro->weight * off * off;
    }
    for (uint64_t i = 0; i < gyro->count; i++)
        cost += add_turn(w, &normal, &gyro->turns[i], H, g);
    for (int i = 0, k = 0; i < 3; k += 3 - i, i++)
        H[k] = (H[k] + gyro->weight) * (1 + s->damping);
    fv_copy3(g, gyro->gradient);
    if (!fv_invert_symmetric3(H, gyro->inverse)) memset(gyro->inverse, 0, sizeof gyro->inverse);
    fv_normal_eliminate(&normal, 3, gyro->inverse, gyro->gradient, list, couple(w, list));
    return cost;
}

void fv_window_keep_turns(struct fv_window *w, bool accept)
{
    if (w->gyro == NULL) return;
    if (accept)
        fv_copy3(w->gyro->bias, w->gyro->before);
    else
        fv_copy3(w->gyro->before, w->gyro->bias);
}

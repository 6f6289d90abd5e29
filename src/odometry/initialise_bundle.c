/* Bundle adjustment of an initialisation: the first view fixed, the poses of the others and the
 * inverse depths of all tracks along the first view's bearings moved. Little parallax is the rule
 * here, and inverse depths are nearly linear in it (J. Civera, A. Davison, J. Montiel, "Inverse
 * depth parametrization for monocular SLAM", 2008; F. Yu and D. Gallup, "3D reconstruction from
 * accidental motion", 2014): a point far away is no special case. */
#include <string.h>

#include "fovea/odometry.h"
#include "geometry/normal_equations.h"
#include "geometry/pose.h"
#include "geometry/vec.h"
#include "odometry/initialise.h"
#include "geometry/chi_square.h"

enum {
    MOVED_MAX = FV_INITIALISE_VIEWS_MAX - 1,
    SYSTEM_MAX = 6 * MOVED_MAX,
    STEPS_MAX = 16,
    ALIGN_STEPS = 6,
    ALIGN_TRACKS = 120 /* on which a view in between is placed at first */
};

static const double gain_min = 1e-3;   /* of the cost: smaller, and the minimum is reached */
static const double error_max = 9;     /* px^2 of level 0: a mismatch says no more than that */
static const double good_error = 0.05; /* px^2 of level 0 */
static const double parallax_some_px =
    2.5; /* of a landmark: less, and noise decides how far it is */
static const double point_fraction_min =
    0.5; /* of the tracks, that fit the motion before both cameras */
static const double stage_limit2[] = {100, 25, 6}; /* px^2 of level 0 */
enum { STAGES = sizeof stage_limit2 / sizeof stage_limit2[0], TIGHT_ROUNDS = 2 };
static const struct fv_damping damping_rule = {.fall = 0.2, .rise = 20, .extra = 1e-6};
static const double inverse_depth_max =
    0.7; /* of the way to the last view: nearer ones would only tell where that lies */
static const double behind_max = 0.1;
static const double scale_weight = 1e6; /* of the prior that holds the scale */
static const double align_limit2 =
    1e4; /* px^2: what an error says no more beyond, a quarter in each step */

/* Normal equations of the views moved, the inverse depths eliminated. */
struct fv_initialise_system {
    double H[SYSTEM_MAX * SYSTEM_MAX], g[SYSTEM_MAX];
    int size;
};

static struct fv_normal normal_of(struct fv_initialise_system *s)
{
    return (struct fv_normal){s->H, s->g, s->size};
}

/* Error of a track in view v (px), its weight, and derivatives by the view's motion (translation
 * first, then rotation, on the left of R) and by the inverse depth. False: behind the camera. */
struct fv_initialise_row {
    double error[2], weight;
    double by_pose[2][6], by_depth[2];
};

/* A small motion on the left of R, translation first; t is not turned. */
static void move(struct fv_se3 *T, const double step[6])
{
    double turn[9], R[9];
    fv_so3_exp(step + 3, turn);
    fv_multiply33(turn, T->R, R);
    for (int k = 0; k < 9; k++)
        T->R[k] = R[k];
    for (int k = 0; k < 3; k++)
        T->t[k] += step[k];
}

static const struct fv_keypoint *keypoint_of(const struct fv_map_frame *frame,
                                             const struct fv_feature_track *track, uint32_t v)
{
    return &frame->keypoints[track->feature[v]];
}

static bool row_of(const struct fv_initialise_bundle *b,
                   const struct fv_map_frame views[FV_INITIALISE_VIEWS_MAX],
                   const struct fv_pair *pair, const struct fv_feature_track *track,
                   double inverse_depth, uint32_t v, struct fv_initialise_row *row)
{
    const struct fv_keypoint *p = keypoint_of(&views[v], track, v),
                             *first = keypoint_of(&views[0], track, 0);
    const struct fv_se3 *T = &b->T_view_first[v];
    double ray[3], q[3], J[6], A[6];
    const double bearing[3] = {(double)p->bearing[0], (double)p->bearing[1], (double)p->bearing[2]};
    for (int k = 0; k < 6; k++)
        A[k] = (double)p->A[k];
    fv_rotate3(T->R, pair->x1, ray);
    for (int k = 0; k < 3; k++)
        q[k] = ray[k] + inverse_depth * T->t[k];
    if (!fv_observation_error(bearing, A, q, row->error, J)) return false;
    row->weight = 1 / (1 / (double)p->weight + 1 / (double)first->weight);
    for (int r = 0; r < 2; r++) {
        for (int k = 0; k < 3; k++)
            row->by_pose[r][k] = inverse_depth * J[3 * r + k];
        fv_cross3(ray, J + 3 * r, row->by_pose[r] + 3);
        row->by_depth[r] = fv_dot3(J + 3 * r, T->t);
    }
    return true;
}

/* Add both rows to the system, at the block of their view. */
static void add_row(const struct fv_normal *normal, int first, const struct fv_initialise_row *row)
{
    double weighted[12];
    fv_block_weigh(row->by_pose[0], 12, row->weight, weighted);
    fv_normal_add_rows(normal, first, 6, row->by_pose[0], weighted, row->error, 2);
}

/* Geman's and McClure's weight: errors beyond the limit count less and less. Returns the cost. */
static double robust(struct fv_initialise_row *row, double limit2)
{
    const double square =
        row->weight * (row->error[0] * row->error[0] + row->error[1] * row->error[1]);
    const double trust = 1 / (1 + square / limit2);
    row->weight *= trust * trust;
    return square * trust;
}

/* ---- first guess ----------------------------------------------------------------------------- */

/* Move view v until it fits the points. False: too few are seen. */
static bool place_view(struct fv_initialiser *in, uint32_t count,
                       const struct fv_map_frame views[FV_INITIALISE_VIEWS_MAX],
                       struct fv_initialise_bundle *b, uint32_t v)
{
    double limit2 = align_limit2;
    for (int step = 0; step < ALIGN_STEPS; step++, limit2 /= 4) {
        double H[36] = {0}, g[6] = {0};
        const struct fv_normal normal = {H, g, 6};
        uint32_t observations = 0;
        for (uint32_t i = 0; i < count && observations < ALIGN_TRACKS; i++) {
            struct fv_initialise_row row;
            if (in->tracks[i].feature[v] == FV_MAP_NONE ||
                !row_of(b, views, &in->pairs[i], &in->tracks[i], in->depths[i].value, v, &row))
                continue;
            (void)robust(&row, limit2);
            observations++;
            add_row(&normal, 0, &row);
        }
        fv_normal_damp(&normal, 1e-6, 1e-9);
        if (observations < FOVEA_POSED_INLIERS_MIN || !fv_normal_solve(&normal, g)) return false;
        move(&b->T_view_first[v], g);
    }
    return true;
}

static void find_views(const struct fv_initialiser *in, const struct fv_initialise_bundle *b,
                       struct fv_map_frame views[FV_INITIALISE_VIEWS_MAX])
{
    for (uint32_t v = 0; v < b->view_count; v++)
        views[v] = fv_map_frame_at(in->map, b->slots[v]);
}

bool fv_initialise_guess_motion(struct fv_initialiser *in, uint32_t count,
                                const struct fv_se3 *T_last_first, struct fv_initialise_bundle *b)
{
    struct fv_map_frame views[FV_INITIALISE_VIEWS_MAX];
    const uint32_t last = b->view_count - 1;
    uint32_t placed = 0;
    find_views(in, b, views);
    fv_se3_identity(&b->T_view_first[0]);
    b->T_view_first[last] = *T_last_first;
    for (uint32_t i = 0; i < count; i++)
        placed +=
            fv_initialise_inverse_depth(in, &in->pairs[i], T_last_first, &in->depths[i].value);
    if (placed < point_fraction_min * count) return false;
    for (uint32_t v = 1; v < last; v++) {
        fv_se3_part(T_last_first, b->fraction[v], &b->T_view_first[v]);
        if (!place_view(in, count, views, b, v)) return false;
    }
    return true;
}

bool fv_initialise_guess_again(struct fv_initialiser *in, uint32_t count,
                               struct fv_initialise_bundle *b)
{
    const struct fv_initialise_state *s = in->state;
    struct fv_map_frame views[FV_INITIALISE_VIEWS_MAX];
    const uint32_t last = b->view_count - 1;
    if (s->guessed != s->frames[0]) return false;
    find_views(in, b, views);
    fv_se3_identity(&b->T_view_first[0]);
    for (uint32_t i = 0; i < count; i++)
        in->depths[i].value = (double)in->guessed_depth[in->tracks[i].feature[0]];
    for (uint32_t v = 1; v <= last; v++) {
        b->T_view_first[v] = v == last ? s->guess : views[v].keyframe->T_cam_world;
        if (!place_view(in, count, views, b, v)) return false;
    }
    return true;
}

bool fv_initialise_guess_reversed(struct fv_initialiser *in, uint32_t count,
                                  struct fv_initialise_bundle *b)
{
    struct fv_map_frame views[FV_INITIALISE_VIEWS_MAX];
    double sum = 0;
    find_views(in, b, views);
    for (uint32_t i = 0; i < count; i++)
        sum += (double)in->guessed_depth[in->tracks[i].feature[0]];
    for (uint32_t i = 0; i < count; i++)
        in->depths[i].value = 2 * sum / count - (double)in->guessed_depth[in->tracks[i].feature[0]];
    for (uint32_t v = 1; v < b->view_count; v++) {
        for (int k = 0; k < 3; k++)
            b->T_view_first[v].t[k] = -b->T_view_first[v].t[k];
        if (!place_view(in, count, views, b, v)) return false;
    }
    return true;
}

void fv_initialise_note_guess(struct fv_initialiser *in, uint64_t now, uint32_t count, uint32_t all,
                              const struct fv_initialise_bundle *b)
{
    struct fv_initialise_state *s = in->state;
    const struct fv_map_frame first = fv_map_frame_at(in->map, b->slots[0]);
    double sum = 0;
    s->guess = b->T_view_first[b->view_count - 1];
    s->guessed = s->frames[0];
    for (uint32_t i = 0; i < count; i++)
        sum += in->depths[i].value;
    for (uint32_t f = 0; f < first.keyframe->features; f++)
        in->guessed_depth[f] = (float)(sum / count);
    for (uint32_t i = 0; i < all; i++) {
        double depth = in->depths[i].value;
        if (i >= count) (void)fv_initialise_inverse_depth(in, &in->pairs[i], &s->guess, &depth);
        in->guessed_depth[in->tracks[i].feature[0]] = (float)depth;
    }
    for (uint32_t i = 1; i < s->count; i++)
        fv_se3_part(&s->guess, (double)(s->frames[i] - s->frames[0]) / (double)(now - s->frames[0]),
                    &in->map->keyframes[s->slots[i]].T_cam_world);
    for (uint32_t v = 1; v + 1 < b->view_count; v++)
        in->map->keyframes[b->slots[v]].T_cam_world = b->T_view_first[v];
}

/* ---- adjustment ------------------------------------------------------------------------------ */

/* Add a track: its blocks, with its inverse depth eliminated. Returns its cost. */
static double add_rows(struct fv_initialiser *in, const struct fv_initialise_bundle *b,
                       const struct fv_map_frame views[FV_INITIALISE_VIEWS_MAX], uint32_t track,
                       double damping, double limit2, const struct fv_normal *normal)
{
    struct fv_initialise_depth *d = &in->depths[track];
    double cost = 0, h = 0;
    d->gradient = 0;
    memset(d->cross, 0, sizeof d->cross);
    for (uint32_t v = 1; v < b->view_count; v++) {
        struct fv_initialise_row row;
        double *cross = d->cross + 6 * (v - 1);
        if (in->tracks[track].feature[v] == FV_MAP_NONE) continue;
        if (!row_of(b, views, &in->pairs[track], &in->tracks[track], d->value, v, &row)) {
            cost += limit2;
            continue;
        }
        cost += robust(&row, limit2);
        add_row(normal, 6 * ((int)v - 1), &row);
        for (int r = 0; r < 2; r++) {
            const double scaled_depth = row.weight * row.by_depth[r];
            h += scaled_depth * row.by_depth[r];
            d->gradient -= scaled_depth * row.error[r];
            for (int k = 0; k < 6; k++)
                cross[k] += scaled_depth * row.by_pose[r][k];
        }
    }
    d->inverse = 1 / (h * (1 + damping) + 1e-9);
    return cost;
}

/* Normal equations at the present poses and depths; returns the cost. */
static double build(struct fv_initialiser *in, uint32_t count, const struct fv_initialise_bundle *b,
                    const struct fv_map_frame views[FV_INITIALISE_VIEWS_MAX], double damping,
                    double limit2, struct fv_initialise_system *s)
{
    double cost = 0;
    s->size = 6 * ((int)b->view_count - 1);
    const struct fv_normal normal = normal_of(s);
    fv_normal_clear(&normal);
    for (uint32_t i = 0; i < count; i++)
        cost += add_rows(in, b, views, i, damping, limit2, &normal);
    fv_normal_damp(&normal, damping, 0);
    for (uint32_t i = 0; i < count; i++) {
        const struct fv_initialise_depth *d = &in->depths[i];
        const struct fv_coupling coupling = {d->cross, 0, s->size};
        fv_normal_eliminate(&normal, 1, &d->inverse, &d->gradient, &coupling, 1);
    }
    return cost;
}

/* Move by the solution of the system; what was is kept in `before`. */
static bool take_step(struct fv_initialiser *in, uint32_t count, struct fv_initialise_bundle *b,
                      struct fv_initialise_system *s, struct fv_se3 before[FV_INITIALISE_VIEWS_MAX])
{
    memcpy(before, b->T_view_first, sizeof b->T_view_first);
    const struct fv_normal normal = normal_of(s);
    if (!fv_normal_solve(&normal, s->g)) return false;
    for (uint32_t v = 1; v < b->view_count; v++)
        move(&b->T_view_first[v], s->g + 6 * (v - 1));
    const double near = inverse_depth_max / fv_norm3(b->T_view_first[b->view_count - 1].t);
    for (uint32_t i = 0; i < count; i++) {
        struct fv_initialise_depth *d = &in->depths[i];
        const struct fv_coupling coupling = {d->cross, 0, s->size};
        double change;
        fv_landmark_step(1, &d->inverse, &d->gradient, &coupling, 1, s->g, &change);
        d->before = d->value;
        d->value += change;
        d->value = d->value > near                 ? near
                   : d->value < -near * behind_max ? -near * behind_max
                                                   : d->value;
    }
    return true;
}

/* Levenberg's and Marquardt's steps until nothing is gained. */
static void minimise(struct fv_initialiser *in, uint32_t count,
                     const struct fv_map_frame views[FV_INITIALISE_VIEWS_MAX],
                     struct fv_initialise_bundle *b, double limit2, struct fv_initialise_system *s)
{
    struct fv_se3 before[FV_INITIALISE_VIEWS_MAX];
    double damping = 1e-3, cost = build(in, count, b, views, damping, limit2, s);
    for (int step = 0; step < STEPS_MAX && take_step(in, count, b, s, before); step++) {
        const double now = build(in, count, b, views, damping, limit2, s);
        if (now <= cost) {
            const bool there = cost - now < gain_min * cost;
            cost = now;
            damping = fv_damping_lower(&damping_rule, damping);
            if (there) return;
            continue;
        }
        memcpy(b->T_view_first, before, sizeof before);
        for (uint32_t i = 0; i < count; i++)
            in->depths[i].value = in->depths[i].before;
        damping = fv_damping_raise(&damping_rule, damping);
        if (damping > 1e3) return;
        (void)build(in, count, b, views, damping, limit2, s);
    }
}

/* Points before the cameras, and the last view at distance 1. */
static void normalise(struct fv_initialiser *in, uint32_t count, struct fv_initialise_bundle *b)
{
    const uint32_t last = b->view_count - 1;
    double length = fv_norm3(b->T_view_first[last].t);
    uint32_t behind = 0;
    for (uint32_t i = 0; i < count; i++)
        behind += in->depths[i].value < 0;
    if (!(length > 1e-12)) length = 1;
    const double scale = (2 * behind > count ? -1 : 1) / length;
    for (uint32_t v = 1; v <= last; v++) {
        fv_so3_orthonormalise(b->T_view_first[v].R);
        for (int k = 0; k < 3; k++)
            b->T_view_first[v].t[k] *= scale;
    }
    for (uint32_t i = 0; i < count; i++)
        in->depths[i].value /= scale;
}

/* What each part of the image pulls at the poses with, the inverse depths eliminated; at the
 * minimum all of it adds up to nothing. */
static void pull_of(const struct fv_initialiser *in, uint32_t count,
                    const struct fv_initialise_bundle *b,
                    const struct fv_map_frame views[FV_INITIALISE_VIEWS_MAX], double limit2,
                    double pull[FV_MAP_PARTS][SYSTEM_MAX])
{
    memset(pull, 0, FV_MAP_PARTS * sizeof pull[0]);
    for (uint32_t i = 0; i < count; i++) {
        const struct fv_initialise_depth *d = &in->depths[i];
        const struct fv_pixel *p = &views[0].points[in->tracks[i].feature[0]];
        double *sum = pull[fv_map_part(in->map, p)];
        for (uint32_t v = 1; v < b->view_count; v++) {
            struct fv_initialise_row row;
            if (in->tracks[i].feature[v] == FV_MAP_NONE ||
                !row_of(b, views, &in->pairs[i], &in->tracks[i], d->value, v, &row))
                continue;
            (void)robust(&row, limit2);
            for (int k = 0; k < 6; k++)
                sum[6 * (v - 1) + k] += row.weight * (row.by_pose[0][k] * row.error[0] +
                                                      row.by_pose[1][k] * row.error[1]);
        }
        for (uint32_t k = 0; k < 6 * (b->view_count - 1); k++)
            sum[k] += d->cross[k] * d->inverse * d->gradient;
    }
}

/* One standard deviation (rad) of the direction in which the last view lies; the scale, which is
 * free, is held by a prior along it. The larger of two: by the noise, whose errors are independent;
 * and by what the parts of the image pull to either side, whose errors may be one (K.-Y. Liang and
 * S. Zeger, "Longitudinal data analysis using generalized linear models", 1986): where a thing that
 * moves bends the bundle, it pulls against all the rest. FV_PI: not determined. */
static double direction_sigma(struct fv_initialiser *in, uint32_t count,
                              const struct fv_initialise_bundle *b,
                              const struct fv_map_frame views[FV_INITIALISE_VIEWS_MAX],
                              double limit2, struct fv_initialise_system *s)
{
    const double *t = b->T_view_first[b->view_count - 1].t;
    double variance = 0, variance_parts = 0, pull[FV_MAP_PARTS][SYSTEM_MAX];
    (void)build(in, count, b, views, 1e-9, limit2, s);
    pull_of(in, count, b, views, limit2, pull);
    const int n = s->size, at = n - 6;
    const struct fv_normal fixed = {s->H, NULL, n};
    double along[3];
    fv_block_weigh(t, 3, scale_weight, along);
    fv_normal_add_one(&fixed, at, 3, t, along, NULL, 1, NULL);
    if (!fv_ldlt_factor(s->H, n)) return FV_PI;
    for (int axis = 0; axis < 3; axis++) {
        memset(s->g, 0, sizeof s->g);
        for (int k = 0; k < 3; k++)
            s->g[at + k] = (k == axis) - t[axis] * t[k];
        const double across[3] = {s->g[at], s->g[at + 1], s->g[at + 2]};
        fv_ldlt_back(s->H, n, s->g);
        variance += fv_dot3(across, s->g + at);
        for (int part = 0; part < FV_MAP_PARTS; part++) {
            double moved = 0;
            for (int k = 0; k < n; k++)
                moved += s->g[k] * pull[part][k];
            variance_parts += moved * moved;
        }
    }
    variance *= b->noise * b->noise;
    return __builtin_sqrt(variance > variance_parts ? variance : variance_parts);
}

/* ---- judgement ------------------------------------------------------------------------------- */

/* How badly a track is explained; `fits` tells whether all its errors are small. The logarithm
 * (Cauchy's weights) at the scale of a good match lets a slightly bent geometry, which explains a
 * moving thing as well, lose to the right one. */
static double track_cost(const struct fv_initialiser *in, const struct fv_initialise_bundle *b,
                         const struct fv_map_frame views[FV_INITIALISE_VIEWS_MAX], uint32_t track,
                         bool *fits, double *square)
{
    double cost = 0;
    *square = 0;
    *fits = in->depths[track].value > 0;
    for (uint32_t v = 1; v < b->view_count; v++) {
        struct fv_initialise_row row;
        double error = error_max;
        if (in->tracks[track].feature[v] == FV_MAP_NONE) continue;
        if (row_of(b, views, &in->pairs[track], &in->tracks[track], in->depths[track].value, v,
                   &row))
            error = row.weight * (row.error[0] * row.error[0] + row.error[1] * row.error[1]);
        if (!(error < error_max)) error = error_max;
        cost += fv_log(1 + error / good_error);
        *square += error;
        *fits = *fits && error < FV_CHI_SQUARE_95_2;
    }
    return cost;
}

/* Cost, points and noise of the bundle. */
static void judge(struct fv_initialiser *in, uint32_t count,
                  const struct fv_map_frame views[FV_INITIALISE_VIEWS_MAX],
                  struct fv_initialise_bundle *b)
{
    const struct fv_se3 *last = &b->T_view_first[b->view_count - 1];
    double squares = 0, freedom = -6.0 * (b->view_count - 1);
    b->points = b->parallax_points = 0;
    b->cost = 0;
    for (uint32_t i = 0; i < count; i++) {
        bool fits;
        double square;
        b->cost += track_cost(in, b, views, i, &fits, &square);
        in->inlier[i] = fits;
        if (!fits) continue;
        squares += square;
        freedom -= 1;
        for (uint32_t v = 1; v < b->view_count; v++)
            freedom += in->tracks[i].feature[v] == FV_MAP_NONE ? 0 : 2;
        b->points++;
        b->parallax_points +=
            fv_initialise_parallax_px(in, &in->pairs[i], last, in->depths[i].value) >=
            FV_INITIALISE_PARALLAX_PX;
    }
    const double variance = freedom > 0 ? squares / freedom : 1;
    b->noise = __builtin_sqrt(variance > FV_MAP_VARIANCE_MIN ? variance : FV_MAP_VARIANCE_MIN);
}

void fv_initialise_adjust(struct fv_initialiser *in, uint32_t count, enum fv_initialise_trust trust,
                          struct fv_initialise_bundle *b)
{
    struct fv_initialise_system system;
    struct fv_map_frame views[FV_INITIALISE_VIEWS_MAX];
    find_views(in, b, views);
    for (int stage = (int)trust; stage < STAGES; stage++)
        minimise(in, count, views, b, stage_limit2[stage], &system);
    double limit2 = FV_CHI_SQUARE_95_2;
    for (int round = 0; round < TIGHT_ROUNDS; round++) {
        judge(in, count, views, b);
        limit2 = FV_CHI_SQUARE_95_2 * (b->noise < 1 ? b->noise * b->noise : 1);
        minimise(in, count, views, b, limit2, &system);
    }
    normalise(in, count, b);
    judge(in, count, views, b);
    b->direction_sigma = direction_sigma(in, count, b, views, limit2, &system);
}

double fv_initialise_turn_cost(struct fv_initialiser *in, uint32_t count,
                               const struct fv_initialise_bundle *b)
{
    struct fv_map_frame views[FV_INITIALISE_VIEWS_MAX];
    struct fv_initialise_bundle turn = *b;
    double cost = 0, square;
    bool fits;
    find_views(in, b, views);
    for (uint32_t i = 0; i < count; i++)
        in->depths[i].value = 0;
    for (uint32_t v = 1; v < b->view_count; v++)
        (void)place_view(in, count, views, &turn, v);
    for (uint32_t i = 0; i < count; i++)
        cost += track_cost(in, &turn, views, i, &fits, &square);
    return cost;
}

/* Largest weighted squared error of a track over its views. */
static double track_error2(const struct fv_initialiser *in, const struct fv_initialise_bundle *b,
                           const struct fv_map_frame views[FV_INITIALISE_VIEWS_MAX], uint32_t track)
{
    double worst = 0;
    for (uint32_t v = 1; v < b->view_count; v++) {
        struct fv_initialise_row row;
        if (in->tracks[track].feature[v] == FV_MAP_NONE) continue;
        if (!row_of(b, views, &in->pairs[track], &in->tracks[track], in->depths[track].value, v,
                    &row))
            return 1e300;
        const double error2 =
            row.weight * (row.error[0] * row.error[0] + row.error[1] * row.error[1]);
        worst = error2 > worst ? error2 : worst;
    }
    return worst;
}

double fv_initialise_fit_clarity(const struct fv_initialiser *in, uint32_t count,
                                 const struct fv_initialise_bundle *b)
{
    struct fv_map_frame views[FV_INITIALISE_VIEWS_MAX];
    const double limit2 = FV_CHI_SQUARE_95_2 * b->noise * b->noise;
    uint32_t clear = 0, about = 0;
    find_views(in, b, views);
    for (uint32_t i = 0; i < count; i++) {
        const double error2 = track_error2(in, b, views, i);
        clear += error2 < limit2;
        about += error2 < 16 * limit2;
    }
    return about > 0 ? (double)clear / about : 0;
}

bool fv_initialise_point_serves(const struct fv_initialiser *in,
                                const struct fv_initialise_bundle *b, uint32_t track)
{
    return in->inlier[track] &&
           fv_initialise_parallax_px(in, &in->pairs[track], &b->T_view_first[b->view_count - 1],
                                     in->depths[track].value) >= parallax_some_px;
}

/* Bundle adjustment of a start: the first view fixed, the others and the points of all tracks moved, in the
 * window's own memory and by its optimiser. */
#include "geometry/vec.h"
#include "odometry/odometry.h"

enum { PASSES_MAX = 12, ROUNDS_MAX = 3 };

static const double round_gain_min = 0.03; /* of the cost: less, and another round is of no use */
static const double chi_square_95_2 = 5.991,
                    error_max = 9;          /* px^2 of level 0: a mismatch says no more than that */
static const double good_error = 0.05;      /* px^2 of level 0 */
static const double parallax_some_px = 2.5; /* of a landmark: less, and noise decides how far it is */
static const double point_share_min = 0.5;  /* of the tracks, that fit the motion before both cameras */

/* inlier[track] holds a bit for each view in which the track takes part. */
static bool fv_takes_part(const struct fv_odometry *o, uint32_t track, uint32_t view)
{
    return o->inlier[track] >> view & 1;
}

/* Points of the tracks by the motion; those that do not fit it take no part. */
static uint32_t fv_place_points(struct fv_odometry *o, uint32_t count, uint32_t last, const struct fv_se3 *T)
{
    uint32_t placed = 0;
    for (uint32_t i = 0; i < count; i++) {
        o->inlier[i] = 0;
        if (!fv_start_place_point(o, &o->pairs[i], T, o->window.landmarks[i].point)) continue;
        o->inlier[i] = (uint8_t)(1u | 1u << last);
        placed++;
    }
    return placed;
}

/* Pose of a view in between: part of the way, refined on the points. False: they do not agree. */
static bool fv_place_view(struct fv_odometry *o, uint32_t count, const struct fv_start_bundle *b, uint32_t v,
                          struct fv_se3 *T)
{
    const struct fv_view view = fv_map_view(&o->map, b->slots[v]);
    const struct fv_se3 *last = &b->T_view_first[b->view_count - 1];
    struct fv_pose_fit fit;
    double turn[3];
    uint32_t sights = 0;
    fv_so3_log(last->R, turn);
    for (int k = 0; k < 3; k++) {
        turn[k] *= b->share[v];
        T->t[k] = last->t[k] * b->share[v];
    }
    fv_so3_exp(turn, T->R);
    for (uint32_t i = 0; i < count; i++) {
        if (o->inlier[i] == 0 || o->tracks[i].feature[v] == FV_MAP_NONE) continue;
        fv_sight_from(&view.points[o->tracks[i].feature[v]], o->window.landmarks[i].point,
                      &o->sights[sights]);
        o->sight_feature[sights++] = i;
    }
    if (sights < FOVEA_POSED_INLIERS_MIN || !fv_pose_refine(o->sights, sights, 3, 4, T, &fit)) return false;
    for (uint32_t k = 0; k < sights; k++)
        if (o->sights[k].inlier) o->inlier[o->sight_feature[k]] |= (uint8_t)(1u << v);
    return fit.inliers >= FOVEA_POSED_INLIERS_MIN;
}

static void fv_fill(struct fv_odometry *o, uint32_t count, const struct fv_start_bundle *b)
{
    struct fv_window *w = &o->window;
    fv_window_clear(w);
    for (uint32_t v = 0; v < b->view_count; v++)
        (void)fv_window_put_pose(w, &b->T_view_first[v], v > 0);
    for (uint32_t i = 0; i < count; i++) {
        const double point[3] = {w->landmarks[i].point[0], w->landmarks[i].point[1],
                                 w->landmarks[i].point[2]};
        fv_window_put_landmark(w, point);
        for (uint32_t v = 0; v < b->view_count; v++)
            if (fv_takes_part(o, i, v))
                fv_window_put_observation(
                    w, &fv_map_view(&o->map, b->slots[v]).points[o->tracks[i].feature[v]], v);
    }
    fv_window_begin(w, PASSES_MAX);
}

double fv_start_parallax_px(const struct fv_odometry *o, const struct fv_se3 *T, const double point[3])
{
    const double origin[3] = {0, 0, 0};
    double centre[3], ray[3], cross[3];
    fv_se3_apply_inverse(T, origin, centre);
    fv_subtract3(point, centre, ray);
    fv_cross3(point, ray, cross);
    return o->focal_px * fv_norm3(cross) / (fv_norm3(point) * fv_norm3(ray) + 1e-12);
}

/* Weighted squared error of a track in a view, at most `error_max`. */
static double fv_track_error(const struct fv_odometry *o, const struct fv_start_bundle *b, uint32_t track,
                             uint32_t v)
{
    struct fv_sight s;
    double q[3], e[2];
    fv_sight_from(&fv_map_view(&o->map, b->slots[v]).points[o->tracks[track].feature[v]],
                  o->window.landmarks[track].before, &s);
    fv_se3_apply(&b->T_view_first[v], s.point, q);
    if (o->inlier[track] == 0 || !fv_sight_error(s.bearing, s.A, q, e, 0)) return error_max;
    double error = s.weight * (e[0] * e[0] + e[1] * e[1]);
    return error < error_max ? error : error_max;
}

/* How badly a track is explained; `fits` tells whether all its errors are small. The logarithm (Cauchy's
 * weights) at the scale of a good match lets a slightly bent geometry, which explains a moving thing as well,
 * lose to the right one. */
static double fv_track_cost(const struct fv_odometry *o, const struct fv_start_bundle *b, uint32_t track,
                            bool *fits)
{
    double cost = 0;
    *fits = true;
    for (uint32_t v = 0; v < b->view_count; v++) {
        if (o->tracks[track].feature[v] == FV_MAP_NONE) continue;
        double error = fv_track_error(o, b, track, v);
        cost += fovea_log(1 + error / good_error);
        *fits = *fits && error < chi_square_95_2;
    }
    return cost;
}

bool fv_start_point_serves(const struct fv_odometry *o, const struct fv_start_bundle *b, uint32_t track)
{
    bool fits;
    (void)fv_track_cost(o, b, track, &fits);
    return fits && fv_start_parallax_px(o, &b->T_view_first[b->view_count - 1],
                                        o->window.landmarks[track].before) >= parallax_some_px;
}

/* Fit points and views to the motion, and adjust all of them. */
static bool fv_adjust_once(struct fv_odometry *o, uint32_t count, struct fv_start_bundle *b)
{
    struct fv_window *w = &o->window;
    const uint32_t last = b->view_count - 1;
    if (fv_place_points(o, count, last, &b->T_view_first[last]) < point_share_min * count) return false;
    for (uint32_t v = 1; v < last; v++)
        if (!fv_place_view(o, count, b, v, &b->T_view_first[v])) return false;
    fv_fill(o, count, b);
    while (fv_window_unit(w))
        ;
    for (uint32_t v = 0; v <= last; v++) {
        b->T_view_first[v] = w->state->poses[v].before;
        fv_so3_orthonormalise(b->T_view_first[v].R);
    }
    b->direction_sigma = fv_window_direction_sigma(w, last);
    b->points = b->parallax_points = 0;
    b->cost = 0;
    for (uint32_t i = 0; i < count; i++) {
        bool fits;
        b->cost += fv_track_cost(o, b, i, &fits);
        if (!fits) continue;
        b->points++;
        b->parallax_points +=
            fv_start_parallax_px(o, &b->T_view_first[last], w->landmarks[i].before) >= FV_START_PARALLAX_PX;
    }
    return true;
}

bool fv_start_adjust(struct fv_odometry *o, uint32_t count, const struct fv_se3 *T_last_first,
                     struct fv_start_bundle *b)
{
    const uint32_t last = b->view_count - 1;
    double before = 1e300;
    fv_se3_identity(&b->T_view_first[0]);
    b->T_view_first[last] = *T_last_first;
    for (int round = 0; round < ROUNDS_MAX; round++) {
        if (!fv_adjust_once(o, count, b)) return false;
        if (b->cost > before * (1 - round_gain_min)) return true;
        before = b->cost;
        /* The next round places points anew: those that the motion could not place before may now take part.
         */
        (void)fv_normalise3(b->T_view_first[last].t);
    }
    return true;
}

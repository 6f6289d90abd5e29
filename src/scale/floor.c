/* The floor under the camera, from the landmarks of the map. */
#include "geometry/vec.h"
#include "scale/scale.h"

enum { SAMPLES = 96, INLIERS_MIN = 20 };

static const double depression_least = 0.07; /* sine of the angle below the horizon: 4 degrees */
static const double flat_sigma =
    0.02; /* of the floor right below, relative to the camera's height */
static const double slope_sigma_rad = 0.01; /* of the floor ahead against that below */
static const double sigma_most = 0.3; /* of a point's distance, relative; worse ones say nothing */
static const double sharp_sigma_least = 0.01; /* relative, as flat_sigma */
static const double prior_sigma_rad = 0.05,
                    prior_off_max_rad = 0.2; /* robots nod, and ramps begin */

/* Largest squared sine of the parallax between the first observer of a landmark and the others. */
static double landmark_parallax2(const struct fv_map *map, const struct fv_landmark *l)
{
    static const double origin[3] = {0, 0, 0};
    double first[3], ray[3], centre[3], across[3], best = 0;
    for (uint32_t k = 0; k < l->observer_count; k++) {
        fv_se3_apply_inverse(&map->keyframes[l->observers[k].keyframe].T_cam_world, origin, centre);
        fv_subtract3(l->point, centre, k == 0 ? first : ray);
        if (k == 0) continue;
        fv_cross3(first, ray, across);
        double sine2 = fv_dot3(across, across) / (fv_dot3(first, first) * fv_dot3(ray, ray));
        if (sine2 > best) best = sine2;
    }
    return best;
}

/* A landmark as a point of the floor; false when it is none, or says nothing. Its height errs along
 * the ray by what triangulation leaves open, and across by what the floor's shape does. */
static bool landmark_as_point(const struct fv_floor_look *look, const struct fv_odometry *odometry,
                              const struct fv_se3 *T_cam_world, const struct fv_landmark *l,
                              struct fv_floor_point *point)
{
    fv_se3_apply(T_cam_world, l->point, point->p);
    double distance = fv_norm3(point->p), depth = fv_dot3(look->down, point->p);
    if (!(depth > depression_least * distance)) return false;
    if (look->takes != NULL && !look->takes(look->context, point->p)) return false;
    double pixel_rad = fv_level_scale(l->level) / fv_odometry_focal_px(odometry),
           parallax2 = landmark_parallax2(fv_odometry_map(odometry), l);
    double along2 = 2 * pixel_rad * pixel_rad / (parallax2 + 1e-12);
    if (along2 > sigma_most * sigma_most) return false;
    double across = slope_sigma_rad * distance / depth;
    point->sigma = __builtin_sqrt(along2 + across * across + flat_sigma * flat_sigma);
    return true;
}

struct fv_floor_gather fv_scale_gather_begin(const struct fv_odometry *odometry)
{
    const struct fv_map *map = fv_odometry_map(odometry);
    return (struct fv_floor_gather){.T_cam_world = map->keyframes[fv_map_current(map)].T_cam_world};
}

bool fv_scale_gather_floor(const struct fv_odometry *odometry, const struct fv_floor_look *look,
                           struct fv_floor_gather *gather)
{
    const struct fv_map *map = fv_odometry_map(odometry);
    const uint32_t top = map->state->landmark_top; /* of another map it may be less */
    for (uint32_t i = 0; i < FV_FLOOR_SLOTS && gather->next < top; i++, gather->next++) {
        struct fv_floor_point point;
        const struct fv_landmark *l = &map->landmarks[gather->next];
        if (!l->used || l->observer_count < 2 ||
            map->keyframes[l->observers[0].keyframe].map_id != map->state->map_id)
            continue;
        if (!landmark_as_point(look, odometry, &gather->T_cam_world, l, &point)) continue;
        /* Reservoir: every point is kept with the same probability (J. Vitter, 1985). */
        const uint32_t at = gather->met < look->points_max
                                ? gather->met
                                : fv_random_below(look->random, gather->met + 1);
        gather->met++;
        if (at < look->points_max) look->points[at] = point;
    }
    gather->count = gather->met < look->points_max ? gather->met : look->points_max;
    return gather->next >= top;
}

bool fv_scale_fit_floor(const struct fv_floor_look *look, uint32_t count, struct fv_floor *floor)
{
    struct fv_floor_prior prior = {.sigma_rad = prior_sigma_rad, .off_max_rad = prior_off_max_rad};
    fv_copy3(look->down, prior.down);
    return fv_floor_estimate(look->points, count, &prior, look->samples, INLIERS_MIN, look->random,
                             floor);
}

void fv_scale_sharpen_floor(const struct fv_floor_look *look, uint32_t count,
                            const struct fv_floor *floor)
{
    const double spread = fv_floor_spread(look->points, count, floor);
    for (uint32_t i = 0; i < count && spread < 1; i++) {
        double *sigma = &look->points[i].sigma;
        *sigma = *sigma * spread > sharp_sigma_least ? *sigma * spread : sharp_sigma_least;
    }
}

bool fv_scale_find_floor(struct fv_scale *scale, const struct fv_odometry *odometry,
                         struct fv_floor *floor, bool *found)
{
    struct fv_scale_state *s = scale->state;
    struct fv_floor_look look = {.random = &s->random,
                                 .points = scale->points,
                                 .points_max = FV_FLOOR_POINTS_MAX,
                                 .samples = SAMPLES};
    fv_copy3(scale->down, look.down);
    if (!s->gathering) s->gather = fv_scale_gather_begin(odometry);
    s->gathering = !fv_scale_gather_floor(odometry, &look, &s->gather);
    if (s->gathering) return false;
    *found = fv_scale_fit_floor(&look, s->gather.count, floor);
    return true;
}

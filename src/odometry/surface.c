#include "odometry/surface.h"

#include "geometry/vec.h"
#include "odometry/odometry.h"

static const double contradicts2 = 9; /* squared error in units of its variance */

/* What the frame knows that all of its points are judged by. */
struct sight {
    const struct fv_map *map;
    struct fv_map_frame frame;
    const struct fv_inverse_distance *measured; /* NULL: nothing */
    double pixel_rad;                           /* error of a feature of level 0 */
};

/* Of a relative distance, 1 / variance: what one measurement of the inverse distance adds. */
static double weight_of(const struct fv_inverse_distance *m, double distance)
{
    return (double)m->weight / (distance * distance);
}

/* The same of a landmark: by the rays of its observers, or by the distance of the only one. */
static double landmark_weight(const struct sight *s, const struct fv_landmark *l, double distance)
{
    const double ray_rad = s->pixel_rad * fv_level_scale(l->level), spread = (double)l->spread;
    if (l->observer_count >= 2) return l->observer_count * spread * spread / (ray_rad * ray_rad);
    if (l->observer_count == 0 || s->measured == NULL) return 0;
    const struct fv_observer only = l->observers[0];
    const struct fv_inverse_distance *m = &fv_map_distances(s->map, only.keyframe)[only.feature];
    const double value2 = (double)m->value * (double)m->value;
    if (s->map->keyframes[only.keyframe].stamp_ns == s->frame.keyframe->stamp_ns)
        return 0; /* of this frame, whose measurement is added */
    /* Its error in metres stays, from wherever it is seen. */
    return (double)m->weight * value2 * value2 * distance * distance;
}

/* False: what is measured contradicts it. */
static bool agrees(const struct fv_inverse_distance *m, double distance, double weight)
{
    if (m == NULL || !(m->weight > 0)) return true;
    const double error = 1 / distance - (double)m->value,
                 own = 1 / (distance * distance * (weight + 1e-12));
    return error * error < contradicts2 * (1 / (double)m->weight + own);
}

static bool landmark_place(const struct sight *s, uint32_t feature, double q[3], double *weight)
{
    const struct fv_landmark *l = &s->map->landmarks[s->frame.landmark[feature]];
    const struct fv_inverse_distance *m = s->measured == NULL ? NULL : &s->measured[feature];
    fv_se3_apply(&s->frame.keyframe->T_cam_world, l->point, q);
    const double distance = fv_norm3(q);
    if (!(q[2] > 0) || !(distance > 1e-6)) return false;
    *weight = landmark_weight(s, l, distance);
    if (!agrees(m, distance, *weight)) return false;
    if (m != NULL) *weight += weight_of(m, distance);
    return true;
}

static bool measured_place(const struct sight *s, uint32_t feature, double q[3], double *weight)
{
    const struct fv_inverse_distance *m = s->measured == NULL ? NULL : &s->measured[feature];
    if (m == NULL || !fv_inverse_distance_known(m, FV_MAP_KNOWN_PARTS)) return false;
    const double distance = 1 / (double)m->value;
    for (int k = 0; k < 3; k++)
        q[k] = distance * (double)s->frame.keypoints[feature].bearing[k];
    *weight = weight_of(m, distance);
    return true;
}

static bool point_of(const struct sight *s, uint32_t feature, struct fv_surface_point *point)
{
    double q[3], weight;
    const bool known = s->frame.landmark[feature] != FV_MAP_NONE
                           ? landmark_place(s, feature, q, &weight)
                           : measured_place(s, feature, q, &weight);
    if (!known || !(weight > FV_MAP_KNOWN_PARTS * FV_MAP_KNOWN_PARTS)) return false;
    const double distance = fv_norm3(q),
                 ray_rad = s->pixel_rad * fv_level_scale(s->frame.points[feature].level);
    for (int k = 0; k < 3; k++)
        point->position[k] = (float)(q[k] + s->frame.keyframe->seen_from[k]);
    point->along = (float)(distance / __builtin_sqrt(weight));
    point->across = (float)(distance * ray_rad);
    return true;
}

uint32_t fv_odometry_surface(const struct fv_odometry *o, uint32_t *next,
                             struct fv_surface_point *points, uint32_t capacity)
{
    const uint32_t current = fv_map_current(&o->map);
    const struct sight s = {.map = &o->map,
                            .frame = fv_map_frame_at(&o->map, current),
                            .measured =
                                fv_map_metric(&o->map) ? fv_map_distances(&o->map, current) : NULL,
                            .pixel_rad = __builtin_sqrt(FV_INVERSE_DISTANCE_UNIT) / o->focal_px};
    uint32_t count = 0;
    if (o->state->state != FOVEA_TRACKING_OK) return 0;
    for (; *next < s.frame.keyframe->features && count < capacity; ++*next)
        count += point_of(&s, *next, &points[count]);
    return count;
}

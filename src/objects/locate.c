/* Where an object is in metres: from the height of its class, which gives the range, or from the
 * floor, which its foot stands on. */
#include "objects/objects.h"

#include <string.h>

#include "geometry/se3.h"

static const double height_fraction = 0.1; /* deviation of a class's height */
static const double edge_fraction = 0.03;  /* deviation of a box's edge, of the box's height */
static const double tilt_sigma_rad = 0.01; /* of the camera over the floor */
static const double range_max_m = 1000.0,
                    walk_m_s = 1.0; /* a velocity gains so much within a second */

struct position {
    double at[3];    /* camera frame */
    double along[3]; /* unit vector towards it */
    double range_variance, across_variance;
};

static bool bearing(const struct fv_objects *objects, double x, double y, double b[3])
{
    const double pixel[2] = {x, y};
    return fovea_camera_unproject(objects->camera, pixel, b, NULL) == FOVEA_OK;
}

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static double edge_sigma_px(const struct fv_object_slot *slot)
{
    const double sigma = edge_fraction * slot->box[FV_OBJECT_H].x;
    return sigma > 0.5 ? sigma : 0.5;
}

/* Box cut by the image's border: its height and its foot are not to be trusted. */
static bool is_cut(const struct fv_objects *objects, const struct fv_object_slot *slot)
{
    const struct fovea_object *t = &slot->object;
    return t->x_min_px < 1.0f || t->y_min_px < 1.0f ||
           t->x_max_px > (float)objects->camera->width - 2.0f ||
           t->y_max_px > (float)objects->camera->height - 2.0f;
}

static bool by_size(const struct fv_objects *objects, const struct fv_object_slot *slot,
                    double height_m, struct position *position)
{
    double top[3], bottom[3], middle[3];
    const double x = slot->box[FV_OBJECT_X].x, y = slot->box[FV_OBJECT_Y].x,
                 half = 0.5 * slot->box[FV_OBJECT_H].x;
    if (!bearing(objects, x, y - half, top) || !bearing(objects, x, y + half, bottom) ||
        !bearing(objects, x, y, middle))
        return false;
    const double difference[3] = {top[0] - bottom[0], top[1] - bottom[1], top[2] - bottom[2]};
    const double chord = __builtin_sqrt(
        dot(difference, difference)); /* 2 sin of half the angle that the height fills */
    if (!(chord > 1e-6)) return false;
    const double half_sine = 0.5 * chord, half_cosine = __builtin_sqrt(1.0 - half_sine * half_sine);
    const double range = 0.5 * height_m * half_cosine / half_sine;
    const double fraction = 1.4 * edge_sigma_px(slot) / slot->box[FV_OBJECT_H].x;
    if (!(range < range_max_m)) return false;
    const double across = edge_sigma_px(slot) / objects->camera->fy * range;
    memcpy(position->along, middle, sizeof middle);
    for (int i = 0; i < 3; i++)
        position->at[i] = range * middle[i];
    position->range_variance =
        range * range * (fraction * fraction + height_fraction * height_fraction);
    position->across_variance = across * across;
    return true;
}

static bool by_floor(const struct fv_objects *objects, const struct fv_object_slot *slot,
                     struct position *position)
{
    double foot[3];
    const double *T = objects->T_body_cam;
    if (!bearing(objects, slot->box[FV_OBJECT_X].x,
                 slot->box[FV_OBJECT_Y].x + 0.5 * slot->box[FV_OBJECT_H].x, foot))
        return false;
    const double down = -(T[8] * foot[0] + T[9] * foot[1] +
                          T[10] * foot[2]); /* sine of the angle below the horizon */
    if (!(down > 0.02) || !(T[11] > 0.01)) return false;
    const double range = T[11] / down;
    if (!(range < range_max_m)) return false;
    const double pixel_rad = edge_sigma_px(slot) / objects->camera->fy,
                 cosine = __builtin_sqrt(1.0 - down * down);
    const double fraction =
        __builtin_sqrt(pixel_rad * pixel_rad + tilt_sigma_rad * tilt_sigma_rad) * cosine / down;
    memcpy(position->along, foot, sizeof foot);
    for (int i = 0; i < 3; i++)
        position->at[i] = range * foot[i];
    position->range_variance = range * range * fraction * fraction;
    position->across_variance = range * range * pixel_rad * pixel_rad;
    return true;
}

/* Covariance across and along the ray, turned by R (NULL: camera frame). */
static void covariance_of(const struct position *position, const double *T_world_cam,
                          double full[9])
{
    double along[3];
    for (int i = 0; i < 3; i++) {
        along[i] = T_world_cam == NULL
                       ? position->along[i]
                       : dot((const double[3]){T_world_cam[4 * i], T_world_cam[4 * i + 1],
                                               T_world_cam[4 * i + 2]},
                             position->along);
    }
    for (int i = 0; i < 9; i++) {
        full[i] =
            (position->range_variance - position->across_variance) * along[i / 3] * along[i % 3] +
            (i % 4 == 0 ? position->across_variance : 0.0);
    }
}

static void upper(const double full[9], double covariance[6])
{
    static const int index[6] = {0, 1, 2, 4, 5, 8};
    for (int i = 0; i < 6; i++)
        covariance[i] = full[index[i]];
}

/* The matrix of the given variances that has the correlations of `full`. */
static void scale_to(double full[9], const double variance[3])
{
    double scale[3];
    for (int i = 0; i < 3; i++)
        scale[i] = __builtin_sqrt(variance[i] / full[4 * i]);
    for (int i = 0; i < 9; i++)
        full[i] *= scale[i / 3] * scale[i % 3];
}

static void filter_position(struct fv_object_slot *slot, const struct position *position,
                            const struct fv_objects_inference *inference)
{
    struct fv_se3 T;
    double at[3], full[9];
    fv_se3_from_rows(inference->T_world_cam, &T);
    fv_se3_apply(&T, position->at, at);
    covariance_of(position, inference->T_world_cam, full);
    const bool goes_on = slot->has_position && slot->world == inference->world;
    const double dt_s = (double)(inference->stamp_ns - slot->position_ns) * 1e-9;
    for (int i = 0; i < 3; i++) {
        if (goes_on) {
            fv_filter_predict(&slot->position[i], dt_s, walk_m_s * walk_m_s);
            fv_filter_update(&slot->position[i], at[i], full[4 * i]);
        } else {
            fv_filter_start(&slot->position[i], at[i], __builtin_sqrt(full[4 * i]), walk_m_s);
        }
    }
    slot->has_position = 1;
    slot->world = inference->world;
    slot->position_ns = inference->stamp_ns;
    for (int i = 0; i < 3; i++) {
        slot->object.position_m[i] = slot->position[i].x;
        slot->object.velocity_m_s[i] = slot->position[i].v;
    }
    /* The filter works axis by axis; the measurement's shape is kept, scaled to its variances. */
    scale_to(full,
             (const double[3]){slot->position[0].xx, slot->position[1].xx, slot->position[2].xx});
    upper(full, slot->object.covariance_m2);
    scale_to(full,
             (const double[3]){slot->position[0].vv, slot->position[1].vv, slot->position[2].vv});
    upper(full, slot->object.velocity_covariance_m2_s2);
    slot->object.located = FOVEA_OBJECT_LOCATED_WORLD;
}

void fv_objects_locate(const struct fv_objects *objects, struct fv_object_slot *slot,
                       const struct fv_objects_inference *inference)
{
    const struct fovea_objects_config *config = objects->config;
    const int32_t c = slot->object.class_id;
    const double height_m =
        c >= 0 && c < FOVEA_OBJECT_CLASSES_MAX ? (double)config->height_m[c] : 0.0;
    struct position position;
    slot->object.located = FOVEA_OBJECT_LOCATED_NOT;
    if (!slot->matched || (height_m <= 0.0 && !config->ground) || is_cut(objects, slot)) return;
    if (!(height_m > 0.0 && by_size(objects, slot, height_m, &position)) &&
        !(config->ground && by_floor(objects, slot, &position)))
        return;
    if (inference->posed && inference->metric) {
        filter_position(slot, &position, inference);
        return;
    }
    double full[9];
    covariance_of(&position, NULL, full);
    upper(full, slot->object.covariance_m2);
    memcpy(slot->object.position_m, position.at, sizeof position.at);
    memset(slot->object.velocity_m_s, 0, sizeof slot->object.velocity_m_s);
    memset(slot->object.velocity_covariance_m2_s2, 0,
           sizeof slot->object.velocity_covariance_m2_s2);
    slot->object.located = FOVEA_OBJECT_LOCATED_CAMERA;
}

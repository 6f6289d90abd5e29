#include "stereo/stereo.h"

#include <string.h>

#include "geometry/vec.h"

enum { RAYS_PER_BATCH = 32 };

static struct fv_se3 between(const double T_body_cam0[12], const double T_body_cam1[12])
{
    struct fv_se3 T_body_0, T_body_1, T_1_0;
    fv_se3_from_rows(T_body_cam0, &T_body_0);
    fv_se3_from_rows(T_body_cam1, &T_body_1);
    fv_se3_invert(&T_body_1, &T_1_0);
    fv_se3_compose(&T_1_0, &T_body_0, &T_1_0);
    return T_1_0;
}

bool fv_stereo_serves(const double T_body_cam0[12], const double T_body_cam1[12])
{
    const struct fv_se3 T_1_0 = between(T_body_cam0, T_body_cam1);
    return fv_norm3(T_1_0.t) >= FV_STEREO_BASELINE_MIN_M;
}

/* A frame of the second camera whose first axis is the baseline. The second is that of the image's
 * axes which lies most across it, so that the angle around the baseline jumps behind the camera
 * where the baseline lies across its view. */
static void find_axes(struct fv_stereo *s)
{
    double ahead[3] = {0, 0, 1};
    fv_copy3(s->T_1_0.t, s->axis);
    (void)fv_normalise3(s->axis);
    if (fv_abs(s->axis[2]) > 0.7) {
        ahead[0] = 1;
        ahead[2] = 0;
    }
    const double along = fv_dot3(ahead, s->axis);
    for (int i = 0; i < 3; i++)
        s->ahead[i] = ahead[i] - along * s->axis[i];
    (void)fv_normalise3(s->ahead);
    fv_cross3(s->axis, s->ahead, s->aside);
}

void fv_stereo_carve(struct fv_stereo *s, const struct fovea_camera *camera0,
                     const struct fovea_camera *camera1, const double T_body_cam0[12],
                     const double T_body_cam1[12], uint32_t features_max,
                     struct fv_arena *persistent, struct fv_arena *frame)
{
    const struct fovea_camera *const cameras[FV_STEREO_CAMERAS] = {camera0, camera1};
    memset(s, 0, sizeof *s);
    s->T_1_0 = between(T_body_cam0, T_body_cam1);
    s->baseline_m = fv_norm3(s->T_1_0.t);
    s->features_max = features_max;
    find_axes(s);
    for (int i = 0; i < FV_STEREO_CAMERAS; i++) {
        s->camera[i] = cameras[i];
        s->focal_px[i] = __builtin_sqrt(cameras[i]->fx * cameras[i]->fy);
        fv_bearing_carve(&s->table[i], cameras[i]->width, cameras[i]->height, persistent);
    }
    s->ray = fv_arena_take_raw(frame, features_max, sizeof *s->ray);
    s->bearing = fv_arena_take_raw(frame, features_max, sizeof *s->bearing);
    s->bin_of = fv_arena_take_raw(frame, features_max, sizeof *s->bin_of);
    s->first = fv_arena_take_raw(frame, FV_STEREO_BINS + 1, sizeof *s->first);
    s->order = fv_arena_take_raw(frame, features_max, sizeof *s->order);
    s->match = fv_arena_take_raw(frame, features_max, sizeof *s->match);
    s->distance = fv_arena_take_raw(frame, features_max, sizeof *s->distance);
    s->owner = fv_arena_take_raw(frame, features_max, sizeof *s->owner);
    s->measured = fv_arena_take_raw(frame, features_max, sizeof *s->measured);
    s->moved = fv_arena_take_raw(frame, features_max, sizeof *s->moved);
    s->moved_descriptors = fv_arena_take_raw(frame, features_max, 32);
}

void fv_stereo_init(struct fv_stereo *s)
{
    for (int i = 0; i < FV_STEREO_CAMERAS; i++)
        fv_bearing_init(&s->table[i], s->camera[i]);
}

bool fv_stereo_project(const struct fv_stereo *s, const double turned[3], double value,
                       struct fv_stereo_place *place)
{
    const double *t = s->T_1_0.t;
    const double q[3] = {turned[0] + value * t[0], turned[1] + value * t[1],
                         turned[2] + value * t[2]};
    if (fovea_camera_project(s->camera[1], q, place->pixel, place->J) != FOVEA_OK) return false;
    place->along[0] = fv_dot3(place->J, t);
    place->along[1] = fv_dot3(place->J + 3, t);
    return true;
}

double fv_stereo_intersect(const struct fv_stereo *s, const double turned[3],
                           const float bearing[3])
{
    const double b[3] = {(double)bearing[0], (double)bearing[1], (double)bearing[2]};
    double far[3], near[3];
    fv_cross3(b, turned, far);
    fv_cross3(b, s->T_1_0.t, near);
    return -fv_dot3(far, near) / fv_dot3(near, near);
}

/* Rays of a view's features, some at a time: those of the first camera are kept whole, of the
 * second the bearings. */
static void find_rays(struct fv_stereo *s, const struct fv_stereo_view *view, int camera)
{
    float pixels[RAYS_PER_BATCH][2];
    struct fv_ray rays[RAYS_PER_BATCH];
    for (uint32_t done = 0; done < view->count;) {
        const uint32_t left = view->count - done,
                       some = left < RAYS_PER_BATCH ? left : RAYS_PER_BATCH;
        struct fv_ray *out = camera == 0 ? s->ray + done : rays;
        for (uint32_t i = 0; i < some; i++) {
            pixels[i][0] = view->features[done + i].x_px;
            pixels[i][1] = view->features[done + i].y_px;
        }
        fv_bearings_of(&s->table[camera], s->camera[camera], (const float(*)[2])pixels, some, out);
        for (uint32_t i = 0; camera == 1 && i < some; i++)
            for (int k = 0; k < 3; k++)
                s->bearing[done + i][k] = rays[i].seen ? (float)rays[i].bearing[k] : 0;
        done += some;
    }
}

uint32_t fv_stereo_measure(struct fv_stereo *s, const struct fv_kernels *kernels,
                           const struct fv_stereo_view given[FV_STEREO_CAMERAS])
{
    struct fv_stereo_view view[FV_STEREO_CAMERAS] = {given[0], given[1]};
    uint32_t measured = 0;
    for (int i = 0; i < FV_STEREO_CAMERAS; i++) {
        if (view[i].count > s->features_max) view[i].count = s->features_max;
        find_rays(s, &view[i], i);
    }
    fv_stereo_sort(s, &view[1]);
    const uint32_t matches = fv_stereo_match(s, kernels, view),
                   wanted = matches < FV_STEREO_ALIGNED_MAX ? matches : FV_STEREO_ALIGNED_MAX;
    for (uint32_t f = 0, met = 0; f < view[0].count; f++) {
        s->measured[f] = (struct fv_inverse_distance){0, 0};
        if (s->match[f] == FV_STEREO_NONE) continue;
        const bool chosen = met * wanted / matches != (met + 1) * wanted / matches;
        met++;
        if (chosen && fv_stereo_align(s, view, f, s->match[f], &s->measured[f])) measured++;
    }
    return measured;
}

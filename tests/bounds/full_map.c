#include "bounds/full_map.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/detector.h"
#include "drivers/table.h"
#include "fovea/source.h"
#include "geometry/vec.h"

struct fovea_rig full_map_rig(const char *uri)
{
    const struct fovea_source_selection none = {.step = 1};
    const struct fovea_source_ops *ops;
    struct fovea_source *source;
    struct fovea_error error;
    const char *address;
    if (fv_source_find(uri, &ops, &address, &error) || ops->open(address, &none, &source, &error)) {
        fprintf(stderr, "%s\n", error.text);
        exit(2);
    }
    const struct fovea_rig rig = ops->info(source)->rig;
    ops->close(source);
    return rig;
}

void full_map_config(struct fovea_config *config, int32_t width, int32_t height)
{
    char uri[64];
    snprintf(uri, sizeof uri, "sim:corridor?width=%d&height=%d", (int)width, (int)height);
    fovea_config_default(config);
    config->rig.cameras[0].camera = full_map_rig(uri).cameras[0].camera;
    config->detect.model = detector_model(&config->detect.model_bytes);
}

struct fovea *full_map_runtime(const struct fovea_config *config)
{
    size_t bytes;
    struct fovea_error error;
    struct fovea *rt;
    if (fovea_size(config, &bytes, &error) == FOVEA_OK) {
        void *memory = aligned_alloc(FOVEA_BLOCK_ALIGNMENT, (bytes + 63) / 64 * 64);
        if (memory != NULL && fovea_init(memory, bytes, config, &rt, &error) == FOVEA_OK) return rt;
        free(memory);
    }
    fprintf(stderr, "%s\n", error.text);
    exit(2);
}

/* ---- the scene ------------------------------------------------------------------------------- */

static const double scene_depth = 5;

/* The middle of the cell in the middle of the image. */
static void target_pixel(const struct fv_odometry *o, double pixel[2])
{
    pixel[0] = (o->map.columns / 2 + 0.5) * FV_MAP_CELL_PX;
    pixel[1] = (o->map.rows / 2 + 0.5) * FV_MAP_CELL_PX;
}

void full_map_point(const struct fv_odometry *o, uint32_t feature, double point[3])
{
    /* A few pixels to all sides, and some depth, so that poses are determined. */
    const double px = scene_depth / o->focal_px;
    point[0] = ((int)(feature % 7) - 3) * px;
    point[1] = ((int)(feature / 7 % 7) - 3) * px;
    point[2] = scene_depth + 0.05 * ((int)(feature / 49 % 5) - 2);
}

/* The camera at a place of the arc, turned so that the scene is seen at the target pixel. */
static void pose_of(const struct fv_odometry *o, uint32_t place, struct fv_se3 *T)
{
    const double middle[3] = {0, 0, scene_depth},
                 centre[3] = {-0.5 + place / (double)FULL_MAP_PLACES, 0, 0};
    double pixel[2], to[3], from[3], axis[3], turned[3];
    target_pixel(o, pixel);
    if (fovea_camera_unproject(&o->camera, pixel, to, NULL) != FOVEA_OK) abort();
    fv_subtract3(middle, centre, from);
    (void)fv_normalise3(from);
    fv_cross3(from, to, axis);
    const double sine = fv_norm3(axis), cosine = fv_dot3(from, to);
    const double angle = fv_atan2(sine, cosine);
    for (int k = 0; k < 3; k++)
        axis[k] *= sine > 1e-12 ? angle / sine : 0;
    fv_so3_exp(axis, T->R);
    fv_rotate3(T->R, centre, turned);
    for (int k = 0; k < 3; k++)
        T->t[k] = -turned[k];
}

struct crowd full_map_crowd(const struct fv_odometry *o)
{
    const uint32_t features = o->map.limits.features;
    return (struct crowd){.levels_high = features > CROWD_MATCHES ? features - CROWD_MATCHES : 0,
                          .descriptor = 0};
}

/* Measured of every feature, some of them off by more than counts in full. */
static void measure_distances(struct fv_odometry *o, uint32_t slot)
{
    struct fv_inverse_distance *distances = fv_map_distances(&o->map, slot);
    for (uint32_t f = 0; distances != NULL && f < o->map.keyframes[slot].features; f++) {
        double point[3];
        full_map_point(o, f, point);
        distances[f] = (struct fv_inverse_distance){
            .value = (float)(1 / fv_norm3(point) + (f % 2 == 0 ? 0.1 : 0)), .weight = 1e4f};
    }
}

void full_map_view(struct fv_odometry *o, const struct crowd *crowd, uint32_t place)
{
    const uint32_t count = o->map.limits.features, current = fv_map_current(&o->map);
    struct fovea_feature *features = calloc(count, sizeof *features);
    uint8_t *descriptors = malloc((size_t)count * FV_MAP_DESCRIPTOR_BYTES);
    struct fv_se3 *T = &o->map.keyframes[current].T_cam_world;
    if (features == NULL || descriptors == NULL) abort();
    pose_of(o, place, T);
    for (uint32_t f = 0; f < count; f++) {
        double point[3], q[3], pixel[2];
        full_map_point(o, f, point);
        fv_se3_apply(T, point, q);
        if (fovea_camera_project(&o->camera, q, pixel, NULL) != FOVEA_OK) abort();
        features[f] =
            (struct fovea_feature){.x_px = (float)pixel[0],
                                   .y_px = (float)pixel[1] + (f < crowd->off ? crowd->off_px : 0),
                                   .level = f < crowd->levels_high ? 7 : 0,
                                   .score = 50};
    }
    memset(descriptors, 0, (size_t)count * FV_MAP_DESCRIPTOR_BYTES);
    for (uint32_t f = 0; f < count; f++) /* 40 bits where it is 0xff */
        memset(descriptors + (size_t)f * FV_MAP_DESCRIPTOR_BYTES, crowd->descriptor, 5);
    fv_map_fill_frame(&o->map, current, features, descriptors, count, NULL);
    if (o->map.keyframes[current].features != count) abort();
    o->map.keyframes[current].depth = scene_depth;
    measure_distances(o, current);
    free(descriptors);
    free(features);
}

/* ---- the map --------------------------------------------------------------------------------- */

void full_map_fill(struct fv_odometry *o, uint32_t observers)
{
    const struct fv_map_limits *limits = &o->map.limits;
    const struct crowd crowd = full_map_crowd(o);
    int32_t parent = FV_MAP_NONE;
    fv_map_reset(&o->map);
    if (o->map.distances != NULL) /* in metres by two cameras */
        o->map.state->scale = (struct fv_map_scale){FOVEA_SCALE_STEREO, 0, 0, 1e-6};
    for (uint32_t k = 0; k < limits->keyframes; k++) {
        full_map_view(o, &crowd, k % FULL_MAP_PLACES);
        const uint32_t slot = fv_map_add_keyframe(&o->map, fv_map_current(&o->map));
        struct fv_keyframe *keyframe = &o->map.keyframes[slot];
        keyframe->depth = scene_depth;
        keyframe->parent = parent;
        parent = (int32_t)slot;
        /* Groups of `observers` keyframes see the same; counted from the last, which is full. */
        const bool first = k == 0 || (limits->keyframes - k) % observers == 0;
        const struct fv_map_frame frame = fv_map_frame_at(&o->map, slot),
                                  last = first ? frame : fv_map_frame_at(&o->map, slot - 1);
        /* Where landmarks do not suffice for all groups, the first have none. */
        const uint32_t groups = (limits->keyframes - k + observers - 1) / observers;
        for (uint32_t f = 0; f < limits->features; f++) {
            double point[3];
            full_map_point(o, f, point);
            if (first && groups * limits->features > limits->landmarks) break;
            const int32_t landmark =
                first ? fv_map_add_landmark(&o->map, point, 1) : last.landmark[f];
            if (landmark != FV_MAP_NONE) (void)fv_map_link(&o->map, (uint32_t)landmark, slot, f);
        }
    }
    for (uint32_t i = 0; i < o->map.state->landmark_top; i++)
        if (o->map.landmarks[i].used) fv_map_refresh_landmark(&o->map, i);
    for (uint32_t k = 0; k < limits->keyframes; k++)
        fv_map_rate_keyframe(&o->map, k);
    o->state->newest = limits->keyframes - 1;
    o->map.keyframes[fv_map_current(&o->map)].parent = (int32_t)o->state->newest;
    o->state->frame_number = 1000;
    o->state->localise.recent_count = 0;
}

void full_map_far_levels(struct fv_odometry *o)
{
    for (uint32_t i = 0; i < o->map.state->landmark_top; i++) {
        o->map.landmarks[i].level = FOVEA_PYRAMID_LEVELS_MAX - 1;
        o->map.landmarks[i].distance = (float)(scene_depth / 3.5831808);
    }
}

/* Objects before a pinhole camera, and inferences at 30 Hz that are given to it. For one file of
 * a program. */
#ifndef FOVEA_TESTS_OBJECT_RIG_H
#define FOVEA_TESTS_OBJECT_RIG_H

#include <cmocka.h>
#include <stdlib.h>
#include <string.h>

#include "common/carved.h"
#include "fovea/fovea.h"
#include "objects/objects.h"

enum { WIDTH = 640, HEIGHT = 480 };

static struct fovea_camera camera;
static struct fovea_objects_config config;
static double T_body_cam[12];
static struct fv_objects pool;
static void *block;

static inline int setup(void **state)
{
    (void)state;
    struct fovea_error error;
    struct fovea_config all;
    fovea_config_default(&all);
    config = all.objects;
    memcpy(T_body_cam, all.rig.cameras[0].T_body_cam, sizeof T_body_cam);
    camera = (struct fovea_camera){
        .width = WIDTH, .height = HEIGHT, .fx = 400, .fy = 400, .cx = 319.5, .cy = 239.5};
    return fovea_camera_prepare(&camera, &error) == FOVEA_OK ? 0 : -1;
}

static inline void carve(void *context, struct fv_arena *arena)
{
    (void)context;
    fv_objects_carve(&pool, &config, &camera, T_body_cam, arena, arena);
}

static inline void make(void)
{
    block = carved(carve, NULL);
}

static inline struct fovea_detection box(double x, double y, double w, double h, double score)
{
    return (struct fovea_detection){(float)(x - w / 2),
                                    (float)(y - h / 2),
                                    (float)(x + w / 2),
                                    (float)(y + h / 2),
                                    (float)score,
                                    0,
                                    0};
}

/* An inference at 30 Hz that found `count` objects, and `uncertain` more below the model's
 * threshold; the objects after it. */
static inline struct fovea_objects infer_unsure(int frame, const struct fovea_detection *found,
                                                uint32_t count, uint32_t uncertain)
{
    const struct fv_objects_inference l = {.stamp_ns = (int64_t)(frame + 1) * 33333333,
                                           .sequence = (uint64_t)frame,
                                           .detections = found,
                                           .count = count,
                                           .uncertain = uncertain};
    struct fovea_objects objects;
    fv_objects_update(&pool, &l);
    fv_objects_get(&pool, &objects);
    return objects;
}

static inline struct fovea_objects infer(int frame, const struct fovea_detection *found,
                                         uint32_t count)
{
    return infer_unsure(frame, found, count, 0);
}

#endif

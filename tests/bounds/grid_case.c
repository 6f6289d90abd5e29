#include "bounds/grid_case.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bounds/full_map.h"
#include "common/detector.h"
#include "nn/model.h"

enum { IGNORED, FLOOR, OBSTACLE, MOVABLE, BEYOND, CLASSES };

static void ask_for_most(struct fovea_grid_job_config *job)
{
    job->enabled = true;
    job->grid.side_cells = 512;
    job->grid.range_m = 0.5 * job->grid.side_cells * job->grid.resolution_m;
    job->grid.rays = 1440;
    job->grid.heights = true;
    job->grid.half_life_s = job->grid.movable_half_life_s = 2; /* all cells forget at each mask */
    for (int i = 0; i < 256; i++)
        job->labels[i] = (uint8_t)((i + FOVEA_GRID_FLOOR) % CLASSES);
    job->labels[FLOOR] = FOVEA_GRID_FLOOR;
    job->labels[OBSTACLE] = FOVEA_GRID_OBSTACLE;
    job->labels[MOVABLE] = FOVEA_GRID_MOVABLE;
    job->labels[IGNORED] = FOVEA_GRID_IGNORED;
    job->labels[BEYOND] = FOVEA_GRID_BEYOND;
}

void grid_case_uri(char *uri, size_t capacity, int32_t width, int32_t height)
{
    snprintf(uri, capacity, "sim:drive?width=%d&height=%d&rate=10", (int)width, (int)height);
}

void grid_case_config(struct fovea_config *config, int32_t width, int32_t height)
{
    char uri[96];
    grid_case_uri(uri, sizeof uri, width, height);
    fovea_config_default(config);
    config->rig = full_map_rig(uri);
    config->detect.model = detector_as_segmenter(&config->detect.model_bytes);
    config->scale.source = FOVEA_SCALE_CAMERA_HEIGHT;
    config->scale.camera_height_m = config->rig.cameras[0].T_body_cam[11];
    ask_for_most(&config->grid_job);
}

/* ---- masks ----------------------------------------------------------------------------------- */

static uint8_t class_of(enum grid_case_mask mask, int32_t x, int32_t y, int32_t rows)
{
    if (mask == GRID_CASE_ENDS) return y < rows * 9 / 10 ? BEYOND : FLOOR;
    if (mask == GRID_CASE_ALTERNATE) return (uint8_t)((x + 3 * y) % CLASSES);
    return mask == GRID_CASE_OBSTACLES ? OBSTACLE : FLOOR;
}

static bool is_sure(enum grid_case_mask mask, int32_t y)
{
    return mask == GRID_CASE_SOME_SURE ? y % 2 == 0 : mask != GRID_CASE_UNSURE;
}

void grid_case_view(const struct fovea *rt, enum grid_case_mask mask, bool below,
                    struct fovea_grid_view *view)
{
    static struct fovea_segmentation seen;
    static struct fovea_segmentation_class list[CLASSES];
    static uint8_t index[256], *pixels, *confidence;
    const struct fovea_rig_camera *camera = &rt->config.rig.cameras[0];
    const double height = camera->T_body_cam[11],
                 down[12] = {0, -1, 0, 0, -1, 0, 0, 0, 0, 0, -1, height};
    const int32_t width = camera->camera.width, rows = camera->camera.height;
    const size_t bytes = (size_t)width * (size_t)rows;
    pixels = realloc(pixels, bytes);
    confidence = realloc(confidence, bytes);
    if (pixels == NULL || confidence == NULL) abort();
    for (int i = 0; i < 256; i++)
        index[i] = (uint8_t)i;
    for (int i = 0; i < CLASSES; i++)
        list[i].class_id = i;
    for (int32_t y = 0; y < rows; y++)
        for (int32_t x = 0; x < width; x++) {
            pixels[y * width + x] = class_of(mask, x, y, rows);
            confidence[y * width + x] = is_sure(mask, y) ? 255 : 0;
        }
    seen = (struct fovea_segmentation){.inferences = 1,
                                       .stamp_ns = 1,
                                       .image_width = width,
                                       .image_height = rows,
                                       .width = width,
                                       .height = rows,
                                       .raw_scale = {1, 1},
                                       .count = CLASSES,
                                       .list = list,
                                       .pixels = pixels,
                                       .index = index,
                                       .confidence = confidence};
    *view = (struct fovea_grid_view){.stamp_ns = 1,
                                     .seen = &seen,
                                     .labels = rt->config.grid_job.labels,
                                     .camera = &camera->camera};
    memcpy(view->T_odom_cam, below ? down : camera->T_body_cam, sizeof view->T_odom_cam);
}

/* ---- poses ----------------------------------------------------------------------------------- */

void grid_case_pose(struct fovea *rt, double ahead_m)
{
    struct fovea_pose *pose = &rt->odometry.state->pose;
    static int64_t stamp_ns;
    for (int i = 0; i < 12; i++)
        pose->T_world_cam[i] = pose->T_map_world[i] = pose->T_keyframe_cam[i] = i % 5 == 0;
    pose->T_world_cam[11] = ahead_m; /* the way that the camera looks */
    pose->map_scale = pose->scale = 1;
    pose->posed = true;
    pose->state = FOVEA_TRACKING_OK;
    rt->odometry.state->state = FOVEA_TRACKING_OK;
    rt->scale.state->known = true;
    rt->scale.state->source = FOVEA_SCALE_CAMERA_HEIGHT;
    rt->scale.state->log_scale = 0;
    rt->scale.state->variance = 1e-4;
    stamp_ns += 100000000;
    fv_publish_step(&rt->publish, &rt->odometry, &rt->scale, NULL, stamp_ns);
}

/* For tests of the grid: a mask of five classes as a pinhole camera without distortion sees it, and
 * what cells say. */
#ifndef FOVEA_TESTS_COMMON_GRID_MASK_H
#define FOVEA_TESTS_COMMON_GRID_MASK_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

#include "fovea/grid.h"

enum { SKY, FLOOR, WALL, CART, AIR, CLASSES }; /* SKY is ignored, AIR lies beyond the floor */

static const uint8_t labels[256] = {[SKY] = FOVEA_GRID_IGNORED,
                                    [FLOOR] = FOVEA_GRID_FLOOR,
                                    [WALL] = FOVEA_GRID_OBSTACLE,
                                    [CART] = FOVEA_GRID_MOVABLE,
                                    [AIR] = FOVEA_GRID_BEYOND};
static struct fovea_camera camera;
static struct fovea_segmentation seen;

/* Fill both: `pixels` is the mask, width x height, of an image that is `scale` times as large. */
static inline void grid_mask_make(const uint8_t *pixels, int32_t width, int32_t height,
                                  int32_t scale, double focal_px)
{
    static struct fovea_segmentation_class list[CLASSES];
    static uint8_t identity[256];
    struct fovea_error error;
    for (int i = 0; i < 256; i++)
        identity[i] = (uint8_t)i;
    for (int i = 0; i < CLASSES; i++)
        list[i].class_id = i;
    camera = (struct fovea_camera){.width = scale * width,
                                   .height = scale * height,
                                   .fx = focal_px,
                                   .fy = focal_px,
                                   .cx = 0.5 * (scale * width - 1),
                                   .cy = 0.5 * (scale * height - 1)};
    seen = (struct fovea_segmentation){.width = width,
                                       .height = height,
                                       .image_width = scale * width,
                                       .image_height = scale * height,
                                       .raw_scale = {scale, scale},
                                       .raw_offset = {0.5 * (scale - 1), 0.5 * (scale - 1)},
                                       .count = CLASSES,
                                       .list = list,
                                       .pixels = pixels,
                                       .index = identity};
    assert_int_equal(fovea_camera_prepare(&camera, &error), FOVEA_OK);
}

/* The mask as a camera sees it that looks ahead from over the origin, tilted down. */
static inline struct fovea_grid_view grid_mask_view(double height_m, double tilt_rad)
{
    const double s = sin(tilt_rad), c = cos(tilt_rad);
    return (struct fovea_grid_view){.seen = &seen,
                                    .labels = labels,
                                    .camera = &camera,
                                    .T_odom_cam = {0, -s, c, 0, -1, 0, 0, 0, 0, -c, -s, height_m}};
}

/* Percent of the cell that holds a point; -2: outside. */
static inline int grid_mask_cell(const int8_t *cells, const struct fovea_grid_place *place,
                                 double x_m, double y_m)
{
    const double column = floor((x_m - place->origin_m[0]) / place->resolution_m + 1e-9),
                 row = floor((y_m - place->origin_m[1]) / place->resolution_m + 1e-9);
    if (column < 0 || row < 0 || column >= place->width || row >= place->height) return -2;
    return cells[(int)row * (int)place->width + (int)column];
}

static inline bool is_free(int percent)
{
    return percent >= 0 && percent < 100 * FOVEA_GRID_FREE_BELOW;
}

static inline bool is_occupied(int percent)
{
    return percent > 100 * FOVEA_GRID_OCCUPIED_ABOVE;
}

/* How many cells are. */
static inline int grid_mask_occupied(const int8_t *cells, const struct fovea_grid_place *place)
{
    int count = 0;
    for (int i = 0; i < (int)place->width * (int)place->height; i++)
        count += is_occupied(cells[i]);
    return count;
}

#endif

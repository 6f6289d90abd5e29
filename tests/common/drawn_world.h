/* For tests of the grid: boxes on a floor, drawn as the mask of a network that labels pixels. */
#ifndef FOVEA_TESTS_COMMON_DRAWN_WORLD_H
#define FOVEA_TESTS_COMMON_DRAWN_WORLD_H

#include <math.h>

#include "common/grid_mask.h"
#include "common/made_grid.h"

enum { W = 160, H = 120, BOXES_MAX = 6, SIDE = 128 };
static const int64_t SECOND = 1000000000;

/* x0 x1 y0 y1 height, class */
struct box {
    double x[2], y[2], top;
    int class_id;
};
static struct box boxes[BOXES_MAX];
static int box_count;

static uint8_t mask[W * H];

/* A setup of cmocka: no boxes, and a grid of the defaults but for its side. */
static inline int setup(void **state)
{
    (void)state;
    grid_mask_make(mask, W, H, 2, 200);
    fovea_grid_config_default(&config);
    config.side_cells = SIDE;
    make_grid();
    box_count = 0;
    return 0;
}

/* What the ray from `from` along `way` meets first, at `*t`: a class. */
static inline int meets(const double from[3], const double way[3], double *t)
{
    int found = SKY;
    *t = 1e9;
    if (way[2] < -1e-9) {
        *t = -from[2] / way[2];
        found = FLOOR;
    }
    for (int i = 0; i < box_count; i++) {
        const double low[3] = {boxes[i].x[0], boxes[i].y[0], 0},
                     high[3] = {boxes[i].x[1], boxes[i].y[1], boxes[i].top};
        double in = 0, out = 1e9;
        for (int k = 0; k < 3; k++) {
            const double a = (low[k] - from[k]) / way[k], b = (high[k] - from[k]) / way[k];
            in = fmax(in, fmin(a, b));
            out = fmin(out, fmax(a, b));
        }
        if (in < out && in < *t) {
            *t = in;
            found = boxes[i].class_id;
        }
    }
    return found;
}

/* A view from 0.8 m above (x, y), looking along `yaw`, `tilt` down and rolled. */
static inline struct fovea_grid_view view_from(double x, double y, double yaw, double tilt,
                                               double roll)
{
    struct fovea_grid_view view = {
        .seen = &seen, .labels = labels, .camera = &camera, .position_m = {x, y}, .yaw_rad = yaw};
    const double z[3] = {cos(yaw) * cos(tilt), sin(yaw) * cos(tilt), -sin(tilt)};
    const double flat[3] = {sin(yaw), -cos(yaw), 0};
    const double down[3] = {z[1] * flat[2] - z[2] * flat[1], z[2] * flat[0] - z[0] * flat[2],
                            z[0] * flat[1] - z[1] * flat[0]};
    double *T = view.T_odom_cam;
    for (int k = 0; k < 3; k++) {
        T[4 * k] = cos(roll) * flat[k] + sin(roll) * down[k];
        T[4 * k + 1] = cos(roll) * down[k] - sin(roll) * flat[k];
        T[4 * k + 2] = z[k];
    }
    T[3] = x;
    T[7] = y;
    T[11] = 0.8;
    return view;
}

/* What is seen from there, into `mask`. */
static inline void draw(const struct fovea_grid_view *view)
{
    const double *T = view->T_odom_cam, from[3] = {T[3], T[7], T[11]};
    for (int i = 0; i < W * H; i++) {
        const double pixel[2] = {2 * (i % W) + 0.5, 2 * (i / W) + 0.5};
        double b[3], way[3], t;
        assert_int_equal(fovea_camera_unproject(&camera, pixel, b, NULL), FOVEA_OK);
        for (int k = 0; k < 3; k++)
            way[k] = T[4 * k] * b[0] + T[4 * k + 1] * b[1] + T[4 * k + 2] * b[2];
        mask[i] = (uint8_t)meets(from, way, &t);
    }
}

static inline void add_box(double x0, double x1, double y0, double y1, double top, int class_id)
{
    boxes[box_count++] = (struct box){{x0, x1}, {y0, y1}, top, class_id};
}

#endif

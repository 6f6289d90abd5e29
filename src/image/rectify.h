/* Rectification: the raw image as a virtual camera without distortion would have seen it, made only
 * when somebody asks (a network, the grid, a preview). Geometry itself works on the raw image.
 *
 * The virtual camera looks the same way as the real one. As a pinhole, straight lines of the world
 * are straight in the image; beyond 75 degrees from the axis a pinhole image grows out of all
 * bounds, so a wide fisheye is shown as a cylinder about the vertical axis: columns are equal steps
 * of the horizontal angle, vertical lines stay straight.
 *
 * The map from output to raw pixels is computed once, to 1/64 pixel; resampling is bilinear and
 * integer (contracts/remap.h). */
#ifndef FOVEA_IMAGE_RECTIFY_H
#define FOVEA_IMAGE_RECTIFY_H

#include <stdbool.h>
#include <stdint.h>

#include "base/arena.h"
#include "fovea/camera.h"
#include "fovea/status.h"
#include "image/plane.h"
#include "kernels/kernels.h"

#ifdef __cplusplus
extern "C" {
#endif

enum fv_rectified_shape {
    FV_RECTIFIED_PINHOLE = 0, /* x = fx X/Z + cx, y = fy Y/Z + cy */
    FV_RECTIFIED_CYLINDER = 1 /* x = fx atan2(X, Z) + cx, y = fy Y / sqrt(X^2 + Z^2) + cy */
};

enum fv_rectified_fit {
    FV_RECTIFIED_CROP =
        0, /* every output pixel shows something: the raw image's corners are lost */
    FV_RECTIFIED_KEEP_ALL = 1 /* every raw pixel is shown (pinhole: up to 75 degrees; cylinder: 60
                            up and down): there are black margins */
};

struct fv_rectified {
    enum fv_rectified_shape shape;
    int32_t width, height; /* pixels */
    double fx, fy, cx, cy; /* pixels, for the cylinder's fx pixels per radian */
};

struct fv_rectify {
    struct fv_rectified rectified;
    int32_t blocks_per_row,
        stride_bytes;              /* of the output: FV_REMAP_BLOCK * blocks_per_row or more */
    struct fv_remap_block *blocks; /* rectified.height rows */
    struct fv_remap_pixel *scattered;
    uint32_t scattered_count;
};

/* Choose the rectified image of width x height pixels (within FOVEA_IMAGE_*) for a prepared camera
 * of known size, with square pixels and its own centre. FOVEA_ERROR_ARGUMENT: the camera sees too
 * little for that; `error` says so. Init-only. */
enum fovea_status fv_rectified_choose(const struct fovea_camera *camera,
                                      enum fv_rectified_shape shape, enum fv_rectified_fit fit,
                                      int32_t width, int32_t height, struct fv_rectified *rectified,
                                      struct fovea_error *error);

/* Where a pixel of the rectified image looks, in the raw image. Returns false where the camera does
 * not see it. */
bool fv_rectified_to_raw(const struct fv_rectified *rectified, const struct fovea_camera *camera,
                         double x_px, double y_px, double raw_px[2]);

/* Where the rectified image shows a raw pixel, which may lie outside it. Returns false where it
 * cannot show it. Bounded; real-time safe. */
bool fv_rectified_from_raw(const struct fv_rectified *rectified, const struct fovea_camera *camera,
                           double x_px, double y_px, double rectified_px[2]);

/* Take the map for this camera and rectified image. Computes it, to know its size: some 100 ms when
 * counting, as much again when building, when the map is filled in. Init-only. */
void fv_rectify_carve(struct fv_rectify *rectify, const struct fovea_camera *camera,
                      const struct fv_rectified *rectified, struct fv_arena *persistent);

/* Resample a grey image of the camera's size into `out`, which has the rectified image's size and
 * rows of rectify->stride_bytes. Pixels that the camera does not see are 0. Real-time safe: cost
 * proportional to the output's pixels. */
void fv_rectify_run(const struct fv_rectify *rectify, const struct fv_kernels *kernels,
                    const struct fv_plane *source, const struct fv_plane *out);

#ifdef __cplusplus
}
#endif
#endif

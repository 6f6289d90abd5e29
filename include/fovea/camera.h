/* Camera models: the pixel of the raw image that a direction projects to, and the direction of a
 * pixel.
 *
 * Camera frame: x right, y down, z forward (REP-103 optical frame). Pixels: (0, 0) is the centre of
 * the top left pixel. Two lens models:
 *  - radial-tangential (Brown-Conrady, as OpenCV): with x = X/Z, y = Y/Z, r2 = x^2 + y^2,
 *    scale = (1 + k1 r2 + k2 r2^2 + k3 r2^3) / (1 + k4 r2 + k5 r2^2 + k6 r2^3),
 *    x' = x scale + 2 p1 x y + p2 (r2 + 2 x^2),  y' = y scale + p1 (r2 + 2 y^2) + 2 p2 x y;
 *    coefficients in OpenCV's order k1 k2 p1 p2 k3 k4 k5 k6;
 *  - equidistant fisheye (Kannala-Brandt, as OpenCV's fisheye and Kalibr's `equi`): with theta the
 *    angle to the optical axis, theta' = theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4
 *    theta^8). */
#ifndef FOVEA_CAMERA_H
#define FOVEA_CAMERA_H

#include <stdint.h>

#include "fovea/status.h"

#ifdef __cplusplus
extern "C" {
#endif

enum fovea_lens {
    FOVEA_LENS_RADTAN = 0,
    FOVEA_LENS_EQUIDISTANT = 1,
};

enum { FOVEA_LENS_COEFFICIENTS = 8 };

/* Limits of fx and fy, and of the size of cx and cy. */
#define FOVEA_CAMERA_FOCAL_MIN_PX 0.001
#define FOVEA_CAMERA_FOCAL_MAX_PX 1e6
#define FOVEA_CAMERA_CENTRE_MAX_PX 1e5

struct fovea_camera {
    /* pixels of the image that the parameters belong to; 0 x 0: not stated (TUM, KITTI) */
    int32_t width, height;
    enum fovea_lens lens;
    double fx, fy, cx, cy;             /* pixels */
    double k[FOVEA_LENS_COEFFICIENTS]; /* radtan: k1 k2 p1 p2 k3 k4 k5 k6; equidistant: k1 k2 k3 k4
                                          0 0 0 0 */
    /* largest angle to the axis at which the distortion is still monotone; set by
     * fovea_camera_prepare, at most pi (equidistant) or just under pi/2 (radtan) */
    double field_max_rad;
};

/* Check the parameters (finite, focal lengths positive, centre within two image sizes, at least 40
 * % of the image with a direction) and compute `field_max_rad`. Must be called once before
 * projecting. Init-only. Returns FOVEA_OK, or FOVEA_ERROR_INPUT with the offending value in
 * `error`. */
enum fovea_status fovea_camera_prepare(struct fovea_camera *camera, struct fovea_error *error);

/* Project a point (camera frame, any unit; need not be normalised) to a pixel. `jacobian`, when not
 * NULL, takes the 2x3 row-major derivative d(pixel)/d(point). Refused (FOVEA_ERROR_ARGUMENT,
 * outputs untouched) behind the camera and past field_max_rad, where the polynomial folds back.
 * Does not test the image border. Real-time safe, any thread. */
enum fovea_status fovea_camera_project(const struct fovea_camera *camera, const double point[3],
                                       double pixel[2], double jacobian[6]);

/* Unit bearing of a pixel by Newton iteration on the distortion, bounded in steps, to 1e-9.
 * `jacobian`, when not NULL, takes the 3x2 row-major d(bearing)/d(pixel). Refused
 * (FOVEA_ERROR_ARGUMENT, outputs untouched) where no direction within field_max_rad maps to the
 * pixel. Real-time safe, any thread. */
enum fovea_status fovea_camera_unproject(const struct fovea_camera *camera, const double pixel[2],
                                         double bearing[3], double jacobian[6]);

#ifdef __cplusplus
}
#endif
#endif

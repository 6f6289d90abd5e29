/* Choice of the virtual camera: what the rays along the raw image's border allow. */
#include "base/elementary.h"
#include "fovea/image.h"
#include "image/rectify.h"

/* Largest X/Z and Y/Z of a pinhole image (75 degrees); largest angle and Y / sqrt(X^2 + Z^2)
 * (60 degrees) of a cylinder. */
static const double tangent_max = 3.7320508075688772, azimuth_max = 3.1,
                    elevation_max = 1.7320508075688772;

struct bounds {
    double low[2], high[2];
};

/* Direction of a raw pixel in the rectified image's own coordinates before scaling; false where the
 * model refuses it or the rectified image cannot show it. */
static bool normalised(const struct fovea_camera *camera, enum fv_rectified_shape shape,
                       double x_px, double y_px, double at[2])
{
    const double pixel[2] = {x_px, y_px};
    double b[3];
    if (fovea_camera_unproject(camera, pixel, b, NULL) != FOVEA_OK) return false;
    if (shape == FV_RECTIFIED_PINHOLE) {
        if (!(b[2] > 0)) return false;
        at[0] = b[0] / b[2];
        at[1] = b[1] / b[2];
        return __builtin_fabs(at[0]) <= tangent_max && __builtin_fabs(at[1]) <= tangent_max;
    }
    const double across = __builtin_sqrt(b[0] * b[0] + b[2] * b[2]);
    if (!(across * elevation_max >= __builtin_fabs(b[1])) || across == 0) return false;
    at[0] = fv_atan2(b[0], b[2]);
    at[1] = b[1] / across;
    return __builtin_fabs(at[0]) <= azimuth_max;
}

/* Nearest visible point on the way from the border pixel to the image's centre: where the model
 * ends inside the image, the edge of what it covers stands for the border. */
static bool edge_point(const struct fovea_camera *camera, enum fv_rectified_shape shape,
                       double x_px, double y_px, double at[2])
{
    enum { STEPS = 64 };
    for (int i = STEPS; i > 0; i--) {
        const double part = (double)i / STEPS;
        if (normalised(camera, shape, camera->cx + part * (x_px - camera->cx),
                       camera->cy + part * (y_px - camera->cy), at))
            return true;
    }
    return false;
}

static void widen(struct bounds *outer, const double at[2])
{
    for (int k = 0; k < 2; k++) {
        if (at[k] < outer->low[k]) outer->low[k] = at[k];
        if (at[k] > outer->high[k]) outer->high[k] = at[k];
    }
}

/* Bounds of all border rays (outer), and of the rectangle between the innermost ones of each side
 * (inner). */
static bool border_bounds(const struct fovea_camera *camera, enum fv_rectified_shape shape,
                          struct bounds *outer, struct bounds *inner)
{
    const double right = camera->width - 1, bottom = camera->height - 1;
    const struct bounds nothing = {{1e9, 1e9}, {-1e9, -1e9}},
                        everything = {{-1e9, -1e9}, {1e9, 1e9}};
    double at[2];
    *outer = nothing;
    *inner = everything;
    for (int32_t x = 0; x < camera->width; x++) {
        if (!edge_point(camera, shape, x, 0, at)) return false;
        widen(outer, at);
        if (at[1] > inner->low[1]) inner->low[1] = at[1];
        if (!edge_point(camera, shape, x, bottom, at)) return false;
        widen(outer, at);
        if (at[1] < inner->high[1]) inner->high[1] = at[1];
    }
    for (int32_t y = 0; y < camera->height; y++) {
        if (!edge_point(camera, shape, 0, y, at)) return false;
        widen(outer, at);
        if (at[0] > inner->low[0]) inner->low[0] = at[0];
        if (!edge_point(camera, shape, right, y, at)) return false;
        widen(outer, at);
        if (at[0] < inner->high[0]) inner->high[0] = at[0];
    }
    return true;
}

enum fovea_status fv_rectified_choose(const struct fovea_camera *camera,
                                      enum fv_rectified_shape shape, enum fv_rectified_fit fit,
                                      int32_t width, int32_t height, struct fv_rectified *rectified,
                                      struct fovea_error *error)
{
    struct bounds outer, inner;
    if (width < FOVEA_IMAGE_WIDTH_MIN || width > FOVEA_IMAGE_WIDTH_MAX ||
        height < FOVEA_IMAGE_HEIGHT_MIN || height > FOVEA_IMAGE_HEIGHT_MAX)
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                               "rectified size: found %d x %d, expected %d x %d to %d x %d", width,
                               height, FOVEA_IMAGE_WIDTH_MIN, FOVEA_IMAGE_HEIGHT_MIN,
                               FOVEA_IMAGE_WIDTH_MAX, FOVEA_IMAGE_HEIGHT_MAX);
    if (!border_bounds(camera, shape, &outer, &inner))
        return fovea_error_set(
            error, FOVEA_ERROR_ARGUMENT,
            "rectification: the camera model covers nothing towards a border of its image");
    const struct bounds *shown = fit == FV_RECTIFIED_CROP ? &inner : &outer;
    const double across = shown->high[0] - shown->low[0], down = shown->high[1] - shown->low[1];
    if (!(across > 1e-6 && down > 1e-6))
        return fovea_error_set(
            error, FOVEA_ERROR_ARGUMENT,
            "rectification: no rectangle of this %s rectified is seen everywhere; keep all instead",
            shape == FV_RECTIFIED_PINHOLE ? "pinhole" : "cylinder");
    const double fx = (width - 1) / across, fy = (height - 1) / down;
    const double f = fit == FV_RECTIFIED_CROP ? (fx > fy ? fx : fy) : (fx < fy ? fx : fy);
    rectified->shape = shape;
    rectified->width = width;
    rectified->height = height;
    rectified->fx = rectified->fy = f;
    rectified->cx = 0.5 * (width - 1) - f * 0.5 * (shown->low[0] + shown->high[0]);
    rectified->cy = 0.5 * (height - 1) - f * 0.5 * (shown->low[1] + shown->high[1]);
    return FOVEA_OK;
}

bool fv_rectified_from_raw(const struct fv_rectified *rectified, const struct fovea_camera *camera,
                           double x_px, double y_px, double rectified_px[2])
{
    double at[2];
    if (!normalised(camera, rectified->shape, x_px, y_px, at)) return false;
    rectified_px[0] = rectified->fx * at[0] + rectified->cx;
    rectified_px[1] = rectified->fy * at[1] + rectified->cy;
    return true;
}

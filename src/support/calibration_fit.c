#include "support/calibration.h"

#include <stdlib.h>

enum fovea_status fovea_calibration_fit(struct fovea_camera *camera, int32_t width, int32_t height,
                                        bool scale, const char *origin, struct fovea_error *error)
{
    struct fovea_camera fitted = *camera;
    const bool stated = camera->width > 0 && camera->height > 0;
    if (stated && (camera->width != width || camera->height != height)) {
        const int64_t skew = (int64_t)camera->width * height - (int64_t)camera->height * width;
        const int64_t pixel = camera->width > camera->height ? camera->width : camera->height;
        if (!scale)
            return fovea_error_set(
                error, FOVEA_ERROR_INPUT,
                "%s: image size: found %d x %d, expected %d x %d as the frames have", origin,
                camera->width, camera->height, width, height);
        if (llabs(skew) > pixel)
            return fovea_error_set(
                error, FOVEA_ERROR_INPUT,
                "%s: image size: found %d x %d, expected the shape of the frames, %d x %d, to scale it",
                origin, camera->width, camera->height, width, height);
        const double sx = (double)width / camera->width, sy = (double)height / camera->height;
        fitted.fx *= sx;
        fitted.fy *= sy;
        fitted.cx = (fitted.cx + 0.5) * sx - 0.5;
        fitted.cy = (fitted.cy + 0.5) * sy - 0.5;
    }
    fitted.width = width;
    fitted.height = height;
    struct fovea_error why = {0};
    const enum fovea_status status = fovea_camera_prepare(&fitted, &why);
    if (status != FOVEA_OK) return fovea_error_set(error, status, "%s: %s", origin, why.text);
    *camera = fitted;
    return FOVEA_OK;
}

#include "support/calibration.h"

#include <stdlib.h>

enum fovea_status fv_calibration_fit(struct fovea_camera *camera, int32_t width, int32_t height,
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

bool fv_calibration_is_rotation(const double T[12])
{
    for (int i = 0; i < 3; i++) {
        for (int j = i; j < 3; j++) {
            const double *a = T + 4 * i, *b = T + 4 * j;
            const double off = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] - (i == j ? 1.0 : 0.0);
            if (!(off > -1e-3 && off < 1e-3)) return false;
        }
    }
    const double determinant = T[0] * (T[5] * T[10] - T[6] * T[9]) -
                               T[1] * (T[4] * T[10] - T[6] * T[8]) +
                               T[2] * (T[4] * T[9] - T[5] * T[8]);
    return determinant > 0.0;
}

/* The camera as it is solved for, and its projection with derivatives. Needs Ceres: of the files
 * that solve alone. */
#ifndef FOVEA_CALIBRATE_PROJECTION_H
#define FOVEA_CALIBRATE_PROJECTION_H

#include <ceres/ceres.h>

#include <algorithm>

#include "calibrate/calibrate.h"

namespace calibrate
{

/* The camera as it is solved for: fx, fy / fx, cx, cy, coefficients. */
using Parameters = std::array<double, PARAMETERS_MAX>;

/* As fovea_camera_project; templated, for derivatives. False: behind a camera that sees forward. */
template <typename T> bool project(Model model, const T *camera, const T *point, T *pixel)
{
    const T *k = camera + 4;
    T x, y;
    if (model == Model::equidistant) {
        const T radius2 = point[0] * point[0] + point[1] * point[1];
        T scale;
        if (radius2 > 1e-18) {
            const T radius = sqrt(radius2), theta = atan2(radius, point[2]), t2 = theta * theta;
            scale = theta * (1.0 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3])))) / radius;
        } else {
            scale = 1.0 / point[2];
        }
        x = point[0] * scale;
        y = point[1] * scale;
    } else {
        if (!(point[2] > 1e-9)) return false;
        const T a = point[0] / point[2], b = point[1] / point[2], r2 = a * a + b * b;
        const T scale = (1.0 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]))) /
                        (1.0 + r2 * (k[5] + r2 * (k[6] + r2 * k[7])));
        x = a * scale + 2.0 * k[2] * a * b + k[3] * (r2 + 2.0 * a * a);
        y = b * scale + k[2] * (r2 + 2.0 * b * b) + 2.0 * k[3] * a * b;
    }
    pixel[0] = camera[0] * x + camera[2];
    pixel[1] = camera[0] * camera[1] * y + camera[3];
    return true;
}

/* Coefficients of the rational model can replace each other, up to a pole inside the image that a
 * zero all but cancels. They are held near zero as if that had been measured: a coefficient of 1
 * counts as much as an error of 0.05 px in one corner. */
struct SmallCoefficients {
    enum { COUNT = 6 };
    static constexpr double WEIGHT_PX = .05;
    template <typename T> bool operator()(const T *camera, T *residual) const
    {
        static const int which[COUNT] = {0, 1, 4, 5, 6, 7};
        for (int i = 0; i < COUNT; i++)
            residual[i] = WEIGHT_PX * camera[4 + which[i]];
        return true;
    }
};
using SmallCost =
    ceres::AutoDiffCostFunction<SmallCoefficients, SmallCoefficients::COUNT, PARAMETERS_MAX>;

inline int extra_residuals(Model model)
{
    return model == Model::rational ? (int)SmallCoefficients::COUNT : 0;
}

inline fovea_camera camera_of(Model model, const Parameters &parameters, int width, int height)
{
    fovea_camera camera = {};
    camera.width = width;
    camera.height = height;
    camera.lens = model == Model::equidistant ? FOVEA_LENS_EQUIDISTANT : FOVEA_LENS_RADTAN;
    camera.fx = parameters[0];
    camera.fy = parameters[0] * parameters[1];
    camera.cx = parameters[2];
    camera.cy = parameters[3];
    for (int i = 0; i < FOVEA_LENS_COEFFICIENTS; i++)
        camera.k[i] = parameters[(size_t)(4 + i)];
    return camera;
}

inline Parameters parameters_of(const fovea_camera &camera)
{
    Parameters parameters = {camera.fx, camera.fy / camera.fx, camera.cx, camera.cy};
    std::copy(camera.k, camera.k + FOVEA_LENS_COEFFICIENTS, parameters.begin() + 4);
    return parameters;
}

} // namespace calibrate
#endif

/* How far corners of two cameras are from each other's epipolar curves. */
#include "calibrate/rig_start.h"

#include <cmath>

namespace calibrate
{
namespace
{

/* Squared distance, in the image of `camera`, of a pixel from the plane through its centre with
 * that normal: the plane's distance from the bearing over its change with the pixel. Negative: no
 * ray. */
double distance2_px(const fovea_camera &camera, const Pixel &pixel, const Eigen::Vector3d &normal)
{
    double bearing[3], jacobian[6];
    if (fovea_camera_unproject(&camera, pixel.data(), bearing, jacobian) != FOVEA_OK) return -1;
    double along = 0, slope[2] = {0, 0};
    for (int i = 0; i < 3; i++) {
        along += normal[i] * bearing[i];
        slope[0] += normal[i] * jacobian[2 * i];
        slope[1] += normal[i] * jacobian[2 * i + 1];
    }
    return along * along / (slope[0] * slope[0] + slope[1] * slope[1]);
}

struct Sum {
    double squares = 0;
    size_t count = 0;
    void add(double square)
    {
        if (square < 0) return;
        squares += square;
        count++;
    }
};

void add_pair(const std::vector<RigInput> &inputs, const RigSolution &solution,
              const std::vector<fovea_camera> &cameras, size_t a, size_t b, size_t v, Sum &sum)
{
    const Rigid T_b_a = rigid_of(solution.cameras[b].T_cam_first) *
                        rigid_of(solution.cameras[a].T_cam_first).inverse();
    for (size_t c = 0; c < solution.used[a][v].size(); c++) {
        if (!solution.used[a][v][c] || !solution.used[b][v][c]) continue;
        const Pixel at_a = rig_corner(inputs[a], solution.turned[a][v] != 0, v, c);
        const Pixel at_b = rig_corner(inputs[b], solution.turned[b][v] != 0, v, c);
        double ray_a[3], ray_b[3];
        if (fovea_camera_unproject(&cameras[a], at_a.data(), ray_a, nullptr) != FOVEA_OK ||
            fovea_camera_unproject(&cameras[b], at_b.data(), ray_b, nullptr) != FOVEA_OK)
            continue;
        const Eigen::Vector3d in_b = T_b_a.R * Eigen::Vector3d(ray_a[0], ray_a[1], ray_a[2]);
        const Eigen::Vector3d of_b(ray_b[0], ray_b[1], ray_b[2]);
        sum.add(distance2_px(cameras[b], at_b, T_b_a.t.cross(in_b)));
        sum.add(distance2_px(cameras[a], at_a, T_b_a.R.transpose() * T_b_a.t.cross(of_b)));
    }
}

} // namespace

double epipolar_rms_px(const std::vector<RigInput> &inputs, const RigSolution &solution,
                       const std::vector<char> &of)
{
    std::vector<fovea_camera> cameras;
    Sum sum;
    for (const RigCamera &camera : solution.cameras) {
        cameras.push_back(camera.camera);
        if (fovea_camera_prepare(&cameras.back(), nullptr) != FOVEA_OK) return -1;
    }
    for (size_t v = 0; v < solution.poses.size(); v++) {
        if (!of.empty() && !of[v]) continue;
        for (size_t b = 0; b < cameras.size(); b++)
            for (size_t a = 0; a < b; a++)
                if (solution.left_out[a][v].empty() && solution.left_out[b][v].empty())
                    add_pair(inputs, solution, cameras, a, b, v, sum);
    }
    return sum.count > 0 ? std::sqrt(sum.squares / (double)sum.count) : -1;
}

} // namespace calibrate

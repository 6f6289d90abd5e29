/* Rows of the image room: rectification, and bearings of key points. */
#include "bench/bench.h"
#include "bench/memory.h"

#include <array>

#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "geometry/bearing.h"
#include "image/rectify.h"

using bench::Input;
using bench::Run;

namespace
{

/* The camera of EuRoC MH_05 (its published sensor.yaml). */
struct fovea_camera drone()
{
    struct fovea_camera camera = {
        752,     480,     FOVEA_LENS_RADTAN, 458.654,
        457.296, 367.215, 248.375,           {-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05},
        0};
    fovea_camera_prepare(&camera, nullptr);
    return camera;
}

void opencv_camera(const struct fovea_camera &camera, cv::Mat &K, cv::Mat &D)
{
    K = (cv::Mat_<double>(3, 3) << camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1);
    D = (cv::Mat_<double>(1, 4) << camera.k[0], camera.k[1], camera.k[2], camera.k[3]);
}

struct fv_rectified crop(const struct fovea_camera &camera)
{
    struct fv_rectified rectified;
    fv_rectified_choose(&camera, FV_RECTIFIED_PINHOLE, FV_RECTIFIED_CROP, camera.width,
                        camera.height, &rectified, nullptr);
    return rectified;
}

Run remap_opencv(const Input &input)
{
    const struct fovea_camera camera = drone();
    const struct fv_rectified rectified = crop(camera);
    cv::Mat K, D, map_1, map_2;
    opencv_camera(camera, K, D);
    const cv::Mat P = (cv::Mat_<double>(3, 3) << rectified.fx, 0, rectified.cx, 0, rectified.fy,
                       rectified.cy, 0, 0, 1);
    cv::initUndistortRectifyMap(K, D, cv::noArray(), P, input.image.size(), CV_16SC2, map_1, map_2);
    const cv::Mat image = input.image;
    return [=] {
        cv::Mat out;
        cv::remap(image, out, map_1, map_2, cv::INTER_LINEAR);
    };
}

const bench::Stage rectify(
    "rectify to a pinhole", "752x480", "remap, linear, fixed-point maps",
    [](const Input &input, const struct fv_kernels &kernels) -> Run {
        const struct fovea_camera camera = drone();
        const struct fv_rectified rectified = crop(camera);
        auto map = std::make_shared<struct fv_rectify>();
        auto block = std::make_shared<bench::Block>([&](struct fv_arena *arena) {
            fv_rectify_carve(map.get(), &camera, &rectified, arena);
        });
        auto out = std::make_shared<std::vector<uint8_t>>(
            static_cast<size_t>(map->stride_bytes * rectified.height));
        const cv::Mat image = input.image;
        return [=] {
            (void)block;
            const struct fv_plane source = bench::plane(image),
                                  result = {out->data(), rectified.width, rectified.height,
                                            map->stride_bytes};
            fv_rectify_run(map.get(), &kernels, &source, &result);
        };
    },
    remap_opencv);

const bench::Peer remap_row("remap_row_u8", "remap, linear, fixed-point maps", remap_opencv);

std::vector<cv::Point2f> thousand_points()
{
    std::vector<cv::Point2f> points;
    cv::RNG random(3);
    for (int i = 0; i < 1000; i++)
        points.emplace_back(random.uniform(0.f, 751.f), random.uniform(0.f, 479.f));
    return points;
}

const bench::Stage undistort(
    "undistort 1000 points", "752x480", "undistortPoints",
    [](const Input &, const struct fv_kernels &) -> Run {
        auto camera = std::make_shared<struct fovea_camera>(drone());
        auto table = std::make_shared<struct fv_bearing_table>();
        auto block = std::make_shared<bench::Block>([&](struct fv_arena *arena) {
            fv_bearing_carve(table.get(), camera->width, camera->height, arena);
        });
        fv_bearing_init(table.get(), camera.get());
        auto points = std::make_shared<std::vector<std::array<float, 2>>>();
        for (const auto &p : thousand_points())
            points->push_back({p.x, p.y});
        auto rays = std::make_shared<std::vector<struct fv_ray>>(points->size());
        return [=] {
            (void)block;
            fv_bearings_of(table.get(), camera.get(),
                           reinterpret_cast<const float(*)[2]>(points->data()),
                           static_cast<uint32_t>(points->size()), rays->data());
        };
    },
    [](const Input &) -> Run {
        cv::Mat K, D;
        opencv_camera(drone(), K, D);
        auto points = std::make_shared<std::vector<cv::Point2f>>(thousand_points());
        return [=] {
            std::vector<cv::Point2f> out;
            cv::undistortPoints(*points, out, K, D);
        };
    });

} // namespace

/* Rectification: every output pixel against the exact map in double precision, pinhole and
 * cylinder, crop and keep-all, narrow and wide lenses; and a real image against cv::remap. */
#include "oracle/images.h"

#include <cmath>
#include <cstdio>
#include <cstring>
#include <vector>

#include <opencv2/calib3d.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "bench/memory.h"
#include "image/rectify.h"

namespace
{

struct fovea_camera camera_of(enum fovea_lens lens, int width, int height, double fx, double fy,
                              double cx, double cy, std::initializer_list<double> k)
{
    struct fovea_camera camera = {};
    struct fovea_error error;
    camera.width = width, camera.height = height, camera.lens = lens;
    camera.fx = fx, camera.fy = fy, camera.cx = cx, camera.cy = cy;
    std::copy(k.begin(), k.end(), camera.k);
    if (fovea_camera_prepare(&camera, &error) != FOVEA_OK) {
        std::printf("FAILED %s\n", error.text);
        std::exit(1);
    }
    return camera;
}

/* One rectification, whose map is made once for all kernel sets. */
class Resampler
{
  public:
    Resampler(const struct fovea_camera &camera, const struct fv_rectified &to)
        : rectified(to), block([&](struct fv_arena *arena) {
              fv_rectify_carve(&rectify, &camera, &rectified, arena);
          })
    {
    }
    cv::Mat operator()(const cv::Mat &image, const struct fv_kernels &kernels)
    {
        cv::Mat out(rectified.height, rectify.stride_bytes, CV_8U);
        const struct fv_plane source = bench::plane(image), result = bench::plane(out);
        fv_rectify_run(&rectify, &kernels, &source, &result);
        return out.colRange(0, rectified.width).clone();
    }

  private:
    struct fv_rectified rectified;
    struct fv_rectify rectify = {};
    bench::Block block;
};

double bilinear(const cv::Mat &image, double x, double y)
{
    x = std::min(std::max(x, 0.0), image.cols - 1.0);
    y = std::min(std::max(y, 0.0), image.rows - 1.0);
    const int x0 = std::min(static_cast<int>(x), image.cols - 2),
              y0 = std::min(static_cast<int>(y), image.rows - 2);
    const double fx = x - x0, fy = y - y0;
    const auto at = [&](int dx, int dy) {
        return static_cast<double>(image.at<uint8_t>(y0 + dy, x0 + dx));
    };
    return (at(0, 0) * (1 - fx) + at(1, 0) * fx) * (1 - fy) +
           (at(0, 1) * (1 - fx) + at(1, 1) * fx) * fy;
}

/* A smooth image: then 1/64 pixel and the blend's rounding make less than two grey levels. */
cv::Mat smooth_image(int width, int height)
{
    cv::Mat image(height, width, CV_8U);
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++)
            image.at<uint8_t>(y, x) =
                static_cast<uint8_t>(128 + 60 * std::sin(x / 9.0) + 60 * std::cos(y / 7.0));
    return image;
}

bool check_exact(const char *name, const struct fovea_camera &camera, enum fv_rectified_shape shape,
                 enum fv_rectified_fit fit, int width, int height,
                 const std::vector<struct fv_kernels> &sets)
{
    struct fv_rectified rectified;
    struct fovea_error error;
    if (fv_rectified_choose(&camera, shape, fit, width, height, &rectified, &error) != FOVEA_OK) {
        std::printf("FAILED %s: %s\n", name, error.text);
        return false;
    }
    const cv::Mat image = smooth_image(camera.width, camera.height);
    Resampler resampled(camera, rectified);
    const cv::Mat out = resampled(image, sets.front());
    for (const auto &kernels : sets)
        if (cv::norm(out, resampled(image, kernels), cv::NORM_INF) != 0) {
            std::printf("FAILED %s: kernels %s differ\n", name, fv_cpu_set_name(kernels.set));
            return false;
        }
    double worst = 0;
    long seen = 0;
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++) {
            double raw[2];
            const bool visible = fv_rectified_to_raw(&rectified, &camera, x, y, raw) &&
                                 raw[0] > -0.49 && raw[1] > -0.49 && raw[0] < camera.width - 0.51 &&
                                 raw[1] < camera.height - 0.51;
            if (visible)
                worst = std::max(worst,
                                 std::abs(out.at<uint8_t>(y, x) - bilinear(image, raw[0], raw[1])));
            seen += visible;
        }
    const double fraction = static_cast<double>(seen) / (static_cast<double>(width) * height);
    std::printf("%-34s f %6.1f, %5.1f %% of pixels seen, worst difference %.2f grey levels\n", name,
                rectified.fx, 100 * fraction, worst);
    return worst < 2 && fraction > (fit == FV_RECTIFIED_CROP ? 0.9999 : 0.3) &&
           (fit == FV_RECTIFIED_CROP || fraction < 1);
}

/* Without distortion the rectified image is the camera, and its image the image. */
bool check_identity(const struct fv_kernels &kernels)
{
    const struct fovea_camera camera =
        camera_of(FOVEA_LENS_RADTAN, 333, 222, 300, 300, 160, 110, {});
    const struct fv_rectified rectified = {FV_RECTIFIED_PINHOLE, 333, 222, 300, 300, 160, 110};
    cv::Mat image(222, 333, CV_8U);
    cv::RNG(4).fill(image, cv::RNG::UNIFORM, 0, 256);
    const cv::Mat out = Resampler(camera, rectified)(image, kernels);
    const cv::Rect inner(0, 0, 332, 221);
    if (cv::norm(out(inner), image(inner), cv::NORM_INF) == 0) return true;
    std::printf("FAILED identity\n");
    return false;
}

bool check_remap(const struct fv_kernels &kernels)
{
    const std::vector<std::string> names = images_under(data_folder() + "/euroc_mh05_a", 1);
    if (names.empty()) {
        std::printf("SKIPPED euroc_mh05_a: not there\n");
        return true;
    }
    const cv::Mat image = cv::imread(names[0], cv::IMREAD_GRAYSCALE);
    const struct fovea_camera camera =
        camera_of(FOVEA_LENS_RADTAN, 752, 480, 458.654, 457.296, 367.215, 248.375,
                  {-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05});
    struct fv_rectified rectified;
    if (fv_rectified_choose(&camera, FV_RECTIFIED_PINHOLE, FV_RECTIFIED_CROP, 752, 480, &rectified,
                            nullptr) != FOVEA_OK)
        return false;
    const cv::Mat K =
        (cv::Mat_<double>(3, 3) << camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1);
    const cv::Mat D =
        (cv::Mat_<double>(1, 4) << camera.k[0], camera.k[1], camera.k[2], camera.k[3]);
    const cv::Mat P = (cv::Mat_<double>(3, 3) << rectified.fx, 0, rectified.cx, 0, rectified.fy,
                       rectified.cy, 0, 0, 1);
    cv::Mat x, y, exact, fixed, expected, map_1, map_2, difference;
    cv::initUndistortRectifyMap(K, D, cv::noArray(), P, image.size(), CV_32F, x, y);
    cv::Mat wide;
    image.convertTo(wide, CV_32F);
    cv::remap(wide, exact, x, y, cv::INTER_LINEAR);
    cv::convertMaps(x, y, map_1, map_2, CV_16SC2);
    cv::remap(image, fixed, map_1, map_2, cv::INTER_LINEAR);
    cv::Mat ours;
    Resampler(camera, rectified)(image, kernels).convertTo(ours, CV_32F);
    fixed.convertTo(fixed, CV_32F);
    const cv::Rect inner(1, 1, 750, 478);
    const double error = cv::norm(ours(inner), exact(inner), cv::NORM_L1) / inner.area();
    const double cv_error = cv::norm(fixed(inner), exact(inner), cv::NORM_L1) / inner.area();
    std::printf(
        "EuRoC image: mean difference to exact resampling %.3f grey levels, OpenCV's fixed-point remap %.3f\n",
        error, cv_error);
    return error < 0.26; /* rounding to whole grey levels alone makes 0.25 */
}

} // namespace

int main()
{
    std::vector<struct fv_kernels> sets;
    for (int set = 0; set < FV_CPU_SET_COUNT; set++) {
        struct fv_kernels kernels;
        fv_kernels_init(&kernels, static_cast<enum fv_cpu_set>(set));
        if (kernels.set == set) sets.push_back(kernels);
    }
    const struct fovea_camera drone =
        camera_of(FOVEA_LENS_RADTAN, 752, 480, 458.654, 457.296, 367.215, 248.375,
                  {-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05});
    const struct fovea_camera fisheye =
        camera_of(FOVEA_LENS_EQUIDISTANT, 960, 600, 227.37, 226.55, 471.42, 305.64,
                  {0.02474, -0.02245, 0.0188, -0.00682});
    bool good = check_identity(sets.back());
    good = check_exact("drone, pinhole, crop", drone, FV_RECTIFIED_PINHOLE, FV_RECTIFIED_CROP, 752,
                       480, sets) &&
           good;
    good = check_exact("drone, pinhole, keep all, odd size", drone, FV_RECTIFIED_PINHOLE,
                       FV_RECTIFIED_KEEP_ALL, 641, 399, sets) &&
           good;
    good = check_exact("drone, cylinder, crop", drone, FV_RECTIFIED_CYLINDER, FV_RECTIFIED_CROP,
                       640, 480, sets) &&
           good;
    good = check_exact("fisheye, cylinder, keep all", fisheye, FV_RECTIFIED_CYLINDER,
                       FV_RECTIFIED_KEEP_ALL, 960, 600, sets) &&
           good;
    good = check_exact("fisheye, pinhole, keep all", fisheye, FV_RECTIFIED_PINHOLE,
                       FV_RECTIFIED_KEEP_ALL, 960, 600, sets) &&
           good;
    good = check_exact("fisheye, pinhole, crop, small", fisheye, FV_RECTIFIED_PINHOLE,
                       FV_RECTIFIED_CROP, 160, 120, sets) &&
           good;
    good = check_remap(sets.back()) && good;
    return good ? 0 : 1;
}

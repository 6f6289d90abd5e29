/* The lens model on real pictures of a checkerboard with strong barrel distortion
 * (vamr_checkerboard), through the published K and D: the board's corners, projected from the
 * published poses, against those found in the images; and lines of the board, straight after
 * rectification. */
#include "oracle/images.h"

#include <array>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <memory>
#include <vector>

#include <opencv2/calib3d.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "bench/memory.h"
#include "image/rectify.h"

namespace
{

const cv::Size board(9, 6); /* inner corners */
const double square_m = 0.04;

using Pose = std::array<double, 6>; /* axis-angle and translation, board to camera */

struct Set {
    std::vector<std::string> images;
    std::vector<Pose> poses; /* of these images */
    struct fovea_camera camera = {};
};

std::vector<double> numbers_of(const std::string &path)
{
    std::ifstream file(path);
    std::vector<double> all;
    for (double value; file >> value;)
        all.push_back(value);
    return all;
}

bool read_set(const std::string &folder, Set &set)
{
    const std::vector<double> K = numbers_of(folder + "K.txt"), D = numbers_of(folder + "D.txt"),
                              poses = numbers_of(folder + "poses.txt");
    if (K.size() != 9 || D.size() != 2 || poses.size() % 6 != 0) {
        std::printf("FAILED %s: found %zu numbers in K.txt, %zu in D.txt, %zu in poses.txt\n",
                    folder.c_str(), K.size(), D.size(), poses.size());
        return false;
    }
    set.camera = {752, 480, FOVEA_LENS_RADTAN, K[0], K[4], K[2], K[5], {D[0], D[1]}, 0};
    for (const auto &name : set.images) {
        const size_t line = std::strtoul(name.c_str() + name.rfind('_') + 1, nullptr,
                                         10); /* img_0009.jpg: the ninth */
        Pose pose;
        if (line < 1 || 6 * line > poses.size()) return false;
        for (size_t i = 0; i < 6; i++)
            pose[i] = poses[6 * (line - 1) + i];
        set.poses.push_back(pose);
    }
    struct fovea_error error;
    return fovea_camera_prepare(&set.camera, &error) == FOVEA_OK;
}

bool find_board(const cv::Mat &image, std::vector<cv::Point2f> &corners)
{
    if (!cv::findChessboardCorners(image, board, corners)) return false;
    cv::cornerSubPix(image, corners, cv::Size(5, 5), cv::Size(-1, -1),
                     cv::TermCriteria(cv::TermCriteria::EPS | cv::TermCriteria::COUNT, 40, 1e-4));
    return true;
}

/* Distances of the found corners from where the camera model puts them. Found boards may start at
 * either end.
 */
bool corner_errors(const struct fovea_camera &camera, const Pose &pose,
                   const std::vector<cv::Point2f> &found, std::vector<double> &errors)
{
    cv::Matx33d R;
    cv::Rodrigues(cv::Vec3d(pose[0], pose[1], pose[2]), R);
    const auto count = static_cast<size_t>(board.area());
    std::vector<double> there(count), back(count);
    double there_sum = 0, back_sum = 0;
    for (size_t i = 0; i < count; i++) {
        const cv::Vec3d corner(static_cast<double>(i % 9) * square_m,
                               static_cast<double>(i / 9) * square_m, 0);
        const cv::Vec3d p = R * corner + cv::Vec3d(pose[3], pose[4], pose[5]);
        double pixel[2];
        if (fovea_camera_project(&camera, p.val, pixel, nullptr) != FOVEA_OK) return false;
        const cv::Point2f &a = found[i], &b = found[count - 1 - i];
        there_sum += there[i] = std::hypot(a.x - pixel[0], a.y - pixel[1]);
        back_sum += back[i] = std::hypot(b.x - pixel[0], b.y - pixel[1]);
    }
    const std::vector<double> &all = there_sum < back_sum ? there : back;
    errors.insert(errors.end(), all.begin(), all.end());
    return true;
}

/* Root mean square distance of points from the line that fits them best, in pixels. */
double crookedness(const std::vector<cv::Point2f> &points)
{
    cv::Vec4f line;
    cv::fitLine(points, line, cv::DIST_L2, 0, 1e-4, 1e-6);
    double sum = 0;
    for (const auto &p : points)
        sum += std::pow((p.x - line[2]) * line[1] - (p.y - line[3]) * line[0], 2);
    return std::sqrt(sum / static_cast<double>(points.size()));
}

/* Of the board's worst line. */
double crookedness_of_board(const std::vector<cv::Point2f> &corners)
{
    double worst = 0;
    for (int row = 0; row < board.height; row++)
        worst = std::max(worst, crookedness({corners.begin() + row * board.width,
                                             corners.begin() + (row + 1) * board.width}));
    for (int column = 0; column < board.width; column++) {
        std::vector<cv::Point2f> line;
        for (int row = 0; row < board.height; row++)
            line.push_back(corners[static_cast<size_t>(row * board.width + column)]);
        worst = std::max(worst, crookedness(line));
    }
    return worst;
}

struct Rectifier {
    struct fv_kernels kernels;
    struct fv_rectified rectified;
    struct fv_rectify map;
    std::unique_ptr<bench::Block> block;

    explicit Rectifier(const struct fovea_camera &camera)
    {
        fv_kernels_init(&kernels, fv_cpu_best(fv_cpu_detect()));
        fv_rectified_choose(&camera, FV_RECTIFIED_PINHOLE, FV_RECTIFIED_CROP, camera.width,
                            camera.height, &rectified, nullptr);
        block = std::make_unique<bench::Block>(
            [&](struct fv_arena *arena) { fv_rectify_carve(&map, &camera, &rectified, arena); });
    }
    cv::Mat run(const cv::Mat &image) const
    {
        cv::Mat out(rectified.height, map.stride_bytes, CV_8U);
        const struct fv_plane source = bench::plane(image), result = bench::plane(out);
        fv_rectify_run(&map, &kernels, &source, &result);
        return out.colRange(0, rectified.width).clone();
    }
};

double median(std::vector<double> values)
{
    std::sort(values.begin(), values.end());
    return values[values.size() / 2];
}

} // namespace

int main()
{
    Set set;
    const std::string folder = data_folder() + "/vamr_checkerboard/";
    set.images = images_under(folder + "images", 24);
    if (set.images.empty()) {
        std::printf("SKIPPED vamr_checkerboard: not there\n");
        return 0;
    }
    if (!read_set(folder, set)) return 1;
    const Rectifier rectifier(set.camera);
    std::vector<double> errors, straight, raw;
    size_t found = 0;
    for (size_t i = 0; i < set.images.size(); i++) {
        const cv::Mat image = cv::imread(set.images[i], cv::IMREAD_GRAYSCALE);
        std::vector<cv::Point2f> corners;
        if (find_board(image, corners)) {
            found++;
            raw.push_back(crookedness_of_board(corners));
            if (!corner_errors(set.camera, set.poses[i], corners, errors)) return 1;
        }
        if (find_board(rectifier.run(image), corners))
            straight.push_back(crookedness_of_board(corners));
    }
    if (found < set.images.size() / 2 || straight.size() < set.images.size() / 2) {
        std::printf("FAILED: board found in %zu of %zu images, in %zu rectified ones\n", found,
                    set.images.size(), straight.size());
        return 1;
    }
    const double error = median(errors),
                 worst = *std::max_element(straight.begin(), straight.end());
    std::printf("projected corners: median %.3f px from those found, %zu corners of %zu images\n",
                error, errors.size(), found);
    std::printf(
        "worst line of a board off straight by %.3f px RMS, median of %zu images (largest %.3f); raw %.2f px\n",
        median(straight), straight.size(), worst, median(raw));
    return error < 0.25 && worst < 0.3 ? 0 : 1;
}

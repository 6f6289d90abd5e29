/* A first guess of focal length and poses from the pictures alone. */
#include <Eigen/Dense>

#include "calibrate/calibrate.h"
#include "calibrate/least_squares.h"

#include <algorithm>
#include <cmath>

namespace calibrate
{
namespace
{

struct Guess {
    double error_px = INFINITY; /* root mean square of the view's reprojection */
    Pose pose = {};
};

Eigen::Vector3d bearing_of(const fovea_camera &camera, const Pixel &pixel)
{
    const double x = (pixel[0] - camera.cx) / camera.fx, y = (pixel[1] - camera.cy) / camera.fy;
    if (camera.lens != FOVEA_LENS_EQUIDISTANT) return Eigen::Vector3d(x, y, 1).normalized();
    const double theta = std::min(std::hypot(x, y), 3.1);
    const double scale = theta > 1e-9 ? std::sin(theta) / theta : 1;
    return {x * scale, y * scale, std::cos(theta)};
}

Pixel pixel_of(const fovea_camera &camera, const Eigen::Vector3d &point)
{
    const double radius = std::hypot(point[0], point[1]);
    double scale = 1 / std::max(point[2], 1e-6 * point.norm());
    if (camera.lens == FOVEA_LENS_EQUIDISTANT && radius > 1e-12)
        scale = std::atan2(radius, point[2]) / radius;
    return {camera.fx * point[0] * scale + camera.cx, camera.fy * point[1] * scale + camera.cy};
}

/* The homography from the board to bearings, which may point backwards: bearing x (H point) = 0. */
Eigen::Matrix3d homography(const std::vector<Point> &points, double unit,
                           const std::vector<Eigen::Vector3d> &bearings)
{
    Eigen::Matrix<double, 9, 9> normal = Eigen::Matrix<double, 9, 9>::Zero();
    for (size_t i = 0; i < points.size(); i++) {
        if (!bearings[i].allFinite()) continue;
        const Eigen::Vector3d board(points[i][0] / unit, points[i][1] / unit, 1);
        const Eigen::Matrix3d cross = cross_matrix(bearings[i]);
        Eigen::Matrix<double, 3, 9> rows;
        for (int r = 0; r < 3; r++)
            for (int c = 0; c < 3; c++)
                rows.block<1, 3>(r, 3 * c) = cross(r, c) * board.transpose();
        normal += rows.transpose() * rows;
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 9, 9>> solver(normal);
    const Eigen::Matrix<double, 9, 1> h = solver.eigenvectors().col(0);
    Eigen::Matrix3d H;
    H << h[0], h[1], h[2], h[3], h[4], h[5], h[6], h[7], h[8];
    double ahead = 0;
    for (size_t i = 0; i < points.size(); i++)
        if (bearings[i].allFinite())
            ahead +=
                bearings[i].dot(H * Eigen::Vector3d(points[i][0] / unit, points[i][1] / unit, 1));
    return ahead < 0 ? Eigen::Matrix3d(-H) : H;
}

/* T_cam_board of the bearings of its points; NaN: not seen. False: nothing fits. */
bool pose_from_bearings(const std::vector<Point> &points, double unit,
                        const std::vector<Eigen::Vector3d> &bearings, Eigen::Matrix3d &R,
                        Eigen::Vector3d &t)
{
    const Eigen::Matrix3d H = homography(points, unit, bearings);
    const double scale = .5 * (H.col(0).norm() + H.col(1).norm());
    if (!(scale > 0)) return false;
    R << H.col(0), H.col(1), H.col(0).cross(H.col(1)) / scale;
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(R, Eigen::ComputeFullU | Eigen::ComputeFullV);
    R = svd.matrixU() * svd.matrixV().transpose();
    t = H.col(2) / scale * unit;
    return R.determinant() > 0;
}

Pose pose_of(const Eigen::Matrix3d &R, const Eigen::Vector3d &t)
{
    const Eigen::AngleAxisd rotation(R);
    const Eigen::Vector3d axis = rotation.angle() * rotation.axis();
    return {axis[0], axis[1], axis[2], t[0], t[1], t[2]};
}

Guess pose_by(const fovea_camera &camera, const std::vector<Point> &points, double unit,
              const View &view)
{
    std::vector<Eigen::Vector3d> bearings;
    for (const Pixel &pixel : view.corners)
        bearings.push_back(bearing_of(camera, pixel));
    Guess guess;
    Eigen::Matrix3d R;
    Eigen::Vector3d t;
    if (!pose_from_bearings(points, unit, bearings, R, t)) return guess;
    double squares = 0;
    size_t count = 0;
    for (size_t i = 0; i < points.size(); i++) {
        if (!seen(view.corners[i])) continue;
        count++;
        const Eigen::Vector3d point = R * Eigen::Vector3d(points[i][0], points[i][1], 0) + t;
        const Pixel pixel = pixel_of(camera, point);
        squares +=
            std::pow(pixel[0] - view.corners[i][0], 2) + std::pow(pixel[1] - view.corners[i][1], 2);
    }
    guess.pose = pose_of(R, t);
    guess.error_px = std::sqrt(squares / (double)count);
    return guess;
}

} // namespace

/* Focal lengths between these fractions of the image's width are tried, each with every view; the
 * one with the least error wins. The error of a view is limited, so that a wrong board decides
 * nothing. */
bool initial_guess(const Board &board, const std::vector<View> &views, int width, int height,
                   bool equidistant, fovea_camera &camera, std::vector<Pose> &poses,
                   std::string &error)
{
    constexpr double fraction_min = .12, fraction_max = 8, step = 1.08, error_max_px = 30;
    const std::vector<Point> points = board.points();
    const double unit = std::max(points.back()[0], points.back()[1]);
    double best = INFINITY;
    size_t usable = 0;
    for (const View &view : views)
        usable += view.left_out.empty() && view.corners.size() == points.size();
    if (usable < 2) {
        error = "found " + std::to_string(usable) + (usable == 1 ? " picture" : " pictures") +
                " with the board, expected 2 or more";
        return false;
    }
    for (double fraction = fraction_min; fraction < fraction_max; fraction *= step) {
        fovea_camera tried = {};
        tried.width = width;
        tried.height = height;
        tried.lens = equidistant ? FOVEA_LENS_EQUIDISTANT : FOVEA_LENS_RADTAN;
        tried.fx = tried.fy = fraction * std::max(width, height);
        tried.cx = .5 * (width - 1);
        tried.cy = .5 * (height - 1);
        std::vector<Pose> found(views.size());
        double sum = 0;
        for (size_t v = 0; v < views.size(); v++) {
            if (!views[v].left_out.empty() || views[v].corners.size() != points.size()) continue;
            const Guess guess = pose_by(tried, points, unit, views[v]);
            found[v] = guess.pose;
            sum += std::min(guess.error_px, error_max_px);
        }
        if (sum >= best) continue;
        best = sum;
        camera = tried;
        poses = found;
    }
    if (std::isfinite(best)) return true;
    error = "no focal length fits the pictures";
    return false;
}

bool initial_pose(const Board &board, const fovea_camera &camera, const View &view, Pose &pose)
{
    constexpr int corners_min = 6;
    const std::vector<Point> points = board.points();
    std::vector<Eigen::Vector3d> bearings;
    int count = 0;
    for (const Pixel &pixel : view.corners) {
        double bearing[3] = {NAN, NAN, NAN};
        if (seen(pixel)) (void)fovea_camera_unproject(&camera, pixel.data(), bearing, nullptr);
        bearings.push_back({bearing[0], bearing[1], bearing[2]});
        count += std::isfinite(bearing[0]);
    }
    Eigen::Matrix3d R;
    Eigen::Vector3d t;
    if (count < corners_min ||
        !pose_from_bearings(points, std::max(points.back()[0], points.back()[1]), bearings, R, t))
        return false;
    pose = pose_of(R, t);
    return true;
}

} // namespace calibrate

/* The image of a circle's centre, which is not the middle of its ellipse. */
#include "calibrate/corners.h"

#include <Eigen/Dense>

#include <algorithm>

namespace calibrate
{
namespace
{

/* The homography that fits the points around one of the board, least squares; board lengths are
 * from that point on, over `unit`. */
struct Around {
    Eigen::Matrix3d H;
    double unit;

    Around(const std::vector<Point> &points, const std::vector<Pixel> &pixels, size_t c,
           double reach)
        : unit(reach)
    {
        Eigen::Matrix<double, 9, 9> normal = Eigen::Matrix<double, 9, 9>::Zero();
        for (size_t i = 0; i < points.size(); i++) {
            const double x = (points[i][0] - points[c][0]) / unit,
                         y = (points[i][1] - points[c][1]) / unit;
            if (std::hypot(x, y) > 1) continue;
            const double u = pixels[i][0] - pixels[c][0], v = pixels[i][1] - pixels[c][1];
            Eigen::Matrix<double, 2, 9> rows;
            rows << x, y, 1, 0, 0, 0, -u * x, -u * y, -u, 0, 0, 0, x, y, 1, -v * x, -v * y, -v;
            normal += rows.transpose() * rows;
        }
        const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 9, 9>> solver(normal);
        const Eigen::Matrix<double, 9, 1> h = solver.eigenvectors().col(0);
        H << h[0], h[1], h[2], h[3], h[4], h[5], h[6], h[7], h[8];
    }
    /* Pixels from the point's own. */
    Eigen::Vector2d pixel(double x_m, double y_m) const
    {
        return (H * Eigen::Vector3d(x_m / unit, y_m / unit, 1)).hnormalized();
    }
    double board_length(double u, double v) const
    {
        return unit * (H.inverse() * Eigen::Vector3d(u, v, 1)).hnormalized().norm();
    }
};

/* The middle of the ellipse less the image of its centre, pixels. */
Eigen::Vector2d offset_of(const Around &around, double radius_m)
{
    constexpr int corners = 32;
    Eigen::Vector2d sum = Eigen::Vector2d::Zero(), before = around.pixel(radius_m, 0);
    double area = 0;
    for (int k = 1; k <= corners; k++) {
        const double angle = 2 * 3.14159265358979323846 * k / corners;
        const Eigen::Vector2d here =
            around.pixel(radius_m * std::cos(angle), radius_m * std::sin(angle));
        const double part = before[0] * here[1] - here[0] * before[1];
        area += part;
        sum += part * (before + here);
        before = here;
    }
    return sum / (3 * area) - around.pixel(0, 0);
}

/* Half way between black and white on the line from one centre to another; NaN: there is no step.
 */
double radius_px(const Grey &image, const Pixel &from, const Pixel &to)
{
    const double length = distance(from, to);
    double white = 0, last = NAN;
    const auto at = [&](double s) {
        return grey_at(image, from[0] + s / length * (to[0] - from[0]),
                       from[1] + s / length * (to[1] - from[1]));
    };
    const double black = at(0);
    for (double s = 0; s < .5 * length; s += .5)
        white = std::max(white, at(s));
    for (double s = 0; s < .5 * length; s += .1)
        if (at(s) < .5 * (black + white)) last = s;
    return last;
}

} // namespace

void correct_circles(const Grey &image, const Board &board, View &view)
{
    const std::vector<Point> points = board.points();
    const double spacing =
        board.pattern == Pattern::circles ? board.square_m : board.square_m * 1.41422;
    const double reach = 2.1 * spacing; /* 8 or more circles around each but those at the border */
    std::vector<Around> around;
    std::vector<double> radii;
    for (size_t c = 0; c < points.size(); c++) {
        around.emplace_back(points, view.corners, c, reach);
        for (size_t n = 0; n < points.size(); n++) {
            const double away =
                std::hypot(points[n][0] - points[c][0], points[n][1] - points[c][1]);
            if (n == c || away > 1.05 * spacing) continue;
            const double r = radius_px(image, view.corners[c], view.corners[n]);
            const double share = r / distance(view.corners[c], view.corners[n]);
            radii.push_back(
                around[c].board_length(share * (view.corners[n][0] - view.corners[c][0]),
                                       share * (view.corners[n][1] - view.corners[c][1])));
        }
    }
    const double radius_m = median(radii);
    if (!(radius_m > 0 && radius_m < .5 * spacing)) return;
    for (size_t c = 0; c < points.size(); c++) {
        const Eigen::Vector2d offset = offset_of(around[c], radius_m);
        view.corners[c] = {view.corners[c][0] - offset[0], view.corners[c][1] - offset[1]};
    }
}

} // namespace calibrate

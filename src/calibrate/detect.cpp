/* Chessboards by OpenCV; their corners between pixels by our own refinement. */
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "calibrate/detect.h"

#include <algorithm>
#include <cmath>

namespace calibrate
{
namespace
{

double sample(const Grey &image, double x, double y)
{
    const int i = (int)std::floor(x), j = (int)std::floor(y);
    if (i < 0 || j < 0 || i + 1 >= image.width || j + 1 >= image.height) return NAN;
    const double a = x - i, b = y - j;
    const uint8_t *row = image.pixels + (size_t)j * (size_t)image.stride_bytes + i;
    const uint8_t *next = row + image.stride_bytes;
    return (1 - b) * ((1 - a) * row[0] + a * row[1]) + b * ((1 - a) * next[0] + a * next[1]);
}

/* The point at which the gradients around it point least: each edge through the corner is at right
 * angles to its gradients (Foerstner and Gulch, 1987). The window is Gaussian, about 5 x 5 pixels,
 * so that lens distortion and the next corners have no part in it. False: it wanders off. */
bool refine_corner(const Grey &image, double half, Pixel &corner)
{
    constexpr int iterations_max = 30;
    constexpr double converged_px = 1e-4;
    const int reach = (int)std::ceil(half);
    const double sigma = .6 * half;
    Pixel at = corner;
    for (int iteration = 0; iteration < iterations_max; iteration++) {
        double xx = 0, xy = 0, yy = 0, bx = 0, by = 0;
        for (int j = -reach; j <= reach; j++) {
            for (int i = -reach; i <= reach; i++) {
                const double x = at[0] + i, y = at[1] + j;
                const double gx = .5 * (sample(image, x + 1, y) - sample(image, x - 1, y));
                const double gy = .5 * (sample(image, x, y + 1) - sample(image, x, y - 1));
                if (!std::isfinite(gx) || !std::isfinite(gy)) return false;
                const double weight = std::exp(-.5 * (i * i + j * j) / (sigma * sigma));
                xx += weight * gx * gx;
                xy += weight * gx * gy;
                yy += weight * gy * gy;
                bx += weight * gx * (gx * i + gy * j);
                by += weight * gy * (gx * i + gy * j);
            }
        }
        const double determinant = xx * yy - xy * xy;
        if (!(determinant > 1e-6 * (xx + yy) * (xx + yy))) return false;
        const double dx = (yy * bx - xy * by) / determinant, dy = (xx * by - xy * bx) / determinant;
        at[0] += dx;
        at[1] += dy;
        if (std::hypot(at[0] - corner[0], at[1] - corner[1]) > 2 * half) return false;
        if (std::hypot(dx, dy) < converged_px) break;
    }
    corner = at;
    return true;
}

double distance(const Pixel &a, const Pixel &b)
{
    return std::hypot(a[0] - b[0], a[1] - b[1]);
}

/* From each corner to the nearest of its neighbours in row and column. */
double spacing(const Board &board, const std::vector<Pixel> &corners, int column, int row)
{
    const size_t at = (size_t)(row * board.columns + column);
    double least = INFINITY;
    if (column > 0) least = std::min(least, distance(corners[at], corners[at - 1]));
    if (column + 1 < board.columns) least = std::min(least, distance(corners[at], corners[at + 1]));
    if (row > 0)
        least = std::min(least, distance(corners[at], corners[at - (size_t)board.columns]));
    if (row + 1 < board.rows)
        least = std::min(least, distance(corners[at], corners[at + (size_t)board.columns]));
    return least;
}

void refine_own(const Grey &image, const Board &board, View &view)
{
    constexpr double half_max_px = 3.5, half_min_px = 1.5, half_share = .3;
    const std::vector<Pixel> rough = view.corners;
    for (int j = 0; j < board.rows; j++) {
        for (int i = 0; i < board.columns; i++) {
            const double half =
                std::clamp(half_share * spacing(board, rough, i, j), half_min_px, half_max_px);
            Pixel &corner = view.corners[(size_t)(j * board.columns + i)];
            Pixel coarse = corner;
            if (refine_corner(image, half, coarse)) corner = coarse;
        }
    }
}

/* Along the profile across an edge between two corners: where it passes 10 % and 90 % of its step.
 */
double edge_width(const Grey &image, const Pixel &a, const Pixel &b)
{
    const double length = distance(a, b), reach = .35 * length;
    const double nx = -(b[1] - a[1]) / length, ny = (b[0] - a[0]) / length;
    const double mx = .5 * (a[0] + b[0]), my = .5 * (a[1] + b[1]);
    const double low = sample(image, mx - reach * nx, my - reach * ny);
    const double high = sample(image, mx + reach * nx, my + reach * ny);
    constexpr double step_px = .1, contrast_min = 20;
    if (!(std::fabs(high - low) > contrast_min)) return NAN;
    double first = NAN, last = NAN;
    for (double s = -reach; s <= reach; s += step_px) {
        const double level = (sample(image, mx + s * nx, my + s * ny) - low) / (high - low);
        if (level > .1 && std::isnan(first)) first = s;
        if (level < .9) last = s;
    }
    return last - first;
}

/* Median over the edges along rows and columns. */
double sharpness(const Grey &image, const Board &board, const std::vector<Pixel> &corners)
{
    std::vector<double> widths;
    for (int j = 0; j < board.rows; j++) {
        for (int i = 0; i < board.columns; i++) {
            const size_t at = (size_t)(j * board.columns + i);
            const double across =
                i + 1 < board.columns ? edge_width(image, corners[at], corners[at + 1]) : NAN;
            const double down = j + 1 < board.rows ? edge_width(image, corners[at],
                                                                corners[at + (size_t)board.columns])
                                                   : NAN;
            if (std::isfinite(across)) widths.push_back(across);
            if (std::isfinite(down)) widths.push_back(down);
        }
    }
    if (widths.empty()) return 0;
    std::nth_element(widths.begin(), widths.begin() + widths.size() / 2, widths.end());
    return widths[widths.size() / 2];
}

/* Rows are turned round where the board is numbered as its mirror image, so that a bend has the
 * same sign in all views. */
void same_hand(const Board &board, std::vector<Pixel> &corners)
{
    const Pixel &o = corners[0], &x = corners[(size_t)board.columns - 1],
                &y = corners[(size_t)(board.columns * (board.rows - 1))];
    if ((x[0] - o[0]) * (y[1] - o[1]) - (x[1] - o[1]) * (y[0] - o[0]) > 0) return;
    for (int j = 0; j < board.rows; j++)
        std::reverse(corners.begin() + j * board.columns,
                     corners.begin() + (j + 1) * board.columns);
}

} // namespace

void detect_chessboard(const Grey &image, const Board &board, Refinement refinement, View &view)
{
    const cv::Mat picture(image.height, image.width, CV_8UC1, const_cast<uint8_t *>(image.pixels),
                          (size_t)image.stride_bytes);
    const cv::Size size(board.columns, board.rows);
    std::vector<cv::Point2f> found;
    if (!cv::findChessboardCorners(picture, size, found,
                                   cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_NORMALIZE_IMAGE |
                                       cv::CALIB_CB_FAST_CHECK) &&
        !cv::findChessboardCorners(picture, size, found,
                                   cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_NORMALIZE_IMAGE)) {
        view.left_out = "no board of " + std::to_string(board.columns) + " x " +
                        std::to_string(board.rows) + " inner corners was found";
        return;
    }
    if (refinement == Refinement::OPENCV_11)
        cv::cornerSubPix(picture, found, cv::Size(11, 11), cv::Size(-1, -1),
                         cv::TermCriteria(cv::TermCriteria::EPS + cv::TermCriteria::COUNT, 30, .1));
    view.corners.clear();
    for (const cv::Point2f &corner : found)
        view.corners.push_back({corner.x, corner.y});
    if (refinement == Refinement::OWN) refine_own(image, board, view);
    same_hand(board, view.corners);
    view.edge_px = sharpness(image, board, view.corners);
}

} // namespace calibrate

#include "calibrate/corners.h"

#include <Eigen/Dense>

#include <algorithm>

namespace calibrate
{
double grey_at(const Grey &image, double x, double y)
{
    const int i = (int)std::floor(x), j = (int)std::floor(y);
    if (i < 0 || j < 0 || i + 1 >= image.width || j + 1 >= image.height) return NAN;
    const double a = x - i, b = y - j;
    const uint8_t *row = image.pixels + (size_t)j * (size_t)image.stride_bytes + i;
    const uint8_t *next = row + image.stride_bytes;
    return (1 - b) * ((1 - a) * row[0] + a * row[1]) + b * ((1 - a) * next[0] + a * next[1]);
}

double distance(const Pixel &a, const Pixel &b)
{
    return std::hypot(a[0] - b[0], a[1] - b[1]);
}

namespace
{

/* Reach of Gaussian weights, in their sigmas. */
constexpr double REACH = 2.6;

std::vector<double> gauss(double sigma)
{
    std::vector<double> weights;
    const int reach = (int)std::ceil(REACH * sigma);
    double sum = 0;
    for (int i = -reach; i <= reach; i++) {
        weights.push_back(std::exp(-.5 * i * i / (sigma * sigma)));
        sum += weights.back();
    }
    for (double &weight : weights)
        weight /= sum;
    return weights;
}

/* A square of the image, smoothed. */
struct Patch {
    int left = 0, top = 0, side = 0;
    std::vector<double> grey;

    /* Of `reach` pixels around a pixel. False: it is too near the border. */
    bool take(const Grey &image, int x, int y, int reach, double sigma)
    {
        const std::vector<double> weights = gauss(sigma);
        const int more = (int)weights.size() / 2;
        left = x - reach;
        top = y - reach;
        side = 2 * reach + 1;
        if (left < more || top < more || left + side + more > image.width ||
            top + side + more > image.height)
            return false;
        std::vector<double> rows; /* smoothed along them */
        for (int j = -more; j < side + more; j++) {
            const uint8_t *row =
                image.pixels + (size_t)(top + j) * (size_t)image.stride_bytes + left - more;
            for (int i = 0; i < side; i++) {
                double sum = 0;
                for (size_t k = 0; k < weights.size(); k++)
                    sum += weights[k] * row[i + (int)k];
                rows.push_back(sum);
            }
        }
        grey.assign((size_t)(side * side), 0);
        for (size_t at = 0; at < grey.size(); at++)
            for (size_t k = 0; k < weights.size(); k++)
                grey[at] += weights[k] * rows[at + k * (size_t)side];
        return true;
    }
};

/* The saddle of the quadric that fits a patch about `at`, as an offset from it. False: the quadric
 * has none. */
bool saddle(const Patch &patch, const Pixel &at, double sigma, Pixel &offset)
{
    using Six = Eigen::Matrix<double, 6, 1>;
    Eigen::Matrix<double, 6, 6> normal = Eigen::Matrix<double, 6, 6>::Zero();
    Six right = Six::Zero();
    for (int j = 0; j < patch.side; j++) {
        for (int i = 0; i < patch.side; i++) {
            const double x = patch.left + i - at[0], y = patch.top + j - at[1];
            const double weight = std::exp(-.5 * (x * x + y * y) / (sigma * sigma));
            Six row;
            row << x * x, x * y, y * y, x, y, 1;
            normal += weight * row * row.transpose();
            right += weight * patch.grey[(size_t)(j * patch.side + i)] * row;
        }
    }
    const Six q = normal.ldlt().solve(right);
    const double determinant = 4 * q[0] * q[2] - q[1] * q[1];
    const double size = q[0] * q[0] + q[1] * q[1] + q[2] * q[2];
    if (!(determinant < -.01 * size)) return false;
    offset = {(q[1] * q[4] - 2 * q[2] * q[3]) / determinant,
              (q[1] * q[3] - 2 * q[0] * q[4]) / determinant};
    return true;
}

/* Go to the saddle at the scale of `sigma`; at most `far` pixels. */
bool climb(const Grey &image, double sigma, double far, Pixel &corner)
{
    constexpr int iterations_max = 20;
    constexpr double converged_px = 1e-4;
    Pixel at = corner;
    Patch patch;
    const int reach = (int)std::ceil(REACH * sigma);
    for (int iteration = 0; iteration < iterations_max; iteration++) {
        const int x = (int)std::lround(at[0]), y = (int)std::lround(at[1]);
        const bool here = patch.side > 0 && patch.left + reach == x && patch.top + reach == y;
        if (!here && !patch.take(image, x, y, reach, sigma)) return false;
        Pixel offset;
        if (!saddle(patch, at, sigma, offset)) return false;
        at = {at[0] + offset[0], at[1] + offset[1]};
        if (!(distance(at, corner) < far)) return false;
        if (std::hypot(offset[0], offset[1]) < converged_px) break;
    }
    corner = at;
    return true;
}

} // namespace

/* Where two edges cross, the smoothed image has a saddle (Lucchese and Mitra, 2002). It lies where
 * the edges cross however they are turned and where they fall among the pixels, to about 0.02 px;
 * places by gradients (Foerstner and Gulch, 1987; OpenCV's cornerSubPix) are off by two to three
 * times as much in the same windows. Where there is none, a wider scale finds it from further off.
 */
bool refine_corner(const Grey &image, double half, Pixel &corner)
{
    constexpr double sigma_share = .27, sigma_min_px = .6, wider = 1.6;
    const double border =
        std::min({corner[0], corner[1], image.width - 1 - corner[0], image.height - 1 - corner[1]});
    const double most = (border - 2) / (2 * REACH), sigma = std::min(sigma_share * half, most);
    if (!(sigma >= sigma_min_px)) return false;
    Pixel at = corner;
    if (!climb(image, sigma, half, at) &&
        !(climb(image, std::min(wider * sigma, most), half, at) && climb(image, sigma, half, at)))
        return false;
    corner = at;
    return true;
}

double step_width(const Grey &image, const Pixel &from, const Pixel &to)
{
    constexpr double step_px = .1, contrast_min = 20;
    const double length = distance(from, to);
    const double low = grey_at(image, from[0], from[1]), high = grey_at(image, to[0], to[1]);
    if (!(std::fabs(high - low) > contrast_min)) return NAN;
    double first = NAN, last = NAN;
    for (double s = 0; s <= length; s += step_px) {
        const double t = s / length;
        const double here =
            grey_at(image, from[0] + t * (to[0] - from[0]), from[1] + t * (to[1] - from[1]));
        const double level = (here - low) / (high - low);
        if (level > .1 && std::isnan(first)) first = s;
        if (level < .9) last = s;
    }
    return last - first;
}

double edge_width(const Grey &image, const Pixel &a, const Pixel &b, double reach)
{
    const double nx = reach * (a[1] - b[1]), ny = reach * (b[0] - a[0]);
    const double mx = .5 * (a[0] + b[0]), my = .5 * (a[1] + b[1]);
    return step_width(image, {mx - nx, my - ny}, {mx + nx, my + ny});
}

} // namespace calibrate

/* Pictures of printed boards through a camera model. */
#ifndef FOVEA_TESTS_COMMON_BOARD_PICTURE_H
#define FOVEA_TESTS_COMMON_BOARD_PICTURE_H

#include "calibrate/drawing.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <vector>

/* Where a board stands: its point (0, 0, 0) and its axes, in the camera's frame. */
struct BoardPlace {
    double origin[3], x[3], y[3];
};

/* Black shapes by place, so that a point meets few of them. */
class BoardPaint
{
  public:
    explicit BoardPaint(const calibrate::Drawing &of)
        : drawing(of), per_x(SIDE / of.width_m), per_y(SIDE / of.height_m),
          cells((size_t)(SIDE * SIDE))
    {
        for (const calibrate::Shape &shape : drawing.shapes) {
            const double r = .5 * shape.width;
            const double x = shape.circle ? shape.x - r : shape.x,
                         y = shape.circle ? shape.y - r : shape.y;
            const double height = shape.circle ? shape.width : shape.height;
            for (int j = row(y); j <= row(y + height); j++)
                for (int i = column(x); i <= column(x + shape.width); i++)
                    cells[(size_t)(j * SIDE + i)].push_back(shape);
        }
    }
    /* Metres from the first point of the board on. */
    bool black(double x, double y) const
    {
        x += drawing.x_m;
        y += drawing.y_m;
        if (!(x >= 0 && y >= 0 && x < drawing.width_m && y < drawing.height_m)) return false;
        for (const calibrate::Shape &shape : cells[(size_t)(row(y) * SIDE + column(x))]) {
            if (shape.circle ? std::hypot(x - shape.x, y - shape.y) < .5 * shape.width
                             : x >= shape.x && y >= shape.y && x < shape.x + shape.width &&
                                   y < shape.y + shape.height)
                return true;
        }
        return false;
    }

  private:
    static constexpr int SIDE = 100;
    int column(double x) const
    {
        return std::min(SIDE - 1, std::max(0, (int)(x * per_x)));
    }
    int row(double y) const
    {
        return std::min(SIDE - 1, std::max(0, (int)(y * per_y)));
    }
    calibrate::Drawing drawing;
    double per_x, per_y; /* cells of a metre */
    std::vector<std::vector<calibrate::Shape>> cells;
};

/* Where a ray from the camera meets the board, in metres from its first point on; NaN: nowhere. */
inline std::array<double, 2> board_point(const BoardPlace &place, const std::array<double, 3> &ray)
{
    const double *o = place.origin, *x = place.x, *y = place.y;
    const double n[3] = {x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2],
                         x[0] * y[1] - x[1] * y[0]};
    const double along = n[0] * ray[0] + n[1] * ray[1] + n[2] * ray[2];
    const double t = (n[0] * o[0] + n[1] * o[1] + n[2] * o[2]) / along;
    if (!(t > 0)) return {NAN, NAN};
    std::array<double, 2> found = {0, 0};
    for (size_t i = 0; i < 3; i++) {
        found[0] += (t * ray[i] - o[i]) * x[i];
        found[1] += (t * ray[i] - o[i]) * y[i];
    }
    return found;
}

/* Rays of the corners of a camera's pixels, row by row from the top left; NaN: it does not see
 * there. Those of the last camera are kept, as it takes many pictures. */
inline const std::vector<std::array<double, 3>> &corner_rays(const fovea_camera &camera)
{
    static fovea_camera of;
    static std::vector<std::array<double, 3>> rays;
    if (!rays.empty() && std::memcmp(&of, &camera, sizeof of) == 0) return rays;
    rays.clear();
    for (int v = 0; v <= camera.height; v++) {
        for (int u = 0; u <= camera.width; u++) {
            const double at[2] = {u - .5, v - .5};
            std::array<double, 3> ray;
            if (fovea_camera_unproject(&camera, at, ray.data(), nullptr) != FOVEA_OK)
                ray = {NAN, NAN, NAN};
            rays.push_back(ray);
        }
    }
    std::memcpy(&of, &camera, sizeof of);
    return rays;
}

/* A picture of grey 30 and 220, of paper as wide as the board and a margin, before grey 120. Each
 * pixel is the mean over its area: of 16 x 16 samples where its
 * corners and the places between them differ. */
class BoardPicture
{
  public:
    BoardPicture(const calibrate::Drawing &of, const fovea_camera &camera, const BoardPlace &place)
        : drawing(of), paint(of)
    {
        const int columns = camera.width + 1;
        for (const std::array<double, 3> &ray : corner_rays(camera))
            grid.push_back(board_point(place, ray));
        for (int v = 0; v < camera.height; v++) {
            for (int u = 0; u < camera.width; u++) {
                const Corner *corner = &grid[(size_t)(v * columns + u)];
                pixels.push_back((uint8_t)std::lround(mean(corner, columns)));
            }
        }
    }
    std::vector<uint8_t> pixels;

  private:
    using Corner = std::array<double, 2>;
    /* At (a, b) of a pixel, from 0 to 1: between its corners the board's points are all but linear.
     */
    double grey_in(const Corner *corner, int columns, double a, double b) const
    {
        const Corner at = between(between(corner[0], corner[columns], b),
                                  between(corner[1], corner[columns + 1], b), a);
        return grey_at(at[0], at[1]);
    }
    static Corner between(const Corner &from, const Corner &to, double share)
    {
        return {(1 - share) * from[0] + share * to[0], (1 - share) * from[1] + share * to[1]};
    }
    double mean(const Corner *corner, int columns) const
    {
        constexpr int rough = 2, fine = 16;
        if (beside_paper(corner, columns)) return BEHIND;
        const double first = grey_in(corner, columns, 0, 0);
        bool same = true;
        for (int s = 1; s < (rough + 1) * (rough + 1); s++)
            same = same && first == grey_in(corner, columns, (double)(s % (rough + 1)) / rough,
                                            (double)(s / (rough + 1)) / rough);
        if (same) return first;
        double sum = 0;
        for (int row = 0; row < fine; row++) {
            const double b = (row + .5) / fine;
            const Corner left = between(corner[0], corner[columns], b),
                         right = between(corner[1], corner[columns + 1], b);
            for (int i = 0; i < fine; i++) {
                const Corner at = between(left, right, (i + .5) / fine);
                sum += grey_at(at[0], at[1]);
            }
        }
        return sum / (fine * fine);
    }
    /* Whether all corners of a pixel lie beyond one edge of the paper. */
    bool beside_paper(const Corner *corner, int columns) const
    {
        int left = 0, right = 0, above = 0, below = 0;
        for (const Corner *c : {corner, corner + 1, corner + columns, corner + columns + 1}) {
            left += (*c)[0] <= low[0];
            right += (*c)[0] >= high[0];
            above += (*c)[1] <= low[1];
            below += (*c)[1] >= high[1];
        }
        return left == 4 || right == 4 || above == 4 || below == 4;
    }
    double grey_at(double x, double y) const
    {
        if (!(x > low[0] && y > low[1] && x < high[0] && y < high[1])) return BEHIND;
        return paint.black(x, y) ? 30 : 220;
    }
    static constexpr double BEHIND = 120;
    const calibrate::Drawing &drawing;
    const double margin = .08 * drawing.width_m;
    const double low[2] = {-drawing.x_m - margin, -drawing.y_m - margin};
    const double high[2] = {drawing.width_m - drawing.x_m + margin,
                            drawing.height_m - drawing.y_m + margin};
    BoardPaint paint;
    std::vector<Corner> grid;
};

inline std::vector<uint8_t> board_picture(const calibrate::Drawing &drawing,
                                          const fovea_camera &camera, const BoardPlace &place)
{
    return BoardPicture(drawing, camera, place).pixels;
}

#endif

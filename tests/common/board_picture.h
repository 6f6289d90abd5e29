/* Pictures of printed boards through a camera model. */
#ifndef FOVEA_TESTS_COMMON_BOARD_PICTURE_H
#define FOVEA_TESTS_COMMON_BOARD_PICTURE_H

#include "calibrate/drawing.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

/* Where a board stands: its point (0, 0, 0) and its axes, in the camera's frame. */
struct BoardPlace {
    double origin[3], x[3], y[3];
};

/* Black shapes by place, so that a point meets few of them. */
class BoardPaint
{
  public:
    explicit BoardPaint(const calibrate::Drawing &of) : drawing(of), cells((size_t)(SIDE * SIDE))
    {
        for (size_t s = 0; s < drawing.shapes.size(); s++) {
            const calibrate::Shape &shape = drawing.shapes[s];
            const double r = .5 * shape.width;
            const double x = shape.circle ? shape.x - r : shape.x,
                         y = shape.circle ? shape.y - r : shape.y;
            const double height = shape.circle ? shape.width : shape.height;
            for (int j = row(y); j <= row(y + height); j++)
                for (int i = column(x); i <= column(x + shape.width); i++)
                    cells[(size_t)(j * SIDE + i)].push_back(s);
        }
    }
    /* Metres from the first point of the board on. */
    bool black(double x, double y) const
    {
        x += drawing.x_m;
        y += drawing.y_m;
        if (!(x >= 0 && y >= 0 && x < drawing.width_m && y < drawing.height_m)) return false;
        for (const size_t s : cells[(size_t)(row(y) * SIDE + column(x))]) {
            const calibrate::Shape &shape = drawing.shapes[s];
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
        return std::min(SIDE - 1, std::max(0, (int)(x / drawing.width_m * SIDE)));
    }
    int row(double y) const
    {
        return std::min(SIDE - 1, std::max(0, (int)(y / drawing.height_m * SIDE)));
    }
    calibrate::Drawing drawing;
    std::vector<std::vector<size_t>> cells;
};

/* Where the ray of a pixel meets the board, in metres from its first point on; NaN: nowhere. */
inline std::array<double, 2> board_point(const fovea_camera &camera, const BoardPlace &place,
                                         double u, double v)
{
    const double *o = place.origin, *x = place.x, *y = place.y;
    const double n[3] = {x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2],
                         x[0] * y[1] - x[1] * y[0]};
    const double at[2] = {u, v};
    double ray[3];
    if (fovea_camera_unproject(&camera, at, ray, nullptr) != FOVEA_OK) return {NAN, NAN};
    const double along = n[0] * ray[0] + n[1] * ray[1] + n[2] * ray[2];
    const double t = (n[0] * o[0] + n[1] * o[1] + n[2] * o[2]) / along;
    if (!(t > 0)) return {NAN, NAN};
    std::array<double, 2> found = {0, 0};
    for (int i = 0; i < 3; i++) {
        found[0] += (t * ray[i] - o[i]) * x[i];
        found[1] += (t * ray[i] - o[i]) * y[i];
    }
    return found;
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
        for (int v = 0; v <= camera.height; v++)
            for (int u = 0; u < columns; u++)
                grid.push_back(board_point(camera, place, u - .5, v - .5));
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
        double at[2];
        for (size_t i = 0; i < 2; i++)
            at[i] = (1 - b) * ((1 - a) * corner[0][i] + a * corner[1][i]) +
                    b * ((1 - a) * corner[columns][i] + a * corner[columns + 1][i]);
        return grey_at(at[0], at[1]);
    }
    double mean(const Corner *corner, int columns) const
    {
        constexpr int rough = 2, fine = 16;
        const double first = grey_in(corner, columns, 0, 0);
        bool same = true;
        for (int s = 1; s < (rough + 1) * (rough + 1); s++)
            same = same && first == grey_in(corner, columns, (double)(s % (rough + 1)) / rough,
                                            (double)(s / (rough + 1)) / rough);
        if (same) return first;
        double sum = 0;
        for (int s = 0; s < fine * fine; s++)
            sum += grey_in(corner, columns, (s % fine + .5) / fine, (s / fine + .5) / fine);
        return sum / (fine * fine);
    }
    double grey_at(double x, double y) const
    {
        const double margin = .08 * drawing.width_m;
        if (!(x > -drawing.x_m - margin && y > -drawing.y_m - margin &&
              x < drawing.width_m - drawing.x_m + margin &&
              y < drawing.height_m - drawing.y_m + margin))
            return 120;
        return paint.black(x, y) ? 30 : 220;
    }
    const calibrate::Drawing &drawing;
    BoardPaint paint;
    std::vector<Corner> grid;
};

inline std::vector<uint8_t> board_picture(const calibrate::Drawing &drawing,
                                          const fovea_camera &camera, const BoardPlace &place)
{
    return BoardPicture(drawing, camera, place).pixels;
}

#endif

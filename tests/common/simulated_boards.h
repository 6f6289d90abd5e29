/* Corners of boards seen by random true cameras, without pictures: what a perfect detector with
 * noise would find. */
#ifndef FOVEA_TESTS_COMMON_SIMULATED_BOARDS_H
#define FOVEA_TESTS_COMMON_SIMULATED_BOARDS_H

#include "calibrate/calibrate.h"

#include <cmath>
#include <random>
#include <string>
#include <vector>

namespace simulated
{

constexpr int WIDTH = 640, HEIGHT = 480, VIEWS = 20;
constexpr double NOISE_PX = .15;
inline const calibrate::Board board = {9, 6, .03};

struct Random {
    std::mt19937_64 bits;
    double between(double low, double high)
    {
        return low + (high - low) * (double)(bits() >> 11) * 0x1p-53;
    }
    double gauss()
    {
        return std::sqrt(-2 * std::log(between(1e-12, 1))) * std::cos(between(0, 6.283185307));
    }
};

inline fovea_camera true_camera(calibrate::Model model, Random &random)
{
    for (;;) {
        fovea_camera camera = {};
        camera.width = WIDTH;
        camera.height = HEIGHT;
        camera.cx = .5 * WIDTH + random.between(-20, 20);
        camera.cy = .5 * HEIGHT + random.between(-20, 20);
        const bool fisheye = model == calibrate::Model::equidistant;
        camera.lens = fisheye ? FOVEA_LENS_EQUIDISTANT : FOVEA_LENS_RADTAN;
        camera.fx = fisheye ? random.between(180, 320)
                            : random.between(model == calibrate::Model::rational ? 450 : 350, 900);
        camera.fy = camera.fx * random.between(.99, 1.01);
        if (fisheye) {
            for (int i = 0; i < 4; i++)
                camera.k[i] = random.between(-.02, .02) / (i + 1);
        } else {
            camera.k[0] = random.between(-.35, .1);
            camera.k[1] = random.between(-.05, .15);
            camera.k[2] = random.between(-.001, .001);
            camera.k[3] = random.between(-.001, .001);
            camera.k[4] = random.between(-.03, .03);
        }
        if (model == calibrate::Model::rational)
            for (int i = 5; i < 8; i++)
                camera.k[i] = random.between(-.1, .1);
        const double corner[2] = {0, 0};
        double bearing[3];
        if (fovea_camera_prepare(&camera, nullptr) == FOVEA_OK &&
            (fisheye || fovea_camera_unproject(&camera, corner, bearing, nullptr) == FOVEA_OK))
            return camera;
    }
}

inline void cross(const double a[3], const double b[3], double out[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
}

inline void normalise(double v[3])
{
    const double length = std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    for (int i = 0; i < 3; i++)
        v[i] /= length;
}

/* How a board is held; what a set that is bad on purpose changes. */
struct Holding {
    double left = 60, top = 60, right = 60,
           bottom = 60;         /* the middle stays so far from the border */
    double tilt = .5;           /* of each component of its normal */
    double near = 1.6, far = 4; /* distance over the board's width */
    double bend_m = 0;          /* height of the middle over the edges */
    double noise_px = NOISE_PX;
};

/* The middle of a board and its axes, in the camera's frame. */
struct Held {
    double middle[3], x[3], y[3], z[3];
};

/* A board of that width somewhere in the image, tilted by up to some 40 degrees; false: the lens
 * does not see there. */
inline bool hold(const fovea_camera &camera, Random &random, const Holding &holding, double size,
                 Held &held)
{
    const double at[2] = {random.between(holding.left, WIDTH - holding.right),
                          random.between(holding.top, HEIGHT - holding.bottom)};
    double towards[3], *x = held.x, *y = held.y, *z = held.z;
    if (fovea_camera_unproject(&camera, at, towards, nullptr) != FOVEA_OK) return false;
    const double distance = size * camera.fx / WIDTH * random.between(holding.near, holding.far);
    const double turn = random.between(-.6, .6);
    const double along[3] = {std::cos(turn), std::sin(turn), 0};
    for (int i = 0; i < 3; i++) /* a board that is never tilted is held parallel to the image */
        z[i] = (holding.tilt > .1 ? towards[i] : (i == 2)) +
               random.between(-holding.tilt, holding.tilt);
    normalise(z);
    cross(z, along, y);
    normalise(y);
    cross(y, z, x);
    for (int i = 0; i < 3; i++)
        held.middle[i] = distance * towards[i];
    return true;
}

/* A pixel of a point in the camera's frame; false: it is not seen, or too near to the border. */
inline bool see_point(const fovea_camera &camera, const double point[3], double pixel[2])
{
    return fovea_camera_project(&camera, point, pixel, nullptr) == FOVEA_OK && pixel[0] >= 3 &&
           pixel[1] >= 3 && pixel[0] <= WIDTH - 4 && pixel[1] <= HEIGHT - 4;
}

inline calibrate::Pixel with_noise(const double pixel[2], Random &random)
{
    const double x = pixel[0] + NOISE_PX * random.gauss();
    return {x, pixel[1] + NOISE_PX * random.gauss()};
}

inline calibrate::View without_board(calibrate::View view)
{
    view.corners.clear();
    view.left_out = "no board";
    return view;
}

/* What a detector finds of such a board, with noise, and the truth; false: a corner is not seen. */
inline bool see(const fovea_camera &camera, Random &random, const Holding &holding,
                calibrate::View &view, calibrate::View &exact)
{
    const double size = board.square_m * (board.columns - 1);
    const double height = board.square_m * (board.rows - 1);
    Held held;
    if (!hold(camera, random, holding, size, held)) return false;
    view.corners.clear();
    exact.corners.clear();
    for (const calibrate::Point &point : board.points()) {
        double seen[3], pixel[2];
        const double a = point[0] - .5 * size, b = point[1] - .5 * height;
        const double up = holding.bend_m * (1 - 4 * a * a / (size * size));
        for (int i = 0; i < 3; i++)
            seen[i] = held.middle[i] + a * held.x[i] + b * held.y[i] - up * held.z[i];
        if (!see_point(camera, seen, pixel)) return false;
        exact.corners.push_back({pixel[0], pixel[1]});
        view.corners.push_back({pixel[0] + holding.noise_px * random.gauss(),
                                pixel[1] + holding.noise_px * random.gauss()});
    }
    return true;
}

inline std::vector<calibrate::View> see_boards(const fovea_camera &camera, Random &random,
                                               size_t count, std::vector<calibrate::View> *exact,
                                               const Holding &holding = Holding())
{
    std::vector<calibrate::View> views;
    while (views.size() < count) {
        calibrate::View view, without_noise;
        view.name = std::to_string(views.size());
        view.edge_px = 2.2;
        if (!see(camera, random, holding, view, without_noise)) continue;
        views.push_back(view);
        if (exact != nullptr) exact->push_back(without_noise);
    }
    return views;
}

} // namespace simulated

#endif

/* Corners between pixels, and how sharp edges are. */
#ifndef FOVEA_CALIBRATE_CORNERS_H
#define FOVEA_CALIBRATE_CORNERS_H

#include "calibrate/detect.h"

namespace calibrate
{

double distance(const Pixel &a, const Pixel &b);

/* Between pixels, bilinear; NaN outside the image. */
double grey_at(const Grey &image, double x, double y);

/* Move the middles of blobs to the images of the circles' centres. How the board is seen around
 * each and how large its circles are is measured in the picture. */
void correct_circles(const Grey &image, const Board &board, View &view);

/* Move `corner`, where two edges cross, to its place between pixels, by a Gaussian window of
 * `half` pixels to each side. False, and nothing moved: it wanders off, or there is no corner. */
bool refine_corner(const Grey &image, double half, Pixel &corner);

/* Where the profile from one place to another passes 10 % and 90 % of its step: how far these are
 * apart, in pixels. NaN: there is no step. */
double step_width(const Grey &image, const Pixel &from, const Pixel &to);

/* step_width across the middle of the edge from a to b, `reach` of its length to both sides. */
double edge_width(const Grey &image, const Pixel &a, const Pixel &b, double reach);

} // namespace calibrate
#endif

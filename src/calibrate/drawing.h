/* Boards as they are printed. */
#ifndef FOVEA_CALIBRATE_DRAWING_H
#define FOVEA_CALIBRATE_DRAWING_H

#include "calibrate/calibrate.h"

namespace calibrate
{

/* Black on white; metres, x to the right and y down from the drawing's top left. */
struct Shape {
    bool circle; /* about (x, y), of diameter `width`; else a rectangle from (x, y) on */
    double x, y, width, height;
};

struct Drawing {
    double width_m, height_m; /* of all shapes */
    double x_m, y_m;          /* where the first of Board::points lies */
    std::vector<Shape> shapes;
};

/* False: a board that cannot be printed, such as one with more markers than its dictionary has. */
bool draw(const Board &board, Drawing &drawing, std::string &error);

} // namespace calibrate
#endif

/* What residuals say when they are looked at together: by place in the image and by direction. */
#ifndef FOVEA_CALIBRATE_RESIDUALS_H
#define FOVEA_CALIBRATE_RESIDUALS_H

#include "calibrate/calibrate.h"

namespace calibrate
{

struct ResidualCell {
    Pixel mean = {0, 0}; /* predicted less found */
    int count = 0;
};

struct ResidualPattern {
    enum { COLUMNS = 12, ROWS = 9, DIRECTIONS = 24 };
    std::array<ResidualCell, COLUMNS * ROWS> cells; /* of the image, row by row */
    /* Residuals that point into each sector; the first begins at x, and they turn towards y. */
    std::array<int, DIRECTIONS> directions = {};
    /* Mean of count x mean^2 over the cells, over what independent noise gives: 1. Residuals that
     * point the same way in a part of the image make it large. NaN: too few corners. */
    double ratio = NAN;
};

ResidualPattern residual_pattern(const std::vector<View> &views, const Solution &solution);

/* Convex hull of the corners that are used, turning from x towards y. */
std::vector<Pixel> corner_hull(const std::vector<View> &views, const Solution &solution);

} // namespace calibrate
#endif

#include "calibrate/residuals.h"

#include <algorithm>

namespace calibrate
{

namespace
{

/* Of fewer residuals the mean says little. */
constexpr int CELL_CORNERS_MIN = 4;
constexpr double TURN = 6.283185307179586;

double ratio_of(const ResidualPattern &pattern, double noise_px)
{
    double sum = 0;
    int cells = 0;
    for (const ResidualCell &cell : pattern.cells) {
        if (cell.count < CELL_CORNERS_MIN) continue;
        sum += cell.count * (cell.mean[0] * cell.mean[0] + cell.mean[1] * cell.mean[1]);
        cells++;
    }
    return cells > 0 && noise_px > 0 ? sum / (2 * noise_px * noise_px * cells) : NAN;
}

/* Twice the area of the triangle, positive when it turns from x towards y. */
double turn_of(const Pixel &a, const Pixel &b, const Pixel &c)
{
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}

} // namespace

ResidualPattern residual_pattern(const std::vector<View> &views, const Solution &solution)
{
    ResidualPattern pattern;
    for (size_t v = 0; v < solution.residuals_px.size(); v++) {
        for (size_t c = 0; c < solution.residuals_px[v].size(); c++) {
            const Pixel &residual = solution.residuals_px[v][c], &at = views[v].corners[c];
            if (!seen(residual)) continue;
            const int i = (int)((at[0] + .5) / solution.camera.width * pattern.COLUMNS);
            const int j = (int)((at[1] + .5) / solution.camera.height * pattern.ROWS);
            const double angle = std::atan2(residual[1], residual[0]);
            const int sector =
                (int)((angle < 0 ? angle + TURN : angle) / TURN * pattern.DIRECTIONS);
            pattern.directions[(size_t)std::min<int>(sector, pattern.DIRECTIONS - 1)]++;
            ResidualCell &cell =
                pattern.cells[(size_t)(std::clamp<int>(j, 0, pattern.ROWS - 1) * pattern.COLUMNS +
                                       std::clamp<int>(i, 0, pattern.COLUMNS - 1))];
            cell.count++;
            for (size_t k = 0; k < 2; k++)
                cell.mean[k] += residual[k];
        }
    }
    for (ResidualCell &cell : pattern.cells)
        for (size_t k = 0; k < 2 && cell.count > 0; k++)
            cell.mean[k] /= cell.count;
    pattern.ratio = ratio_of(pattern, solution.noise_px);
    return pattern;
}

/* Andrew's monotone chain. */
std::vector<Pixel> corner_hull(const std::vector<View> &views, const Solution &solution)
{
    std::vector<Pixel> corners, hull;
    for (size_t v = 0; v < solution.residuals_px.size(); v++)
        for (size_t c = 0; c < solution.residuals_px[v].size(); c++)
            if (seen(solution.residuals_px[v][c])) corners.push_back(views[v].corners[c]);
    std::sort(corners.begin(), corners.end());
    for (const bool back : {false, true}) {
        const size_t first = hull.size();
        for (const Pixel &corner : corners) {
            while (hull.size() >= first + 2 &&
                   turn_of(hull[hull.size() - 2], hull.back(), corner) <= 0)
                hull.pop_back();
            hull.push_back(corner);
        }
        if (!hull.empty()) hull.pop_back(); /* the first of the way back */
        if (!back) std::reverse(corners.begin(), corners.end());
    }
    return hull;
}

} // namespace calibrate

#include "calibrate/report_drawings.h"

#include <algorithm>

#include "calibrate/html.h"

namespace calibrate
{
namespace
{

/* Of the scale of colours, pixels. */
constexpr double SCALE_LOW = .03, SCALE_HIGH = 10;

std::string begin(const char *name, double width, double height)
{
    return formatted("<svg class=\"%s\" viewBox=\"0 0 %g %g\" role=\"img\" aria-label=\"%s\">\n",
                     name, width, height, name);
}

/* Pixels have their centres at whole numbers; a drawing of the image begins at its border. */
double across(double pixel)
{
    return pixel + .5;
}

std::string path_of(const std::vector<Pixel> &corners)
{
    std::string path;
    for (size_t i = 0; i < corners.size(); i++)
        path += formatted("%s%.1f %.1f", i == 0 ? "M" : "L", across(corners[i][0]),
                          across(corners[i][1]));
    return path.empty() ? path : path + "Z";
}

/* From dark blue over green to yellow: five colours of matplotlib's viridis, between them linear.
 */
std::string colour_of(double stdev_px)
{
    static const double colours[5][3] = {
        {68, 1, 84}, {59, 82, 139}, {33, 145, 140}, {94, 201, 98}, {253, 231, 37}};
    const double at =
        4 * std::clamp(std::log(stdev_px / SCALE_LOW) / std::log(SCALE_HIGH / SCALE_LOW), 0., 1.);
    const int first = std::min(3, (int)at);
    int mixed[3];
    for (int i = 0; i < 3; i++)
        mixed[i] = (int)std::lround(colours[first][i] +
                                    (at - first) * (colours[first + 1][i] - colours[first][i]));
    return formatted("#%02x%02x%02x", (unsigned)mixed[0], (unsigned)mixed[1], (unsigned)mixed[2]);
}

/* A colour per direction, all as bright as each other. */
std::string hue_of(const Pixel &direction)
{
    const double degrees = std::atan2(direction[1], direction[0]) * 57.29577951308232;
    return formatted("hsl(%.0f,80%%,50%%)", degrees < 0 ? degrees + 360 : degrees);
}

/* Values of the map in words, at a few of its cells. */
std::string labels_of(const Uncertainty &map, double width, double height)
{
    constexpr int columns = 4, rows = 4;
    std::string text;
    for (int j = 0; j < rows; j++) {
        for (int i = 0; i < columns; i++) {
            const int column = (int)((i + .5) / columns * map.columns);
            const int row = (int)((j + .5) / rows * map.rows);
            const double value = map.stdev_px[(size_t)(row * map.columns + column)];
            text += formatted("<text class=\"label\" x=\"%.1f\" y=\"%.1f\" font-size=\"%.1f\">",
                              (column + .5) / map.columns * width, (row + .5) / map.rows * height,
                              width / 26);
            text +=
                std::isfinite(value) ? formatted(value < 10 ? "%.2f" : "%.0f", value) : "no ray";
            text += "</text>\n";
        }
    }
    return text;
}

} // namespace

std::string draw_coverage(const std::vector<View> &views, const Solution &solution)
{
    const double width = solution.camera.width, height = solution.camera.height;
    std::string svg = begin("coverage", width, height);
    svg += formatted("<rect class=\"frame\" width=\"%g\" height=\"%g\"/>\n", width, height);
    svg += formatted("<path class=\"hull\" d=\"%s\"/>\n",
                     path_of(corner_hull(views, solution)).c_str());
    for (size_t v = 0; v < solution.residuals_px.size(); v++)
        for (size_t c = 0; c < solution.residuals_px[v].size(); c++)
            if (seen(solution.residuals_px[v][c]))
                svg += formatted("<circle cx=\"%.1f\" cy=\"%.1f\" r=\"%.1f\"/>",
                                 across(views[v].corners[c][0]), across(views[v].corners[c][1]),
                                 width / 320);
    return svg + "\n</svg>\n";
}

std::string draw_residuals(const ResidualPattern &pattern, const Solution &solution)
{
    const double width = solution.camera.width, height = solution.camera.height;
    constexpr double sure = 8; /* means of fewer residuals are drawn paler */
    const double cell[2] = {width / pattern.COLUMNS, height / pattern.ROWS};
    const double scale = solution.rms_px > 0 ? std::min(cell[0], cell[1]) / solution.rms_px : 0;
    std::string svg = begin("residuals", width, height);
    svg += formatted("<rect class=\"frame\" width=\"%g\" height=\"%g\"/>\n", width, height);
    for (int j = 0; j < pattern.ROWS; j++) {
        for (int i = 0; i < pattern.COLUMNS; i++) {
            const ResidualCell &one = pattern.cells[(size_t)(j * pattern.COLUMNS + i)];
            if (one.count == 0) continue;
            const double x = (i + .5) * cell[0], y = (j + .5) * cell[1];
            const double dx = scale * one.mean[0], dy = scale * one.mean[1];
            svg += formatted(
                "<g stroke=\"%s\" fill=\"%s\" opacity=\"%.2f\"><path stroke-width=\"%.1f\" "
                "d=\"M%.1f %.1fl%.1f %.1f\"/><circle stroke=\"none\" cx=\"%.1f\" "
                "cy=\"%.1f\" r=\"%.1f\"/></g>\n",
                hue_of(one.mean).c_str(), hue_of(one.mean).c_str(), std::min(1., one.count / sure),
                width / 200, x, y, dx, dy, x, y, width / 130);
        }
    }
    return svg + "</svg>\n";
}

std::string draw_directions(const ResidualPattern &pattern)
{
    constexpr double half = 100, even = 60;
    constexpr double turn = 6.283185307179586;
    int all = 0;
    for (const int count : pattern.directions)
        all += count;
    std::string svg = begin("directions", 2 * half, 2 * half);
    for (int d = 0; d < pattern.DIRECTIONS && all > 0; d++) {
        const double share = (double)pattern.directions[(size_t)d] * pattern.DIRECTIONS / all;
        const double radius = std::min(half, even * share);
        const double from = turn * d / pattern.DIRECTIONS, to = turn * (d + 1) / pattern.DIRECTIONS;
        const Pixel middle = {std::cos(.5 * (from + to)), std::sin(.5 * (from + to))};
        svg += formatted("<path fill=\"%s\" d=\"M%g %gL%.1f %.1fA%.1f %.1f 0 0 1 %.1f %.1fZ\"/>\n",
                         hue_of(middle).c_str(), half, half, half + radius * std::cos(from),
                         half + radius * std::sin(from), radius, radius,
                         half + radius * std::cos(to), half + radius * std::sin(to));
    }
    return svg + formatted("<circle class=\"even\" cx=\"%g\" cy=\"%g\" r=\"%g\"/>\n</svg>\n", half,
                           half, even);
}

std::string draw_uncertainty(const std::vector<View> &views, const Solution &solution)
{
    const Uncertainty &map = solution.uncertainty_fine;
    const double width = solution.camera.width, height = solution.camera.height;
    const double cell[2] = {width / map.columns, height / map.rows};
    std::string svg = begin("uncertainty", width, height);
    svg += formatted("<defs><pattern id=\"beyond\" width=\"%.1f\" height=\"%.1f\" "
                     "patternUnits=\"userSpaceOnUse\" patternTransform=\"rotate(45)\">"
                     "<rect class=\"hatch\" width=\"%.1f\" height=\"%.1f\"/></pattern></defs>\n",
                     width / 40, width / 40, width / 130, width / 40);
    for (int j = 0; j < map.rows; j++) {
        for (int i = 0; i < map.columns; i++) {
            const double value = map.stdev_px[(size_t)(j * map.columns + i)];
            const bool ray = std::isfinite(value);
            svg += formatted("<rect class=\"%s\" x=\"%.1f\" y=\"%.1f\" width=\"%.2f\" "
                             "height=\"%.2f\" fill=\"%s\"/>\n",
                             ray ? "cell" : "no-ray", i * cell[0], j * cell[1], 1.03 * cell[0],
                             1.03 * cell[1], ray ? colour_of(value).c_str() : "#777");
        }
    }
    const std::string hull = path_of(corner_hull(views, solution));
    svg += formatted("<path class=\"extrapolated\" fill=\"url(#beyond)\" fill-rule=\"evenodd\" "
                     "d=\"M0 0H%gV%gH0Z%s\"/>\n<path class=\"outermost\" d=\"%s\"/>\n",
                     width, height, hull.c_str(), hull.c_str());
    return svg + labels_of(map, width, height) + "</svg>\n";
}

std::string draw_uncertainty_scale()
{
    constexpr int steps = 40;
    constexpr double width = 400, height = 34, ticks[] = {.03, .1, .3, 1, 3, 10};
    std::string svg = begin("scale", width, height);
    for (int i = 0; i < steps; i++)
        svg += formatted(
            "<rect x=\"%g\" width=\"%g\" height=\"14\" fill=\"%s\"/>", width * i / steps,
            1.03 * width / steps,
            colour_of(SCALE_LOW * std::pow(SCALE_HIGH / SCALE_LOW, (i + .5) / steps)).c_str());
    for (const double tick : ticks) {
        const double at = std::log(tick / SCALE_LOW) / std::log(SCALE_HIGH / SCALE_LOW);
        const char *anchor = at < .05 ? "start" : at > .95 ? "end" : "middle";
        svg +=
            formatted("<text x=\"%.0f\" y=\"30\" font-size=\"14\" text-anchor=\"%s\">%g%s</text>",
                      width * at, anchor, tick, at > .95 ? " px" : "");
    }
    return svg + "\n</svg>\n";
}

std::string draw_view(const View &view, const std::vector<Pixel> &residuals)
{
    const Thumbnail &picture = view.thumbnail;
    std::string svg = begin("view", picture.width, picture.height);
    svg += formatted("<image width=\"%d\" height=\"%d\" href=\"%s\"/>\n", picture.width,
                     picture.height, picture_uri(picture).c_str());
    for (size_t c = 0; c < view.corners.size(); c++) {
        if (!seen(view.corners[c])) continue;
        const bool used = c < residuals.size() && seen(residuals[c]);
        svg += formatted("<circle class=\"%s\" cx=\"%.1f\" cy=\"%.1f\" r=\"%g\"/>",
                         used ? "used" : "out", across(view.corners[c][0]) / picture.reduction,
                         across(view.corners[c][1]) / picture.reduction,
                         used || residuals.empty() ? 1.6 : 4);
    }
    return svg + "\n</svg>\n";
}

} // namespace calibrate

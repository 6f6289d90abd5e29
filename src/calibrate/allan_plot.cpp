#include "calibrate/allan_plot.h"

#include <algorithm>
#include <cmath>

#include "calibrate/html.h"
#include "support/canvas.h"

namespace calibrate
{
namespace
{

constexpr int WIDTH = 1240, HEIGHT = 560, LETTER = 15;
constexpr uint32_t PAPER = 0xffffff, INK = 0x202428, GRID = 0xdde1e6;
constexpr uint32_t COLOURS[3] = {0xc62828, 0x1a7f37, 0x3b6fb6};

/* One part of the sensor, its axes logarithmic from and to powers of ten. */
struct Panel {
    fv_canvas *canvas;
    int left, top, width, height;
    double tau[2], deviation[2]; /* powers */

    float x(double tau_s) const
    {
        return (float)(left + width * (std::log10(tau_s) - tau[0]) / (tau[1] - tau[0]));
    }
    float y(double value) const
    {
        return (float)(top +
                       height * (deviation[1] - std::log10(value)) / (deviation[1] - deviation[0]));
    }
};

Panel panel_of(fv_canvas *canvas, const AllanFit *axes, int left)
{
    Panel panel = {canvas, left, 60, 500, 420, {INFINITY, -INFINITY}, {INFINITY, -INFINITY}};
    for (int a = 0; a < 3; a++) {
        for (const AllanPoint &point : axes[a].points) {
            if (!(point.variance > 0)) continue;
            const double values[2] = {std::log10(point.tau_s), .5 * std::log10(point.variance)};
            panel.tau[0] = std::min(panel.tau[0], std::floor(values[0]));
            panel.tau[1] = std::max(panel.tau[1], std::ceil(values[0] + 1e-9));
            panel.deviation[0] = std::min(panel.deviation[0], std::floor(values[1]));
            panel.deviation[1] = std::max(panel.deviation[1], std::ceil(values[1] + 1e-9));
        }
    }
    return panel;
}

void draw_grid(const Panel &p, const char *title, const char *unit)
{
    fv_canvas_letters(p.canvas, p.left, p.top - 32, LETTER + 3, INK, title);
    fv_canvas_letters(p.canvas, p.left, p.top - 12, LETTER, INK, unit);
    for (double power = p.tau[0]; power <= p.tau[1]; power++) {
        const float x = p.x(std::pow(10, power));
        const std::string text = formatted("%g", std::pow(10, power));
        fv_canvas_line(p.canvas, x, (float)p.top, x, (float)(p.top + p.height), 1, GRID);
        fv_canvas_letters(p.canvas, (int)x - fv_canvas_letters_width(LETTER, text.c_str()) / 2,
                          p.top + p.height + 20, LETTER, INK, text.c_str());
    }
    for (double power = p.deviation[0]; power <= p.deviation[1]; power++) {
        const float y = p.y(std::pow(10, power));
        const std::string text = formatted("1e%g", power);
        fv_canvas_line(p.canvas, (float)p.left, y, (float)(p.left + p.width), y, 1, GRID);
        fv_canvas_letters(p.canvas, p.left - 8 - fv_canvas_letters_width(LETTER, text.c_str()),
                          (int)y + 5, LETTER, INK, text.c_str());
    }
    fv_canvas_letters(p.canvas, p.left + p.width / 2 - 40, p.top + p.height + 44, LETTER, INK,
                      "averaged over, s");
}

void draw_curves(const Panel &p, const AllanFit *axes)
{
    static const char *const names[] = {"x", "y", "z"};
    for (int a = 0; a < 3; a++) {
        float before[2] = {0, 0};
        bool any = false;
        for (const AllanPoint &point : axes[a].points) {
            const double fit = axes[a].variance(point.tau_s);
            if (!(point.variance > 0) || !(fit > 0)) continue;
            const float x = p.x(point.tau_s), y = p.y(std::sqrt(fit));
            if (any) fv_canvas_line(p.canvas, before[0], before[1], x, y, 1.5f, COLOURS[a]);
            fv_canvas_disc(p.canvas, x, p.y(std::sqrt(point.variance)), 3.5f, COLOURS[a]);
            before[0] = x;
            before[1] = y;
            any = true;
        }
        fv_canvas_letters(p.canvas, p.left + p.width - 70 + 24 * a, p.top - 12, LETTER, COLOURS[a],
                          names[a]);
    }
}

} // namespace

fovea_status plot_allan(const ImuNoise &noise, const char *path, fovea_error *error)
{
    fv_canvas canvas;
    fovea_status status = fv_canvas_create(&canvas, WIDTH, HEIGHT, PAPER);
    if (status != FOVEA_OK)
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%.300s: out of memory", path);
    const struct {
        const char *title, *unit;
        size_t first;
        int left;
    } parts[] = {{"Gyroscope", "Allan deviation, rad/s", 0, 80},
                 {"Accelerometer", "Allan deviation, m/s^2", 3, 700}};
    for (const auto &part : parts) {
        const AllanFit *axes = &noise.axes[part.first];
        const Panel panel = panel_of(&canvas, axes, part.left);
        if (!(panel.tau[0] < panel.tau[1])) continue;
        draw_grid(panel, part.title, part.unit);
        draw_curves(panel, axes);
    }
    status = fv_canvas_write(&canvas, path, error);
    fv_canvas_free(&canvas);
    return status;
}

} // namespace calibrate

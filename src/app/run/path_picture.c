#include "app/run/run_picture.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "geometry/linear.h"

enum {
    SIDE = FV_PATH_PANEL_WIDTH,
    MARGIN = 60,
    EDGE = 30,
    TOP = FV_PATH_PANEL_HEIGHT - SIDE,
    INK = 0x222222,
    GREY = 0xe4e4e4,
    OURS = 0x1f5fa8,
    TRUTH = 0xe08214
};

/* From points to pixels: two orthogonal directions, a centre and a scale, equal for both. */
struct view {
    double axis[2][3], centre[2], px_per_unit;
};

static double along(const double axis[3], const double p[3])
{
    return axis[0] * p[0] + axis[1] * p[1] + axis[2] * p[2];
}

static void widen(struct view *view, const double p[3], double low[2], double high[2])
{
    for (int a = 0; a < 2; a++) {
        double at = along(view->axis[a], p);
        if (at < low[a]) low[a] = at;
        if (at > high[a]) high[a] = at;
    }
}

static void directions(const struct fv_trajectory_summary *summary, struct view *view)
{
    double mean[3] = {0}, S[9] = {0}, values[3], V[9], p[3];
    double count = 0.0;
    for (uint32_t i = 0; i < summary->points; i++) {
        if (isnan(summary->centres[i][0])) continue;
        for (int r = 0; r < 3; r++)
            mean[r] += summary->centres[i][r];
        count += 1.0;
    }
    for (uint32_t i = 0; i < summary->points; i++) {
        if (isnan(summary->centres[i][0])) continue;
        for (int r = 0; r < 3; r++)
            p[r] = summary->centres[i][r] - mean[r] / count;
        for (int r = 0; r < 3; r++)
            for (int c = 0; c < 3; c++)
                S[3 * r + c] += p[r] * p[c];
    }
    fv_eigen_symmetric(S, 3, values, V);
    memcpy(view->axis, V, sizeof view->axis);
    for (int a = 0; a < 2;
         a++) { /* the same path gives the same picture: the largest component is positive */
        int big = 0;
        for (int r = 1; r < 3; r++)
            if (fabs(view->axis[a][r]) > fabs(view->axis[a][big])) big = r;
        for (int r = 0; r < 3 && view->axis[a][big] < 0.0; r++)
            if (r != big) view->axis[a][r] = -view->axis[a][r];
        if (view->axis[a][big] < 0.0) view->axis[a][big] = -view->axis[a][big];
    }
}

static void view_fit(const struct fv_trajectory_summary *summary, struct view *view)
{
    double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
    directions(summary, view);
    for (uint32_t i = 0; i < summary->points; i++) {
        widen(view, summary->centres[i], low, high); /* NaN widens nothing */
        if (summary->truths != NULL) widen(view, summary->truths[i], low, high);
    }
    double extent = high[0] - low[0] > high[1] - low[1] ? high[0] - low[0] : high[1] - low[1];
    for (int a = 0; a < 2; a++)
        view->centre[a] = (low[a] + high[a]) / 2;
    view->px_per_unit = extent > 0.0 ? (SIDE - 2 * MARGIN) / extent : 1.0;
}

static void to_pixel(const struct view *view, const double p[3], float pixel[2])
{
    pixel[0] =
        (float)(SIDE / 2.0 + (along(view->axis[0], p) - view->centre[0]) * view->px_per_unit);
    pixel[1] =
        (float)(TOP + SIDE / 2.0 - (along(view->axis[1], p) - view->centre[1]) * view->px_per_unit);
}

static void grid(struct fv_canvas *canvas, const struct view *view, const char *unit)
{
    char label[64];
    double tick = 1e-6;
    for (int i = 0; tick * view->px_per_unit < 70.0 && i < 48; i++)
        tick *= i % 3 == 1 ? 2.5 : 2.0;
    const double middle[2] = {SIDE / 2.0, TOP + SIDE / 2.0};
    for (int k = -12; k <= 12; k++) {
        float x = (float)(middle[0] + k * tick * view->px_per_unit),
              y = (float)(middle[1] + k * tick * view->px_per_unit);
        if (x > EDGE && x < SIDE - EDGE)
            fv_canvas_line(canvas, x, TOP, x, TOP + SIDE - EDGE, 1.0F, GREY);
        if (y > TOP && y < TOP + SIDE - EDGE)
            fv_canvas_line(canvas, EDGE, y, SIDE - EDGE, y, 1.0F, GREY);
    }
    snprintf(label, sizeof label, "one square is %.4g %s", tick, unit);
    fv_canvas_text(canvas, EDGE, TOP + SIDE - 20, 1, INK, label);
}

static void draw(struct fv_canvas *canvas, const struct fv_trajectory_summary *summary,
                 const struct view *view)
{
    float last[2] = {0}, pixel[2];
    for (uint32_t i = 0; summary->truths != NULL && i < summary->points; i++) {
        to_pixel(view, summary->truths[i], pixel);
        if (i > 0) fv_canvas_line(canvas, last[0], last[1], pixel[0], pixel[1], 3.0F, TRUTH);
        memcpy(last, pixel, sizeof last);
    }
    bool drawn = false;
    for (uint32_t i = 0; i < summary->points; i++) {
        if (isnan(summary->centres[i][0])) continue;
        to_pixel(view, summary->centres[i], pixel);
        if (!drawn || summary->map_of[i] != summary->map_of[i - 1])
            fv_canvas_circle(canvas, pixel[0], pixel[1], 6.0F, 1.5F, OURS);
        else
            fv_canvas_line(canvas, last[0], last[1], pixel[0], pixel[1], 1.4F, OURS);
        memcpy(last, pixel, sizeof last);
        drawn = true;
    }
    if (drawn) fv_canvas_disc(canvas, last[0], last[1], 4.0F, OURS);
}

enum fovea_status fv_path_panel(struct fv_canvas *canvas, const char *name,
                                const struct fv_trajectory_summary *summary)
{
    struct view view;
    char line[200];
    enum fovea_status status = fv_canvas_create(canvas, SIDE, TOP + SIDE, 0xffffff);
    if (status != FOVEA_OK) return status;
    const bool aligned = isfinite(summary->scale);
    if (summary->points > 0) {
        view_fit(summary, &view);
        grid(canvas, &view, aligned ? "m" : "of the path's own unit");
        draw(canvas, summary, &view);
    }
    snprintf(line, sizeof line, "%.60s  %" PRIu64 " posed frames", name, summary->samples);
    fv_canvas_text(canvas, EDGE, 14, fv_canvas_text_width(2, line) > SIDE - MARGIN ? 1 : 2, INK,
                   line);
    int x = fv_canvas_text(canvas, EDGE, 44, 1, OURS, "path (rings: a map starts, dot: end)   ");
    if (aligned) {
        x = fv_canvas_text(canvas, x, 44, 1, TRUTH, "truth   ");
        snprintf(line, sizeof line, "RMS error %.4g m over %.4g m, %" PRIu32 " map%s",
                 summary->error_m, summary->truth_length_m, summary->maps,
                 summary->maps == 1 ? "" : "s");
        fv_canvas_text(canvas, x, 44, 1, INK, line);
    }
    return FOVEA_OK;
}

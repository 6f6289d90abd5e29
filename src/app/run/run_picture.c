#include "app/run/run_picture.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app/lab/map_open.h"

#define INK 0x222222
#define GREY 0xe4e4e4

enum {
    TRACKS_WIDTH = 900,
    TRACKS_HEIGHT = 700,
    LEFT = 50,
    RIGHT = 880,
    TOP = 64,
    BOTTOM = 660,
    GAP = 20,
    COLOURS = 6
};

static const uint32_t colours[COLOURS] = {0xd62728, 0x2ca02c, 0x1f77b4,
                                          0xbf9000, 0x9467bd, 0x17a2a2};

/* ---- tracks ---------------------------------------------------------------------------------- */

struct time_axis {
    double seconds;
    int32_t width_px; /* of the camera's image */
};

static void to_pixel(const struct time_axis *axis, const struct fv_trail_point *point,
                     float pixel[2])
{
    pixel[0] = (float)(LEFT + (double)point->time_s / axis->seconds * (RIGHT - LEFT));
    pixel[1] = (float)(TOP + (double)point->x_px / axis->width_px * (BOTTOM - TOP));
}

static void tracks_grid(struct fv_canvas *canvas, const struct time_axis *axis)
{
    char label[64];
    double tick = 1e-3;
    for (int i = 0; tick * 8.0 < axis->seconds && i < 40; i++)
        tick *= i % 3 == 1 ? 2.5 : 2.0;
    for (int i = 0; i * tick <= axis->seconds && i < 20; i++) {
        const float x = (float)(LEFT + i * tick / axis->seconds * (RIGHT - LEFT));
        fv_canvas_line(canvas, x, TOP, x, BOTTOM, 1.0F, GREY);
        snprintf(label, sizeof label, "%.4g s", i * tick);
        fv_canvas_text(canvas, (int)x - 8, BOTTOM + 8, 1, INK, label);
    }
    for (int i = 0; i <= 4; i++) {
        const float y = TOP + (float)i / 4 * (BOTTOM - TOP);
        fv_canvas_line(canvas, LEFT, y, RIGHT, y, 1.0F, GREY);
        snprintf(label, sizeof label, "%d", i * axis->width_px / 4);
        fv_canvas_text(canvas, LEFT - 8 - fv_canvas_text_width(1, label), (int)y - 4, 1, INK,
                       label);
    }
}

/* A line where a track was seen in the look before too, thin over a gap; its id where it begins. */
static void trail_draw(struct fv_canvas *canvas, const struct fv_trails *trails,
                       const struct time_axis *axis, uint32_t i)
{
    const struct fv_trail_point *point = &trails->points[i];
    const uint32_t colour = colours[point->class_id % COLOURS];
    float from[2], to[2];
    char label[16];
    to_pixel(axis, point, to);
    for (uint32_t k = i; k-- > 0;) {
        if (trails->points[k].id != point->id) continue;
        to_pixel(axis, &trails->points[k], from);
        fv_canvas_line(canvas, from[0], from[1], to[0], to[1],
                       trails->points[k].look + 1 == point->look ? 2.0F : 0.5F, colour);
        return;
    }
    snprintf(label, sizeof label, "%u", point->id);
    fv_canvas_text(canvas, (int)to[0], (int)to[1] - 12, 1, colour, label);
}

static enum fovea_status tracks_panel(struct fv_canvas *canvas, const struct fv_trails *trails,
                                      const struct fovea *rt, int32_t width_px)
{
    const struct time_axis axis = {(double)(trails->last_ns - trails->first_ns) * 1e-9 + 1e-3,
                                   width_px};
    enum fovea_status status = fv_canvas_create(canvas, TRACKS_WIDTH, TRACKS_HEIGHT, 0xffffff);
    if (status != FOVEA_OK) return status;
    fv_canvas_text(canvas, LEFT - 26, 10, 2, INK, "tracks: column of the image over time");
    int x = fv_canvas_text(canvas, LEFT - 26, 38, 1, INK,
                           "one line and number per id, thin while not seen   ");
    bool named[COLOURS] = {false};
    tracks_grid(canvas, &axis);
    for (uint32_t i = 0; i < trails->count; i++) {
        const int32_t class_id = trails->points[i].class_id;
        const char *label = fovea_detect_label(rt, class_id);
        if (label != NULL && !named[class_id % COLOURS]) {
            x = fv_canvas_text(canvas, x, 38, 1, colours[class_id % COLOURS], label);
            x = fv_canvas_text(canvas, x, 38, 1, INK, "  ");
        }
        named[class_id % COLOURS] = true;
        trail_draw(canvas, trails, &axis, i);
    }
    return FOVEA_OK;
}

/* ---- map ------------------------------------------------------------------------------------- */

/* No panel (no pixels) when there is no map yet. */
static enum fovea_status map_panel(struct fv_canvas *canvas, struct fovea *rt,
                                   const struct fovea_config *config)
{
    static struct fv_map_open open; /* large */
    struct fovea_error error;
    uint32_t map_id;
    const size_t capacity = fovea_map_bytes_max(config);
    uint8_t *buffer = malloc(capacity);
    if (buffer == NULL) return FOVEA_ERROR_SYSTEM;
    const size_t bytes = fovea_map_save(rt, buffer, capacity);
    enum fovea_status status =
        bytes > 0 ? fv_map_open_bytes(buffer, bytes, "map", &open, &error) : FOVEA_ERROR_SYSTEM;
    free(buffer);
    if (status != FOVEA_OK) return status;
    if (fv_map_open_largest(&open, &map_id)) status = fv_map_panel(canvas, &open, "map", map_id, 1);
    fv_map_open_free(&open);
    return status;
}

/* ---- the sheet ------------------------------------------------------------------------------- */

enum { PATH, TIMINGS, MAP, TRACKS, PANELS };

static const struct {
    int width, height;
} sizes[PANELS] = {
    [PATH] = {FV_PATH_PANEL_WIDTH, FV_PATH_PANEL_HEIGHT},
    [TIMINGS] = {FV_REPORT_PANEL_WIDTH, FV_REPORT_PANEL_HEIGHT},
    [MAP] = {FV_MAP_PANEL_WIDTH, FV_MAP_PANEL_HEIGHT},
    [TRACKS] = {TRACKS_WIDTH, TRACKS_HEIGHT},
};

struct sheet {
    struct fv_canvas canvas;
    bool has[PANELS];
    int right; /* where the second column begins */
};

static int larger(int a, int b)
{
    return a > b ? a : b;
}

/* Two columns: path over timings, map over tracks. */
static enum fovea_status sheet_create(struct sheet *sheet)
{
    int width[PANELS] = {0}, height[PANELS] = {0};
    for (int i = 0; i < PANELS; i++)
        if (sheet->has[i]) width[i] = sizes[i].width, height[i] = sizes[i].height;
    const int second = larger(width[MAP], width[TRACKS]);
    sheet->right = larger(width[PATH], width[TIMINGS]) + GAP;
    return fv_canvas_create(&sheet->canvas, second > 0 ? sheet->right + second : sheet->right - GAP,
                            larger(height[PATH] + height[TIMINGS], height[MAP] + height[TRACKS]),
                            0xffffff);
}

/* Copy a panel to its place and free it. */
static void panel_place(struct sheet *sheet, int i, struct fv_canvas *panel)
{
    const size_t bytes = (size_t)panel->width * (size_t)panel->height * 3;
    const struct fovea_image image = {panel->rgb,       panel->width,      panel->height,
                                      3 * panel->width, FOVEA_PIXEL_RGB24, bytes};
    const int top = i % 2 == 1 && sheet->has[i - 1] ? sizes[i - 1].height : 0;
    fv_canvas_image(&sheet->canvas, i >= MAP ? sheet->right : 0, top, &image);
    fv_canvas_free(panel);
}

static enum fovea_status panel_draw(int i, struct fv_canvas *panel,
                                    const struct fv_run_picture *picture, const struct fovea *rt)
{
    const struct fv_report *report = picture->report;
    if (i == PATH) return fv_path_panel(panel, report->source, picture->path);
    if (i == TIMINGS) return fv_report_panel(panel, report);
    return tracks_panel(panel, picture->trails, rt, report->width);
}

/* The map comes first, by itself, as it is opened in memory of its own; the others one after the
 * other. */
static enum fovea_status sheet_draw(struct sheet *sheet, const struct fv_run_picture *picture,
                                    struct fovea *rt, const struct fovea_config *config)
{
    struct fv_canvas panel = {0};
    enum fovea_status status = config->odometry.enabled ? map_panel(&panel, rt, config) : FOVEA_OK;
    if (status != FOVEA_OK) return status;
    sheet->has[PATH] = picture->path->samples > 0;
    sheet->has[TIMINGS] = true;
    sheet->has[MAP] = panel.rgb != NULL;
    sheet->has[TRACKS] = picture->trails->count > 0;
    status = sheet_create(sheet);
    if (status != FOVEA_OK) {
        fv_canvas_free(&panel);
        return status;
    }
    if (sheet->has[MAP]) panel_place(sheet, MAP, &panel);
    for (int i = 0; i < PANELS; i++) {
        if (i == MAP || !sheet->has[i]) continue;
        status = panel_draw(i, &panel, picture, rt);
        if (status != FOVEA_OK) return status;
        panel_place(sheet, i, &panel);
    }
    return FOVEA_OK;
}

enum fovea_status fv_run_picture(const char *path, const struct fv_run_picture *picture,
                                 struct fovea *rt, const struct fovea_config *config,
                                 struct fovea_error *error)
{
    struct sheet sheet = {0};
    enum fovea_status status = sheet_draw(&sheet, picture, rt, config);
    if (status == FOVEA_OK)
        status = fv_canvas_write(&sheet.canvas, path, error);
    else
        fovea_error_set(error, status, "%.200s: no memory for the picture", path);
    fv_canvas_free(&sheet.canvas);
    return status;
}

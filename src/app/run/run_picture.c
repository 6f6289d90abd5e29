#include "app/run/run_picture.h"

#include <inttypes.h>
#include <malloc.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "app/lab/lettering.h"

enum {
    WIDTH = 1600,
    MARGIN = 28,
    GAP = 32,
    HEAD = 76,
    RIBBON = 74,
    COLUMN = (WIDTH - 2 * MARGIN - GAP) / 2,
    UPPER_MIN = 460, /* height of the row with frame and map, as the frame's shape needs it */
    UPPER_MAX = 640,
    LOWER = 400, /* of that with objects and times */
    TITLE = 30   /* of a part's head */
};

/* ---- what the parts share -------------------------------------------------------------------- */

struct fv_area fv_picture_title(struct fv_canvas *canvas, const struct fv_area *area,
                                const char *title)
{
    fv_canvas_letters(canvas, area->left, area->top + 18, FV_PICTURE_TITLE_PX, FV_PICTURE_INK,
                      title);
    return (struct fv_area){area->left, area->top + TITLE, area->width, area->height - TITLE};
}

int fv_picture_legend(struct fv_canvas *canvas, int left, int base, uint32_t colour,
                      const char *text)
{
    fv_canvas_fill(canvas, left, base - 10, 11, 11, colour);
    return fv_canvas_letters(canvas, left + 16, base, FV_PICTURE_TEXT_PX, FV_PICTURE_INK, text) +
           18;
}

double fv_picture_tick(double range, int lines)
{
    double tick = 1e-6;
    for (int i = 0; tick * lines < range && i < 48; i++)
        tick *= i % 3 == 1 ? 2.5 : 2.0;
    return tick;
}

uint32_t fv_picture_class_colour(int32_t class_id)
{
    static const uint32_t colours[] = {0xd62728, 0x1b9e4b, 0x1f77b4, 0xd08a00, 0x9467bd, 0x17a2a2};
    return colours[(uint32_t)class_id % (sizeof colours / sizeof *colours)];
}

/* ---- head ------------------------------------------------------------------------------------ */

/* How long the run was, by the clock of the states. */
static double seconds_of(const struct fv_watch *watch)
{
    int64_t sum_ns = 0;
    for (int i = 0; i < FV_WATCH_STATES; i++)
        sum_ns += watch->total_ns[i];
    return (double)sum_ns * 1e-9;
}

static void head(struct fv_canvas *canvas, const struct fv_run_picture *picture)
{
    const struct fv_report *report = picture->report;
    const struct fv_trajectory_summary *path = picture->path;
    const struct fv_loop_counts *counts = &report->loop->counts;
    char line[320];
    snprintf(line, sizeof line, "Fovea   %.100s", report->source);
    fv_canvas_letters(canvas, MARGIN, 34, 24, FV_PICTURE_INK, line);
    int length =
        snprintf(line, sizeof line,
                 "%d x %d, %" PRIu64 " frames in %.1f s, kernel set %s; posed %" PRIu64 " frames",
                 report->width, report->height, counts->processed, seconds_of(picture->watch),
                 report->kernel_set, counts->posed);
    if (isfinite(path->error_m) && path->truth_length_m > 0)
        snprintf(line + length, sizeof line - (size_t)length,
                 "; RMS error %.4g m (%.2f %%) over %.4g m", path->error_m,
                 100.0 * path->error_m / path->truth_length_m, path->truth_length_m);
    fv_canvas_letters(canvas, MARGIN, 60, 15, FV_PICTURE_PALE, line);
}

/* ---- states over time ------------------------------------------------------------------------ */

static uint32_t state_colour(int state)
{
    static const uint32_t colours[FV_WATCH_STATES] = {
        [FV_WATCH_WAITING] = 0xe6e6e6,  [FV_WATCH_RUNNING] = 0xb8c7d9,
        [FV_WATCH_STARTING] = 0xf2d16b, [FV_WATCH_TRACKING] = 0x4caf6d,
        [FV_WATCH_WEAK] = 0xe9963e,     [FV_WATCH_LOST] = 0xd64545,
        [FV_WATCH_PAUSED] = 0x9a9a9a,   [FV_WATCH_COASTING] = 0x8a63c9,
    };
    return colours[state >= 0 && state < FV_WATCH_STATES ? state : 0];
}

/* The states of the pose over time. */
static void ribbon_draw(struct fv_canvas *canvas, const struct fv_area *area,
                        const struct fv_run_picture *picture)
{
    const struct fv_watch_ribbon *ribbon = &picture->watch->ribbon;
    const double seconds = seconds_of(picture->watch), tick = fv_picture_tick(seconds, 12);
    char label[48];
    int x = fv_canvas_letters(canvas, area->left, area->top + 14, FV_PICTURE_TEXT_PX,
                              FV_PICTURE_INK, "state of the pose     ");
    for (int i = FV_WATCH_RUNNING; i < FV_WATCH_STATES; i++) {
        if (picture->watch->total_ns[i] == 0) continue;
        snprintf(label, sizeof label, "%s %.1f s", fv_watch_name((enum fv_watch_state)i),
                 (double)picture->watch->total_ns[i] * 1e-9);
        x = fv_picture_legend(canvas, x, area->top + 14, state_colour(i), label);
    }
    for (uint32_t i = 0; i < ribbon->bins; i++) {
        const int from = area->left + (int)((int64_t)i * area->width / ribbon->bins),
                  to = area->left + (int)((int64_t)(i + 1) * area->width / ribbon->bins);
        fv_canvas_fill(canvas, from, area->top + 24, to - from, 22, state_colour(ribbon->state[i]));
    }
    for (int i = 0; seconds > 0.0 && i * tick <= seconds; i++) {
        const int at = area->left + (int)(i * tick / seconds * area->width);
        fv_canvas_fill(canvas, at, area->top + 46, 1, 5, FV_PICTURE_PALE);
        snprintf(label, sizeof label, "%.4g s", i * tick);
        const int width = fv_canvas_letters_width(FV_PICTURE_TEXT_PX, label),
                  limit = area->left + area->width - width;
        fv_canvas_letters(canvas, at < limit ? at : limit, area->top + 64, FV_PICTURE_TEXT_PX,
                          FV_PICTURE_PALE, label);
    }
}

/* ---- the sheet ------------------------------------------------------------------------------- */

enum part { FRAME, MAP, OBJECTS, TIMES, PARTS };

static void part_draw(enum part part, struct fv_canvas *canvas, const struct fv_area *area,
                      const struct fv_run_picture *picture, const struct fovea *rt)
{
    switch (part) {
    case FRAME:
        fv_picture_frame(canvas, area, picture, rt);
        break;
    case OBJECTS:
        fv_picture_objects(canvas, area, picture, rt);
        break;
    default:
        fv_picture_times(canvas, area, picture);
        break;
    }
}

/* Height of the row in which the frame has the width of a column. */
static int upper_height(const struct fv_snapshot_frame *snapshot)
{
    if (snapshot == NULL) return UPPER_MAX;
    const int wanted = TITLE + COLUMN * snapshot->image.height / snapshot->image.width + 8;
    return wanted < UPPER_MIN ? UPPER_MIN : wanted < UPPER_MAX ? wanted : UPPER_MAX;
}

/* The areas of the parts that there are; returns the height of the sheet. A part alone in its row
 * takes the whole width, but for the frame, which keeps its shape. */
static int layout(const bool has[PARTS], int upper, struct fv_area area[PARTS])
{
    int top = HEAD + RIBBON + 12;
    for (int row = 0; row < 2; row++) {
        const int left = 2 * row, right = left + 1, height = row == 0 ? upper : LOWER;
        if (!has[left] && !has[right]) continue;
        const int whole = WIDTH - 2 * MARGIN;
        area[left] = (struct fv_area){MARGIN, top, has[right] ? COLUMN : whole, height};
        area[right] = has[left] ? (struct fv_area){MARGIN + COLUMN + GAP, top, COLUMN, height}
                                : (struct fv_area){MARGIN, top, whole, height};
        top += height + GAP / 2;
    }
    return top + MARGIN / 2;
}

/* The map's part on a canvas of its own, before there is a sheet: both the map, which is opened in
 * memory of its own, and the sheet are large. */
static enum fovea_status map_draw(struct fv_canvas *panel, const struct fv_area *area,
                                  const struct fv_run_picture *picture, struct fovea *rt,
                                  const struct fovea_config *config)
{
    const struct fv_area whole = {0, 0, area->width, area->height};
    enum fovea_status status = fv_canvas_create(panel, area->width, area->height, 0xffffff);
    if (status == FOVEA_OK) status = fv_picture_map(panel, &whole, picture, rt, config);
    malloc_trim(0);
    return status;
}

static void panel_place(struct fv_canvas *canvas, const struct fv_area *area,
                        const struct fv_canvas *panel)
{
    const size_t bytes = (size_t)panel->width * (size_t)panel->height * 3;
    const struct fovea_image image = {panel->rgb,       panel->width,      panel->height,
                                      3 * panel->width, FOVEA_PIXEL_RGB24, bytes};
    fv_canvas_image(canvas, area->left, area->top, &image);
}

static enum fovea_status sheet_draw(struct fv_canvas *canvas, const struct fv_run_picture *picture,
                                    struct fovea *rt, const struct fovea_config *config)
{
    const bool has[PARTS] = {
        [FRAME] = picture->snapshot != NULL,
        [MAP] = config->odometry.enabled && picture->path->points > 0,
        [OBJECTS] = picture->trails->count > 0,
        [TIMES] = true,
    };
    struct fv_area area[PARTS];
    struct fv_canvas panel = {0};
    const int height = layout(has, upper_height(picture->snapshot), area);
    enum fovea_status status = FOVEA_OK;
    fv_lettering_open();
    if (has[MAP]) status = map_draw(&panel, &area[MAP], picture, rt, config);
    if (status == FOVEA_OK) status = fv_canvas_create(canvas, WIDTH, height, 0xffffff);
    if (status == FOVEA_OK) {
        const struct fv_area ribbon = {MARGIN, HEAD, WIDTH - 2 * MARGIN, RIBBON};
        head(canvas, picture);
        ribbon_draw(canvas, &ribbon, picture);
        for (int i = 0; i < PARTS; i++)
            if (has[i] && i != MAP) part_draw((enum part)i, canvas, &area[i], picture, rt);
        if (has[MAP]) panel_place(canvas, &area[MAP], &panel);
    }
    fv_canvas_free(&panel);
    return status;
}

enum fovea_status fv_run_picture(const char *path, const struct fv_run_picture *picture,
                                 struct fovea *rt, const struct fovea_config *config,
                                 struct fovea_error *error)
{
    struct fv_canvas canvas = {0};
    enum fovea_status status = sheet_draw(&canvas, picture, rt, config);
    if (status == FOVEA_OK)
        status = fv_canvas_write(&canvas, path, error);
    else
        fovea_error_set(error, status, "%.200s: no memory for the picture", path);
    fv_canvas_free(&canvas);
    return status;
}

/* The picture of a map: seen from above and from the side, in the frame of its first camera (x
 * right, y down, z forward). */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "support/canvas.h"
#include "app/lab/map_open.h"

#define INK 0x222222
#define GREY 0xe4e4e4
#define COVISIBLE 0xb8d4b8
#define CLOSURE 0xd02020
#define PATH 0x1f5fa8

enum {
    WIDTH = 900,
    TOP = 64,
    PANELS = 2,
    PANEL = 620,
    EDGE = 24,
    COVISIBLE_MIN = 30,
    NEIGHBOURS_MAX = 64
};

/* Where a panel shows which coordinates. */
struct panel {
    int right, up;  /* axis of the world: 0 x, 1 y, 2 z */
    double up_sign; /* -1: the axis points down */
    double centre[2], px_per_unit;
    int top;
    const char *title;
};

static int by_value(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Between which values of one axis the map lies, but for the landmarks that stray most. */
static void extent(const struct fv_map_open *open, uint32_t map_id, int axis, double *low,
                   double *high)
{
    double *values = malloc((open->map.limits.landmarks + 1) * sizeof *values);
    uint32_t slots[FV_MAP_KEYFRAMES_MAX], count = 0;
    *low = INFINITY;
    *high = -INFINITY;
    for (uint32_t i = 0; values != NULL && i < open->map.limits.landmarks; i++) {
        const struct fv_landmark *l = &open->map.landmarks[i];
        if (l->used && fv_map_open_map_of(open, l) == map_id) values[count++] = l->point[axis];
    }
    if (count > 0) {
        qsort(values, count, sizeof *values, by_value);
        *low = values[count / 50];
        *high = values[count - 1 - count / 50];
    }
    free(values);
    const uint32_t keyframes = fv_map_open_order(open, map_id, slots);
    for (uint32_t i = 0; i < keyframes; i++) {
        double centre[3];
        fv_map_open_centre(open, slots[i], centre);
        *low = fmin(*low, centre[axis]);
        *high = fmax(*high, centre[axis]);
    }
}

static void fit(const struct fv_map_open *open, uint32_t map_id, struct panel *panel)
{
    const int axes[2] = {panel->right, panel->up}, sides[2] = {WIDTH - 2 * EDGE, PANEL - 3 * EDGE};
    panel->px_per_unit = INFINITY;
    for (int a = 0; a < 2; a++) {
        double low, high;
        extent(open, map_id, axes[a], &low, &high);
        panel->centre[a] = (low + high) / 2;
        if (high > low)
            panel->px_per_unit = fmin(panel->px_per_unit, 0.94 * sides[a] / (high - low));
    }
    if (!isfinite(panel->px_per_unit)) panel->px_per_unit = 1;
}

static bool to_pixel(const struct panel *panel, const double p[3], float pixel[2])
{
    pixel[0] = (float)(WIDTH / 2.0 + (p[panel->right] - panel->centre[0]) * panel->px_per_unit);
    pixel[1] = (float)(panel->top + PANEL / 2.0 -
                       panel->up_sign * (p[panel->up] - panel->centre[1]) * panel->px_per_unit);
    return pixel[0] > 2 && pixel[0] < WIDTH - 2 && pixel[1] > (float)panel->top &&
           pixel[1] < (float)(panel->top + PANEL - EDGE);
}

static void draw_grid(struct fv_canvas *canvas, const struct panel *panel)
{
    char label[160];
    double tick = 1e-6;
    for (int i = 0; tick * panel->px_per_unit < 60.0 && i < 60; i++)
        tick *= i % 3 == 1 ? 2.5 : 2.0;
    const float bottom = (float)(panel->top + PANEL - EDGE);
    for (int k = -20; k <= 20; k++) {
        const float x = (float)(WIDTH / 2.0 + k * tick * panel->px_per_unit);
        const float y = (float)(panel->top + PANEL / 2.0 + k * tick * panel->px_per_unit);
        if (x > EDGE && x < WIDTH - EDGE)
            fv_canvas_line(canvas, x, (float)panel->top, x, bottom, 1.0F, GREY);
        if (y > (float)panel->top && y < bottom)
            fv_canvas_line(canvas, EDGE, y, WIDTH - EDGE, y, 1.0F, GREY);
    }
    snprintf(label, sizeof label, "%s; one square is %.4g", panel->title, tick);
    fv_canvas_text(canvas, EDGE, panel->top + PANEL - 20, 1, INK, label);
}

/* Landmarks with many observers are dark. */
static void draw_landmarks(struct fv_canvas *canvas, const struct fv_map_open *open,
                           uint32_t map_id, const struct panel *panel)
{
    for (uint32_t i = 0; i < open->map.limits.landmarks; i++) {
        const struct fv_landmark *l = &open->map.landmarks[i];
        float pixel[2];
        if (!l->used || fv_map_open_map_of(open, l) != map_id || !to_pixel(panel, l->point, pixel))
            continue;
        const uint32_t grey = l->observer_count > 8 ? 0x30 : 0xb0 - 0x10 * l->observer_count;
        fv_canvas_disc(canvas, pixel[0], pixel[1], 1.1F, grey << 16 | grey << 8 | grey);
    }
}

static void draw_line(struct fv_canvas *canvas, const struct fv_map_open *open,
                      const struct panel *panel, uint32_t a, uint32_t b, float thickness,
                      uint32_t colour)
{
    double centre[3];
    float from[2], to[2];
    fv_map_open_centre(open, a, centre);
    (void)to_pixel(panel, centre, from);
    fv_map_open_centre(open, b, centre);
    (void)to_pixel(panel, centre, to);
    fv_canvas_line(canvas, from[0], from[1], to[0], to[1], thickness, colour);
}

static void draw_graph(struct fv_canvas *canvas, const struct fv_map_open *open,
                       const uint32_t *slots, uint32_t count, const struct panel *panel)
{
    const struct fv_map *map = &open->map;
    for (uint32_t i = 0; i < count; i++) {
        struct fv_neighbour near[NEIGHBOURS_MAX];
        const uint32_t found =
            fv_map_neighbours(map, slots[i], COVISIBLE_MIN, near, NEIGHBOURS_MAX);
        for (uint32_t k = 0; k < found; k++)
            draw_line(canvas, open, panel, slots[i], near[k].slot, 1.0F, COVISIBLE);
    }
    for (uint32_t i = 0; i < map->state->edge_count && i < FV_MAP_EDGES_MAX; i++)
        for (uint32_t k = 0; k < count; k++)
            if (slots[k] == map->edges[i].a)
                draw_line(canvas, open, panel, map->edges[i].a, map->edges[i].b, 2.5F, CLOSURE);
    for (uint32_t i = 1; i < count; i++)
        draw_line(canvas, open, panel, slots[i - 1], slots[i], 1.4F, PATH);
    for (uint32_t i = 0; i < count; i++) {
        double centre[3];
        float pixel[2];
        fv_map_open_centre(open, slots[i], centre);
        (void)to_pixel(panel, centre, pixel);
        fv_canvas_disc(canvas, pixel[0], pixel[1], 3.0F, PATH);
        if (i == 0) fv_canvas_circle(canvas, pixel[0], pixel[1], 7.0F, 1.5F, PATH);
    }
}

/* On a canvas that the caller frees. FOVEA_ERROR_SYSTEM: no memory. */
static enum fovea_status draw_map(struct fv_canvas *canvas, const struct fv_map_open *open,
                                  const char *name, uint32_t map_id)
{
    struct panel panels[PANELS] = {
        {.right = 0, .up = 2, .up_sign = 1, .top = TOP, .title = "from above: x right, z up"},
        {.right = 2,
         .up = 1,
         .up_sign = -1,
         .top = TOP + PANEL,
         .title = "from the side: z right, y down"}};
    char line[200];
    uint32_t slots[FV_MAP_KEYFRAMES_MAX], landmarks = 0;
    const uint32_t count = fv_map_open_order(open, map_id, slots);
    for (uint32_t i = 0; i < open->map.limits.landmarks; i++)
        landmarks += open->map.landmarks[i].used &&
                     fv_map_open_map_of(open, &open->map.landmarks[i]) == map_id;
    enum fovea_status status = fv_canvas_create(canvas, WIDTH, TOP + PANELS * PANEL, 0xffffff);
    if (status != FOVEA_OK) return status;
    for (int i = 0; i < PANELS; i++) {
        fit(open, map_id, &panels[i]);
        draw_grid(canvas, &panels[i]);
        draw_landmarks(canvas, open, map_id, &panels[i]);
        draw_graph(canvas, open, slots, count, &panels[i]);
    }
    snprintf(line, sizeof line, "%.60s: map %u, %u keyframes, %u landmarks", name, map_id, count,
             landmarks);
    fv_canvas_text(canvas, EDGE, 10, fv_canvas_text_width(2, line) > WIDTH - 2 * EDGE ? 1 : 2, INK,
                   line);
    int x = fv_canvas_text(canvas, EDGE, 38, 1, PATH, "keyframes in order (ring: the first)   ");
    x = fv_canvas_text(canvas, x, 38, 1, 0x609060, "covisible (30 landmarks and more)   ");
    x = fv_canvas_text(canvas, x, 38, 1, CLOSURE, "closures   ");
    fv_canvas_text(canvas, x, 38, 1, INK, "landmarks, dark: seen often");
    return FOVEA_OK;
}

enum fovea_status fv_map_picture(const struct fv_map_open *open, const char *name, uint32_t map_id,
                                 const char *path, struct fovea_error *error)
{
    struct fv_canvas canvas;
    enum fovea_status status = draw_map(&canvas, open, name, map_id);
    if (status != FOVEA_OK)
        return fovea_error_set(error, status, "%.200s: no memory for the picture", path);
    status = fv_canvas_write(&canvas, path, error);
    fv_canvas_free(&canvas);
    return status;
}

#include "app/lab/found.h"

#include <stdio.h>

#include "support/json.h"

/* ---- JSON ------------------------------------------------------------------------------------ */

/* Sets that have keypoints. */
static int32_t set_count(const struct fv_found *found)
{
    const int32_t sets = fv_detect_sets_max(found->model);
    return found->count < sets ? found->count : sets;
}

static const struct fovea_keypoint *points_of(const struct fv_found *found, int32_t set)
{
    return found->points + (ptrdiff_t)set * fv_detect_point_count(found->model);
}

/* [x, y, score], score null where the model gives none. */
static void print_points(const struct fv_found *found, int32_t set)
{
    const struct fovea_keypoint *points = points_of(found, set);
    printf(", \"keypoints_px\": [");
    for (int32_t k = 0; k < fv_detect_point_count(found->model); k++) {
        const struct fovea_keypoint *p = &points[k];
        printf("%s[%.3f, %.3f, ", k == 0 ? "" : ", ", (double)p->x_px, (double)p->y_px);
        if (p->score == p->score)
            printf("%.6f]", (double)p->score);
        else
            printf("null]");
    }
    printf("]");
}

void fv_found_print(const struct fv_found *found, const char *path, const struct fovea_image *image)
{
    const uint32_t gives = fv_detect_gives(found->model);
    printf("{\"image\": ");
    fv_json_text(stdout, path);
    printf(", \"width\": %d, \"height\": %d, \"%s\": [", image->width, image->height,
           (gives & FV_DETECT_CLASSES) != 0 ? "classes" : "detections");
    for (int32_t i = 0; i < found->count; i++) {
        const struct fovea_detection *d = &found->list[i];
        printf("%s{\"class\": %d, \"label\": ", i == 0 ? "" : ", ", d->class_id);
        fv_json_text(stdout, fv_detect_label(found->model, d->class_id));
        printf(", \"score\": %.6f", (double)d->score);
        if ((gives & FV_DETECT_BOXES) != 0)
            printf(", \"box_px\": [%.3f, %.3f, %.3f, %.3f]", (double)d->x_min_px,
                   (double)d->y_min_px, (double)d->x_max_px, (double)d->y_max_px);
        if (i < set_count(found)) print_points(found, i);
        printf("}");
    }
    printf("]}\n");
}

/* ---- drawn ----------------------------------------------------------------------------------- */

enum { COLOURS = 6, MARGIN = 2 };

static uint32_t colour_of(int32_t class_id)
{
    static const uint32_t colours[COLOURS] = {0xff5544, 0x44cc66, 0x4499ff,
                                              0xffdd33, 0xbb77ff, 0x33ccbb};
    return colours[class_id % COLOURS];
}

/* "dog 87%" on its colour. */
static void draw_label(const struct fv_found *found, struct fv_canvas *canvas, int32_t i, int left,
                       int top)
{
    const struct fovea_detection *d = &found->list[i];
    char text[96];
    snprintf(text, sizeof text, "%.60s %d%%", fv_detect_label(found->model, d->class_id),
             (int)(d->score * 100.0f + 0.5f));
    fv_canvas_fill(canvas, left, top, fv_canvas_text_width(1, text) + 2 * MARGIN,
                   FV_CANVAS_TEXT_HEIGHT + 2 * MARGIN, colour_of(d->class_id));
    fv_canvas_text(canvas, left + MARGIN, top + MARGIN, 1, 0x000000, text);
}

static void draw_box(const struct fv_found *found, struct fv_canvas *canvas, int32_t i)
{
    const struct fovea_detection *d = &found->list[i];
    const int above = (int)d->y_min_px - FV_CANVAS_TEXT_HEIGHT - 2 * MARGIN;
    fv_canvas_box(canvas, d->x_min_px, d->y_min_px, d->x_max_px, d->y_max_px, 2,
                  colour_of(d->class_id));
    /* a label hides no small object */
    draw_label(found, canvas, i, (int)d->x_min_px + (above < 0 ? MARGIN : 0),
               above < 0 ? (int)d->y_min_px + MARGIN : above);
}

/* Those of a score below one half are hollow. */
static void draw_points(const struct fv_found *found, struct fv_canvas *canvas, int32_t set)
{
    const struct fovea_keypoint *points = points_of(found, set);
    const int32_t count = fv_detect_point_count(found->model);
    const float radius = count > 100 ? 1.0f : 3.0f;
    for (int32_t k = 0; k < count; k++) {
        const uint32_t colour = colour_of(found->list[set].class_id + 1 + k % 2);
        if (points[k].score < 0.5f)
            fv_canvas_circle(canvas, points[k].x_px, points[k].y_px, radius, 1, colour);
        else
            fv_canvas_disc(canvas, points[k].x_px, points[k].y_px, radius, colour);
    }
}

void fv_found_draw(const struct fv_found *found, struct fv_canvas *canvas)
{
    const uint32_t gives = fv_detect_gives(found->model);
    for (int32_t i = found->count - 1; i >= 0; i--) {
        if ((gives & FV_DETECT_BOXES) != 0) draw_box(found, canvas, i);
        if ((gives & FV_DETECT_CLASSES) != 0)
            draw_label(found, canvas, i, MARGIN, MARGIN + i * (FV_CANVAS_TEXT_HEIGHT + 3 * MARGIN));
        if (i < set_count(found)) draw_points(found, canvas, i);
    }
}

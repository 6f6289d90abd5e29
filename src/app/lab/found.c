#include "app/lab/found.h"

#include <stdio.h>
#include <stdlib.h>

#include "base/elementary.h"
#include "support/json.h"

enum fovea_status fv_found_open(struct fv_found *found, const struct fv_model *model)
{
    int32_t width, height;
    found->model = model;
    found->room = (struct fv_detect_room){.points = found->points, .mask = &found->mask};
    fv_detect_mask_size(model, &width, &height);
    if (width == 0) return FOVEA_OK;
    found->room.pixels = calloc((size_t)width * (size_t)height, 2);
    if (found->room.pixels == NULL) return FOVEA_ERROR_SYSTEM;
    if (fv_detect_mask_confident(model))
        found->room.confidence = found->room.pixels + (size_t)width * (size_t)height;
    return FOVEA_OK;
}

void fv_found_close(struct fv_found *found)
{
    free(found->room.pixels);
}

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

void fv_found_segmentation(const struct fv_found *found, struct fovea_segmentation *segmentation)
{
    fv_segmentation_view(found->model, &found->fit, &found->mask, found->room.pixels,
                         found->room.confidence, segmentation);
}

/* Runs as [place in the list, pixels], -1 where there is no class. */
static void print_runs(const struct fovea_segmentation *m)
{
    const int32_t pixels = m->width * m->height;
    printf(", \"runs\": [");
    for (int32_t at = 0, length; at < pixels; at += length) {
        const uint8_t segment = m->index[m->pixels[at]];
        for (length = 1; at + length < pixels; length++)
            if (m->index[m->pixels[at + length]] != segment) break;
        printf("%s[%d, %d]", at == 0 ? "" : ", ", segment == FOVEA_SEGMENTATION_NONE ? -1 : segment,
               length);
    }
    printf("]");
}

/* The mean confidence of a class's pixels, 0 to 1. */
static double confidence_of(const struct fovea_segmentation *m, uint32_t place)
{
    uint64_t sum = 0;
    for (int32_t i = 0; i < m->width * m->height; i++)
        if (m->index[m->pixels[i]] == place) sum += m->confidence[i];
    return (double)sum / (255.0 * (double)m->list[place].pixels);
}

void fv_found_print_mask(const struct fv_found *found, bool runs)
{
    struct fovea_segmentation m;
    fv_found_segmentation(found, &m);
    const double area = (double)m.part.width * m.part.height;
    printf("\"mask\": {\"width\": %d, \"height\": %d, \"raw_scale\": [%.9g, %.9g], "
           "\"raw_offset\": [%.9g, %.9g], \"segments\": [",
           m.width, m.height, m.raw_scale[0], m.raw_scale[1], m.raw_offset[0], m.raw_offset[1]);
    for (uint32_t i = 0; i < m.count; i++) {
        const struct fovea_segmentation_class *c = &m.list[i];
        printf("%s{\"class\": %d, \"label\": ", i == 0 ? "" : ", ", c->class_id);
        fv_json_text(stdout, fv_detect_label(found->model, c->class_id));
        printf(", \"object\": %d, \"pixels\": %u, \"fraction\": %.6f", c->object, c->pixels,
               (double)c->pixels / area);
        if (m.confidence != NULL) printf(", \"confidence\": %.6f", confidence_of(&m, i));
        printf(", \"colour\": [%d, %d, %d]}", c->red, c->green, c->blue);
    }
    printf("]");
    if (runs) print_runs(&m);
    printf("}");
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
        if (found->model->header->decode.kind == FV_DECODER_YOLOV8_OBB)
            printf(", \"angle\": %.6f", (double)d->angle);
        if (i < set_count(found)) print_points(found, i);
        printf("}");
    }
    printf("]");
    if ((gives & FV_DETECT_MASK) != 0) {
        printf(", ");
        fv_found_print_mask(found, true);
    }
    printf("}\n");
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

static void draw_turned(struct fv_canvas *canvas, const struct fovea_detection *d)
{
    const float x = 0.5f * (d->x_min_px + d->x_max_px), y = 0.5f * (d->y_min_px + d->y_max_px),
                half_w = 0.5f * (d->x_max_px - d->x_min_px),
                half_h = 0.5f * (d->y_max_px - d->y_min_px);
    const float cosine = (float)fv_cos((double)d->angle), sine = (float)fv_sin((double)d->angle);
    float corner[4][2];
    for (int k = 0; k < 4; k++) {
        const float dx = k == 0 || k == 3 ? -half_w : half_w, dy = k < 2 ? -half_h : half_h;
        corner[k][0] = x + cosine * dx - sine * dy;
        corner[k][1] = y + sine * dx + cosine * dy;
    }
    for (int k = 0; k < 4; k++)
        fv_canvas_line(canvas, corner[k][0], corner[k][1], corner[(k + 1) % 4][0],
                       corner[(k + 1) % 4][1], 2, colour_of(d->class_id));
}

static void draw_box(const struct fv_found *found, struct fv_canvas *canvas, int32_t i)
{
    const struct fovea_detection *d = &found->list[i];
    const int above = (int)d->y_min_px - FV_CANVAS_TEXT_HEIGHT - 2 * MARGIN;
    if (d->angle == 0.0f)
        fv_canvas_box(canvas, d->x_min_px, d->y_min_px, d->x_max_px, d->y_max_px, 2,
                      colour_of(d->class_id));
    else
        draw_turned(canvas, d);
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

/* Half of the class's colour over the picture; black is background and left as it is. */
static void draw_mask(const struct fv_found *found, struct fv_canvas *canvas)
{
    struct fovea_segmentation m;
    fv_found_segmentation(found, &m);
    const size_t pixels = (size_t)m.image_width * (size_t)m.image_height;
    uint8_t *places = malloc(pixels);
    if (places == NULL) return;
    fovea_segmentation_enlarge(&m, NULL, places);
    for (size_t i = 0; i < pixels; i++) {
        if (places[i] == FOVEA_SEGMENTATION_NONE) continue;
        const struct fovea_segmentation_class *c = &m.list[places[i]];
        const uint8_t colour[3] = {c->red, c->green, c->blue};
        if ((colour[0] | colour[1] | colour[2]) == 0) continue;
        for (int k = 0; k < 3; k++)
            canvas->rgb[3 * i + (size_t)k] =
                (uint8_t)((canvas->rgb[3 * i + (size_t)k] + colour[k]) / 2);
    }
    free(places);
}

void fv_found_draw(const struct fv_found *found, struct fv_canvas *canvas)
{
    const uint32_t gives = fv_detect_gives(found->model);
    if ((gives & FV_DETECT_MASK) != 0) draw_mask(found, canvas);
    for (int32_t i = found->count - 1; i >= 0; i--) {
        if ((gives & FV_DETECT_BOXES) != 0) draw_box(found, canvas, i);
        if ((gives & FV_DETECT_CLASSES) != 0)
            draw_label(found, canvas, i, MARGIN, MARGIN + i * (FV_CANVAS_TEXT_HEIGHT + 3 * MARGIN));
        if (i < set_count(found)) draw_points(found, canvas, i);
    }
}

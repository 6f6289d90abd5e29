/* One frame of the run: its image with features, boxes and the ways of objects. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app/run/run_picture.h"
#include "image/grey.h"
#include "kernels/kernels.h"

static const double way_s = 2.5; /* of an object's way that is shown */

/* The image in one or three bytes per pixel; `grey`: memory for its conversion. */
static struct fovea_image shown_image(const struct fovea_image *image, uint8_t *grey)
{
    if (image->format == FOVEA_PIXEL_GREY8 || image->format == FOVEA_PIXEL_RGB24) return *image;
    struct fv_kernels kernels;
    fv_kernels_init(&kernels, FV_CPU_C);
    const struct fv_plane plane = {grey, image->width, image->height, image->width};
    fv_grey_convert(&plane, &kernels, image);
    return (struct fovea_image){
        grey,         image->width,      image->height,
        image->width, FOVEA_PIXEL_GREY8, (size_t)image->width * (size_t)image->height};
}

/* Where the image lies on the sheet. */
struct place {
    int left, top, width, height;
    float scale;
};

static struct place place_of(const struct fv_area *area, const struct fovea_image *image)
{
    struct place place = {.left = area->left, .top = area->top};
    const float across = (float)area->width / (float)image->width,
                down = (float)area->height / (float)image->height;
    place.scale = across < down ? across : down;
    place.width = (int)((float)image->width * place.scale);
    place.height = (int)((float)image->height * place.scale);
    return place;
}

static int within(int value, int limit)
{
    return value < 0 ? 0 : value < limit ? value : limit - 1;
}

/* Between the four pixels around; one channel. */
static float sample(const struct fovea_image *image, int step, int channel, float x, float y)
{
    const int x0 = (int)floorf(x), y0 = (int)floorf(y);
    const float fx = x - (float)x0, fy = y - (float)y0;
    float value = 0.0F;
    for (int k = 0; k < 4; k++) {
        const int px = within(x0 + k % 2, image->width), py = within(y0 + k / 2, image->height);
        const float weight = (k % 2 ? fx : 1.0F - fx) * (k / 2 ? fy : 1.0F - fy);
        value += weight * (float)image->data[(size_t)py * (size_t)image->stride_bytes +
                                             (size_t)(px * step + channel)];
    }
    return value;
}

static void image_draw(struct fv_canvas *canvas, const struct fovea_image *image,
                       const struct place *place)
{
    const int step = image->format == FOVEA_PIXEL_RGB24 ? 3 : 1;
    for (int y = 0; y < place->height && place->top + y < canvas->height; y++)
        for (int x = 0; x < place->width && place->left + x < canvas->width; x++) {
            uint8_t *to = canvas->rgb + 3 * ((size_t)(place->top + y) * (size_t)canvas->width +
                                             (size_t)(place->left + x));
            const float from_x = ((float)x + 0.5F) / place->scale - 0.5F,
                        from_y = ((float)y + 0.5F) / place->scale - 0.5F;
            for (int c = 0; c < step; c++)
                to[c] = (uint8_t)(sample(image, step, c, from_x, from_y) + 0.5F);
            for (int c = step; c < 3; c++)
                to[c] = to[0];
        }
}

static float sheet_x(const struct place *place, float x_px)
{
    return (float)place->left + (x_px + 0.5F) * place->scale;
}

static float sheet_y(const struct place *place, float y_px)
{
    return (float)place->top + (y_px + 0.5F) * place->scale;
}

static void features_draw(struct fv_canvas *canvas, const struct fv_snapshot_frame *shot,
                          const struct place *place)
{
    for (uint32_t i = 0; i < shot->feature_count; i++) {
        const struct fovea_feature *f = &shot->features[i];
        const float radius = 1.6F + 0.55F * (float)f->level;
        fv_canvas_circle(canvas, sheet_x(place, f->x_px), sheet_y(place, f->y_px), radius, 1.1F,
                         f->level < 3 ? 0x39d353 : 0xb6e34a);
    }
}

/* The paths of the objects in the image, up to its time. */
static void ways_draw(struct fv_canvas *canvas, const struct fv_trails *trails,
                      const struct fv_snapshot_frame *shot, const struct place *place)
{
    const float now_s = (float)((double)(shot->stamp_ns - trails->first_ns) * 1e-9);
    for (uint32_t b = 0; b < shot->box_count; b++) {
        const struct fv_trail_point *last = NULL;
        for (uint32_t i = 0; i < trails->count; i++) {
            const struct fv_trail_point *p = &trails->points[i];
            if (p->id != shot->boxes[b].id || p->time_s > now_s + 1e-4F ||
                p->time_s < now_s - (float)way_s)
                continue;
            if (last != NULL)
                fv_canvas_line(canvas, sheet_x(place, last->x_px), sheet_y(place, last->y_px),
                               sheet_x(place, p->x_px), sheet_y(place, p->y_px), 2.5F,
                               fv_picture_class_colour(p->class_id));
            last = p;
        }
    }
}

static void box_draw(struct fv_canvas *canvas, const struct fv_snapshot_box *box,
                     const struct place *place, const struct fovea *rt)
{
    const uint32_t colour = fv_picture_class_colour(box->class_id);
    const char *name = fovea_detect_label(rt, box->class_id);
    const int width = place->left + place->width, height = place->top + place->height;
    const float left = fmaxf(sheet_x(place, box->x_min_px), (float)place->left + 1.0F),
                top = fmaxf(sheet_y(place, box->y_min_px), (float)place->top + 1.0F),
                right = fminf(sheet_x(place, box->x_max_px), (float)width - 1.0F),
                bottom = fminf(sheet_y(place, box->y_max_px), (float)height - 1.0F);
    char label[96], number[24] = "";
    fv_canvas_box(canvas, left, top, right, bottom, box->coasting ? 1.0F : 3.0F, colour);
    if (box->id > 0) snprintf(number, sizeof number, " %u", (unsigned)box->id);
    snprintf(label, sizeof label, "%.40s%s  %.0f %%", name != NULL ? name : "", number,
             100.0 * (double)box->score);
    const int text = fv_canvas_letters_width(14, label) + 10;
    int at = (int)left - 1, base = (int)top - 5;
    if (base - 16 < place->top) base = (int)bottom + 17; /* no room above: below */
    if (at + text > width) at = width - text;
    fv_canvas_fill(canvas, at, base - 14, text, 19, colour);
    fv_canvas_letters(canvas, at + 5, base, 14, 0xffffff, label);
}

void fv_picture_frame(struct fv_canvas *canvas, const struct fv_area *area,
                      const struct fv_run_picture *picture, const struct fovea *rt)
{
    const struct fv_snapshot_frame *shot = picture->snapshot;
    char title[96];
    snprintf(title, sizeof title, "frame %llu: %u features%s", (unsigned long long)shot->sequence,
             (unsigned)shot->feature_count,
             shot->box_count > 0 ? ", objects with id, score and path" : "");
    const struct fv_area rest = fv_picture_title(canvas, area, title);
    uint8_t *grey = malloc((size_t)shot->image.width * (size_t)shot->image.height);
    if (grey == NULL) return;
    const struct fovea_image image = shown_image(&shot->image, grey);
    const struct place place = place_of(&rest, &image);
    image_draw(canvas, &image, &place);
    free(grey);
    features_draw(canvas, shot, &place);
    ways_draw(canvas, picture->trails, shot, &place);
    for (uint32_t i = 0; i < shot->box_count; i++)
        box_draw(canvas, &shot->boxes[i], &place, rt);
}

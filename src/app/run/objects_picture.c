/* The objects of a run: where across the image each was, over time. */
#include <stdio.h>

#include "app/run/run_picture.h"

enum { CLASSES_SHOWN = 64, LEFT = 44, BOTTOM = 26 };

struct axes {
    struct fv_area plot;
    double seconds;
    int32_t width_px; /* of the camera's image */
};

static float time_x(const struct axes *axes, float time_s)
{
    return (float)axes->plot.left + time_s / (float)axes->seconds * (float)axes->plot.width;
}

static float column_y(const struct axes *axes, float x_px)
{
    return (float)axes->plot.top + x_px / (float)axes->width_px * (float)axes->plot.height;
}

static void grid(struct fv_canvas *canvas, const struct axes *axes)
{
    const struct fv_area *plot = &axes->plot;
    const double tick = fv_picture_tick(axes->seconds, 8);
    char label[48];
    for (int i = 0; i * tick <= axes->seconds; i++) {
        const int x = (int)time_x(axes, (float)(i * tick));
        fv_canvas_fill(canvas, x, plot->top, 1, plot->height, FV_PICTURE_GRID);
        snprintf(label, sizeof label, "%.4g s", i * tick);
        const int width = fv_canvas_letters_width(FV_PICTURE_TEXT_PX, label),
                  limit = plot->left + plot->width - width;
        fv_canvas_letters(canvas, x < limit ? x : limit, plot->top + plot->height + 18,
                          FV_PICTURE_TEXT_PX, FV_PICTURE_PALE, label);
    }
    for (int i = 0; i <= 4; i++) {
        const int y = plot->top + i * plot->height / 4;
        fv_canvas_fill(canvas, plot->left, y, plot->width, 1, FV_PICTURE_GRID);
        snprintf(label, sizeof label, "%d", i * axes->width_px / 4);
        fv_canvas_letters(canvas,
                          plot->left - 8 - fv_canvas_letters_width(FV_PICTURE_TEXT_PX, label),
                          y + 5, FV_PICTURE_TEXT_PX, FV_PICTURE_PALE, label);
    }
}

/* A line from the point of the inference before, thin over a gap; the id where an object begins. */
static void point_draw(struct fv_canvas *canvas, const struct fv_trails *trails,
                       const struct axes *axes, uint32_t i)
{
    const struct fv_trail_point *p = &trails->points[i];
    const uint32_t colour = fv_picture_class_colour(p->class_id);
    const float x = time_x(axes, p->time_s), y = column_y(axes, p->x_px);
    char label[16];
    for (uint32_t k = i; k-- > 0;) {
        const struct fv_trail_point *before = &trails->points[k];
        if (before->id != p->id) continue;
        fv_canvas_line(canvas, time_x(axes, before->time_s), column_y(axes, before->x_px), x, y,
                       before->inference + 1 == p->inference ? 2.4F : 0.6F, colour);
        return;
    }
    snprintf(label, sizeof label, "%u", p->id);
    fv_canvas_letters(canvas, (int)x, (int)y - 5, FV_PICTURE_TEXT_PX, colour, label);
}

static void legend(struct fv_canvas *canvas, const struct fv_area *area,
                   const struct fv_trails *trails, const struct fovea *rt)
{
    bool named[CLASSES_SHOWN] = {false};
    int x = area->left +
            fv_canvas_letters_width(FV_PICTURE_TITLE_PX, "objects: column of the image over time") +
            30;
    for (uint32_t i = 0; i < trails->count; i++) {
        const int32_t class_id = trails->points[i].class_id;
        if (class_id < 0 || class_id >= CLASSES_SHOWN || named[class_id]) continue;
        named[class_id] = true;
        const char *name = fovea_detect_label(rt, class_id);
        if (name == NULL ||
            x + 34 + fv_canvas_letters_width(FV_PICTURE_TEXT_PX, name) > area->left + area->width)
            continue;
        x = fv_picture_legend(canvas, x, area->top + 17, fv_picture_class_colour(class_id), name);
    }
}

void fv_picture_objects(struct fv_canvas *canvas, const struct fv_area *area,
                        const struct fv_run_picture *picture, const struct fovea *rt)
{
    const struct fv_trails *trails = picture->trails;
    const struct fv_area rest =
        fv_picture_title(canvas, area, "objects: column of the image over time");
    const struct axes axes = {
        {rest.left + LEFT, rest.top + 4, rest.width - LEFT, rest.height - 4 - BOTTOM},
        (double)(trails->last_ns - trails->first_ns) * 1e-9 + 1e-3,
        picture->report->width};
    legend(canvas, area, trails, rt);
    grid(canvas, &axes);
    for (uint32_t i = 0; i < trails->count; i++)
        point_draw(canvas, trails, &axes, i);
}

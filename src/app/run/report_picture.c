/* The timings of a run: processor time over the run, and where it goes. */
#include <inttypes.h>
#include <stdio.h>

#include "app/run/run_picture.h"

enum {
    LEFT = 44,   /* of the plot, for its labels */
    CURVES = 44, /* percent of the height for the curves */
    STEP = 0x1f5fa8,
    FRAME = 0xe08214,
    FRAME_LIGHT = 0xf7d9b0,
    STAGE = 0x7f9f7f,
    WORK = 0x8a5fa8
};

/* ---- over the run ---------------------------------------------------------------------------- */

struct axes {
    struct fv_area plot;
    double top_ms;
};

static float value_y(const struct axes *axes, double ms)
{
    const double fraction = ms / axes->top_ms;
    return (float)(axes->plot.top + axes->plot.height * (fraction > 1.0 ? 0.0 : 1.0 - fraction));
}

static float bin_x(const struct axes *axes, const struct fv_curve *curve, uint32_t bin)
{
    return (float)axes->plot.left +
           (float)axes->plot.width * ((float)bin + 0.5F) / (float)curve->bins;
}

static double bin_mean_ms(const struct fv_curve *curve, uint32_t bin)
{
    uint32_t frames = bin + 1 < curve->bins ? curve->stride : curve->in_last;
    return frames > 0 ? (double)curve->sum_ns[bin] / frames * 1e-6 : 0.0;
}

static void mean_curve(struct fv_canvas *canvas, const struct axes *axes,
                       const struct fv_curve *curve, uint32_t colour)
{
    for (uint32_t i = 1; i < curve->bins; i++)
        fv_canvas_line(canvas, bin_x(axes, curve, i - 1), value_y(axes, bin_mean_ms(curve, i - 1)),
                       bin_x(axes, curve, i), value_y(axes, bin_mean_ms(curve, i)), 1.6F, colour);
}

/* One outlier must not flatten the rest: the scale ends at twice the 99th percentile. */
static double top_of(const struct fv_timings *timings)
{
    const struct fv_curve *frame = &timings->frame_curve;
    int64_t largest_ns = 0;
    for (uint32_t i = 0; i < frame->bins; i++)
        if (frame->max_ns[i] > largest_ns) largest_ns = frame->max_ns[i];
    const double p99_ms = (double)fv_histogram_percentile(&timings->frame.cpu, 0.99) * 1e-6;
    double top_ms = (double)largest_ns * 1.05e-6;
    if (top_ms > 2.0 * p99_ms && p99_ms > 0.0) top_ms = 2.0 * p99_ms;
    return top_ms > 0.0 ? top_ms : 1.0;
}

static void grid(struct fv_canvas *canvas, const struct axes *axes)
{
    const double tick = fv_picture_tick(axes->top_ms, 5);
    char label[32];
    for (int i = 0; i * tick <= axes->top_ms * 1.0001; i++) {
        const int y = (int)value_y(axes, i * tick);
        fv_canvas_fill(canvas, axes->plot.left, y, axes->plot.width, 1,
                       i == 0 ? FV_PICTURE_PALE : FV_PICTURE_GRID);
        snprintf(label, sizeof label, "%.4g", i * tick);
        fv_canvas_letters(canvas,
                          axes->plot.left - 8 - fv_canvas_letters_width(FV_PICTURE_TEXT_PX, label),
                          y + 5, FV_PICTURE_TEXT_PX, FV_PICTURE_PALE, label);
    }
}

static void curves(struct fv_canvas *canvas, const struct fv_area *plot,
                   const struct fv_timings *timings)
{
    const struct axes axes = {*plot, top_of(timings)};
    const struct fv_curve *frame = &timings->frame_curve;
    grid(canvas, &axes);
    for (uint32_t i = 0; i < frame->bins; i++) {
        const int left = plot->left + (int)((int64_t)i * plot->width / frame->bins),
                  right = plot->left + (int)((int64_t)(i + 1) * plot->width / frame->bins),
                  y = (int)value_y(&axes, (double)frame->max_ns[i] * 1e-6);
        fv_canvas_fill(canvas, left, y, right > left ? right - left : 1,
                       plot->top + plot->height - y, FRAME_LIGHT);
    }
    mean_curve(canvas, &axes, frame, FRAME);
    mean_curve(canvas, &axes, &timings->step_curve, STEP);
}

/* ---- by stage -------------------------------------------------------------------------------- */

struct bar {
    const char *name;
    const struct fv_histogram *times;
    uint32_t colour;
};

/* Columns of the table, from the left of the area. */
enum { NAMES = 0, BARS = 84, NUMBERS_WIDTH = 260, NUMBER_WIDTH = 65 };

static void numbers(struct fv_canvas *canvas, int right, int base, const double values[4])
{
    for (int i = 0; i < 4; i++) {
        char label[32];
        snprintf(label, sizeof label, "%.3f", values[i]);
        fv_canvas_letters(canvas,
                          right - (3 - i) * NUMBER_WIDTH -
                              fv_canvas_letters_width(FV_PICTURE_TEXT_PX, label),
                          base, FV_PICTURE_TEXT_PX, FV_PICTURE_INK, label);
    }
}

/* A bar up to the median, a line on to the 99th percentile. */
static void bar_draw(struct fv_canvas *canvas, const struct fv_area *area, int base,
                     const struct bar *bar, double top_ms)
{
    const double values[4] = {(double)fv_histogram_mean(bar->times) * 1e-6,
                              (double)fv_histogram_percentile(bar->times, 0.5) * 1e-6,
                              (double)fv_histogram_percentile(bar->times, 0.99) * 1e-6,
                              (double)bar->times->max_ns * 1e-6};
    const int left = area->left + BARS, room = area->width - BARS - NUMBERS_WIDTH;
    int end[2];
    for (int i = 0; i < 2; i++) {
        const double fraction = values[1 + i] / top_ms;
        end[i] = left + (int)((fraction > 1.0 ? 1.0 : fraction) * room);
    }
    fv_canvas_letters(canvas, area->left + NAMES, base, FV_PICTURE_TEXT_PX, FV_PICTURE_INK,
                      bar->name);
    fv_canvas_fill(canvas, left, base - 10, end[0] - left > 1 ? end[0] - left : 1, 11, bar->colour);
    fv_canvas_fill(canvas, end[0], base - 6, end[1] - end[0], 2, bar->colour);
    fv_canvas_fill(canvas, end[1], base - 9, 2, 8, bar->colour);
    numbers(canvas, area->left + area->width, base, values);
}

static void bars(struct fv_canvas *canvas, const struct fv_area *area,
                 const struct fv_timings *timings)
{
    static const char *const heads[4] = {"mean", "median", "99 %", "largest"};
    struct bar list[FOVEA_STAGE_COUNT + 3];
    int count = 0;
    for (; count < FOVEA_STAGE_COUNT; count++)
        list[count] = (struct bar){fovea_stage_name((enum fovea_stage)count),
                                   &timings->stages[count].cpu, STAGE};
    list[count++] = (struct bar){"step", &timings->step.cpu, STEP};
    list[count++] = (struct bar){"work", &timings->work.cpu, WORK};
    list[count++] = (struct bar){"both", &timings->frame.cpu, FRAME};
    double top_ms = (double)fv_histogram_percentile(&timings->frame.cpu, 0.99) * 1e-6;
    if (!(top_ms > 0.0)) top_ms = 1.0;
    for (int i = 0; i < 4; i++)
        fv_canvas_letters(canvas,
                          area->left + area->width - (3 - i) * NUMBER_WIDTH -
                              fv_canvas_letters_width(FV_PICTURE_TEXT_PX, heads[i]),
                          area->top + 12, FV_PICTURE_TEXT_PX, FV_PICTURE_PALE, heads[i]);
    const int pitch = (area->height - 16) / count;
    for (int i = 0; i < count; i++)
        bar_draw(canvas, area, area->top + 16 + i * pitch + pitch * 3 / 4, &list[i], top_ms);
}

void fv_picture_times(struct fv_canvas *canvas, const struct fv_area *area,
                      const struct fv_run_picture *picture)
{
    const struct fv_timings *timings = picture->report->loop->timings;
    const struct fv_area rest = fv_picture_title(canvas, area, "processor time per frame, ms");
    int x = area->left +
            fv_canvas_letters_width(FV_PICTURE_TITLE_PX, "processor time per frame, ms") + 30;
    x = fv_picture_legend(canvas, x, area->top + 17, STEP, "step");
    x = fv_picture_legend(canvas, x, area->top + 17, FRAME, "step and work");
    fv_picture_legend(canvas, x, area->top + 17, FRAME_LIGHT, "largest");
    const int height = rest.height * CURVES / 100;
    const struct fv_area plot = {rest.left + LEFT, rest.top + 4, rest.width - LEFT, height - 4},
                         table = {rest.left, rest.top + height + 4, rest.width,
                                  rest.height - height - 4};
    curves(canvas, &plot, timings);
    bars(canvas, &table, timings);
}

/* The timings of a run: CPU time over the run, and where it goes. */
#include <inttypes.h>

#include "app/run/run_picture.h"

enum {
    WIDTH = FV_REPORT_PANEL_WIDTH,
    HEIGHT = FV_REPORT_PANEL_HEIGHT,
    LEFT = 70,
    RIGHT = 980,
    TOP = 60,
    BOTTOM = 330,
    INK = 0x222222,
    GREY = 0xdddddd,
    STEP = 0x1f5fa8,
    FRAME = 0xe08214,
    FRAME_LIGHT = 0xf7d9b0
};

/* Distance between grid lines: 1, 2 or 5 times a power of ten, at most six of them up to `range`.
 */
static double tick_of(double range)
{
    double tick = 1e-6;
    for (int i = 0; tick * 6.0 < range && i < 48; i++)
        tick *= i % 3 == 1 ? 2.5 : 2.0;
    return tick;
}

static void title(struct fv_canvas *canvas, const struct fv_report *report)
{
    char line[160];
    snprintf(line, sizeof line, "%.60s  %d x %d  %" PRIu64 " frames  kernel set %s", report->source,
             report->width, report->height, report->loop->counts.processed, report->kernel_set);
    fv_canvas_text(canvas, LEFT, 12, fv_canvas_text_width(2, line) > RIGHT - LEFT ? 1 : 2, INK,
                   line);
    int x =
        fv_canvas_text(canvas, LEFT, 40, 1, INK, "ms of the loop's processor time over the run:  ");
    x = fv_canvas_text(canvas, x, 40, 1, STEP, "step (mean)   ");
    x = fv_canvas_text(canvas, x, 40, 1, FRAME, "step and work together (mean)   ");
    fv_canvas_text(canvas, x, 40, 1, 0xc0a070, "largest");
}

static void grid(struct fv_canvas *canvas, double top_ms, uint64_t frames)
{
    char label[32];
    double tick = tick_of(top_ms);
    for (int i = 0; (double)i * tick <= top_ms * 1.0001; i++) {
        float y = (float)(BOTTOM - (double)i * tick / top_ms * (BOTTOM - TOP));
        fv_canvas_line(canvas, LEFT, y, RIGHT, y, 1.0F, i == 0 ? INK : GREY);
        snprintf(label, sizeof label, "%.4g", (double)i * tick);
        fv_canvas_text(canvas, LEFT - 8 - fv_canvas_text_width(1, label), (int)y - 4, 1, INK,
                       label);
    }
    fv_canvas_text(canvas, LEFT, BOTTOM + 8, 1, INK, "frame 1");
    snprintf(label, sizeof label, "%" PRIu64, frames);
    fv_canvas_text(canvas, RIGHT - fv_canvas_text_width(1, label), BOTTOM + 8, 1, INK, label);
}

static float bin_x(const struct fv_curve *curve, uint32_t bin)
{
    return LEFT + (RIGHT - LEFT) * ((float)bin + 0.5F) / (float)curve->bins;
}

static float value_y(double ms, double top_ms)
{
    double share = ms / top_ms;
    return (float)(BOTTOM - (share > 1.0 ? 1.0 : share) * (BOTTOM - TOP));
}

static double bin_mean_ms(const struct fv_curve *curve, uint32_t bin)
{
    uint32_t frames = bin + 1 < curve->bins ? curve->stride : curve->in_last;
    return frames > 0 ? (double)curve->sum_ns[bin] / frames * 1e-6 : 0.0;
}

static void mean_curve(struct fv_canvas *canvas, const struct fv_curve *curve, double top_ms,
                       uint32_t colour)
{
    for (uint32_t i = 1; i < curve->bins; i++)
        fv_canvas_line(canvas, bin_x(curve, i - 1), value_y(bin_mean_ms(curve, i - 1), top_ms),
                       bin_x(curve, i), value_y(bin_mean_ms(curve, i), top_ms), 1.4F, colour);
}

static void curves(struct fv_canvas *canvas, const struct fv_timings *timings)
{
    const struct fv_curve *frame = &timings->frame_curve;
    int64_t largest_ns = 0;
    for (uint32_t i = 0; i < frame->bins; i++)
        if (frame->max_ns[i] > largest_ns) largest_ns = frame->max_ns[i];
    /* One outlier must not flatten the rest: the scale ends at twice the 99th percentile. */
    double p99_ms = (double)fv_histogram_percentile(&timings->frame.cpu, 0.99) * 1e-6;
    double top_ms = (double)largest_ns * 1.05e-6;
    if (top_ms > 2.0 * p99_ms && p99_ms > 0.0) top_ms = 2.0 * p99_ms;
    if (!(top_ms > 0.0)) top_ms = 1.0;
    float half = 0.5F * (float)(RIGHT - LEFT) / (float)(frame->bins > 0 ? frame->bins : 1);
    for (uint32_t i = 0; i < frame->bins; i++) {
        int left = (int)(bin_x(frame, i) - half), right = (int)(bin_x(frame, i) + half);
        int y = (int)value_y((double)frame->max_ns[i] * 1e-6, top_ms);
        fv_canvas_fill(canvas, left, y, right > left ? right - left : 1, BOTTOM - y, FRAME_LIGHT);
    }
    grid(canvas, top_ms, timings->frame.cpu.count);
    mean_curve(canvas, frame, top_ms, FRAME);
    mean_curve(canvas, &timings->step_curve, top_ms, STEP);
}

struct bar {
    const char *name;
    const struct fv_histogram *times;
    uint32_t colour;
};

/* A bar up to the median, a line on to the 99th percentile, a tick at the maximum. */
static void bar_draw(struct fv_canvas *canvas, int y, const struct bar *bar, double top_ms)
{
    char label[96];
    const int left = 150, right = 640;
    double values[3] = {(double)fv_histogram_percentile(bar->times, 0.5) * 1e-6,
                        (double)fv_histogram_percentile(bar->times, 0.99) * 1e-6,
                        (double)bar->times->max_ns * 1e-6};
    int x[3];
    for (int i = 0; i < 3; i++) {
        double share = values[i] / top_ms;
        x[i] = left + (int)((share > 1.0 ? 1.0 : share) * (right - left));
    }
    fv_canvas_text(canvas, LEFT, y + 3, 1, INK, bar->name);
    fv_canvas_fill(canvas, left, y, x[0] - left > 1 ? x[0] - left : 1, 14, bar->colour);
    fv_canvas_fill(canvas, x[0], y + 6, x[1] - x[0], 2, bar->colour);
    fv_canvas_fill(canvas, x[1], y + 2, 2, 10, bar->colour);
    if (x[2] < right) fv_canvas_fill(canvas, x[2], y + 5, 1, 4, bar->colour);
    snprintf(label, sizeof label, "%8.3f %8.3f %8.3f %8.3f",
             (double)fv_histogram_mean(bar->times) * 1e-6, values[0], values[1], values[2]);
    fv_canvas_text(canvas, 660, y + 3, 1, INK, label);
}

static void bars(struct fv_canvas *canvas, const struct fv_timings *timings)
{
    struct bar list[FOVEA_STAGE_COUNT + 3];
    int count = 0;
    for (; count < FOVEA_STAGE_COUNT; count++)
        list[count] = (struct bar){fovea_stage_name((enum fovea_stage)count),
                                   &timings->stages[count].cpu, 0x6f8f6f};
    list[count++] = (struct bar){"step", &timings->step.cpu, STEP};
    list[count++] = (struct bar){"work", &timings->work.cpu, 0x8a5fa8};
    list[count++] = (struct bar){"frame", &timings->frame.cpu, FRAME};
    double top_ms = (double)fv_histogram_percentile(&timings->frame.cpu, 0.99) * 1.1e-6;
    if (!(top_ms > 0.0)) top_ms = 1.0;
    fv_canvas_text(canvas, LEFT, 368, 1, INK,
                   "stage        bar: median, line: to the 99th percentile, dot: largest");
    fv_canvas_text(canvas, 660, 368, 1, INK, " mean ms      p50      p99      max");
    int pitch = (HEIGHT - 390) / count < 24 ? (HEIGHT - 390) / count : 24;
    for (int i = 0; i < count; i++)
        bar_draw(canvas, 384 + i * pitch, &list[i], top_ms);
}

enum fovea_status fv_report_panel(struct fv_canvas *canvas, const struct fv_report *report)
{
    enum fovea_status status = fv_canvas_create(canvas, WIDTH, HEIGHT, 0xffffff);
    if (status != FOVEA_OK) return status;
    title(canvas, report);
    curves(canvas, report->loop->timings);
    bars(canvas, report->loop->timings);
    return FOVEA_OK;
}

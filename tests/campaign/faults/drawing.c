#include "drawing.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "app/run/run_picture.h"
#include "geometry/vec.h"

enum {
    WIDTH = 1100,
    PATH_TOP = 90,
    PATH_HEIGHT = 560,
    STRIP_TOP = 710,
    STRIP_HEIGHT = 150,
    HEIGHT = 900,
    MARGIN = 40,
    WRONG = 0xd62728,
    WEAK = 0x9ab8d8,
    FAULTY = 0xf3e3c8
};
static const double nees_max = 22.5;

struct view {
    double low[2], px_per_m;
};

static void to_pixel(const struct view *view, const double at[3], float px[2])
{
    px[0] = (float)(MARGIN + (at[0] - view->low[0]) * view->px_per_m);
    px[1] = (float)(PATH_TOP + PATH_HEIGHT - (at[1] - view->low[1]) * view->px_per_m);
}

/* Place of a frame's pose in the world of the truth, by the similarity of its map. */
static bool place_of(const struct faults_play *play, const struct faults_frame *frame, double at[3])
{
    struct faults_fit fit;
    const double *T = frame->pose.T_world_cam, p[3] = {T[3], T[7], T[11]};
    if (!frame->processed || !frame->pose.posed ||
        !faults_fit(play, frame->pose.map_id, frame->pose.scale_source != FOVEA_SCALE_FREE, &fit))
        return false;
    fv_rotate3(fit.R, p, at);
    for (int i = 0; i < 3; i++)
        at[i] = fit.scale * at[i] + fit.t[i];
    return true;
}

static void widen(double low[2], double high[2], const double at[3])
{
    for (int i = 0; i < 2; i++) {
        low[i] = fmin(low[i], at[i]);
        high[i] = fmax(high[i], at[i]);
    }
}

static void fit_view(const struct faults_play *play, struct view *view)
{
    double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY}, at[3];
    for (uint32_t i = 0; i < play->count; i++) {
        const struct faults_frame *frame = &play->frame[i];
        const double truth[3] = {frame->truth[3], frame->truth[7], frame->truth[11]};
        if (frame->has_truth) widen(low, high, truth);
        if (place_of(play, frame, at)) widen(low, high, at);
    }
    const double x = fmax(high[0] - low[0], 0.05), y = fmax(high[1] - low[1], 0.05);
    view->px_per_m = fmin((WIDTH - 2 * MARGIN) / x, PATH_HEIGHT / y);
    view->low[0] = low[0];
    view->low[1] = low[1];
}

static void draw_path(struct fv_canvas *canvas, const struct faults_play *play,
                      const double nees[FAULTS_GIVEN_MAX])
{
    struct view view;
    float last[2] = {0, 0}, px[2];
    double at[3];
    fit_view(play, &view);
    for (uint32_t i = 0, any = 0; i < play->count; i++) {
        const double *T = play->frame[i].truth, truth[3] = {T[3], T[7], T[11]};
        if (!play->frame[i].has_truth) continue;
        to_pixel(&view, truth, px);
        if (any++ > 0) fv_canvas_line(canvas, last[0], last[1], px[0], px[1], 3, FV_PICTURE_TRUTH);
        memcpy(last, px, sizeof px);
    }
    for (uint32_t i = 0; i < play->count; i++) {
        const bool tracking = play->frame[i].pose.state == FOVEA_TRACKING_OK;
        if (!place_of(play, &play->frame[i], at)) continue;
        to_pixel(&view, at, px);
        if (nees[i] > nees_max) fv_canvas_disc(canvas, px[0], px[1], 6, WRONG);
        fv_canvas_disc(canvas, px[0], px[1], 2.5f, tracking ? FV_PICTURE_OURS : WEAK);
    }
    const double bar_m = fv_picture_tick(WIDTH / view.px_per_m, 8);
    char text[64];
    (void)snprintf(text, sizeof text, "%g m", bar_m);
    fv_canvas_line(canvas, MARGIN, PATH_TOP, (float)(MARGIN + bar_m * view.px_per_m), PATH_TOP, 2,
                   FV_PICTURE_INK);
    fv_canvas_letters(canvas, MARGIN, PATH_TOP - 6, FV_PICTURE_TEXT_PX, FV_PICTURE_INK, text);
}

/* Squared error by frame, from 0.1 to 10,000 on a logarithmic scale. */
static void draw_strip(struct fv_canvas *canvas, const struct faults_plan *plan,
                       const struct faults_play *play, const double nees[FAULTS_GIVEN_MAX])
{
    const float base = STRIP_TOP + STRIP_HEIGHT, step = (float)(WIDTH - 2 * MARGIN) / FAULTS_FRAMES;
    for (int n = 0; n < FAULTS_FRAMES; n++)
        if (faults_strikes(plan, (uint64_t)n))
            fv_canvas_fill(canvas, MARGIN + (int)((float)n * step), STRIP_TOP, (int)step + 1,
                           STRIP_HEIGHT, FAULTY);
    const float limit = base - (float)((log10(nees_max) + 1) / 5 * STRIP_HEIGHT);
    fv_canvas_line(canvas, MARGIN, limit, WIDTH - MARGIN, limit, 1, WRONG);
    fv_canvas_line(canvas, MARGIN, base, WIDTH - MARGIN, base, 1, FV_PICTURE_INK);
    for (uint32_t i = 0; i < play->count; i++) {
        const struct faults_frame *frame = &play->frame[i];
        if (isnan(nees[i])) continue;
        const double height = (log10(fmin(fmax(nees[i], 0.1), 1e4)) + 1) / 5 * STRIP_HEIGHT;
        fv_canvas_disc(canvas, MARGIN + ((float)frame->index + 0.5f) * step, base - (float)height,
                       2.5f, nees[i] > nees_max ? WRONG : FV_PICTURE_OURS);
    }
}

static void draw_text(struct fv_canvas *canvas, const struct faults_plan *plan,
                      const struct faults_verdict *verdict)
{
    char text[2 * FAULTS_TEXT];
    (void)snprintf(
        text, sizeof text,
        "seed %llu: %u tracking, %u judged, %u of them false; NEES up to %.4g, error since "
        "the keyframe up to %.3f m",
        (unsigned long long)plan->seed, verdict->tracking, verdict->judged, verdict->wrong,
        verdict->worst, verdict->error_m);
    fv_canvas_letters(canvas, MARGIN, 28, FV_PICTURE_TITLE_PX, FV_PICTURE_INK, text);
    (void)snprintf(text, sizeof text, "%s", plan->uri);
    fv_canvas_letters(canvas, MARGIN, 50, 11, FV_PICTURE_PALE, text);
    int x = fv_picture_legend(canvas, MARGIN, STRIP_TOP - 30, FV_PICTURE_TRUTH, "truth");
    x = fv_picture_legend(canvas, x, STRIP_TOP - 30, FV_PICTURE_OURS, "tracking");
    x = fv_picture_legend(canvas, x, STRIP_TOP - 30, WEAK, "weak or coasting");
    x = fv_picture_legend(canvas, x, STRIP_TOP - 30, WRONG, "false confidence");
    fv_picture_legend(canvas, x, STRIP_TOP - 30, FAULTY, "faulty frames");
    fv_canvas_letters(canvas, MARGIN, STRIP_TOP - 8, FV_PICTURE_TEXT_PX, FV_PICTURE_INK,
                      "NEES of tracking frames against their keyframe, 0.1 to 10,000; line: 22.5");
}

void faults_draw(const char *path, const struct faults_plan *plan, const struct faults_play *play,
                 const double nees[FAULTS_GIVEN_MAX], const struct faults_verdict *verdict)
{
    struct fv_canvas canvas;
    struct fovea_error error;
    if (fv_canvas_create(&canvas, WIDTH, HEIGHT, 0xffffff)) faults_die("no memory for a picture");
    draw_path(&canvas, play, nees);
    draw_strip(&canvas, plan, play, nees);
    draw_text(&canvas, plan, verdict);
    if (fv_canvas_write(&canvas, path, &error)) faults_die(error.text);
    fv_canvas_free(&canvas);
}

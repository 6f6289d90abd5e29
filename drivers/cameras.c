#include "cameras.h"

#include <math.h>
#include <stdio.h>

enum { USUAL_PIXELS = 640 * 480 };
static const double rate_enough_hz = 24.5; /* 25 as drivers round it */
static const double usual_rate_hz = 30;

/* A rate that is enough and near to the usual one; 0: none is stated. */
static double usual_rate(const struct fv_camera_mode *mode)
{
    double best = 0;
    if (mode->any_rate) return fmin(fmax(usual_rate_hz, mode->rates_hz[1]), mode->rates_hz[0]);
    for (uint32_t i = 0; i < mode->rate_count; i++) {
        const double rate = mode->rates_hz[i];
        const bool nearer = fabs(rate - usual_rate_hz) < fabs(best - usual_rate_hz);
        if (best == 0 || (nearer && rate >= rate_enough_hz) ||
            (best < rate_enough_hz && rate > best))
            best = rate;
    }
    return best;
}

/* How far the size is from the usual one, as a factor. */
static double oddness(const struct fv_camera_mode *mode)
{
    const double pixels = (double)mode->width * mode->height;
    return pixels > USUAL_PIXELS ? pixels / USUAL_PIXELS : USUAL_PIXELS / pixels;
}

static bool better(const struct fv_camera_mode *a, const struct fv_camera_mode *b)
{
    const bool fast_a = usual_rate(a) >= rate_enough_hz, fast_b = usual_rate(b) >= rate_enough_hz;
    if (fast_a != fast_b) return fast_a;
    if (oddness(a) != oddness(b)) return oddness(a) < oddness(b);
    return a->rank < b->rank;
}

void fv_camera_make_uri(struct fv_camera *camera)
{
    const struct fv_camera_mode *best = NULL;
    for (uint32_t i = 0; i < camera->mode_count; i++) {
        const struct fv_camera_mode *mode = &camera->modes[i];
        if (!mode->read || mode->width <= 0 || mode->height <= 0) continue;
        if (best == NULL || better(mode, best)) best = mode;
    }
    const int used = snprintf(camera->uri, sizeof camera->uri, "%s:%.*s", camera->driver,
                              (int)FV_CAMERA_NAME_BYTES, camera->name);
    if (best == NULL) return;
    const double rate = usual_rate(best);
    char *end = camera->uri + used;
    const size_t left = sizeof camera->uri - (size_t)used;
    /* Every size up to the largest: the usual one, where it is among them. */
    const bool any = best->width_max >= 640 && best->height_max >= 480 && best->width <= 640 &&
                     best->height <= 480;
    const int length = snprintf(end, left, "?width=%d&height=%d&format=%s", any ? 640 : best->width,
                                any ? 480 : best->height, best->format);
    if (rate > 0) snprintf(end + length, left - (size_t)length, "&rate=%g", rate);
}

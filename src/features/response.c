#include "features/response.h"

#include <string.h>

#include "base/float_bits.h"

/* Sobel derivatives are 8 per grey level and pixel, their products are summed over 9 pixels. */
static const float per_product = 1.f / (64 * 9);

void fv_response_carve(struct fv_response_scratch *scratch, int32_t width, float harris_k,
                       struct fv_arena *frame)
{
    const size_t across = (size_t)width;
    scratch->width = width;
    scratch->harris_k = harris_k;
    scratch->responses = fv_arena_take(frame, 3 * across, sizeof *scratch->responses);
    scratch->dx = fv_arena_take(frame, 3 * across, sizeof *scratch->dx);
    scratch->dy = fv_arena_take(frame, 3 * across, sizeof *scratch->dy);
    scratch->sums = fv_arena_take(frame, 3 * across, sizeof *scratch->sums);
    scratch->columns = fv_arena_take(frame, across, sizeof *scratch->columns);
    scratch->scores = fv_arena_take(frame, across, sizeof *scratch->scores);
}

/* ---- scores ---------------------------------------------------------------------------------- */

static uint8_t rounded_down(float score)
{
    return score >= 255 ? 255 : score >= 1 ? (uint8_t)score : 1;
}

uint8_t fv_response_score(float measure)
{
    return rounded_down(FV_RESPONSE_GAIN * __builtin_sqrtf(__builtin_sqrtf(measure)));
}

/* Of a response of the kernel: (a + c) and its like are twice an eigenvalue. */
static uint8_t score_of(int32_t bits, float harris_k)
{
    const float response = fv_float_of_bits(bits);
    if (harris_k >= 0) return fv_response_score(response * (per_product * per_product));
    return rounded_down(FV_RESPONSE_GAIN * __builtin_sqrtf(response * (.5f * per_product)));
}

/* A response that has less than the score, though hardly. */
static int32_t bits_below(int32_t score, float harris_k)
{
    const float root = .999f * (float)score / FV_RESPONSE_GAIN, square = root * root / per_product;
    return fv_float_bits(harris_k >= 0 ? square * square : 2 * square);
}

/* ---- rows ------------------------------------------------------------------------------------ */

static int32_t *response_row(const struct fv_response_scratch *scratch, int32_t y)
{
    return scratch->responses + (int64_t)(y % 3) * scratch->width;
}

static int16_t *derivative_row(const struct fv_response_scratch *scratch, int16_t *rows, int32_t y)
{
    return rows + (int64_t)(y % 3) * scratch->width;
}

static void derive(const struct fv_response *r, int32_t y)
{
    const uint8_t *rows[3] = {fv_plane_row(&r->image, y - 1), fv_plane_row(&r->image, y),
                              fv_plane_row(&r->image, y + 1)};
    const struct fv_response_scratch *s = &r->scratch;
    r->kernels->derivative_x_row_s16(derivative_row(s, s->dx, y), rows, r->image.width, 1, 2, 0);
    r->kernels->derivative_y_row_s16(derivative_row(s, s->dy, y), rows, r->image.width, 1, 2, 0);
}

static void respond(const struct fv_response *r, int32_t y)
{
    const struct fv_response_scratch *s = &r->scratch;
    const int16_t *dx[3], *dy[3];
    derive(r, y + 1);
    for (int i = 0; i < 3; i++) {
        dx[i] = derivative_row(s, s->dx, y - 1 + i);
        dy[i] = derivative_row(s, s->dy, y - 1 + i);
    }
    r->kernels->response_row_f32(response_row(s, y), dx, dy, r->image.width, s->harris_k, s->sums,
                                 0);
}

void fv_response_begin(struct fv_response *r, const struct fv_kernels *kernels,
                       const struct fv_plane *image, int32_t border_px, int32_t threshold,
                       const struct fv_response_scratch *scratch)
{
    *r = (struct fv_response){
        .kernels = kernels,
        .image = *image,
        .border_px = border_px > FV_RESPONSE_BORDER_MIN_PX ? border_px : FV_RESPONSE_BORDER_MIN_PX,
        .threshold = threshold,
        .scratch = *scratch,
        .columns = scratch->columns,
        .scores = scratch->scores,
    };
    r->y = r->border_px - 1;
    r->responded = r->border_px - 2;
}

static void take_peaks(struct fv_response *r)
{
    const struct fv_response_scratch *s = &r->scratch;
    const int32_t end = r->image.width - r->border_px;
    const int32_t *rows[3] = {response_row(s, r->y - 1), response_row(s, r->y),
                              response_row(s, r->y + 1)};
    int32_t *marks = s->sums;
    r->kernels->response_peaks_row_s32(
        marks, rows, r->image.width, bits_below(r->threshold, s->harris_k), marks + r->image.width);
    for (int32_t x = r->border_px; x < end; x++) {
        uint64_t two;
        memcpy(&two, marks + x, sizeof two); /* one more may be read: the border follows */
        if (two == 0) {
            x++;
            continue;
        }
        if (marks[x] == 0) continue;
        const uint8_t score = score_of(rows[1][x], s->harris_k);
        if (score < r->threshold) continue;
        s->columns[r->count] = (uint16_t)x;
        s->scores[r->count++] = score;
    }
}

bool fv_response_next(struct fv_response *r)
{
    const int32_t border = r->border_px;
    r->count = 0;
    if (r->image.width <= 2 * border || r->y + 1 >= r->image.height - border) return false;
    r->y++;
    if (r->responded < border - 1) {
        derive(r, border - 2);
        derive(r, border - 1);
    }
    while (r->responded < r->y + 1)
        respond(r, ++r->responded);
    take_peaks(r);
    return true;
}

/* ---- positions ------------------------------------------------------------------------------- */

enum { AROUND = 5 };

static void sobel(const struct fv_plane *level, int32_t x, int32_t y, int32_t dx[AROUND][AROUND],
                  int32_t dy[AROUND][AROUND])
{
    for (int v = 0; v < AROUND; v++) {
        const uint8_t *row = fv_plane_row(level, y + v - AROUND / 2) + x - AROUND / 2;
        const uint8_t *above = row - level->stride, *below = row + level->stride;
        for (int u = 0; u < AROUND; u++) {
            dx[v][u] = above[u + 1] - above[u - 1] + 2 * (row[u + 1] - row[u - 1]) + below[u + 1] -
                       below[u - 1];
            dy[v][u] = below[u - 1] - above[u - 1] + 2 * (below[u] - above[u]) + below[u + 1] -
                       above[u + 1];
        }
    }
}

/* As contracts/response.h has it, at (x, y) of the surroundings. */
static float measure(int32_t dx[AROUND][AROUND], int32_t dy[AROUND][AROUND], int x, int y, float k)
{
    int32_t xx = 0, xy = 0, yy = 0;
    for (int v = y - 1; v <= y + 1; v++)
        for (int u = x - 1; u <= x + 1; u++) {
            xx += dx[v][u] * dx[v][u];
            xy += dx[v][u] * dy[v][u];
            yy += dy[v][u] * dy[v][u];
        }
    const float a = (float)xx, c = (float)yy;
    if (k >= 0) return a * c - (float)xy * (float)xy - k * ((a + c) * (a + c));
    const float b = (float)(2 * xy);
    return a + c - __builtin_sqrtf((a - c) * (a - c) + b * b);
}

/* Place of the maximum of a parabola through three values, from the middle one. */
static float parabola(float before, float at, float after)
{
    const float bend = before - 2 * at + after;
    return bend < 0 ? .5f * (before - after) / bend : 0;
}

void fv_response_refine(const struct fv_pyramid *pyramid, float harris_k,
                        const struct fv_corner *corners, uint32_t count,
                        struct fovea_feature *features)
{
    for (uint32_t i = 0; i < count; i++) {
        const struct fv_corner *corner = &corners[i];
        int32_t dx[AROUND][AROUND], dy[AROUND][AROUND];
        sobel(&pyramid->level[corner->level], corner->x, corner->y, dx, dy);
        const float at = measure(dx, dy, 2, 2, harris_k);
        const float x =
            parabola(measure(dx, dy, 1, 2, harris_k), at, measure(dx, dy, 3, 2, harris_k));
        const float y =
            parabola(measure(dx, dy, 2, 1, harris_k), at, measure(dx, dy, 2, 3, harris_k));
        features[i].x_px = fv_pyramid_to_raw(corner->level, (float)corner->x + x);
        features[i].y_px = fv_pyramid_to_raw(corner->level, (float)corner->y + y);
    }
}

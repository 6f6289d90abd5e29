/* Orientations and descriptors of SURF (features/surf.h). */
#include <string.h>

#include "base/elementary.h"
#include "features/surf.h"

enum {
    CIRCLE = FV_SURF_CIRCLE,
    RADIUS = CIRCLE / 2,
    BINS = 72,         /* of the directions of Haar responses */
    SECTOR = BINS / 6, /* 60 degrees */
    SAMPLES = FV_SURF_SAMPLES,
    SQUARES = 4,         /* of the descriptor across and down */
    PER_SQUARE = 5,      /* samples across */
    CELLS = SQUARES + 2, /* with one on each side that is left out */
    SUMS = 4             /* of a square */
};

#define CIRCLE_SIGMA 3.
#define WINDOW_SIGMA 6.

/* Weights exp(-r^2 / (2 sigma^2)) of a square of samples around its middle. */
static void fill_window(float *weights, int32_t side, double sigma)
{
    const double middle = (side - 1) / 2.;
    for (int32_t i = 0; i < side * side; i++) {
        const int32_t row = i / side;
        const double x = i % side - middle, y = row - middle;
        weights[i] = (float)fv_exp(-(x * x + y * y) / (2 * sigma * sigma));
    }
}

void fv_surf_tables_fill(struct fv_surf_tables *tables)
{
    fill_window(tables->circle, CIRCLE, CIRCLE_SIGMA);
    fill_window(tables->window, SAMPLES, WINDOW_SIGMA);
    for (int32_t i = 0; i < CIRCLE * CIRCLE; i++) {
        const int32_t x = i % CIRCLE - RADIUS, y = i / CIRCLE - RADIUS;
        if (x * x + y * y > RADIUS * RADIUS) tables->circle[i] = 0;
    }
    for (int32_t i = 0; i < SAMPLES; i++) {
        const double square = (i - (SAMPLES - 1) / 2.) / PER_SQUARE + (CELLS - 1) / 2.;
        tables->square[i] = (int32_t)square;
        tables->second[i] = (float)(square - tables->square[i]);
    }
}

/* A square of samples around a point, rows along (step_x, step_y): its first and its steps, in
 * 1/65536 pixel, counted from the corner of the first pixel. */
struct samples {
    int32_t x, y, step_x, step_y;
};

static int32_t fixed(double value)
{
    return (int32_t)fv_floor(value * 65536 + .5);
}

static struct samples samples_of(const struct fv_surf_point *point, int32_t side, double step_x,
                                 double step_y)
{
    const double half = (side - 1) / 2.;
    return (struct samples){
        fixed(point->x + .5 - half * step_x + half * step_y),
        fixed(point->y + .5 - half * step_y - half * step_x),
        fixed(step_x),
        fixed(step_y),
    };
}

static uint64_t widened(uint32_t difference)
{
    return (uint64_t)(int64_t)(int32_t)difference;
}

/* The integral image at a place in 1/256 pixel, times 2^16, modulo 2^48: sums are modulo 2^32, but
 * those of a row or a column of pixels, which differ between neighbours, fit. */
static uint64_t sum_at(const struct fv_surf *surf, int32_t x, int32_t y)
{
    const uint32_t fx = (uint32_t)x & 255, fy = (uint32_t)y & 255;
    const uint32_t *above = surf->integral + (ptrdiff_t)(y >> 8) * surf->stride + (x >> 8);
    const uint32_t *below = above + (fy != 0 ? surf->stride : 0);
    const int32_t next = fx != 0;
    const uint32_t right = above[next] - above[0], down = below[0] - above[0];
    const uint32_t both = below[next] - below[0] - right;
    return ((uint64_t)above[0] << 16) + (widened(right) * fx << 8) + (widened(down) * fy << 8) +
           widened(both) * (fx * fy);
}

/* A number modulo 2^48 with its sign. */
static float signed_of(uint64_t sum)
{
    sum &= (UINT64_C(1) << 48) - 1;
    return (float)(sum >> 47 != 0 ? (int64_t)sum - (INT64_C(1) << 48) : (int64_t)sum);
}

/* Haar responses of side 2 `half` around a place in 1/65536 pixel: the right half less the left,
 * the lower less the upper; 0 where the square leaves the image. `half` is in 1/256 pixel. */
static void haar(const struct fv_surf *surf, int32_t at_x, int32_t at_y, int32_t half, float d[2])
{
    d[0] = d[1] = 0;
    if (at_x < half << 8 || at_y < half << 8) return;
    const int32_t x = at_x >> 8, y = at_y >> 8;
    const int32_t x0 = x - half, x1 = x + half, y0 = y - half, y1 = y + half;
    if (x1 > surf->width << 8 || y1 > surf->height << 8) return;
    const uint64_t nw = sum_at(surf, x0, y0), n = sum_at(surf, x, y0), ne = sum_at(surf, x1, y0);
    const uint64_t w = sum_at(surf, x0, y), e = sum_at(surf, x1, y);
    const uint64_t sw = sum_at(surf, x0, y1), s = sum_at(surf, x, y1), se = sum_at(surf, x1, y1);
    d[0] = signed_of((se - ne) - 2 * (s - n) + (sw - nw));
    d[1] = signed_of((se - sw) - 2 * (e - w) + (ne - nw));
}

/* Direction in turns, [0, 1], within 2e-6 (Hastings, Approximations for Digital Computers, 1955,
 * sheet 11). */
static float turns_of(float dx, float dy)
{
    const float ax = dx < 0 ? -dx : dx, ay = dy < 0 ? -dy : dy;
    const float low = ax < ay ? ax : ay, high = ax < ay ? ay : ax;
    const float t = high > 0 ? low / high : 0, s = t * t;
    float angle =
        t * (.15915494f *
             (.9998660f + s * (-.3302995f + s * (.1801410f + s * (-.0851330f + s * .0208351f)))));
    angle = ay > ax ? .25f - angle : angle;
    angle = dx < 0 ? .5f - angle : angle;
    return dy < 0 ? 1 - angle : angle;
}

/* Sums of the weighted Haar responses by their direction. */
static void sum_directions(const struct fv_surf *surf, const struct fv_surf_point *point,
                           float sums[BINS][2])
{
    const int32_t half = fixed(3 * point->sigma) >> 8;
    const struct samples at = samples_of(point, CIRCLE, point->sigma, 0);
    for (int32_t i = 0; i < CIRCLE; i++)
        for (int32_t j = 0; j < CIRCLE; j++) {
            const float weight = surf->tables->circle[i * CIRCLE + j];
            float d[2];
            if (!(weight > 0)) continue;
            haar(surf, at.x + j * at.step_x, at.y + i * at.step_x, half, d);
            const int32_t bin = (int32_t)(turns_of(d[0], d[1]) * BINS) % BINS;
            sums[bin][0] += weight * d[0];
            sums[bin][1] += weight * d[1];
        }
}

float fv_surf_orient(const struct fv_surf *surf, const struct fv_surf_point *point)
{
    float sums[BINS][2] = {{0}}, best[2] = {0}, longest = 0;
    sum_directions(surf, point, sums);
    for (int32_t first = 0; first < BINS; first++) {
        float x = 0, y = 0;
        for (int32_t i = 0; i < SECTOR; i++) {
            x += sums[(first + i) % BINS][0];
            y += sums[(first + i) % BINS][1];
        }
        if (x * x + y * y > longest) {
            longest = x * x + y * y;
            best[0] = x;
            best[1] = y;
        }
    }
    const float turns = turns_of(best[0], best[1]);
    return (float)(2 * FV_PI) * (turns > .5f ? turns - 1 : turns);
}

/* One row of samples, into the cells of a row: CELLS x SUMS. */
static void add_row(const struct fv_surf *surf, const struct samples *at, int32_t row, int32_t half,
                    const float turn[2], float *cells)
{
    const float *window = surf->tables->window + row * SAMPLES;
    const int32_t x = at->x - row * at->step_y, y = at->y + row * at->step_x;
    for (int32_t j = 0; j < SAMPLES; j++) {
        float d[2];
        haar(surf, x + j * at->step_x, y + j * at->step_y, half, d);
        const float dx = window[j] * (d[0] * turn[0] + d[1] * turn[1]);
        const float dy = window[j] * (d[1] * turn[0] - d[0] * turn[1]);
        const float sums[SUMS] = {dx, dx < 0 ? -dx : dx, dy, dy < 0 ? -dy : dy};
        const float second = surf->tables->second[j], first = 1 - second;
        float *cell = cells + surf->tables->square[j] * SUMS;
        for (int32_t k = 0; k < SUMS; k++) {
            cell[k] += sums[k] * first;
            cell[k + SUMS] += sums[k] * second;
        }
    }
}

static void finish(const float values[FV_SURF_BYTES], uint8_t descriptor[FV_SURF_BYTES])
{
    float sum = 0;
    for (int32_t i = 0; i < FV_SURF_BYTES; i++)
        sum += values[i] * values[i];
    const float scale = sum > 0 ? 256 / __builtin_sqrtf(sum) : 0;
    for (int32_t i = 0; i < FV_SURF_BYTES; i++) {
        const float value = values[i] * scale + 128.5f;
        descriptor[i] = (uint8_t)(value < 0 ? 0 : value < 255 ? value : 255);
    }
}

void fv_surf_describe(const struct fv_surf *surf, const struct fv_surf_point *point,
                      float angle_rad, uint8_t descriptor[FV_SURF_BYTES])
{
    enum { ROW = CELLS * SUMS };
    const double c = fv_cos((double)angle_rad), s = fv_sin((double)angle_rad);
    const float turn[2] = {(float)c, (float)s};
    const struct samples at = samples_of(point, SAMPLES, point->sigma * c, point->sigma * s);
    const int32_t half = fixed(point->sigma) >> 8;
    float cells[CELLS * ROW] = {0}, values[FV_SURF_BYTES];
    for (int32_t i = 0; i < SAMPLES; i++) {
        float row[ROW] = {0}, *to = cells + surf->tables->square[i] * ROW;
        const float second = surf->tables->second[i], first = 1 - second;
        add_row(surf, &at, i, half, turn, row);
        for (int32_t k = 0; k < ROW; k++) {
            to[k] += row[k] * first;
            to[k + ROW] += row[k] * second;
        }
    }
    for (int32_t i = 0; i < SQUARES; i++)
        memcpy(values + i * SQUARES * SUMS, cells + (i + 1) * ROW + SUMS,
               SQUARES * SUMS * sizeof *values);
    finish(values, descriptor);
}

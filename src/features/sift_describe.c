/* Orientations and descriptors of SIFT (features/sift.h). */
#include <string.h>

#include "base/elementary.h"
#include "features/sift.h"

enum {
    BINS = 36,                             /* of the histogram of orientations */
    ORIENT_SIDE = 15,                      /* samples across and down */
    PER_CELL = 4,                          /* samples across a cell of the descriptor */
    SIDE = PER_CELL * (FV_SIFT_CELLS + 1), /* half a cell beyond the outermost ones */
    PATCH_MAX = SIDE + 2,                  /* and one sample more on each side, for differences */
    CELLS = FV_SIFT_CELLS + 2              /* with one on each side that is left out */
};

#define ORIENT_STEP .6   /* sigma between samples */
#define ORIENT_SIGMA 1.5 /* of the weights, in sigma */
#define CELL_WIDTH 3.    /* sigma */
#define PEAK .8f         /* of the highest bin: an orientation of its own */

struct fv_sift_tables {
    float orient[ORIENT_SIDE * ORIENT_SIDE]; /* weights of the samples */
    float window[SIDE * SIDE];
    int32_t cell[SIDE]; /* of the two cells that a sample adds to, the first, counted from 1 */
    float second[SIDE]; /* weight of the second */
};

size_t fv_sift_tables_bytes(void)
{
    return sizeof(struct fv_sift_tables);
}

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

void fv_sift_tables_fill(struct fv_sift_tables *tables)
{
    fill_window(tables->orient, ORIENT_SIDE, ORIENT_SIGMA / ORIENT_STEP);
    fill_window(tables->window, SIDE, FV_SIFT_CELLS / 2. * PER_CELL);
    for (int32_t i = 0; i < SIDE; i++) {
        const double cell = (i - (SIDE - 1) / 2.) / PER_CELL + (CELLS - 1) / 2.;
        tables->cell[i] = (int32_t)cell;
        tables->second[i] = (float)(cell - tables->cell[i]);
    }
}

/* A square of samples of a level: `side` across and down, around (x, y), rows along (step_x,
 * step_y), all in pixels of the octave. Between pixels values are bilinear, positions in 1/256
 * pixel; beyond the image its border is repeated. */
struct square {
    int32_t side;
    double x, y, step_x, step_y;
};

static uint16_t sample(const struct fv_scale_octave *octave, const uint16_t *level, int32_t x,
                       int32_t y)
{
    const int32_t right = (octave->width - 1) << 16, bottom = (octave->height - 1) << 16;
    x = x < 0 ? 0 : x > right ? right : x;
    y = y < 0 ? 0 : y > bottom ? bottom : y;
    const uint32_t fx = (uint32_t)x >> 8 & 255, fy = (uint32_t)y >> 8 & 255;
    const uint16_t *above = level + (int64_t)(y >> 16) * octave->stride + (x >> 16);
    const uint16_t *below = above + (y < bottom ? octave->stride : 0);
    const int32_t next = x < right;
    const uint32_t a = above[0] * (256 - fx) + above[next] * fx;
    const uint32_t b = below[0] * (256 - fx) + below[next] * fx;
    return (uint16_t)((a * (256 - fy) + b * fy) >> 16);
}

static int32_t fixed(double value)
{
    return (int32_t)fv_floor(value * 65536 + .5);
}

static void square_take(const struct fv_scale_octave *octave, int32_t layer,
                        const struct square *square, uint16_t *out)
{
    const uint16_t *level = octave->level[layer];
    const double half = (square->side - 1) / 2.;
    const int32_t step_x = fixed(square->step_x), step_y = fixed(square->step_y);
    int32_t row_x = fixed(square->x - half * square->step_x + half * square->step_y);
    int32_t row_y = fixed(square->y - half * square->step_y - half * square->step_x);
    for (int32_t i = 0; i < square->side; i++, row_x -= step_y, row_y += step_x)
        for (int32_t j = 0; j < square->side; j++)
            *out++ = sample(octave, level, row_x + j * step_x, row_y + j * step_y);
}

/* Magnitudes and directions of gradients in the inner samples of a square; directions in turns, [0,
 * 1], within 2e-6 (Hastings, Approximations for Digital Computers, 1955, sheet 11). */
static void gradients(const uint16_t *patch, int32_t side, float *magnitude, float *turns)
{
    const int32_t inner = side - 2;
    for (int32_t i = 0; i < inner; i++) {
        const uint16_t *row = patch + (i + 1) * side + 1;
        for (int32_t j = 0; j < inner; j++) {
            const int32_t dx = row[j + 1] - row[j - 1], dy = row[j + side] - row[j - side];
            const int32_t ax = dx < 0 ? -dx : dx, ay = dy < 0 ? -dy : dy;
            const int32_t low = ax < ay ? ax : ay, high = ax < ay ? ay : ax;
            const float fx = (float)dx, fy = (float)dy;
            const float t = (float)low / (float)(high > 0 ? high : 1), s = t * t;
            float angle =
                t * (.15915494f *
                     (.9998660f +
                      s * (-.3302995f + s * (.1801410f + s * (-.0851330f + s * .0208351f)))));
            angle = ay > ax ? .25f - angle : angle;
            angle = dx < 0 ? .5f - angle : angle;
            turns[i * inner + j] = dy < 0 ? 1 - angle : angle;
            magnitude[i * inner + j] = __builtin_sqrtf(fx * fx + fy * fy);
        }
    }
}

/* Histogram of directions, smoothed by 1 4 6 4 1. */
static void orientations(const struct fv_sift *sift, const struct fv_sift_extreme *extreme,
                         float smooth[BINS])
{
    uint16_t patch[(ORIENT_SIDE + 2) * (ORIENT_SIDE + 2)];
    float magnitude[ORIENT_SIDE * ORIENT_SIDE], turns[ORIENT_SIDE * ORIENT_SIDE];
    float bins[BINS + 1] = {0};
    const struct square square = {ORIENT_SIDE + 2, (double)extreme->x, (double)extreme->y,
                                  ORIENT_STEP * fv_sift_sigma(extreme), 0};
    square_take(&sift->space.octave[extreme->octave], extreme->at_layer, &square, patch);
    gradients(patch, ORIENT_SIDE + 2, magnitude, turns);
    for (int32_t i = 0; i < ORIENT_SIDE * ORIENT_SIDE; i++) {
        const int32_t bin = (int32_t)(turns[i] * BINS + .5f);
        bins[bin] += magnitude[i] * sift->tables->orient[i];
    }
    bins[0] += bins[BINS]; /* a whole turn */
    for (int32_t i = 0; i < BINS; i++) {
        const float *b = bins;
        smooth[i] = (b[(i + BINS - 2) % BINS] + b[(i + 2) % BINS]) * .0625f +
                    (b[(i + BINS - 1) % BINS] + b[(i + 1) % BINS]) * .25f + b[i] * .375f;
    }
}

uint32_t fv_sift_orient(const struct fv_sift *sift, const struct fv_sift_extreme *extreme,
                        struct fv_sift_orientation found[FV_SIFT_ORIENTATIONS_MAX])
{
    float bins[BINS], highest = 0;
    uint32_t count = 0;
    orientations(sift, extreme, bins);
    for (int32_t i = 0; i < BINS; i++)
        if (bins[i] > highest) highest = bins[i];
    for (int32_t i = 0; i < BINS && count < FV_SIFT_ORIENTATIONS_MAX; i++) {
        const float left = bins[(i + BINS - 1) % BINS], right = bins[(i + 1) % BINS];
        if (!(bins[i] > left && bins[i] > right && bins[i] >= PEAK * highest)) continue;
        const float peak = (float)i + .5f * (left - right) / (left - 2 * bins[i] + right);
        const float turns = peak / BINS; /* (-1/72, 1) */
        const struct fv_sift_orientation one = {
            (float)(2 * FV_PI) * (turns > .5f ? turns - 1 : turns), bins[i] / highest};
        uint32_t at = count++;
        for (; at > 0 && found[at - 1].share < one.share; at--)
            found[at] = found[at - 1];
        found[at] = one;
    }
    return count;
}

/* One row of samples, into the cells of a row: CELLS x FV_SIFT_DIRECTIONS. */
static void add_row(const struct fv_sift_tables *tables, const float *magnitude, const float *turns,
                    const float *window, float *cells)
{
    for (int32_t j = 0; j < SIDE; j++) {
        const float direction = turns[j] * FV_SIFT_DIRECTIONS;
        const int32_t whole = (int32_t)direction;
        const int32_t a = whole % FV_SIFT_DIRECTIONS, b = (whole + 1) % FV_SIFT_DIRECTIONS;
        const float value = magnitude[j] * window[j];
        const float to_b = value * (direction - (float)whole), to_a = value - to_b;
        const float second = tables->second[j], first = 1 - second;
        float *cell = cells + tables->cell[j] * FV_SIFT_DIRECTIONS;
        cell[a] += to_a * first;
        cell[b] += to_b * first;
        cell[a + FV_SIFT_DIRECTIONS] += to_a * second;
        cell[b + FV_SIFT_DIRECTIONS] += to_b * second;
    }
}

static float length_of(const float *values)
{
    float sum = 0;
    for (int32_t i = 0; i < FV_SIFT_BYTES; i++)
        sum += values[i] * values[i];
    return __builtin_sqrtf(sum);
}

/* Of unit length, limited to 0.2, of unit length again, times 512. */
static void finish(float values[FV_SIFT_BYTES], uint8_t descriptor[FV_SIFT_BYTES])
{
    const float limit = .2f * length_of(values);
    for (int32_t i = 0; i < FV_SIFT_BYTES; i++)
        values[i] = values[i] < limit ? values[i] : limit;
    const float length = length_of(values), scale = length > 0 ? 512 / length : 0;
    for (int32_t i = 0; i < FV_SIFT_BYTES; i++) {
        const float value = values[i] * scale + .5f;
        descriptor[i] = (uint8_t)(value < 255 ? value : 255);
    }
}

void fv_sift_describe(const struct fv_sift *sift, const struct fv_sift_extreme *extreme,
                      float angle_rad, uint8_t descriptor[FV_SIFT_BYTES])
{
    enum { ROW = CELLS * FV_SIFT_DIRECTIONS };
    uint16_t patch[PATCH_MAX * PATCH_MAX];
    float magnitude[SIDE * SIDE], turns[SIDE * SIDE], cells[CELLS * ROW] = {0};
    const struct fv_sift_tables *tables = sift->tables;
    const double step = CELL_WIDTH / PER_CELL * fv_sift_sigma(extreme);
    const struct square square = {PATCH_MAX, (double)extreme->x, (double)extreme->y,
                                  step * fv_cos((double)angle_rad),
                                  step * fv_sin((double)angle_rad)};
    square_take(&sift->space.octave[extreme->octave], extreme->at_layer, &square, patch);
    gradients(patch, PATCH_MAX, magnitude, turns);
    for (int32_t i = 0; i < SIDE; i++) {
        float row[ROW] = {0}, *to = cells + tables->cell[i] * ROW;
        const float second = tables->second[i], first = 1 - second;
        add_row(tables, magnitude + i * SIDE, turns + i * SIDE, tables->window + i * SIDE, row);
        for (int32_t k = 0; k < ROW; k++) {
            to[k] += row[k] * first;
            to[k + ROW] += row[k] * second;
        }
    }
    float values[FV_SIFT_BYTES];
    for (int32_t i = 0; i < FV_SIFT_CELLS; i++)
        memcpy(values + i * FV_SIFT_BYTES / FV_SIFT_CELLS,
               cells + (i + 1) * ROW + FV_SIFT_DIRECTIONS,
               FV_SIFT_BYTES / FV_SIFT_CELLS * sizeof *values);
    finish(values, descriptor);
}

/* The kernels of contracts/scale.h in vectors of 16-bit lanes, for files that define, before they
 * include this one:
 *
 *   FV_NAME(kernel)       the function's name
 *   VECTOR, LANES         the type and its number of lanes, at most FV_SCALE_LANES
 *   LOAD(p), STORE(p, v)  at any address
 *   EACH(n)               n in every lane
 *   ADD, SUB, OR, AND     of two vectors
 *   HIGH(a, b)            upper halves of unsigned products
 *   MIN_U, MIN_S, MAX_S   unsigned and signed
 *   ABOVE(a, b)           all ones where a > b, signed
 *   UNLESS(a, b)          b where a is all zeros */
#include "kernels/kernels.h"

static inline VECTOR blur_part(VECTOR sum, const uint16_t *a, const uint16_t *b, VECTOR weight)
{
    return ADD(sum, HIGH(ADD(LOAD(a), LOAD(b)), weight));
}

void FV_NAME(scale_blur_row_u16)(uint16_t *out, const uint16_t *const *rows, int32_t width,
                                 const uint16_t *weights, int32_t radius, uint16_t *scratch)
{
    uint16_t *column = scratch + FV_SCALE_PAD;
    VECTOR weight[FV_SCALE_RADIUS_MAX + 1];
    const VECTOR rounding = EACH((int16_t)((radius + 1) / 2));
    for (int32_t i = 0; i <= radius; i++)
        weight[i] = EACH((int16_t)weights[i]);
    for (int32_t x = 0; x < width; x += 2 * LANES) {
        VECTOR a = ADD(rounding, HIGH(LOAD(rows[radius] + x), weight[0])), b = rounding;
        if (x + LANES < width) b = ADD(b, HIGH(LOAD(rows[radius] + x + LANES), weight[0]));
        for (int32_t i = 1; i <= radius; i++) {
            const uint16_t *over = rows[radius - i] + x, *under = rows[radius + i] + x;
            a = blur_part(a, over, under, weight[i]);
            if (x + LANES < width) b = blur_part(b, over + LANES, under + LANES, weight[i]);
        }
        STORE(column + x, a);
        if (x + LANES < width) STORE(column + x + LANES, b);
    }
    for (int32_t i = 1; i <= radius; i++) {
        column[-i] = column[i];
        column[width - 1 + i] = column[width - 1 - i];
    }
    const VECTOR white = EACH(FV_SCALE_WHITE);
    for (int32_t x = 0; x < width; x += LANES) {
        VECTOR sum = ADD(rounding, HIGH(LOAD(column + x), weight[0]));
        for (int32_t i = 1; i <= radius; i++)
            sum = blur_part(sum, column + x - i, column + x + i, weight[i]);
        STORE(out + x, MIN_U(sum, white));
    }
}

static inline VECTOR difference(const uint16_t *const *rows, int32_t l, int32_t row, int32_t x)
{
    return SUB(LOAD(rows[3 * (l + 1) + row] + x), LOAD(rows[3 * l + row] + x));
}

/* Largest and smallest of the three differences of a column, for every column. */
static inline void column_ranges(const uint16_t *const *rows, int32_t l, int32_t width,
                                 int16_t *most, int16_t *least)
{
    for (int32_t x = 0; x < width; x += LANES) {
        const VECTOR a = difference(rows, l, 0, x), b = difference(rows, l, 1, x);
        const VECTOR c = difference(rows, l, 2, x);
        STORE(most + x, MAX_S(MAX_S(a, b), c));
        STORE(least + x, MIN_S(MIN_S(a, b), c));
    }
}

void FV_NAME(scale_peaks_row_u16)(uint16_t *marks, const uint16_t *const *rows, int32_t width,
                                  int32_t threshold, int16_t *scratch)
{
    int16_t *most[FV_SCALE_DIFFERENCES], *least[FV_SCALE_DIFFERENCES];
    const int32_t stride = fv_scale_stride(width) + 2 * FV_SCALE_PAD;
    for (int32_t l = 0; l < FV_SCALE_DIFFERENCES; l++) {
        most[l] = scratch + FV_SCALE_PAD + (int64_t)(2 * l) * stride;
        least[l] = most[l] + stride;
        column_ranges(rows, l, width, most[l], least[l]);
    }
    const VECTOR high = EACH((int16_t)threshold), low = EACH((int16_t)-threshold);
    for (int32_t x = 0; x < width; x += LANES) {
        VECTOR up[FV_SCALE_DIFFERENCES], down[FV_SCALE_DIFFERENCES], found = EACH(0);
        for (int32_t l = 0; l < FV_SCALE_DIFFERENCES; l++) {
            const int16_t *u = most[l] + x, *d = least[l] + x;
            up[l] = MAX_S(MAX_S(LOAD(u - 1), LOAD(u)), LOAD(u + 1));
            down[l] = MIN_S(MIN_S(LOAD(d - 1), LOAD(d)), LOAD(d + 1));
        }
        for (int32_t k = 0; k < 3; k++) {
            const VECTOR d = difference(rows, k + 1, 1, x);
            const VECTOR top = MAX_S(MAX_S(up[k], up[k + 1]), up[k + 2]);
            const VECTOR bottom = MIN_S(MIN_S(down[k], down[k + 1]), down[k + 2]);
            const VECTOR peak = UNLESS(ABOVE(top, d), ABOVE(d, high));
            const VECTOR pit = UNLESS(ABOVE(d, bottom), ABOVE(low, d));
            found = OR(found, AND(OR(peak, pit), EACH((int16_t)(1 << k))));
        }
        STORE(marks + x, found);
    }
    marks[0] = marks[width - 1] = 0;
}

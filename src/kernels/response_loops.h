/* Kernels of contracts/response.h, which compilers vectorise well: the C variants, which
 * response_sse4.c and response_avx2.c compile again for their instruction sets, with column sums of
 * their own. FV_NAME(kernel) makes the function's name. */

#include "base/float_bits.h"
#include "kernels/kernels.h"

#ifndef FV_COLUMN_SUMS
/* Sums of the products down the three rows, for every column. */
static inline void column_sums(int32_t *restrict out, const int16_t *const *p,
                               const int16_t *const *q, int32_t width)
{
    const int16_t *p0 = p[0], *p1 = p[1], *p2 = p[2], *q0 = q[0], *q1 = q[1], *q2 = q[2];
    for (int32_t x = 0; x < width; x++)
        out[x] = p0[x] * q0[x] + p1[x] * q1[x] + p2[x] * q2[x];
}
#endif

static inline void eigenvalues(int32_t *restrict out, const int32_t *xx, const int32_t *xy,
                               const int32_t *yy, int32_t width)
{
    for (int32_t x = 1; x < width - 1; x++) {
        const float a = (float)(xx[x - 1] + xx[x] + xx[x + 1]);
        const float b = (float)(2 * (xy[x - 1] + xy[x] + xy[x + 1]));
        const float c = (float)(yy[x - 1] + yy[x] + yy[x + 1]);
        out[x] = fv_float_bits(a + c - __builtin_sqrtf((a - c) * (a - c) + b * b));
    }
}

static inline void harris(int32_t *restrict out, const int32_t *xx, const int32_t *xy,
                          const int32_t *yy, int32_t width, float k)
{
    for (int32_t x = 1; x < width - 1; x++) {
        const float a = (float)(xx[x - 1] + xx[x] + xx[x + 1]);
        const float b = (float)(xy[x - 1] + xy[x] + xy[x + 1]);
        const float c = (float)(yy[x - 1] + yy[x] + yy[x + 1]);
        out[x] = fv_float_bits(a * c - b * b - k * ((a + c) * (a + c)));
    }
}

int32_t FV_NAME(response_row_f32)(int32_t *out, const int16_t *const *dx, const int16_t *const *dy,
                                  int32_t width, float harris_k, int32_t *sums, int32_t most)
{
    int32_t *xx = sums, *xy = sums + width, *yy = sums + 2 * (int64_t)width;
    column_sums(xx, dx, dx, width);
    column_sums(xy, dx, dy, width);
    column_sums(yy, dy, dy, width);
    if (harris_k < 0)
        eigenvalues(out, xx, xy, yy, width);
    else
        harris(out, xx, xy, yy, width, harris_k);
    out[0] = out[width - 1] = 0;
    for (int32_t x = 0; x < width; x++)
        most = out[x] > most ? out[x] : most;
    return most;
}

static inline int32_t larger(int32_t a, int32_t b)
{
    return a > b ? a : b;
}

void FV_NAME(response_peaks_row_s32)(int32_t *restrict marks, const int32_t *const *rows,
                                     int32_t width, int32_t threshold, int32_t *restrict most)
{
    const int32_t *above = rows[0], *row = rows[1], *below = rows[2];
    for (int32_t x = 0; x < width; x++)
        most[x] = larger(larger(above[x], row[x]), below[x]);
    for (int32_t x = 1; x < width - 1; x++) {
        const int32_t around = larger(larger(most[x - 1], most[x]), most[x + 1]);
        marks[x] = (row[x] > threshold) & (row[x] >= around);
    }
    marks[0] = marks[width - 1] = 0;
}

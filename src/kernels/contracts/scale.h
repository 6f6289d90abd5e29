/* Contracts of the kernels of Gaussian scale spaces (features/scale_space.h).
 *
 * Levels are rows of 16 bits in 1/128 grey level, [0, FV_SCALE_WHITE]. Rows are 64-byte aligned and
 * may be read, and outputs written, up to the width rounded up to FV_SCALE_LANES elements; what is
 * written beyond the width is undefined. Inputs and outputs do not overlap; every variant gives the
 * same bits. */
#ifndef FOVEA_KERNELS_CONTRACTS_SCALE_H
#define FOVEA_KERNELS_CONTRACTS_SCALE_H

#include <stdint.h>

enum {
    FV_SCALE_LANES = 32,
    FV_SCALE_WHITE = 255 * 128,
    FV_SCALE_RADIUS_MAX = 13,
    FV_SCALE_PAD = 32, /* elements on either side of the scratch row of a blur */
    FV_SCALE_LEVELS = 6,
    FV_SCALE_DIFFERENCES = FV_SCALE_LEVELS - 1
};

/* Elements of a row of a level. */
static inline int32_t fv_scale_stride(int32_t width)
{
    return (width + FV_SCALE_LANES - 1) / FV_SCALE_LANES * FV_SCALE_LANES;
}

/* One row of a (2 radius + 1) x (2 radius + 1) Gaussian. Down the columns, then along the row,
 * with t = (radius + 1) / 2 rounded down:
 *
 *     s(x) = t + (w[0] r[radius][x] >> 16) + sum over i of (w[i] (r[radius - i][x] +
 *            r[radius + i][x]) >> 16)
 *     out[x] = min(FV_SCALE_WHITE, the same of s(x - i), s(x + i))
 *
 * where t makes up for the rounding down; columns are reflected without repeating the edge. radius
 * in [1, FV_SCALE_RADIUS_MAX]; width > radius; w[0] + 2 (w[1] + ... + w[radius]) = 2^16. `scratch`:
 * fv_scale_stride(width) + 2 FV_SCALE_PAD elements, 64-byte aligned. */
typedef void fv_k_scale_blur_row_u16_fn(uint16_t *out, const uint16_t *const *rows, int32_t width,
                                        const uint16_t *weights, int32_t radius, uint16_t *scratch);

/* Extremes of differences of Gaussians in one row of an octave. rows[3 l + i] is row i (above, at,
 * below) of level l in [0, FV_SCALE_LEVELS), d(l) = level l + 1 - level l. Bit k in [0, 3) of
 * marks[x] is 1 where d(k + 1) at x is above `threshold` and at least each of its 26 neighbours in
 * d(k), d(k + 1) and d(k + 2), or below -threshold and at most each of them; 0 at the first and
 * the last x. width >= 3, threshold in [0, FV_SCALE_WHITE]. `scratch`: FV_SCALE_DIFFERENCES x 2 x
 * (fv_scale_stride(width) + 2 FV_SCALE_PAD) elements, 64-byte aligned. */
typedef void fv_k_scale_peaks_row_u16_fn(uint16_t *marks, const uint16_t *const *rows,
                                         int32_t width, int32_t threshold, int16_t *scratch);

#endif

/* The determinants of SURF (contracts/surf.h): compilers vectorise these loops well. */
#include "kernels/kernels.h"

/* What the boxes of a column sum to, for the three filters. */
static inline void column_sums(uint32_t *restrict xx, uint32_t *restrict yy, uint32_t *restrict xy,
                               const uint32_t *const *rows, int32_t first, int32_t width)
{
    const uint32_t *r[FV_SURF_BOX_ROWS];
    for (int32_t k = 0; k < FV_SURF_BOX_ROWS; k++)
        r[k] = rows[k] + first;
    for (int32_t x = 0; x < width; x++) {
        xx[x] = r[1][x] - r[0][x];
        yy[x] = r[3][x] - r[2][x] - 3 * (r[5][x] - r[4][x]);
        xy[x] = (r[7][x] - r[6][x]) - (r[9][x] - r[8][x]);
    }
}

static inline void determinants(float *restrict out, const uint32_t *xx, const uint32_t *yy,
                                const uint32_t *xy, int32_t side, int32_t step, int32_t count)
{
    const int32_t lobe = side / 3, half = side / 2, near = lobe / 2;
    const float scale = 1.f / (float)(FV_SURF_GREY * side * side);
    for (int32_t i = 0; i < count; i++) {
        const int32_t x = i * step;
        const int32_t sum_xx =
            (int32_t)(xx[x + half + 1] - xx[x - half] - 3 * (xx[x + near + 1] - xx[x - near]));
        const int32_t sum_yy = (int32_t)(yy[x + lobe] - yy[x - lobe + 1]);
        const int32_t sum_xy = (int32_t)((xy[x] - xy[x - lobe]) - (xy[x + lobe + 1] - xy[x + 1]));
        const float dxx = (float)sum_xx * scale, dyy = (float)sum_yy * scale,
                    dxy = (float)sum_xy * scale;
        out[i] = dxx * dyy - .81f * (dxy * dxy);
    }
}

void fv_k_surf_row_f32__c(float *out, const uint32_t *const *rows, int32_t side, int32_t step,
                          int32_t count, uint32_t *sums)
{
    const int32_t half = side / 2, width = (count - 1) * step + 2 * half + 2;
    uint32_t *xx = sums, *yy = xx + width, *xy = yy + width;
    column_sums(xx, yy, xy, rows, -half, width);
    xx += half;
    yy += half;
    xy += half;
    if (step == 2) /* loops of their own, in vectors */
        determinants(out, xx, yy, xy, side, 2, count);
    else if (step == 4)
        determinants(out, xx, yy, xy, side, 4, count);
    else
        determinants(out, xx, yy, xy, side, step, count);
}

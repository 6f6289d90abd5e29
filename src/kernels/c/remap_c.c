#include "kernels/kernels.h"

static uint8_t remap_blend(const uint8_t *p, ptrdiff_t stride, int32_t fx, int32_t fy)
{
    const int32_t top = 64 * p[0] + fx * (p[1] - p[0]);
    const int32_t bottom = 64 * p[stride] + fx * (p[stride + 1] - p[stride]);
    return (uint8_t)((top + (((bottom - top) * fy + 32) >> 6) + 32) >> 6);
}

void fv_k_remap_row_u8__c(uint8_t *out, const uint8_t *source, ptrdiff_t stride,
                          const struct fv_remap_block *blocks, int32_t count,
                          const struct fv_remap_pixel *scattered)
{
    for (int32_t k = 0; k < count; k++, out += FV_REMAP_BLOCK) {
        const struct fv_remap_block *block = &blocks[k];
        if (block->y == FV_REMAP_SCATTERED) {
            const struct fv_remap_pixel *pixel = scattered + block->first;
            for (int i = 0; i < FV_REMAP_BLOCK; i++, pixel++)
                out[i] = pixel->x < 0 ? 0
                                      : remap_blend(source + pixel->y * stride + pixel->x, stride,
                                                    pixel->fx, pixel->fy);
            continue;
        }
        const uint8_t *window = source + block->y * stride + block->x;
        for (int i = 0; i < FV_REMAP_BLOCK; i++) {
            const int at = block->at[i];
            const int row = (at & FV_REMAP_ROW_1 ? 1 : 0) + (at & FV_REMAP_ROW_2 ? 1 : 0);
            out[i] = at & FV_REMAP_OUTSIDE
                         ? 0
                         : remap_blend(window + row * stride + (at & FV_REMAP_COLUMN), stride,
                                       block->fx[i], block->fy[i]);
        }
    }
}

#include "kernels/contracts/grey_ends.h"
#include "kernels/kernels.h"

void fv_k_grey_shift_u16__c(uint8_t *grey, const uint8_t *source, int32_t count, int32_t shift)
{
    for (int32_t i = 0; i < count; i++) {
        const int32_t level = (source[2 * i] | source[2 * i + 1] << 8) >> shift;
        grey[i] = (uint8_t)(level < 255 ? level : 255);
    }
}

void fv_k_grey_pick_u8__c(uint8_t *grey, const uint8_t *source, int32_t count, int32_t offset)
{
    for (int32_t i = 0; i < count; i++)
        grey[i] = source[2 * i + offset];
}

void fv_k_grey_mix_u8__c(uint8_t *grey, const uint8_t *source, int32_t count, int32_t first,
                         int32_t third)
{
    for (int32_t i = 0; i < count; i++) {
        const uint8_t *s = source + 3 * i;
        grey[i] = (uint8_t)((first * s[0] + 19235 * s[1] + third * s[2] + 16384) >> 15);
    }
}

void fv_k_grey_bayer_u8__c(uint8_t *grey, const uint8_t *above, const uint8_t *row,
                           const uint8_t *below, int32_t count)
{
    fv_k_grey_bayer_ends(grey, above, row, below, count, 1);
}

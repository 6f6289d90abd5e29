#include "kernels/kernels.h"

void fv_k_grey_shift_u16__c(uint8_t *grey, const uint16_t *source, int32_t count, int32_t shift)
{
    for (int32_t i = 0; i < count; i++) {
        const int32_t level = source[i] >> shift;
        grey[i] = (uint8_t)(level < 255 ? level : 255);
    }
}

void fv_k_grey_pick_u8__c(uint8_t *grey, const uint8_t *source, int32_t count, int32_t offset)
{
    for (int32_t i = 0; i < count; i++) grey[i] = source[2 * i + offset];
}

#include "kernels/kernels.h"

static const float to_whole = 0x1.8p23f; /* added, it rounds what is below 2^22 to whole numbers */

void fv_k_nn_slopes_u8__c(const struct fv_nn_slopes *p, const uint8_t *in, ptrdiff_t ldi,
                          uint8_t *out, ptrdiff_t ldo, int32_t rows, int32_t count)
{
    const float rising = p->slopes[count];
    for (int32_t r = 0; r < rows; r++, in += ldi, out += ldo) {
        for (int32_t i = 0; i < count; i++) {
            const int32_t x = in[i] - p->zero_in;
            const float y = (float)x * (x < 0 ? p->slopes[i] : rising);
            const int32_t value = p->zero_out + (int32_t)(y + to_whole - to_whole);
            out[i] = (uint8_t)(value < 0 ? 0 : value > 255 ? 255 : value);
        }
    }
}

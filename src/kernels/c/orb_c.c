#include "kernels/kernels.h"

const uint8_t fv_moments_half_width[FV_MOMENTS_RADIUS + 1] = {15, 15, 15, 15, 14, 14, 14, 13,
                                                              13, 12, 11, 10, 9,  8,  6,  3};

static const uint16_t fv_blur7_weights[7] = {18, 34, 48, 56, 48, 34, 18};

void fv_k_blur7_row_u8__c(uint8_t *out, const uint8_t *const rows[7], int32_t width,
                          uint16_t *scratch)
{
    uint16_t *column = scratch + FV_BLUR7_RADIUS; /* sums down the columns: at most 255 * 256 */
    for (int32_t x = 0; x < width; x++) {
        uint32_t sum = 0;
        for (int i = 0; i < 7; i++)
            sum += (uint32_t)fv_blur7_weights[i] * rows[i][x];
        column[x] = (uint16_t)sum;
    }
    for (int32_t i = 1; i <= FV_BLUR7_RADIUS; i++) {
        column[-i] = column[i];
        column[width - 1 + i] = column[width - 1 - i];
    }
    for (int32_t x = 0; x < width; x++) {
        uint32_t sum = 32768;
        for (int j = 0; j < 7; j++)
            sum += (uint32_t)fv_blur7_weights[j] * column[x + j - FV_BLUR7_RADIUS];
        out[x] = (uint8_t)(sum >> 16);
    }
}

void fv_k_moments_u8__c(int32_t *m, const uint8_t *image, ptrdiff_t stride, const int32_t *centres,
                        int32_t count)
{
    for (int32_t k = 0; k < count; k++) {
        const uint8_t *centre = image + centres[k];
        int32_t m10 = 0, m01 = 0;
        for (int32_t v = -FV_MOMENTS_RADIUS; v <= FV_MOMENTS_RADIUS; v++) {
            const int32_t half = fv_moments_half_width[v < 0 ? -v : v];
            for (int32_t u = -half; u <= half; u++) {
                m10 += u * centre[v * stride + u];
                m01 += v * centre[v * stride + u];
            }
        }
        m[2 * k] = m10;
        m[2 * k + 1] = m01;
    }
}

void fv_k_brief_u8__c(uint8_t descriptor[FV_DESCRIPTOR_BYTES], const uint8_t *centre,
                      const int8_t positions[4 * FV_BRIEF_BITS], int32_t along, int32_t across)
{
    for (int i = 0; i < FV_DESCRIPTOR_BYTES; i++) {
        unsigned byte = 0;
        for (int bit = 0; bit < 8; bit++) {
            const int8_t *first = positions + 2 * (8 * i + bit),
                         *second = first + 2 * FV_BRIEF_BITS;
            const int less = centre[along * first[0] + across * first[1]] <
                             centre[along * second[0] + across * second[1]];
            byte |= (unsigned)less << bit;
        }
        descriptor[i] = (uint8_t)byte;
    }
}

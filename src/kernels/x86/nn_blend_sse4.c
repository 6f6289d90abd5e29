/* Bilinear resize: 16 channels of a pixel at a time, in 16-bit then 32-bit arithmetic. */
#include "kernels/kernels.h"
#include "kernels/x86/nn_sse4.h"

struct blend {
    __m128i upper, lower, half, middle, shift;
};

/* Two rows' sum of channels 0-7 and 8-15. */
FV_INLINE void weigh(const uint8_t *top, const uint8_t *bottom, const struct blend *b,
                     __m128i sum[2])
{
    const __m128i zero = _mm_setzero_si128(), t = load16(top), u = load16(bottom);
    sum[0] = _mm_add_epi16(_mm_mullo_epi16(_mm_unpacklo_epi8(t, zero), b->upper),
                           _mm_mullo_epi16(_mm_unpacklo_epi8(u, zero), b->lower));
    sum[1] = _mm_add_epi16(_mm_mullo_epi16(_mm_unpackhi_epi8(t, zero), b->upper),
                           _mm_mullo_epi16(_mm_unpackhi_epi8(u, zero), b->lower));
}

/* Four channels. `is_moved`: whether there are values below the middle, whose halves are rounded
 * down. */
FV_INLINE __m128i round4(__m128i sums, __m128i pair, const struct blend *b, const int is_moved)
{
    __m128i v = _mm_madd_epi16(sums, pair);
    if (is_moved) v = _mm_add_epi32(v, _mm_cmpgt_epi32(b->middle, v));
    return _mm_srl_epi32(_mm_add_epi32(v, b->half), b->shift);
}

/* 16 channels from c on of all pixels. The sum of two rows serves all outputs between the same
 * columns. */
FV_INLINE void blend(const struct fv_nn_blend *p, const struct blend *b, const uint8_t *top,
                     const uint8_t *bottom, int32_t c, uint8_t *out, const int is_moved)
{
    const int32_t one = 1 << p->bits, width = p->channels - c < 16 ? p->channels - c : 16;
    const int32_t *entry = p->columns;
    __m128i sums[4] = {_mm_setzero_si128()};
    int32_t left = -1, right = -1;
    for (int32_t x = 0; x < p->out_w; x++, entry += 3, out += p->out_stride) {
        if (entry[0] != left || entry[1] != right) {
            left = entry[0];
            right = entry[1];
            const ptrdiff_t at = (ptrdiff_t)left * p->in_stride + c,
                            beside = (ptrdiff_t)right * p->in_stride + c;
            __m128i first[2], second[2];
            weigh(top + at, bottom + at, b, first);
            weigh(top + beside, bottom + beside, b, second);
            for (int h = 0; h < 2; h++) {
                sums[2 * h] = _mm_unpacklo_epi16(first[h], second[h]);
                sums[2 * h + 1] = _mm_unpackhi_epi16(first[h], second[h]);
            }
        }
        const __m128i pair =
            _mm_set1_epi32((int32_t)((uint32_t)entry[2] << 16 | (uint32_t)(one - entry[2])));
        const __m128i low = _mm_packus_epi32(round4(sums[0], pair, b, is_moved),
                                             round4(sums[1], pair, b, is_moved));
        const __m128i high = _mm_packus_epi32(round4(sums[2], pair, b, is_moved),
                                              round4(sums[3], pair, b, is_moved));
        store_some(out + c, _mm_packus_epi16(low, high), width);
    }
}

void fv_k_nn_blend_u8__sse4(const struct fv_nn_blend *p, const uint8_t *top, const uint8_t *bottom,
                            int32_t weight, uint8_t *out)
{
    if (p->bits > 7) { /* sums of two rows do not fit 16 bits with a sign */
        fv_k_nn_blend_u8__c(p, top, bottom, weight, out);
        return;
    }
    const int32_t one = 1 << p->bits;
    const struct blend b = {.upper = _mm_set1_epi16((short)(one - weight)),
                            .lower = _mm_set1_epi16((short)weight),
                            .half = _mm_set1_epi32((1 << 2 * p->bits) >> 1),
                            .middle = _mm_set1_epi32(p->bits == 0 ? 0 : p->middle << 2 * p->bits),
                            .shift = _mm_cvtsi32_si128(2 * p->bits)};
    for (int32_t c = 0; c < p->channels; c += 16) {
        if (p->middle == 0)
            blend(p, &b, top, bottom, c, out, 0);
        else
            blend(p, &b, top, bottom, c, out, 1);
    }
}

#include "kernels/kernels.h"

#include <immintrin.h>

/* Pairs of horizontal neighbours (bytes) to 64 times their blend (words). */
static inline __m128i remap_eight(const uint8_t *window, ptrdiff_t stride,
                                  const struct fv_remap_block *block)
{
    const __m128i at = _mm_loadl_epi64((const __m128i *)block->at);
    const __m128i twice = _mm_unpacklo_epi8(at, at);
    const __m128i pick =
        _mm_add_epi8(twice, _mm_set1_epi16(0x100)); /* the pixel and its right neighbour */
    __m128i row[FV_REMAP_WINDOW_ROWS];
    for (int i = 0; i < FV_REMAP_WINDOW_ROWS; i++)
        row[i] = _mm_shuffle_epi8(_mm_loadu_si128((const __m128i *)(window + i * stride)), pick);
    /* Blending looks at the top bit of each byte: bring FV_REMAP_ROW_1 and FV_REMAP_ROW_2 there. */
    const __m128i row_1 = _mm_slli_epi16(twice, 3), row_2 = _mm_slli_epi16(twice, 2);
    const __m128i above = _mm_blendv_epi8(_mm_blendv_epi8(row[0], row[1], row_1), row[2], row_2);
    const __m128i below = _mm_blendv_epi8(_mm_blendv_epi8(row[1], row[2], row_1), row[3], row_2);

    const __m128i fx = _mm_loadl_epi64((const __m128i *)block->fx);
    const __m128i weights = _mm_unpacklo_epi8(_mm_sub_epi8(_mm_set1_epi8(64), fx), fx);
    const __m128i top = _mm_maddubs_epi16(above, weights),
                  bottom = _mm_maddubs_epi16(below, weights);
    const __m128i fy =
        _mm_slli_epi16(_mm_cvtepu8_epi16(_mm_loadl_epi64((const __m128i *)block->fy)), 9);
    const __m128i sum = _mm_add_epi16(top, _mm_mulhrs_epi16(_mm_sub_epi16(bottom, top), fy));
    return _mm_srli_epi16(_mm_add_epi16(sum, _mm_set1_epi16(32)), 6);
}

void fv_k_remap_row_u8__sse4(uint8_t *out, const uint8_t *source, ptrdiff_t stride,
                             const struct fv_remap_block *blocks, int32_t count,
                             const struct fv_remap_pixel *scattered)
{
    for (int32_t k = 0; k < count; k++, out += FV_REMAP_BLOCK) {
        const struct fv_remap_block *block = &blocks[k];
        if (block->y == FV_REMAP_SCATTERED) {
            fv_k_remap_row_u8__c(out, source, stride, block, 1, scattered);
            continue;
        }
        const __m128i words = remap_eight(source + block->y * stride + block->x, stride, block);
        _mm_storel_epi64((__m128i *)out, _mm_packus_epi16(words, words));
    }
}

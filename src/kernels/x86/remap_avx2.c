#include "kernels/kernels.h"

#include <immintrin.h>

/* As the SSE4 variant, one block in each 128-bit lane. */
static inline __m256i remap_pair(const void *low, const void *high)
{
    return _mm256_inserti128_si256(_mm256_castsi128_si256(_mm_loadu_si128((const __m128i *)low)),
                                   _mm_loadu_si128((const __m128i *)high), 1);
}

/* Eight bytes of each block, in the low halves of the lanes. */
static inline __m256i remap_bytes(const uint8_t *low, const uint8_t *high)
{
    return _mm256_inserti128_si256(_mm256_castsi128_si256(_mm_loadl_epi64((const __m128i *)low)),
                                   _mm_loadl_epi64((const __m128i *)high), 1);
}

static inline __m128i remap_sixteen(const uint8_t *a, const uint8_t *b, ptrdiff_t stride,
                                    const struct fv_remap_block *block)
{
    const __m256i at = remap_bytes(block[0].at, block[1].at);
    const __m256i twice = _mm256_unpacklo_epi8(at, at);
    const __m256i pick = _mm256_add_epi8(twice, _mm256_set1_epi16(0x100));
    __m256i row[FV_REMAP_WINDOW_ROWS];
    for (int i = 0; i < FV_REMAP_WINDOW_ROWS; i++)
        row[i] = _mm256_shuffle_epi8(remap_pair(a + i * stride, b + i * stride), pick);
    const __m256i row_1 = _mm256_slli_epi16(twice, 3), row_2 = _mm256_slli_epi16(twice, 2);
    const __m256i above =
        _mm256_blendv_epi8(_mm256_blendv_epi8(row[0], row[1], row_1), row[2], row_2);
    const __m256i below =
        _mm256_blendv_epi8(_mm256_blendv_epi8(row[1], row[2], row_1), row[3], row_2);

    const __m256i fx = remap_bytes(block[0].fx, block[1].fx);
    const __m256i weights = _mm256_unpacklo_epi8(_mm256_sub_epi8(_mm256_set1_epi8(64), fx), fx);
    const __m256i top = _mm256_maddubs_epi16(above, weights),
                  bottom = _mm256_maddubs_epi16(below, weights);
    const __m256i fy_bytes = remap_bytes(block[0].fy, block[1].fy);
    const __m256i fy = _mm256_slli_epi16(_mm256_unpacklo_epi8(fy_bytes, _mm256_setzero_si256()), 9);
    const __m256i sum =
        _mm256_add_epi16(top, _mm256_mulhrs_epi16(_mm256_sub_epi16(bottom, top), fy));
    const __m256i words = _mm256_srli_epi16(_mm256_add_epi16(sum, _mm256_set1_epi16(32)), 6);
    return _mm_packus_epi16(_mm256_castsi256_si128(words), _mm256_extracti128_si256(words, 1));
}

void fv_k_remap_row_u8__avx2(uint8_t *out, const uint8_t *source, ptrdiff_t stride,
                             const struct fv_remap_block *blocks, int32_t count,
                             const struct fv_remap_pixel *scattered)
{
    int32_t k = 0;
    for (; k + 2 <= count; k += 2) {
        const struct fv_remap_block *block = &blocks[k];
        if (block[0].y == FV_REMAP_SCATTERED || block[1].y == FV_REMAP_SCATTERED) {
            fv_k_remap_row_u8__c(out + k * FV_REMAP_BLOCK, source, stride, block, 2, scattered);
            continue;
        }
        const __m128i pixels =
            remap_sixteen(source + block[0].y * stride + block[0].x,
                          source + block[1].y * stride + block[1].x, stride, block);
        _mm_storeu_si128((__m128i *)(out + k * FV_REMAP_BLOCK), pixels);
    }
    fv_k_remap_row_u8__c(out + k * FV_REMAP_BLOCK, source, stride, blocks + k, count - k,
                         scattered);
}

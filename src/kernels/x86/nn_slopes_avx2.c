/* Slopes by channel of bytes, in float32. */
#include "kernels/kernels.h"
#include "kernels/x86/nn_avx2.h"

enum { SLOPES_LANES = 16 };

struct job {
    __m256i zero_in, zero_out;
    __m256 rising;
};

/* The results of eight bytes, without the output's zero point. */
FV_INLINE __m256i eight(const struct job *j, const uint8_t *in, const float *slopes)
{
    const __m256i words = _mm256_cvtepu8_epi32(_mm_loadl_epi64((const __m128i *)(const void *)in));
    const __m256 x = _mm256_cvtepi32_ps(_mm256_sub_epi32(words, j->zero_in));
    const __m256 slope = _mm256_blendv_ps(j->rising, _mm256_loadu_ps(slopes), x);
    return _mm256_cvtps_epi32(_mm256_mul_ps(x, slope));
}

/* Words saturate to 16 bits first: what they lose lies beyond a byte with any zero point. */
FV_INLINE __m128i sixteen(const struct job *j, const uint8_t *in, const float *slopes)
{
    const __m256i mixed = _mm256_packs_epi32(eight(j, in, slopes), eight(j, in + 8, slopes + 8));
    const __m256i sum = _mm256_adds_epi16(_mm256_permute4x64_epi64(mixed, 0xd8), j->zero_out);
    return _mm_packus_epi16(_mm256_castsi256_si128(sum), _mm256_extracti128_si256(sum, 1));
}

#include "kernels/nn_slopes_rows.h"

FV_INLINE struct job job_of(const struct fv_nn_slopes *p, float rising)
{
    return (struct job){_mm256_set1_epi32(p->zero_in), _mm256_set1_epi16((short)p->zero_out),
                        _mm256_set1_ps(rising)};
}

FV_INLINE void vector(const struct job *job, const uint8_t *in, const float *slopes, uint8_t *out)
{
    _mm_storeu_si128((__m128i *)(void *)out, sixteen(job, in, slopes));
}

void fv_k_nn_slopes_u8__avx2(const struct fv_nn_slopes *p, const uint8_t *in, ptrdiff_t ldi,
                             uint8_t *out, ptrdiff_t ldo, int32_t rows, int32_t count)
{
    slopes_rows(p, in, ldi, out, ldo, rows, count);
}

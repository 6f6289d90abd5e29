/* Slopes by channel of bytes, in float32. */
#include "kernels/kernels.h"
#include "kernels/x86/nn_sse4.h"

enum { SLOPES_LANES = 16 };

struct job {
    __m128i zero_in, zero_out;
    __m128 rising;
};

/* The results of bytes 0 to 3, without the output's zero point. */
FV_INLINE __m128i four(const struct job *j, __m128i bytes, const float *slopes)
{
    const __m128 x = _mm_cvtepi32_ps(_mm_sub_epi32(_mm_cvtepu8_epi32(bytes), j->zero_in));
    return _mm_cvtps_epi32(_mm_mul_ps(x, _mm_blendv_ps(j->rising, _mm_loadu_ps(slopes), x)));
}

/* Words saturate to 16 bits first: what they lose lies beyond a byte with any zero point. */
FV_INLINE __m128i sixteen(const struct job *j, __m128i v, const float *slopes)
{
    const __m128i low =
        _mm_packs_epi32(four(j, v, slopes), four(j, _mm_srli_si128(v, 4), slopes + 4));
    const __m128i high = _mm_packs_epi32(four(j, _mm_srli_si128(v, 8), slopes + 8),
                                         four(j, _mm_srli_si128(v, 12), slopes + 12));
    return _mm_packus_epi16(_mm_adds_epi16(low, j->zero_out), _mm_adds_epi16(high, j->zero_out));
}

#include "kernels/nn_slopes_rows.h"

FV_INLINE struct job job_of(const struct fv_nn_slopes *p, float rising)
{
    return (struct job){_mm_set1_epi32(p->zero_in), _mm_set1_epi16((short)p->zero_out),
                        _mm_set1_ps(rising)};
}

FV_INLINE void vector(const struct job *job, const uint8_t *in, const float *slopes, uint8_t *out)
{
    _mm_storeu_si128((__m128i *)(void *)out, sixteen(job, load16(in), slopes));
}

void fv_k_nn_slopes_u8__sse4(const struct fv_nn_slopes *p, const uint8_t *in, ptrdiff_t ldi,
                             uint8_t *out, ptrdiff_t ldo, int32_t rows, int32_t count)
{
    slopes_rows(p, in, ldi, out, ldo, rows, count);
}

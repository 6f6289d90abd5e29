/* Slopes by channel of bytes, in float32. */
#include "kernels/kernels.h"
#include "kernels/x86/nn_avx512.h"

struct job {
    __m512i zero_in;
    __m512 rising;
    struct clamp64 clamp;
};

/* 16 products, rounded to whole numbers; `x` as read. */
FV_INLINE __m512i products(const struct job *j, __m512i x, __m512 falling)
{
    const __m512 value = _mm512_cvtepi32_ps(_mm512_sub_epi32(x, j->zero_in));
    const __mmask16 falls = _mm512_movepi32_mask(_mm512_castps_si512(value));
    return _mm512_cvtps_epi32(_mm512_mul_ps(value, _mm512_mask_mov_ps(j->rising, falls, falling)));
}

/* 64 bytes; `falling`: their slopes in the order of transpose_lanes. */
FV_INLINE __m512i slopes64(const struct job *j, __m512i bytes, const __m512i falling[4])
{
    const __m512i none = _mm512_setzero_si512();
    const __m512i low = _mm512_unpacklo_epi8(bytes, none), high = _mm512_unpackhi_epi8(bytes, none);
    const __m512i x[4] = {_mm512_unpacklo_epi16(low, none), _mm512_unpackhi_epi16(low, none),
                          _mm512_unpacklo_epi16(high, none), _mm512_unpackhi_epi16(high, none)};
    __m512i y[4];
#pragma GCC unroll 4
    for (int q = 0; q < 4; q++)
        y[q] = products(j, x[q], _mm512_castsi512_ps(falling[q]));
    return pack_lanes(y[0], y[1], y[2], y[3], &j->clamp, 0);
}

/* Rows without gap as one run of bytes, in which the channels repeat: every `step`-th 64 bytes are
 * of the same channels. */
static void run_of_rows(const struct job *j, const struct fv_nn_slopes *p, const uint8_t *in,
                        uint8_t *out, ptrdiff_t total, int32_t count)
{
    int32_t step = count;
    while (step % 64 != 0)
        step += count;
    for (int32_t first = 0; first < step && first < total; first += 64) {
        __m512i words[4], falling[4];
        for (int32_t lane = 0; lane < 4; lane++)
            words[lane] = _mm512_loadu_si512(p->slopes + (first + 16 * lane) % count);
        transpose_lanes(words, falling);
        for (ptrdiff_t i = first; i < total; i += step) {
            const __mmask64 some = first_bytes(total - i);
            _mm512_mask_storeu_epi8(out + i, some,
                                    slopes64(j, _mm512_maskz_loadu_epi8(some, in + i), falling));
        }
    }
}

void fv_k_nn_slopes_u8__avx512(const struct fv_nn_slopes *p, const uint8_t *in, ptrdiff_t ldi,
                               uint8_t *out, ptrdiff_t ldo, int32_t rows, int32_t count)
{
    const struct job job = {_mm512_set1_epi32(p->zero_in), _mm512_set1_ps(p->slopes[count]),
                            clamp_of(p->zero_out, 0, 255)};
    if (count % 16 == 0 && ldi == count && ldo == count) {
        run_of_rows(&job, p, in, out, (ptrdiff_t)rows * count, count);
        return;
    }
    const __m512i zero_out = _mm512_set1_epi32(p->zero_out);
    for (int32_t r = 0; r < rows; r++) {
        for (int32_t i = 0; i < count; i += 16) {
            const __mmask16 some =
                (__mmask16)(count - i < 16 ? (1u << (count - i)) - 1 : UINT16_MAX);
            const __m128i bytes = _mm_maskz_loadu_epi8(some, in + r * ldi + i);
            const __m512i y = _mm512_add_epi32(products(&job, _mm512_cvtepu8_epi32(bytes),
                                                        _mm512_maskz_loadu_ps(some, p->slopes + i)),
                                               zero_out);
            const __m512i positive = _mm512_max_epi32(y, _mm512_setzero_si512());
            _mm_mask_storeu_epi8(out + r * ldo + i, some, _mm512_cvtusepi32_epi8(positive));
        }
    }
}

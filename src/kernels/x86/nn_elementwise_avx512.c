#include "kernels/kernels.h"
#include "kernels/x86/nn_avx512.h"

void fv_k_nn_max_u8__avx512(const uint8_t *a, const uint8_t *b, uint8_t *out, int32_t count)
{
    for (int32_t i = 0; i < count; i += 64) {
        const __mmask64 mask = first_bytes(count - i);
        _mm512_mask_storeu_epi8(out + i, mask,
                                _mm512_max_epu8(_mm512_maskz_loadu_epi8(mask, a + i),
                                                _mm512_maskz_loadu_epi8(mask, b + i)));
    }
}

void fv_k_nn_min_u8__avx512(const uint8_t *a, const uint8_t *b, uint8_t *out, int32_t count)
{
    for (int32_t i = 0; i < count; i += 64) {
        const __mmask64 mask = first_bytes(count - i);
        _mm512_mask_storeu_epi8(out + i, mask,
                                _mm512_min_epu8(_mm512_maskz_loadu_epi8(mask, a + i),
                                                _mm512_maskz_loadu_epi8(mask, b + i)));
    }
}

struct blend {
    __m512i upper, lower, pair, half,
        middle; /* pair: the weights of the two columns beside each other */
    __m512i rows, left,
        right; /* of more than 7 bits: of the two rows beside each other, of each column */
    __m128i shift;
};

FV_INLINE __m512i load32(const uint8_t *from)
{
    return _mm512_cvtepu8_epi16(_mm256_loadu_si256((const __m256i *)(const void *)from));
}

/* 32 channels of one output pixel: low and high four of each lane in turn. */
FV_INLINE __m256i round32(__m512i low, __m512i high, const struct blend *b)
{
    const __m512i down = _mm512_sub_epi32(b->half, _mm512_set1_epi32(1));
    low = _mm512_add_epi32(
        low, _mm512_mask_mov_epi32(b->half, _mm512_cmpgt_epi32_mask(b->middle, low), down));
    high = _mm512_add_epi32(
        high, _mm512_mask_mov_epi32(b->half, _mm512_cmpgt_epi32_mask(b->middle, high), down));
    return _mm512_cvtepi16_epi8(
        _mm512_packus_epi32(_mm512_srl_epi32(low, b->shift), _mm512_srl_epi32(high, b->shift)));
}

/* From the four corners, in 16-bit then 32-bit arithmetic. */
FV_INLINE __m256i blend32(const uint8_t *const corner[4], ptrdiff_t c, const struct blend *b)
{
    const __m512i left = _mm512_add_epi16(_mm512_mullo_epi16(load32(corner[0] + c), b->upper),
                                          _mm512_mullo_epi16(load32(corner[1] + c), b->lower));
    const __m512i right = _mm512_add_epi16(_mm512_mullo_epi16(load32(corner[2] + c), b->upper),
                                           _mm512_mullo_epi16(load32(corner[3] + c), b->lower));
    return round32(_mm512_madd_epi16(_mm512_unpacklo_epi16(left, right), b->pair),
                   _mm512_madd_epi16(_mm512_unpackhi_epi16(left, right), b->pair), b);
}

/* The same in 32-bit arithmetic, for weights of more than 7 bits. */
FV_INLINE __m256i blend32_wide(const uint8_t *const corner[4], ptrdiff_t c, const struct blend *b)
{
    __m512i v[4];
#pragma GCC unroll 4
    for (int i = 0; i < 4; i++)
        v[i] = load32(corner[i] + c);
    const __m512i low_left = _mm512_madd_epi16(_mm512_unpacklo_epi16(v[0], v[1]), b->rows);
    const __m512i low_right = _mm512_madd_epi16(_mm512_unpacklo_epi16(v[2], v[3]), b->rows);
    const __m512i high_left = _mm512_madd_epi16(_mm512_unpackhi_epi16(v[0], v[1]), b->rows);
    const __m512i high_right = _mm512_madd_epi16(_mm512_unpackhi_epi16(v[2], v[3]), b->rows);
    return round32(_mm512_add_epi32(_mm512_mullo_epi32(low_left, b->left),
                                    _mm512_mullo_epi32(low_right, b->right)),
                   _mm512_add_epi32(_mm512_mullo_epi32(high_left, b->left),
                                    _mm512_mullo_epi32(high_right, b->right)),
                   b);
}

/* Two 16-bit weights beside each other. */
FV_INLINE __m512i pair_of(int32_t first, int32_t second)
{
    return _mm512_set1_epi32((int32_t)((uint32_t)second << 16 | (uint32_t)first));
}

void fv_k_nn_blend_u8__avx512(const struct fv_nn_blend *p, const uint8_t *top,
                              const uint8_t *bottom, int32_t weight, uint8_t *out)
{
    const int32_t one = 1 << p->bits;
    struct blend b = {.upper = _mm512_set1_epi16((short)(one - weight)),
                      .lower = _mm512_set1_epi16((short)weight),
                      .half = _mm512_set1_epi32((1 << 2 * p->bits) >> 1),
                      .shift = _mm_cvtsi32_si128(2 * p->bits),
                      .middle = _mm512_set1_epi32(p->bits == 0 ? 0 : p->middle << 2 * p->bits),
                      .rows = pair_of(one - weight, weight)};
    for (int32_t x = 0; x < p->out_w; x++, out += p->out_stride) {
        const int32_t *entry = p->columns + (ptrdiff_t)3 * x;
        const ptrdiff_t left = (ptrdiff_t)entry[0] * p->in_stride,
                        right = (ptrdiff_t)entry[1] * p->in_stride;
        const uint8_t *const corner[4] = {top + left, bottom + left, top + right, bottom + right};
        b.pair = pair_of(one - entry[2], entry[2]);
        b.left = _mm512_set1_epi32(one - entry[2]);
        b.right = _mm512_set1_epi32(entry[2]);
        for (int32_t c = 0; c < p->channels; c += 32) {
            const __mmask32 mask =
                p->channels - c >= 32 ? ~UINT32_C(0) : ~UINT32_C(0) >> (32 - (p->channels - c));
            _mm256_mask_storeu_epi8(
                out + c, mask, p->bits <= 7 ? blend32(corner, c, &b) : blend32_wide(corner, c, &b));
        }
    }
}

void fv_k_nn_gather_u8__avx512(const uint8_t *in, ptrdiff_t step, uint8_t *out, ptrdiff_t pitch,
                               int32_t run, int32_t count)
{
    if (run <= 16) { /* of pictures, whose pixels have one value or three */
        for (int32_t i = 0; i < count; i++, in += step, out += pitch)
            _mm_storeu_si128((__m128i *)(void *)out,
                             _mm_loadu_si128((const __m128i *)(const void *)in));
        return;
    }
    const int32_t whole = run / 64 * 64;
    const __mmask64 rest = run == whole ? 0 : first_bytes(run - whole);
    for (int32_t i = 0; i < count; i++, in += step, out += pitch) {
        for (int32_t at = 0; at < whole; at += 64)
            _mm512_storeu_si512(out + at, _mm512_loadu_si512(in + at));
        if (rest != 0)
            _mm512_mask_storeu_epi8(out + whole, rest, _mm512_maskz_loadu_epi8(rest, in + whole));
    }
}

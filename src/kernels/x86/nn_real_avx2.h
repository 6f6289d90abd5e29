/* Rounding by real numbers that gives the bytes of fv_nn_requantize: where all channels have one
 * multiplier and shift, as networks of unsigned bytes have, a product of float32 takes a third of
 * the steps of an exact one of 64 bits.
 *
 * Both ways never fall as the sum rises. So they give the same bytes for all sums, if they do at
 * the 255 sums at most where the exact one comes to a byte, and at the sums just below. That is
 * tried here for each call, with the offset that equals the exact way's two roundings, and with
 * neighbours of it and of the factor. Where none of them fits, the exact way is taken.
 *
 * With a multiplier m and a shift of -e the exact way comes to u at the least sum that is not below
 * (u 2^(31 + e) - 2^(30 + e) - 2^30) / m where u is above zero, and 2^31 / m later elsewhere. */
#ifndef FOVEA_KERNELS_X86_NN_REAL_AVX2_H
#define FOVEA_KERNELS_X86_NN_REAL_AVX2_H

#include "base/elementary.h"
#include "kernels/x86/nn_avx2.h"

enum {
    REAL_SHIFT_LEAST = -14,   /* below it sums are not exact as float32 */
    REAL_STEPS = 32,          /* of eight bytes */
    REAL_RESULTS_LEAST = 2048 /* fewer take longer to prove than to round */
};

/* Where the exact way comes to bytes: the byte less the zero, and the sum. */
struct rises {
    int count;
    __m256i to[REAL_STEPS], at[REAL_STEPS];
};

/* Sums of four of them; 0 where one is so near a whole number that double may err. */
FV_INLINE int find_sums(__m128i to, double each, double above, double below, __m128i *at)
{
    const __m256d u = _mm256_cvtepi32_pd(to), near = _mm256_set1_pd(1.0 / (1 << 20));
    const __m256d add = _mm256_blendv_pd(_mm256_set1_pd(above), _mm256_set1_pd(below),
                                         _mm256_cmp_pd(u, _mm256_setzero_pd(), _CMP_LE_OQ));
    const __m256d sum = _mm256_add_pd(_mm256_mul_pd(u, _mm256_set1_pd(each)), add),
                  next = _mm256_ceil_pd(sum), left = _mm256_sub_pd(next, sum);
    const __m256d unsure =
        _mm256_or_pd(_mm256_cmp_pd(left, near, _CMP_LT_OQ),
                     _mm256_cmp_pd(left, _mm256_sub_pd(_mm256_set1_pd(1.0), near), _CMP_GT_OQ));
    *at = _mm256_cvtpd_epi32(next);
    return _mm256_movemask_pd(unsure) == 0;
}

static int find_rises(struct rises *r, int32_t multiplier, int32_t shift, int32_t first,
                      int32_t last)
{
    const double m = (double)multiplier, power = (double)(INT64_C(1) << (30 - shift)),
                 each = 2.0 * power / m, above = (-power - 0x1p30) / m,
                 below = (-power + 0x1p30) / m;
    const __m256i most = _mm256_set1_epi32(last);
    __m256i to =
        _mm256_add_epi32(_mm256_set1_epi32(first), _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7));
    r->count = 0;
    for (int32_t u = first; u <= last; u += 8, to = _mm256_add_epi32(to, _mm256_set1_epi32(8))) {
        const __m256i these = _mm256_min_epi32(to, most);
        __m128i low, high;
        if (!find_sums(_mm256_castsi256_si128(these), each, above, below, &low) ||
            !find_sums(_mm256_extracti128_si256(these, 1), each, above, below, &high))
            return 0;
        r->to[r->count] = these;
        r->at[r->count++] = _mm256_set_m128i(high, low);
    }
    return 1;
}

FV_INLINE int is_equal(const struct rises *r, const struct scale8 *s, const int mode)
{
    for (int i = 0; i < r->count; i++) {
        const __m256i before = _mm256_add_epi32(r->at[i], _mm256_set1_epi32(-1));
        const __m256i late = _mm256_cmpgt_epi32(r->to[i], requantize_real(r->at[i], s, mode));
        const __m256i early = _mm256_cmpgt_epi32(r->to[i], requantize_real(before, s, mode));
        if (_mm256_movemask_epi8(_mm256_andnot_si256(late, early)) != -1) return 0;
    }
    return 1;
}

/* REAL and perhaps ABOVE_ZERO, or 0, for results that are moved by `zero` and clamped to [low,
 * high]. */
static int find_real(struct scale8 *s, int32_t multiplier, int32_t shift, int32_t zero, int32_t low,
                     int32_t high)
{
    static const int8_t factors[] = {0, 1, -1}, offsets[] = {0, 1, -1, 2, -2};
    const int mode = REAL | (low >= zero ? ABOVE_ZERO : 0);
    struct rises r;
    if (multiplier < 1 << 30 || shift < REAL_SHIFT_LEAST || shift >= 0 ||
        !find_rises(&r, multiplier, shift, low + 1 - zero, high - zero))
        return 0;
    const double half = 1.0 / (double)(2 << -shift);
    const float factor = (float)((double)multiplier * half * 0x1p-30);
    for (size_t i = 0; i < sizeof factors; i++) {
        for (size_t j = 0; j < sizeof offsets; j++) {
            s->factor = _mm256_set1_ps(fv_float_step(factor, factors[i]));
            s->offset = _mm256_set1_ps((float)(half + 0x1p-19 * offsets[j]));
            if (mode == REAL ? is_equal(&r, s, REAL) : is_equal(&r, s, REAL | ABOVE_ZERO))
                return mode;
        }
    }
    return 0;
}

/* Whether `count` channels have one multiplier and shift. */
static int have_one_scale(const int32_t *multiplier, const int32_t *shift, int32_t count)
{
    const __m256i m = _mm256_set1_epi32(multiplier[0]), s = _mm256_set1_epi32(shift[0]);
    int32_t i = 0;
    for (; i + 8 <= count; i += 8) {
        const __m256i one = _mm256_and_si256(_mm256_cmpeq_epi32(m, load32(multiplier + i)),
                                             _mm256_cmpeq_epi32(s, load32(shift + i)));
        if (_mm256_movemask_epi8(one) != -1) return 0;
    }
    for (; i < count; i++)
        if (multiplier[i] != multiplier[0] || shift[i] != shift[0]) return 0;
    return 1;
}

#endif

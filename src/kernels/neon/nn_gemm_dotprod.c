/* ARMv8.2 with dot products: bytes as signed numbers (128 less), 16 inputs of a row at a time by
 * lane. */
#include "kernels/neon/nn_gemm_frame.h"

FV_INLINE void start_of(const int8_t *w, int32_t k4, int32x4_t start[4])
{
    const int8x16_t ones = vdupq_n_s8(1);
    for (int i = 0; i < 4; i++)
        start[i] = vdupq_n_s32(0);
    for (int32_t k = 0; k < k4; k++, w += 64) {
        for (int i = 0; i < 4; i++)
            start[i] = vdotq_s32(start[i], vld1q_s8(w + 16 * i), ones);
    }
    for (int i = 0; i < 4; i++)
        start[i] = vshlq_n_s32(start[i], 7);
}

#define LANE(lane)                                                                                 \
    for (int i = 0; i < 4; i++) {                                                                  \
        const int8x16_t v = vld1q_s8(w + 64 * (lane) + 16 * i);                                    \
        for (int r = 0; r < TILE_ROWS; r++)                                                        \
            acc[r][i] = vdotq_laneq_s32(acc[r][i], v, x[r], lane);                                 \
    }

FV_INLINE void accumulate(const uint8_t *const row[TILE_ROWS], const int8_t *w, int32_t k4,
                          int32x4_t acc[TILE_ROWS][4])
{
    const uint8x16_t flip = vdupq_n_u8(128);
    int8x16_t x[TILE_ROWS];
    int32_t k = 0;
    for (; k + 4 <= k4; k += 4, w += 256) {
        for (int r = 0; r < TILE_ROWS; r++)
            x[r] = vreinterpretq_s8_u8(veorq_u8(vld1q_u8(row[r] + 4 * k), flip));
        LANE(0)
        LANE(1)
        LANE(2)
        LANE(3)
    }
    for (; k < k4; k++, w += 64) {
        for (int r = 0; r < TILE_ROWS; r++) {
            uint32_t word;
            memcpy(&word, row[r] + 4 * k, 4);
            x[r] = vreinterpretq_s8_u32(vdupq_n_u32(word ^ 0x80808080u));
        }
        LANE(0)
    }
}

void fv_k_nn_gemm_u8__dotprod(const struct fv_nn_gemm *g, const uint8_t *a, ptrdiff_t lda,
                              uint8_t *out, ptrdiff_t ldo, int32_t m)
{
    gemm_u8(g, a, lda, out, ldo, m);
}

void fv_k_nn_gemm_i32__dotprod(const struct fv_nn_gemm *g, const uint8_t *a, ptrdiff_t lda,
                               int32_t *out, ptrdiff_t ldo, int32_t m)
{
    gemm_i32(g, a, lda, out, ldo, m);
}

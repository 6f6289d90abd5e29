/* ARMv8.0: bytes as signed numbers (128 less), products of 8 bits widened to 16 and added in pairs.
 */
#include "kernels/neon/nn_gemm_frame.h"

FV_INLINE int8x8_t four_inputs(const uint8_t *bytes)
{
    uint32_t word;
    memcpy(&word, bytes, 4);
    return vreinterpret_s8_u32(vdup_n_u32(word ^ 0x80808080u));
}

FV_INLINE void start_of(const int8_t *w, int32_t k4, int32x4_t start[4])
{
    for (int i = 0; i < 4; i++)
        start[i] = vdupq_n_s32(0);
    for (int32_t k = 0; k < k4; k++, w += 64) {
        for (int i = 0; i < 4; i++)
            start[i] = vpadalq_s16(start[i], vpaddlq_s8(vld1q_s8(w + 16 * i)));
    }
    for (int i = 0; i < 4; i++)
        start[i] = vshlq_n_s32(start[i], 7);
}

/* Two rows: sixteen registers of pairs of sums, joined at the end. */
FV_INLINE void two_rows(const uint8_t *const row[2], const int8_t *w, int32_t k4,
                        int32x4_t acc[2][4])
{
    int32x4_t pair[2][8];
    for (int i = 0; i < 8; i++)
        pair[0][i] = pair[1][i] = vdupq_n_s32(0);
    for (int32_t k = 0; k < k4; k++, w += 64) {
        const int8x8_t x = four_inputs(row[0] + 4 * k), y = four_inputs(row[1] + 4 * k);
        for (int i = 0; i < 8; i++) {
            const int8x8_t v = vld1_s8(w + 8 * i);
            pair[0][i] = vpadalq_s16(pair[0][i], vmull_s8(v, x));
            pair[1][i] = vpadalq_s16(pair[1][i], vmull_s8(v, y));
        }
    }
    for (int r = 0; r < 2; r++) {
        for (int i = 0; i < 4; i++)
            acc[r][i] = vaddq_s32(acc[r][i], vpaddq_s32(pair[r][2 * i], pair[r][2 * i + 1]));
    }
}

FV_INLINE void accumulate(const uint8_t *const row[TILE_ROWS], const int8_t *w, int32_t k4,
                          int32x4_t acc[TILE_ROWS][4])
{
    two_rows(row, w, k4, acc);
    two_rows(row + 2, w, k4, acc + 2);
}

void fv_k_nn_gemm_u8__neon(const struct fv_nn_gemm *g, const uint8_t *a, ptrdiff_t lda,
                           uint8_t *out, ptrdiff_t ldo, int32_t m)
{
    gemm_u8(g, a, lda, out, ldo, m);
}

void fv_k_nn_gemm_i32__neon(const struct fv_nn_gemm *g, const uint8_t *a, ptrdiff_t lda,
                            int32_t *out, ptrdiff_t ldo, int32_t m)
{
    gemm_i32(g, a, lda, out, ldo, m);
}

/* ARMv8.6 with 8-bit matrix products: unsigned by signed, 2 rows by 2 channels by 8 inputs an
 * instruction. */
#include "kernels/neon/nn_gemm_frame.h"

FV_INLINE void start_of(const int8_t *w, int32_t k4, int32x4_t start[4])
{
    (void)w, (void)k4;
    for (int i = 0; i < 4; i++)
        start[i] = vdupq_n_s32(0);
}

/* Eight inputs of two rows; four of each when only one group is left. */
FV_INLINE uint8x16_t two_rows(const uint8_t *a, const uint8_t *b, int whole)
{
    if (whole) return vcombine_u8(vld1_u8(a), vld1_u8(b));
    uint32_t x, y;
    memcpy(&x, a, 4);
    memcpy(&y, b, 4);
    return vcombine_u8(vcreate_u8(x), vcreate_u8(y));
}

FV_INLINE void step(const uint8_t *const row[TILE_ROWS], ptrdiff_t k, const int8_t *w, int whole,
                    int32x4_t pair[2][8])
{
    const uint8x16_t x[2] = {two_rows(row[0] + k, row[1] + k, whole),
                             two_rows(row[2] + k, row[3] + k, whole)};
    for (int i = 0; i < 4; i++) {
        const int32x4_t a = vreinterpretq_s32_s8(vld1q_s8(w + 16 * i));
        const int32x4_t b =
            whole ? vreinterpretq_s32_s8(vld1q_s8(w + 64 + 16 * i)) : vdupq_n_s32(0);
        const int8x16_t low = vreinterpretq_s8_s32(vzip1q_s32(a, b)),
                        high = vreinterpretq_s8_s32(vzip2q_s32(a, b));
        for (int r = 0; r < 2; r++) {
            pair[r][2 * i] = vusmmlaq_s32(pair[r][2 * i], x[r], low);
            pair[r][2 * i + 1] = vusmmlaq_s32(pair[r][2 * i + 1], x[r], high);
        }
    }
}

FV_INLINE void accumulate(const uint8_t *const row[TILE_ROWS], const int8_t *w, int32_t k4,
                          int32x4_t acc[TILE_ROWS][4])
{
    int32x4_t pair[2][8]; /* rows 2 r, 2 r + 1 by channels 2 i, 2 i + 1 */
    for (int i = 0; i < 8; i++)
        pair[0][i] = pair[1][i] = vdupq_n_s32(0);
    int32_t k = 0;
    for (; k + 2 <= k4; k += 2, w += 128)
        step(row, 4 * (ptrdiff_t)k, w, 1, pair);
    if (k < k4) step(row, 4 * (ptrdiff_t)k, w, 0, pair);
    for (int r = 0; r < 2; r++) {
        for (int i = 0; i < 4; i++) {
            const int32x4_t a = pair[r][2 * i], b = pair[r][2 * i + 1];
            acc[2 * r][i] =
                vaddq_s32(acc[2 * r][i], vcombine_s32(vget_low_s32(a), vget_low_s32(b)));
            acc[2 * r + 1][i] =
                vaddq_s32(acc[2 * r + 1][i], vcombine_s32(vget_high_s32(a), vget_high_s32(b)));
        }
    }
}

void fv_k_nn_gemm_u8__i8mm(const struct fv_nn_gemm *g, const uint8_t *a, ptrdiff_t lda,
                           uint8_t *out, ptrdiff_t ldo, int32_t m)
{
    gemm_u8(g, a, lda, out, ldo, m);
}

void fv_k_nn_gemm_i32__i8mm(const struct fv_nn_gemm *g, const uint8_t *a, ptrdiff_t lda,
                            int32_t *out, ptrdiff_t ldo, int32_t m)
{
    gemm_i32(g, a, lda, out, ldo, m);
}

#include <stdbool.h>

#include <arm_neon.h>

#include "kernels/kernels.h"

/* Sums of products down the three rows, eight columns. */
static inline void sum_products(int32_t *out, const int16x8_t p[3], const int16x8_t q[3])
{
    int32x4_t low = vmull_s16(vget_low_s16(p[0]), vget_low_s16(q[0]));
    int32x4_t high = vmull_high_s16(p[0], q[0]);
    for (int row = 1; row < 3; row++) {
        low = vmlal_s16(low, vget_low_s16(p[row]), vget_low_s16(q[row]));
        high = vmlal_high_s16(high, p[row], q[row]);
    }
    vst1q_s32(out, low);
    vst1q_s32(out + 4, high);
}

static inline void column_sums(int32_t *sums, int32_t width, const int16_t *const dx[3],
                               const int16_t *const dy[3], int32_t x)
{
    const int16x8_t p[3] = {vld1q_s16(dx[0] + x), vld1q_s16(dx[1] + x), vld1q_s16(dx[2] + x)};
    const int16x8_t q[3] = {vld1q_s16(dy[0] + x), vld1q_s16(dy[1] + x), vld1q_s16(dy[2] + x)};
    sum_products(sums + x, p, p);
    sum_products(sums + width + x, p, q);
    sum_products(sums + 2 * (int64_t)width + x, q, q);
}

static inline int32x4_t three_columns(const int32_t *sums)
{
    return vaddq_s32(vaddq_s32(vld1q_s32(sums - 1), vld1q_s32(sums)), vld1q_s32(sums + 1));
}

/* The operations in the contract's order. */
static inline int32x4_t response_of(int32x4_t xx, int32x4_t xy, int32x4_t yy, bool eigenvalues,
                                    float32x4_t k)
{
    const float32x4_t a = vcvtq_f32_s32(xx), c = vcvtq_f32_s32(yy), both = vaddq_f32(a, c);
    if (eigenvalues) {
        const float32x4_t b = vcvtq_f32_s32(vaddq_s32(xy, xy)), apart = vsubq_f32(a, c);
        const float32x4_t squares = vaddq_f32(vmulq_f32(apart, apart), vmulq_f32(b, b));
        return vreinterpretq_s32_f32(vsubq_f32(both, vsqrtq_f32(squares)));
    }
    const float32x4_t b = vcvtq_f32_s32(xy);
    const float32x4_t determinant = vsubq_f32(vmulq_f32(a, c), vmulq_f32(b, b));
    return vreinterpretq_s32_f32(vsubq_f32(determinant, vmulq_f32(k, vmulq_f32(both, both))));
}

static inline int32x4_t respond(int32_t *out, const int32_t *sums, int32_t width, bool eigenvalues,
                                float32x4_t k, int32x4_t most)
{
    for (int i = 0; i < 16; i += 4) {
        const int32_t *xx = sums + i, *xy = xx + width, *yy = xy + width;
        const int32x4_t response =
            response_of(three_columns(xx), three_columns(xy), three_columns(yy), eigenvalues, k);
        vst1q_s32(out + i, response);
        most = vmaxq_s32(most, response);
    }
    return most;
}

/* The compiler makes one of it for each measure. */
static inline int32_t response_row(int32_t *out, const int16_t *const *dx, const int16_t *const *dy,
                                   int32_t width, bool eigenvalues, float harris_k, int32_t *sums,
                                   int32_t most)
{
    const int16_t *const p[3] = {dx[0], dx[1], dx[2]}, *const q[3] = {dy[0], dy[1], dy[2]};
    const float32x4_t k = vdupq_n_f32(harris_k);
    int32x4_t most4 = vdupq_n_s32(most > 0 ? most : 0); /* the ends are 0 */
    for (int32_t x = 0; x < width - 8; x += 8) /* the last vectors overlap the ones before */
        column_sums(sums, width, p, q, x);
    column_sums(sums, width, p, q, width - 8);
    for (int32_t x = 1; x < width - 17; x += 16)
        most4 = respond(out + x, sums + x, width, eigenvalues, k, most4);
    most4 = respond(out + width - 17, sums + width - 17, width, eigenvalues, k, most4);
    out[0] = out[width - 1] = 0;
    return vmaxvq_s32(most4);
}

int32_t fv_k_response_row_f32__neon(int32_t *out, const int16_t *const *dx,
                                    const int16_t *const *dy, int32_t width, float harris_k,
                                    int32_t *sums, int32_t most)
{
    if (width < 18) return fv_k_response_row_f32__c(out, dx, dy, width, harris_k, sums, most);
    return harris_k < 0 ? response_row(out, dx, dy, width, true, harris_k, sums, most)
                        : response_row(out, dx, dy, width, false, harris_k, sums, most);
}

static inline void largest_of_rows(int32_t *most, const int32_t *const rows[3], int32_t x)
{
    const int32x4x4_t a = vld1q_s32_x4(rows[0] + x), b = vld1q_s32_x4(rows[1] + x),
                      c = vld1q_s32_x4(rows[2] + x);
    int32x4x4_t largest;
    for (int i = 0; i < 4; i++)
        largest.val[i] = vmaxq_s32(vmaxq_s32(a.val[i], b.val[i]), c.val[i]);
    vst1q_s32_x4(most + x, largest);
}

static inline void mark(int32_t *marks, const int32_t *row, const int32_t *most,
                        int32x4_t threshold)
{
    const int32x4x4_t v = vld1q_s32_x4(row), left = vld1q_s32_x4(most - 1), at = vld1q_s32_x4(most),
                      right = vld1q_s32_x4(most + 1);
    int32x4x4_t marked;
    for (int i = 0; i < 4; i++) {
        const int32x4_t around = vmaxq_s32(vmaxq_s32(left.val[i], at.val[i]), right.val[i]);
        const uint32x4_t peak =
            vandq_u32(vcgtq_s32(v.val[i], threshold), vcgeq_s32(v.val[i], around));
        marked.val[i] = vreinterpretq_s32_u32(vshrq_n_u32(peak, 31));
    }
    vst1q_s32_x4(marks, marked);
}

void fv_k_response_peaks_row_s32__neon(int32_t *marks, const int32_t *const *rows, int32_t width,
                                       int32_t threshold, int32_t *most)
{
    if (width < 18) {
        fv_k_response_peaks_row_s32__c(marks, rows, width, threshold, most);
        return;
    }
    const int32_t *const row[3] = {rows[0], rows[1], rows[2]};
    const int32x4_t threshold4 = vdupq_n_s32(threshold);
    for (int32_t x = 0; x < width - 16; x += 16) /* the last vectors overlap the ones before */
        largest_of_rows(most, row, x);
    largest_of_rows(most, row, width - 16);
    for (int32_t x = 1; x < width - 17; x += 16)
        mark(marks + x, row[1] + x, most + x, threshold4);
    mark(marks + width - 17, row[1] + width - 17, most + width - 17, threshold4);
    marks[0] = marks[width - 1] = 0;
}

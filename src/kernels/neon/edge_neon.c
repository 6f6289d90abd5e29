#include "kernels/kernels.h"

#include <arm_neon.h>

#define FV_INLINE static inline __attribute__((always_inline))

/* Sixteen columns, eight and eight. */
struct columns {
    int16x8_t low, high;
};

static inline int16x8_t signed_words(uint16x8_t words)
{
    return vreinterpretq_s16_u16(words);
}

/* side a + centre b + side c, at most 7650 */
FV_INLINE struct columns weighted_rows(const uint8_t *const rows[3], int32_t x, int32_t side,
                                       int32_t centre)
{
    const uint8x16_t a = vld1q_u8(rows[0] + x), b = vld1q_u8(rows[1] + x),
                     c = vld1q_u8(rows[2] + x), weight = vdupq_n_u8((uint8_t)centre);
    uint16x8_t low = vaddl_u8(vget_low_u8(a), vget_low_u8(c)), high = vaddl_high_u8(a, c);
    if (side != 1) {
        low = vmulq_n_u16(low, (uint16_t)side);
        high = vmulq_n_u16(high, (uint16_t)side);
    }
    return (struct columns){signed_words(vmlal_u8(low, vget_low_u8(b), vget_low_u8(weight))),
                            signed_words(vmlal_high_u8(high, b, weight))};
}

/* c - a */
FV_INLINE struct columns outer_rows(const uint8_t *const rows[3], int32_t x, int32_t side,
                                    int32_t centre)
{
    (void)side;
    (void)centre;
    const uint8x16_t a = vld1q_u8(rows[0] + x), c = vld1q_u8(rows[2] + x);
    return (struct columns){signed_words(vsubl_u8(vget_low_u8(c), vget_low_u8(a))),
                            signed_words(vsubl_high_u8(c, a))};
}

FV_INLINE int16x8_t across_x(int16x8_t left, int16x8_t at, int16x8_t right, int32_t side,
                             int32_t centre)
{
    (void)at;
    (void)side;
    (void)centre;
    return vsubq_s16(right, left);
}

FV_INLINE int16x8_t across_y(int16x8_t left, int16x8_t at, int16x8_t right, int32_t side,
                             int32_t centre)
{
    int16x8_t sum = vaddq_s16(left, right);
    if (side != 1) sum = vmulq_n_s16(sum, (int16_t)side);
    return vmlaq_n_s16(sum, at, (int16_t)centre);
}

typedef struct columns down_fn(const uint8_t *const[3], int32_t, int32_t, int32_t);
typedef int16x8_t across_fn(int16x8_t, int16x8_t, int16x8_t, int32_t, int32_t);

/* Down the columns and across them; weights. */
struct passes {
    down_fn *down;
    across_fn *across;
    int32_t side, centre;
};

FV_INLINE struct columns down(const struct passes *by, const uint8_t *const rows[3], int32_t x)
{
    return by->down(rows, x, by->side, by->centre);
}

/* Sixteen columns from those, the eight before and the eight after. */
FV_INLINE void across(const struct passes *by, int16_t *out, int16x8_t before, struct columns at,
                      int16x8_t after)
{
    const int16x8_t inner_left = vextq_s16(at.low, at.high, 7),
                    inner_right = vextq_s16(at.low, at.high, 1);
    vst1q_s16(out,
              by->across(vextq_s16(before, at.low, 7), at.low, inner_right, by->side, by->centre));
    vst1q_s16(out + 8,
              by->across(inner_left, at.high, vextq_s16(at.high, after, 1), by->side, by->centre));
}

FV_INLINE int16x8_t before_first(struct columns at, int32_t repeat)
{
    return repeat ? vdupq_laneq_s16(at.low, 0) : vdupq_laneq_s16(at.low, 1);
}

FV_INLINE int16x8_t after_last(struct columns at, int32_t repeat)
{
    return repeat ? vdupq_laneq_s16(at.high, 7) : vdupq_laneq_s16(at.high, 6);
}

/* Rows of at least 32. The last 32 first: of these the first column is right where it is that of
 * the row, and else it is written again. */
FV_INLINE void derive(const struct passes *by, int16_t *out, const uint8_t *const *rows,
                      int32_t width, int32_t repeat)
{
    const uint8_t *const row[3] = {rows[0], rows[1], rows[2]};
    const int32_t last = width - 16;
    struct columns a = down(by, row, last - 16), b = down(by, row, last), c;
    across(by, out + last - 16, before_first(a, repeat), a, b.low);
    across(by, out + last, a.high, b, after_last(b, repeat));
    int32_t x = 0;
    b = down(by, row, 0);
    a.high = before_first(b, repeat);
    for (; x + 64 <= width; x += 48) { /* three at a time, so that none moves */
        c = down(by, row, x + 16);
        across(by, out + x, a.high, b, c.low);
        a = down(by, row, x + 32);
        across(by, out + x + 16, b.high, c, a.low);
        b = down(by, row, x + 48);
        across(by, out + x + 32, c.high, a, b.low);
    }
    for (; x + 32 <= width; x += 16) {
        c = down(by, row, x + 16);
        across(by, out + x, a.high, b, c.low);
        a = b;
        b = c;
    }
}

FV_INLINE void derive_x(int16_t *out, const uint8_t *const *rows, int32_t width, int32_t side,
                        int32_t centre, int32_t repeat)
{
    derive(&(struct passes){weighted_rows, across_x, side, centre}, out, rows, width, repeat);
}

FV_INLINE void derive_y(int16_t *out, const uint8_t *const *rows, int32_t width, int32_t side,
                        int32_t centre, int32_t repeat)
{
    derive(&(struct passes){outer_rows, across_y, side, centre}, out, rows, width, repeat);
}

void fv_k_derivative_x_row_s16__neon(int16_t *out, const uint8_t *const *rows, int32_t width,
                                     int32_t side, int32_t centre, int32_t repeat)
{
    if (width < 32)
        fv_k_derivative_x_row_s16__c(out, rows, width, side, centre, repeat);
    else if (side == 1)
        derive_x(out, rows, width, 1, centre, repeat);
    else
        derive_x(out, rows, width, side, centre, repeat);
}

void fv_k_derivative_y_row_s16__neon(int16_t *out, const uint8_t *const *rows, int32_t width,
                                     int32_t side, int32_t centre, int32_t repeat)
{
    if (width < 32)
        fv_k_derivative_y_row_s16__c(out, rows, width, side, centre, repeat);
    else if (side == 1)
        derive_y(out, rows, width, 1, centre, repeat);
    else
        derive_y(out, rows, width, side, centre, repeat);
}

/* Sixteen columns of the Laplacian: the neighbours in two pairs, less the centre. */
FV_INLINE void laplacian_sixteen(int16_t *out, const uint8_t *const pairs[4], const uint8_t *centre,
                                 int32_t x, int32_t corners)
{
    const uint8x16_t a = vld1q_u8(pairs[0] + x), b = vld1q_u8(pairs[1] + x);
    const uint8x16_t c = vld1q_u8(pairs[2] + x), d = vld1q_u8(pairs[3] + x);
    const uint8x16_t at = vld1q_u8(centre + x), weight = vdupq_n_u8(corners ? 8 : 4);
    uint16x8_t low = vaddq_u16(vaddl_u8(vget_low_u8(a), vget_low_u8(b)),
                               vaddl_u8(vget_low_u8(c), vget_low_u8(d)));
    uint16x8_t high = vaddq_u16(vaddl_high_u8(a, b), vaddl_high_u8(c, d));
    if (corners) {
        low = vaddq_u16(low, low);
        high = vaddq_u16(high, high);
    }
    vst1q_s16(out + x, signed_words(vmlsl_u8(low, vget_low_u8(at), vget_low_u8(weight))));
    vst1q_s16(out + x + 8, signed_words(vmlsl_high_u8(high, at, weight)));
}

/* All columns but the first and the last. The last vector overlaps the one before. */
FV_INLINE void laplacian_row(int16_t *out, const uint8_t *const *rows, int32_t width,
                             int32_t corners)
{
    const uint8_t *a = rows[0], *b = rows[1], *c = rows[2];
    const uint8_t *const pairs[4] = {corners ? a - 1 : a, corners ? a + 1 : c,
                                     corners ? c - 1 : b - 1, corners ? c + 1 : b + 1};
    int32_t x = 1;
    for (; x < width - 33; x += 32) {
        laplacian_sixteen(out, pairs, b, x, corners);
        laplacian_sixteen(out, pairs, b, x + 16, corners);
    }
    if (x < width - 17) laplacian_sixteen(out, pairs, b, x, corners);
    laplacian_sixteen(out, pairs, b, width - 17, corners);
}

void fv_k_laplacian_row_s16__neon(int16_t *out, const uint8_t *const *rows, int32_t width,
                                  int32_t corners)
{
    if (width < 18) {
        fv_k_laplacian_row_s16__c(out, rows, width, corners);
        return;
    }
    if (corners)
        laplacian_row(out, rows, width, 1);
    else
        laplacian_row(out, rows, width, 0);
    int16_t two[2];
    const uint8_t *right[3] = {rows[0] + width - 2, rows[1] + width - 2, rows[2] + width - 2};
    fv_k_laplacian_row_s16__c(two, rows, 2, corners);
    out[0] = two[0];
    fv_k_laplacian_row_s16__c(two, right, 2, corners);
    out[width - 1] = two[1];
}

FV_INLINE void magnitude_sixteen(int32_t *out, const int16_t *dx, const int16_t *dy,
                                 int32_t squared)
{
    const int16x8x2_t x = vld1q_s16_x2(dx), y = vld1q_s16_x2(dy);
    int32x4x4_t magnitude;
    for (int i = 0; i < 2; i++) {
        const int16x8_t gx = x.val[i], gy = y.val[i];
        if (squared) {
            magnitude.val[2 * i] = vmlal_s16(vmull_s16(vget_low_s16(gx), vget_low_s16(gx)),
                                             vget_low_s16(gy), vget_low_s16(gy));
            magnitude.val[2 * i + 1] = vmlal_high_s16(vmull_high_s16(gx, gx), gy, gy);
        } else { /* at most 16320 */
            const int16x8_t sum = vaddq_s16(vabsq_s16(gx), vabsq_s16(gy));
            magnitude.val[2 * i] = vmovl_s16(vget_low_s16(sum));
            magnitude.val[2 * i + 1] = vmovl_high_s16(sum);
        }
    }
    vst1q_s32_x4(out, magnitude);
}

void fv_k_magnitude_row_s32__neon(int32_t *out, const int16_t *dx, const int16_t *dy, int32_t width,
                                  int32_t squared)
{
    int32_t x = 0;
    if (squared)
        for (; x + 16 <= width; x += 16)
            magnitude_sixteen(out + x, dx + x, dy + x, 1);
    else
        for (; x + 16 <= width; x += 16)
            magnitude_sixteen(out + x, dx + x, dy + x, 0);
    fv_k_magnitude_row_s32__c(out + x, dx + x, dy + x, width - x, squared);
}

/* ---- thinning -------------------------------------------------------------------------------- */

/* Where four columns are to be compared: along the row, down the column, else along a diagonal. */
struct way {
    uint32x4_t flat, steep, mixed;
};

/* 32768 |dy| beside 13573 |dx| and 13573 |dx| + 65536 |dx|; `shifted` is the last in words. */
static inline struct way way_of(uint16x4_t across, uint16x8_t shifted, uint16x4_t down,
                                int16x4_t sign)
{
    const uint32x4_t t = vmull_n_u16(across, 13573), scaled = vshll_n_u16(down, 15);
    return (struct way){vcltq_u32(scaled, t),
                        vcgtq_u32(scaled, vaddq_u32(t, vreinterpretq_u32_u16(shifted))),
                        vreinterpretq_u32_s32(vmovl_s16(sign))};
}

/* All ones where v is more than the one neighbour and, where the way is straight, at least the
 * other, else more. */
static inline uint32x4_t stays(const int32_t *const magnitude[3], int32_t x, int32x4_t v,
                               const struct way *way)
{
    const int32_t *above = magnitude[0] + x, *row = magnitude[1] + x, *below = magnitude[2] + x;
    const int32x4_t over = vbslq_s32(way->mixed, vld1q_s32(above + 1), vld1q_s32(above - 1));
    const int32x4_t under = vbslq_s32(way->mixed, vld1q_s32(below - 1), vld1q_s32(below + 1));
    const int32x4_t a =
        vbslq_s32(way->flat, vld1q_s32(row - 1), vbslq_s32(way->steep, vld1q_s32(above), over));
    const int32x4_t b =
        vbslq_s32(way->flat, vld1q_s32(row + 1), vbslq_s32(way->steep, vld1q_s32(below), under));
    const int32x4_t straight = vreinterpretq_s32_u32(vorrq_u32(way->flat, way->steep));
    return vandq_u32(vcgtq_s32(v, a), vcgtq_s32(vsubq_s32(v, straight), b));
}

/* All ones where a pixel stays, and where it is strong as well; eight columns. */
struct thinned {
    uint16x8_t stays, strong;
};

static inline struct thinned thin_eight(const int32_t *const magnitude[3], const int16_t *dx,
                                        const int16_t *dy, int32_t x, int32x4_t low, int32x4_t high)
{
    const int32x4_t v0 = vld1q_s32(magnitude[1] + x), v1 = vld1q_s32(magnitude[1] + x + 4);
    const uint32x4_t above0 = vcgtq_s32(v0, low), above1 = vcgtq_s32(v1, low);
    if (vmaxvq_u32(vorrq_u32(above0, above1)) == 0)
        return (struct thinned){vdupq_n_u16(0), vdupq_n_u16(0)};
    const int16x8_t gx = vld1q_s16(dx + x), gy = vld1q_s16(dy + x);
    const uint16x8_t across = vreinterpretq_u16_s16(vabsq_s16(gx)),
                     down = vreinterpretq_u16_s16(vabsq_s16(gy));
    const int16x8_t sign = vshrq_n_s16(veorq_s16(gx, gy), 15);
    const uint16x8_t zero = vdupq_n_u16(0);
    const struct way way0 = way_of(vget_low_u16(across), vzip1q_u16(zero, across),
                                   vget_low_u16(down), vget_low_s16(sign));
    const struct way way1 = way_of(vget_high_u16(across), vzip2q_u16(zero, across),
                                   vget_high_u16(down), vget_high_s16(sign));
    const uint32x4_t stays0 = vandq_u32(above0, stays(magnitude, x, v0, &way0));
    const uint32x4_t stays1 = vandq_u32(above1, stays(magnitude, x + 4, v1, &way1));
    const uint16x8_t strong = vuzp1q_u16(vreinterpretq_u16_u32(vcgtq_s32(v0, high)),
                                         vreinterpretq_u16_u32(vcgtq_s32(v1, high)));
    const uint16x8_t both =
        vuzp1q_u16(vreinterpretq_u16_u32(stays0), vreinterpretq_u16_u32(stays1));
    return (struct thinned){both, vandq_u16(both, strong)};
}

/* One bit per column, the first column's the highest. */
static inline uint64_t bits_of(uint16x8_t ones)
{
    static const uint16_t bit[8] = {128, 64, 32, 16, 8, 4, 2, 1};
    return vaddvq_u16(vandq_u16(ones, vld1q_u16(bit)));
}

/* Columns beyond the last eight of a row, in room of their own. */
static void thin_rest(uint64_t *weak, uint64_t *strong, const int32_t *const magnitude[3],
                      const int16_t *dx, const int16_t *dy, int32_t x, int32_t count, int32_t low,
                      int32_t high)
{
    const int32_t *const from[3] = {magnitude[0] + x, magnitude[1] + x, magnitude[2] + x};
    uint64_t weak_rest, strong_rest;
    fv_k_thin_row_s32__c(&weak_rest, &strong_rest, from, dx + x, dy + x, count, low, high);
    *weak |= weak_rest >> x % 64;
    *strong |= strong_rest >> x % 64;
}

void fv_k_thin_row_s32__neon(uint64_t *weak, uint64_t *strong, const int32_t *const *magnitude,
                             const int16_t *dx, const int16_t *dy, int32_t width, int32_t low,
                             int32_t high)
{
    const int32_t *const rows[3] = {magnitude[0], magnitude[1], magnitude[2]};
    const int32x4_t low4 = vdupq_n_s32(low), high4 = vdupq_n_s32(high);
    for (int32_t first = 0; first < width; first += 64) {
        const int32_t end = width - first < 64 ? width : first + 64;
        uint64_t weak_bits = 0, strong_bits = 0;
        int32_t x = first;
        for (; x + 8 <= end; x += 8) {
            const struct thinned eight = thin_eight(rows, dx, dy, x, low4, high4);
            weak_bits |= bits_of(eight.stays) << (56 - x % 64);
            strong_bits |= bits_of(eight.strong) << (56 - x % 64);
        }
        if (x < end) thin_rest(&weak_bits, &strong_bits, rows, dx, dy, x, end - x, low, high);
        weak[first / 64] = weak_bits;
        strong[first / 64] = strong_bits;
    }
}

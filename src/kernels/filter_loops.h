/* Kernels of contracts/filter.h that compilers vectorise well: the C variants, which filter_avx2.c
 * and filter_avx512.c compile again for their instruction sets. FV_NAME(kernel) makes the
 * function's name. */
#include "kernels/kernels.h"

static inline uint8_t smaller(uint8_t a, uint8_t b)
{
    return a < b ? a : b;
}

static inline uint8_t larger(uint8_t a, uint8_t b)
{
    return a > b ? a : b;
}

static inline uint8_t middle(uint8_t a, uint8_t b, uint8_t c)
{
    return larger(smaller(a, b), smaller(larger(a, b), c));
}

/* Median of the columns l, m, r of three rows: of the largest minimum, the median median and the
 * smallest maximum of the columns. */
static inline uint8_t median9(const uint8_t *a, const uint8_t *b, const uint8_t *c, int32_t l,
                              int32_t m, int32_t r)
{
    const uint8_t low_l = smaller(smaller(a[l], b[l]), c[l]);
    const uint8_t low_m = smaller(smaller(a[m], b[m]), c[m]);
    const uint8_t low_r = smaller(smaller(a[r], b[r]), c[r]);
    const uint8_t high_l = larger(larger(a[l], b[l]), c[l]);
    const uint8_t high_m = larger(larger(a[m], b[m]), c[m]);
    const uint8_t high_r = larger(larger(a[r], b[r]), c[r]);
    return middle(
        larger(larger(low_l, low_m), low_r),
        middle(middle(a[l], b[l], c[l]), middle(a[m], b[m], c[m]), middle(a[r], b[r], c[r])),
        smaller(smaller(high_l, high_m), high_r));
}

void FV_NAME(median3_row_u8)(uint8_t *restrict out, const uint8_t *const *rows, int32_t width)
{
    const uint8_t *a = rows[0], *b = rows[1], *c = rows[2];
    for (int32_t x = 1; x < width - 1; x++)
        out[x] = median9(a, b, c, x - 1, x, x + 1);
    out[0] = median9(a, b, c, 0, 0, 1);
    out[width - 1] = median9(a, b, c, width - 2, width - 1, width - 1);
}

void FV_NAME(range_u8)(uint8_t range[2], const uint8_t *in, int32_t count)
{
    uint8_t low = range[0], high = range[1];
    for (int32_t i = 0; i < count; i++) {
        low = smaller(low, in[i]);
        high = larger(high, in[i]);
    }
    range[0] = low;
    range[1] = high;
}

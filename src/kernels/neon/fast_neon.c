#include "kernels/kernels.h"

#include <arm_neon.h>

#define MIN vminq_u8
#define MAX vmaxq_u8
#define load vld1q_u8

enum { STRETCH = 1024 }; /* pixels whose groups are listed at once */

/* Of the arcs of nine, the best weakest pixel (brightest) and the best strongest one (darkest). Two
 * arcs that differ in their ends share eight pixels: min over them once, then the better of the two
 * ends. */
static inline void best_arcs(const uint8x16_t p[16], uint8x16_t *brightest, uint8x16_t *darkest)
{
    uint8x16_t low[8], high[8];
    for (int j = 0; j < 8; j++) {
        low[j] = MIN(p[2 * j + 1], p[(2 * j + 2) & 15]);
        high[j] = MAX(p[2 * j + 1], p[(2 * j + 2) & 15]);
    }
    uint8x16_t low4[8], high4[8];
    for (int j = 0; j < 8; j++) {
        low4[j] = MIN(low[j], low[(j + 1) & 7]);
        high4[j] = MAX(high[j], high[(j + 1) & 7]);
    }
    uint8x16_t bright = vdupq_n_u8(0), dark = vdupq_n_u8(255);
    for (int j = 0; j < 8; j++) {
        const uint8x16_t one_end = p[2 * j], other_end = p[(2 * j + 9) & 15];
        bright = MAX(bright, MIN(MIN(low4[j], low4[(j + 2) & 7]), MAX(one_end, other_end)));
        dark = MIN(dark, MAX(MAX(high4[j], high4[(j + 2) & 7]), MIN(one_end, other_end)));
    }
    *brightest = bright;
    *darkest = dark;
}

static inline int any(uint8x16_t v)
{
    return vmaxvq_u32(vreinterpretq_u32_u8(v)) != 0;
}

/* Of two opposite pairs: the brighter of each, then the darker of the two; and the other way round.
 */
static inline void pairs(const uint8_t *first, const uint8_t *first8, const uint8_t *second,
                         const uint8_t *second8, uint8x16_t *bright, uint8x16_t *dark)
{
    const uint8x16_t a = load(first), b = load(first8), c = load(second), d = load(second8);
    *bright = MIN(*bright, MIN(MAX(a, b), MAX(c, d)));
    *dark = MAX(*dark, MAX(MIN(a, b), MIN(c, d)));
}

/* Whether any of sixteen pixels may be a corner. */
static inline int candidates(const uint8_t *c, ptrdiff_t s, uint8x16_t t)
{
    const uint8x16_t centre = load(c);
    uint8x16_t bright = vdupq_n_u8(255), dark = vdupq_n_u8(0);
    pairs(c - 3 * s, c + 3 * s, c + 3, c - 3, &bright, &dark);
    pairs(c - 2 * s + 2, c + 2 * s - 2, c + 2 * s + 2, c - 2 * s - 2, &bright, &dark);
    return any(
        vorrq_u8(vcgtq_u8(bright, vqaddq_u8(centre, t)), vcltq_u8(dark, vqsubq_u8(centre, t))));
}

static inline void score_group(uint8_t *scores, const uint8_t *c, ptrdiff_t s, uint8x16_t t)
{
    const uint8x16_t p[16] = {
        load(c - 3 * s), load(c - 3 * s + 1), load(c - 2 * s + 2), load(c - s + 3),
        load(c + 3),     load(c + s + 3),     load(c + 2 * s + 2), load(c + 3 * s + 1),
        load(c + 3 * s), load(c + 3 * s - 1), load(c + 2 * s - 2), load(c + s - 3),
        load(c - 3),     load(c - s - 3),     load(c - 2 * s - 2), load(c - 3 * s - 1)};
    const uint8x16_t centre = load(c);
    uint8x16_t bright, dark;
    best_arcs(p, &bright, &dark);
    const uint8x16_t best = MAX(vqsubq_u8(bright, centre), vqsubq_u8(centre, dark));
    vst1q_u8(scores, vandq_u8(vcgtq_u8(best, t), vsubq_u8(best, vdupq_n_u8(1))));
}

/* Two passes over a stretch of the row. The first asks of every group of sixteen pixels whether any
 * of them has, in each of four opposite pairs of the circle, a pixel beyond the threshold on the
 * same side: nine contiguous ones hold one of every pair. The second scores the groups that passed.
 * Listing them instead of branching spares the mispredictions. */
static void score_stretch(uint8_t *scores, const uint8_t *pixels, ptrdiff_t stride_bytes,
                          const uint8_t *thresholds, int32_t count)
{
    int32_t groups[STRETCH / 16 + 1], found = 0;
    for (int32_t i = 0; i < count; i += 16) {
        vst1q_u8(scores + i, vdupq_n_u8(0));
        groups[found] = i;
        found += candidates(pixels + i, stride_bytes, load(thresholds + i));
    }
    for (int32_t k = 0; k < found; k++)
        score_group(scores + groups[k], pixels + groups[k], stride_bytes,
                    load(thresholds + groups[k]));
}

void fv_k_fast_score_u8__neon(uint8_t *scores, const uint8_t *pixels, ptrdiff_t stride_bytes,
                              const uint8_t *thresholds, int32_t count)
{
    for (int32_t i = 0; i < count; i += STRETCH)
        score_stretch(scores + i, pixels + i, stride_bytes, thresholds + i,
                      count - i < STRETCH ? count - i : STRETCH);
}

int32_t fv_k_fast_peaks_u8__neon(uint16_t *columns, const uint8_t *above, const uint8_t *row,
                                 const uint8_t *below, int32_t from, int32_t to)
{
    int32_t found = 0;
    for (int32_t i = from; i < to; i += 16) {
        const uint8x16_t centre = load(row + i);
        if (!any(centre)) continue;
        uint8x16_t around = MAX(load(row + i - 1), load(row + i + 1));
        around = MAX(around, MAX(MAX(load(above + i - 1), load(above + i)), load(above + i + 1)));
        around = MAX(around, MAX(MAX(load(below + i - 1), load(below + i)), load(below + i + 1)));
        /* Narrowing by 4 leaves one nibble per lane: a 64-bit mask. */
        const uint8x8_t nibbles = vshrn_n_u16(vreinterpretq_u16_u8(vcgtq_u8(centre, around)), 4);
        uint64_t peaks =
            vget_lane_u64(vreinterpret_u64_u8(nibbles), 0) & UINT64_C(0x1111111111111111);
        if (to - i < 16) peaks &= (UINT64_C(1) << 4 * (to - i)) - 1u;
        for (; peaks != 0; peaks &= peaks - 1)
            columns[found++] = (uint16_t)(i + (__builtin_ctzll(peaks) >> 2));
    }
    return found;
}

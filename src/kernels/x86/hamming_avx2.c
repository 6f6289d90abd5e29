#include "kernels/kernels.h"

#include <immintrin.h>
#include <string.h>

/* 128 train descriptors at a time, turned into planes: plane p holds nibble p of each of them. The
 * distances of a nibble of a query from all of a plane are then one table lookup. A table of the
 * nibbles of two queries has their distances in the two halves of a byte. Distances are bounded
 * from below first: a nibble's counts as 3 at most, so that a half of a byte holds the sum of five
 * lookups, and the last planes are left out. Only where the bound is below the second nearest found
 * so far are all bits compared. */
enum {
    TRAINS = 128,
    VECTORS = TRAINS / 32,
    BYTES = FV_DESCRIPTOR_BYTES,
    ADDED = 5, /* lookups that a half of a byte holds */
    PLANES = 12 * ADDED
};

struct block {
    _Alignas(64) uint8_t planes[2 * BYTES][TRAINS]; /* low nibbles of the bytes, then high ones */
    uint8_t missing[TRAINS];                        /* 255 behind the last descriptor */
    const uint8_t *trains;                          /* first of the block */
    int32_t first, count;
};

/* tables[16 a + b][t]: distance of nibbles b and t, 3 at most, and 16 times that of a and t */
typedef uint8_t pair_tables[256][16];

static uint8_t of_nibbles(int a, int b)
{
    const int distance = __builtin_popcount((unsigned)(a ^ b));
    return (uint8_t)(distance < 3 ? distance : 3);
}

static void fill_tables(pair_tables tables)
{
    for (int i = 0; i < 256; i++)
        for (int t = 0; t < 16; t++)
            tables[i][t] = (uint8_t)(16 * of_nibbles(i >> 4, t) + of_nibbles(i & 15, t));
}

static inline __m256i load(const void *from)
{
    return _mm256_loadu_si256(from);
}

static inline __m256i table_at(const uint8_t *from)
{
    return _mm256_broadcastsi128_si256(_mm_loadu_si128((const void *)from));
}

/* out[k] has byte k of each of 16 rows: four times, rows i and i + 8 are interleaved. */
static void transpose(__m128i rows[16])
{
    for (int round = 0; round < 4; round++) {
        __m128i next[16];
        for (int i = 0; i < 8; i++) {
            next[2 * i] = _mm_unpacklo_epi8(rows[i], rows[i + 8]);
            next[2 * i + 1] = _mm_unpackhi_epi8(rows[i], rows[i + 8]);
        }
        memcpy(rows, next, sizeof next);
    }
}

static void fill_block(struct block *block, const uint8_t *trains, int32_t first, int32_t count)
{
    const __m128i low = _mm_set1_epi8(15);
    block->trains = trains + (int64_t)BYTES * first;
    block->first = first;
    block->count = count;
    memset(block->missing, 0, (size_t)count);
    memset(block->missing + count, 255, (size_t)(TRAINS - count));
    for (int32_t t = 0; t < TRAINS; t += 16)
        for (int32_t half = 0; half < BYTES; half += 16) {
            __m128i rows[16];
            for (int32_t i = 0; i < 16; i++)
                rows[i] = t + i < count ? _mm_loadu_si128((const void *)(block->trains + half +
                                                                         (int64_t)BYTES * (t + i)))
                                        : _mm_setzero_si128();
            transpose(rows);
            for (int32_t i = 0; i < 16; i++) {
                _mm_storeu_si128((void *)&block->planes[half + i][t], _mm_and_si128(rows[i], low));
                _mm_storeu_si128((void *)&block->planes[BYTES + half + i][t],
                                 _mm_and_si128(_mm_srli_epi16(rows[i], 4), low));
            }
        }
}

/* Offsets of the tables of two queries, for each plane. */
static inline void offsets_of(uint16_t offsets[2 * BYTES], const uint8_t *a, const uint8_t *b)
{
    const __m256i low = _mm256_set1_epi16(15);
    for (int half = 0; half < BYTES; half += 16) {
        const __m256i x = _mm256_cvtepu8_epi16(_mm_loadu_si128((const void *)(a + half)));
        const __m256i y = _mm256_cvtepu8_epi16(_mm_loadu_si128((const void *)(b + half)));
        const __m256i lows = _mm256_or_si256(_mm256_slli_epi16(_mm256_and_si256(x, low), 4),
                                             _mm256_and_si256(y, low));
        const __m256i highs = _mm256_or_si256(_mm256_andnot_si256(low, x), _mm256_srli_epi16(y, 4));
        _mm256_storeu_si256((void *)(offsets + half), _mm256_slli_epi16(lows, 4));
        _mm256_storeu_si256((void *)(offsets + BYTES + half), _mm256_slli_epi16(highs, 4));
    }
}

/* Modulo 256. */
static inline __m256i times_16(__m256i bytes)
{
    return _mm256_andnot_si256(_mm256_set1_epi8(15), _mm256_slli_epi16(bytes, 4));
}

/* Bounds of the distances of two queries from the block, 255 where missing. */
static inline void bounds_of(__m256i of_a[VECTORS], __m256i of_b[VECTORS],
                             const struct block *block, const uint8_t *tables,
                             const uint16_t offsets[2 * BYTES])
{
    __m256i both[VECTORS], high[VECTORS];
    for (int v = 0; v < VECTORS; v++)
        both[v] = high[v] = _mm256_setzero_si256();
    for (int p = 0; p < PLANES; p += ADDED) {
        __m256i sum[VECTORS];
        const __m256i first = table_at(tables + offsets[p]);
        for (int v = 0; v < VECTORS; v++)
            sum[v] = _mm256_shuffle_epi8(first, load(block->planes[p] + 32 * v));
        for (int k = 1; k < ADDED; k++) {
            const __m256i table = table_at(tables + offsets[p + k]);
            for (int v = 0; v < VECTORS; v++) {
                sum[v] = _mm256_add_epi8(
                    sum[v], _mm256_shuffle_epi8(table, load(block->planes[p + k] + 32 * v)));
                __asm__ volatile("" : "+x"(sum[v])); /* one plane after the other: no spilling */
            }
        }
        for (int v = 0; v < VECTORS; v++) {
            both[v] = _mm256_add_epi8(both[v], sum[v]);
            high[v] = _mm256_add_epi8(high[v], _mm256_srli_epi16(sum[v], 4));
            __asm__ volatile("" : "+x"(both[v]), "+x"(high[v]));
        }
    }
    for (int v = 0; v < VECTORS; v++) {
        /* Of each 16 bits, the upper byte of `high` is right; 16 times the lower half of the upper
         * byte came into the lower. */
        const __m256i missing = load(block->missing + 32 * v);
        const __m256i upper = _mm256_sub_epi8(both[v], times_16(high[v]));
        const __m256i right = _mm256_sub_epi8(high[v], times_16(_mm256_srli_epi16(upper, 8)));
        of_a[v] = _mm256_or_si256(right, missing);
        of_b[v] = _mm256_or_si256(_mm256_sub_epi8(both[v], times_16(right)), missing);
    }
}

static inline uint32_t distance_of(const uint8_t *a, const uint8_t *b)
{
    uint32_t sum = 0;
    for (int i = 0; i < BYTES; i += 8) {
        uint64_t x, y;
        memcpy(&x, a + i, 8);
        memcpy(&y, b + i, 8);
        sum += (uint32_t)__builtin_popcountll(x ^ y);
    }
    return sum;
}

/* Where bounds are at most `most`, of two vectors. */
static inline uint64_t at_most(const __m256i bounds[2], __m256i most)
{
    const __m256i a = _mm256_cmpeq_epi8(_mm256_min_epu8(bounds[0], most), bounds[0]);
    const __m256i b = _mm256_cmpeq_epi8(_mm256_min_epu8(bounds[1], most), bounds[1]);
    return (uint32_t)_mm256_movemask_epi8(a) | (uint64_t)(uint32_t)_mm256_movemask_epi8(b) << 32;
}

/* Take those whose bound is less than `limit` [1, 256], in the order of their indices. */
static void take(uint32_t *nearest, uint32_t *second, const __m256i bounds[VECTORS], uint32_t limit,
                 const struct block *block, const uint8_t *query)
{
    const __m256i most = _mm256_set1_epi8((char)(limit - 1));
    uint64_t mask = at_most(bounds, most), then = at_most(bounds + 2, most);
    uint32_t near = *nearest, next = *second;
    int32_t from = 0;
    /* no processor foresees how often: one loop without other branches */
    while ((mask | then) != 0) {
        from = mask == 0 ? 64 : from;
        const uint64_t of = mask == 0 ? then : mask;
        then = mask == 0 ? 0 : then;
        mask = of & (of - 1);
        const int32_t at = from + __builtin_ctzll(of);
        if (at >= block->count) break;
        const uint32_t match = distance_of(query, block->trains + (int64_t)BYTES * at)
                                   << FV_MATCH_INDEX_BITS |
                               (uint32_t)(block->first + at);
        const uint32_t later = match > near ? match : near;
        near = match < near ? match : near;
        next = later < next ? later : next;
    }
    *nearest = near;
    *second = next;
}

/* The second least of the bounds that are least in their lane. */
static uint32_t second_least(__m256i least)
{
    uint8_t lanes[16];
    _mm_storeu_si128((void *)lanes, _mm_min_epu8(_mm256_castsi256_si128(least),
                                                 _mm256_extracti128_si256(least, 1)));
    uint32_t first = 255, second = 255;
    for (int i = 0; i < 16; i++) {
        const uint32_t later = lanes[i] > first ? lanes[i] : first;
        first = lanes[i] < first ? lanes[i] : first;
        second = later < second ? later : second;
    }
    return second;
}

/* The first that a query meets: those little above the least bounds, and all where these do not
 * have the two nearest for certain. */
static void begin(uint32_t *nearest, uint32_t *second, const __m256i bounds[VECTORS], __m256i least,
                  const struct block *block, const uint8_t *query)
{
    enum { ABOVE = 12 };
    const uint32_t limit = second_least(least) + ABOVE;
    take(nearest, second, bounds, limit < 256 ? limit : 256, block, query);
    if (*second >> FV_MATCH_INDEX_BITS < limit) return;
    *nearest = *second = FV_MATCH_NONE;
    take(nearest, second, bounds, 256, block, query);
}

static inline void update(uint32_t *nearest, uint32_t *second, const __m256i bounds[VECTORS],
                          const struct block *block, const uint8_t *query)
{
    __m256i least = bounds[0];
    for (int v = 1; v < VECTORS; v++)
        least = _mm256_min_epu8(least, bounds[v]);
    if (*second == FV_MATCH_NONE) {
        begin(nearest, second, bounds, least, block, query);
        return;
    }
    const uint32_t far = *second >> FV_MATCH_INDEX_BITS, limit = far < 256 ? far : 256;
    const __m256i most = _mm256_set1_epi8((char)(limit - 1));
    const __m256i less = _mm256_cmpeq_epi8(_mm256_min_epu8(least, most), least);
    if (limit == 0 || _mm256_testz_si256(less, less)) return;
    take(nearest, second, bounds, limit, block, query);
}

void fv_k_hamming_two_u8__avx2(uint32_t *nearest, uint32_t *second, const uint8_t *queries,
                               int32_t query_count, const uint8_t *trains, int32_t train_count)
{
    enum { FEW = 8 }; /* queries for which planes do not pay */
    if (query_count < FEW) {
        fv_k_hamming_two_u8__sse4(nearest, second, queries, query_count, trains, train_count);
        return;
    }
    _Alignas(64) pair_tables tables;
    struct block block;
    fill_tables(tables);
    memset(nearest, 255, sizeof *nearest * (size_t)query_count);
    memset(second, 255, sizeof *second * (size_t)query_count);
    for (int32_t t = 0; t < train_count; t += TRAINS) {
        fill_block(&block, trains, t, train_count - t < TRAINS ? train_count - t : TRAINS);
        for (int32_t q = 0; q < query_count; q += 2) {
            const int32_t other = q + 1 < query_count ? q + 1 : q;
            const uint8_t *a = queries + (int64_t)BYTES * q, *b = queries + (int64_t)BYTES * other;
            _Alignas(64) uint16_t offsets[2 * BYTES];
            __m256i of_a[VECTORS], of_b[VECTORS];
            offsets_of(offsets, a, b);
            bounds_of(of_a, of_b, &block, &tables[0][0], offsets);
            update(nearest + q, second + q, of_a, &block, a);
            if (other != q) update(nearest + other, second + other, of_b, &block, b);
        }
    }
}

#include "kernels/kernels.h"

#include <immintrin.h>
#include <string.h>

/* 128 train descriptors at a time, turned into planes: plane p holds nibble p of each of them. The
 * distances of a nibble of a query from all of a plane are then one table lookup. A table of the
 * nibbles of two queries has their distances in the two halves of a byte, which hold the sum of
 * three lookups, at most 12. */
enum { TRAINS = 128, VECTORS = TRAINS / 32, BYTES = FV_DESCRIPTOR_BYTES, PLANES = 2 * BYTES };

struct block {
    uint8_t planes[PLANES][TRAINS]; /* low nibbles of the bytes, then high ones */
    uint8_t missing[TRAINS];        /* 255 behind the last descriptor */
    const uint8_t *trains;          /* first of the block */
    int32_t first, count;
};

/* tables[16 a + b][t]: distance of nibbles b and t, and 16 times that of a and t */
typedef uint8_t pair_tables[256][16];

static void fill_tables(pair_tables tables)
{
    for (int i = 0; i < 256; i++)
        for (int t = 0; t < 16; t++)
            tables[i][t] =
                (uint8_t)(16 * __builtin_popcount((i >> 4) ^ t) + __builtin_popcount((i & 15) ^ t));
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
static inline void offsets_of(uint16_t offsets[PLANES], const uint8_t *a, const uint8_t *b)
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

/* Distances of two queries from the block, modulo 256 and with 255 where missing. */
static inline void distances_of(__m256i of_a[VECTORS], __m256i of_b[VECTORS],
                                const struct block *block, const uint8_t *tables,
                                const uint16_t offsets[PLANES])
{
    const __m256i low = _mm256_set1_epi8(15);
    __m256i both[VECTORS], high[VECTORS];
    for (int v = 0; v < VECTORS; v++) {
        both[v] =
            _mm256_shuffle_epi8(table_at(tables + offsets[0]), load(block->planes[0] + 32 * v));
        high[v] = _mm256_and_si256(_mm256_srli_epi16(both[v], 4), low);
    }
    for (int p = 1; p < PLANES; p += 3) {
        const __m256i first = table_at(tables + offsets[p]);
        const __m256i second = table_at(tables + offsets[p + 1]);
        const __m256i third = table_at(tables + offsets[p + 2]);
        for (int v = 0; v < VECTORS; v++) {
            const uint8_t *at = block->planes[p] + 32 * v;
            const __m256i sum =
                _mm256_add_epi8(_mm256_add_epi8(_mm256_shuffle_epi8(first, load(at)),
                                                _mm256_shuffle_epi8(second, load(at + TRAINS))),
                                _mm256_shuffle_epi8(third, load(at + 2 * TRAINS)));
            both[v] = _mm256_add_epi8(both[v], sum);
            high[v] = _mm256_add_epi8(high[v], _mm256_and_si256(_mm256_srli_epi16(sum, 4), low));
        }
    }
    for (int v = 0; v < VECTORS; v++) {
        const __m256i missing = load(block->missing + 32 * v);
        const __m256i times_16 = _mm256_andnot_si256(low, _mm256_slli_epi16(high[v], 4));
        of_a[v] = _mm256_or_si256(high[v], missing);
        of_b[v] = _mm256_or_si256(_mm256_sub_epi8(both[v], times_16), missing);
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

/* Take those at less than `limit` [1, 256], in the order of their indices. */
static void take(uint32_t *nearest, uint32_t *second, const __m256i distances[VECTORS],
                 uint32_t limit, const struct block *block, const uint8_t *query)
{
    const __m256i most = _mm256_set1_epi8((char)(limit - 1));
    for (int v = 0; v < VECTORS; v++) {
        const __m256i less = _mm256_cmpeq_epi8(_mm256_min_epu8(distances[v], most), distances[v]);
        for (uint32_t mask = (uint32_t)_mm256_movemask_epi8(less); mask != 0; mask &= mask - 1) {
            const int32_t at = 32 * v + __builtin_ctz(mask);
            if (at >= block->count) return;
            const uint32_t match = distance_of(query, block->trains + (int64_t)BYTES * at)
                                       << FV_MATCH_INDEX_BITS |
                                   (uint32_t)(block->first + at);
            const uint32_t later = match > *nearest ? match : *nearest;
            *nearest = match < *nearest ? match : *nearest;
            *second = later < *second ? later : *second;
        }
    }
}

/* The second least of the distances that are least in their lane, plus 1; 256 where the least is 0,
 * which may be 256. */
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
    return first == 0 ? 256 : second + 1;
}

static inline void update(uint32_t *nearest, uint32_t *second, const __m256i distances[VECTORS],
                          const struct block *block, const uint8_t *query)
{
    uint32_t limit = *second >> FV_MATCH_INDEX_BITS;
    limit = limit < 256 ? limit : 256;
    __m256i least = distances[0];
    for (int v = 1; v < VECTORS; v++)
        least = _mm256_min_epu8(least, distances[v]);
    if (*second == FV_MATCH_NONE) limit = second_least(least);
    const __m256i most = _mm256_set1_epi8((char)(limit - 1));
    const __m256i less = _mm256_cmpeq_epi8(_mm256_min_epu8(least, most), least);
    if (limit == 0 || _mm256_testz_si256(less, less)) return;
    take(nearest, second, distances, limit, block, query);
}

void fv_k_hamming_two_u8__avx2(uint32_t *nearest, uint32_t *second, const uint8_t *queries,
                               int32_t query_count, const uint8_t *trains, int32_t train_count)
{
    enum { FEW = 8 }; /* queries for which planes do not pay */
    if (query_count < FEW) {
        fv_k_hamming_two_u8__sse4(nearest, second, queries, query_count, trains, train_count);
        return;
    }
    pair_tables tables;
    struct block block;
    fill_tables(tables);
    memset(nearest, 255, sizeof *nearest * (size_t)query_count);
    memset(second, 255, sizeof *second * (size_t)query_count);
    for (int32_t t = 0; t < train_count; t += TRAINS) {
        fill_block(&block, trains, t, train_count - t < TRAINS ? train_count - t : TRAINS);
        for (int32_t q = 0; q < query_count; q += 2) {
            const int32_t other = q + 1 < query_count ? q + 1 : q;
            const uint8_t *a = queries + (int64_t)BYTES * q, *b = queries + (int64_t)BYTES * other;
            uint16_t offsets[PLANES];
            __m256i of_a[VECTORS], of_b[VECTORS];
            offsets_of(offsets, a, b);
            distances_of(of_a, of_b, &block, &tables[0][0], offsets);
            update(nearest + q, second + q, of_a, &block, a);
            if (other != q) update(nearest + other, second + other, of_b, &block, b);
        }
    }
}

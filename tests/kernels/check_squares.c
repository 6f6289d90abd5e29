/* Descriptors of bytes (contracts/squares.h). */
#include "kernels/check.h"

#include <string.h>

#include "kernels/kernels.h"

void check_squares_two_u8(struct check *check, fv_k_squares_two_u8_fn *reference,
                          fv_k_squares_two_u8_fn *variant)
{
    const int32_t groups = check_between(check, 1, 5), queries = check_between(check, 0, 11);
    const int32_t words = check_between(check, 1, FV_SQUARES_WORDS_MAX);
    const size_t train_bytes = (size_t)groups * 64 * (size_t)words;
    const size_t query_bytes = (size_t)queries * 4 * (size_t)words;
    uint8_t *trains = check_buffer(check, train_bytes, 64, 0);
    int8_t *query = check_buffer(check, query_bytes, 4, 0);
    int32_t *bias = check_buffer(check, (size_t)groups * 64, 64, 0);
    check_fill(check, trains, train_bytes);
    check_fill(check, query, query_bytes);
    const int equal = check_between(check, 0, 2) == 0; /* many ties */
    for (int32_t i = 0; i < groups * FV_SQUARES_GROUP; i++)
        bias[i] = equal ? check_between(check, 0, 1) : check_between(check, -8000000, 8000000);
    if (equal) memset(query, 0, query_bytes);
    bias[groups * FV_SQUARES_GROUP - 1] = FV_SQUARES_NONE;
    int32_t *results[2][3];
    for (int i = 0; i < 2; i++) {
        for (int k = 0; k < 3; k++)
            results[i][k] = check_buffer(check, 4 * (size_t)queries, 4, 0);
        (i == 0 ? reference : variant)(results[i][0], results[i][1], (uint32_t *)results[i][2],
                                       query, queries, trains, bias, groups, words);
    }
    check_equal(check, "nearest", results[0][0], results[1][0], 4 * (size_t)queries);
    check_equal(check, "second", results[0][1], results[1][1], 4 * (size_t)queries);
    check_equal(check, "index", results[0][2], results[1][2], 4 * (size_t)queries);
}

void bench_squares_two_u8(struct check *check, fv_k_squares_two_u8_fn *variant)
{
    enum { COUNT = 992, WORDS = 32 };
    static int32_t nearest[COUNT], second[COUNT], bias[COUNT] __attribute__((aligned(64)));
    static uint32_t index[COUNT];
    static uint8_t trains[COUNT * 4 * WORDS] __attribute__((aligned(64)));
    static int8_t queries[COUNT * 4 * WORDS] __attribute__((aligned(4)));
    strcpy(check->size, "992 x 992 of 128 bytes");
    if (trains[0] == 0)
        for (int i = 0; i < COUNT * 4 * WORDS; i++) {
            trains[i] = bench_image()[i] | 1;
            queries[i] = (int8_t)(bench_image()[i + 7] - 128);
        }
    variant(nearest, second, index, queries, COUNT, trains, bias, COUNT / FV_SQUARES_GROUP, WORDS);
}

void check_squares_bound_s16(struct check *check, fv_k_squares_bound_s16_fn *reference,
                             fv_k_squares_bound_s16_fn *variant)
{
    const int32_t groups = check_between(check, 1, 4), pairs = 2 * check_between(check, 1, 32);
    const int32_t count = groups * FV_BOUND_GROUP;
    const int32_t stride = count + FV_BOUND_GROUP * check_between(check, 0, 1);
    const size_t train_bytes = 2 * (size_t)count * (size_t)pairs;
    const size_t query_bytes = 2 * (size_t)pairs * FV_BOUND_QUERIES;
    uint8_t *trains = check_buffer(check, train_bytes, 64, 0);
    int8_t *queries = check_buffer(check, query_bytes, 1, 0);
    int16_t *half = check_buffer(check, 2 * (size_t)count, 64, 0);
    check_fill(check, half, 2 * (size_t)count);
    for (size_t i = 0; i < train_bytes; i++)
        trains[i] = (uint8_t)check_between(check, 1, 127);
    const int extreme = check_between(check, 0, 3) == 0;
    for (size_t i = 0; i < query_bytes; i++)
        queries[i] = (int8_t)(extreme ? 63 : check_between(check, -63, 63));
    if (extreme) memset(trains, 127, train_bytes);
    const size_t bytes = 2 * (size_t)stride * FV_BOUND_QUERIES;
    const size_t least_bytes = 2 * (size_t)FV_BOUND_LANES * FV_BOUND_QUERIES;
    int16_t *rows[2], *least[2];
    for (int i = 0; i < 2; i++) {
        rows[i] = check_buffer(check, bytes, 64, 0);
        least[i] = check_buffer(check, least_bytes, 2, 0);
        memset(rows[i], 0, bytes);
        (i == 0 ? reference : variant)(rows[i], stride, least[i], queries, trains, half, groups,
                                       pairs);
    }
    check_equal(check, "rows", rows[0], rows[1], bytes);
    check_equal(check, "least", least[0], least[1], least_bytes);
}

enum { BENCH_BOUNDS = 992, BENCH_PAIRS = 20 };

void bench_squares_bound_s16(struct check *check, fv_k_squares_bound_s16_fn *variant)
{
    static int16_t rows[FV_BOUND_QUERIES * BENCH_BOUNDS] __attribute__((aligned(64)));
    static int16_t half[BENCH_BOUNDS] __attribute__((aligned(64)));
    static int16_t least[FV_BOUND_QUERIES * FV_BOUND_LANES];
    static uint8_t trains[2 * BENCH_PAIRS * BENCH_BOUNDS] __attribute__((aligned(64)));
    static int8_t queries[2 * BENCH_PAIRS * BENCH_BOUNDS];
    strcpy(check->size, "992 x 992 of 40 values");
    if (trains[0] == 0)
        for (int i = 0; i < 2 * BENCH_PAIRS * BENCH_BOUNDS; i++) {
            trains[i] = (uint8_t)(1 + bench_image()[i] % 127);
            queries[i] = (int8_t)(bench_image()[i + 7] % 127 - 63);
        }
    for (int q = 0; q < BENCH_BOUNDS; q += FV_BOUND_QUERIES)
        variant(rows, BENCH_BOUNDS, least, queries + (size_t)q * 2 * BENCH_PAIRS, trains, half,
                BENCH_BOUNDS / FV_BOUND_GROUP, BENCH_PAIRS);
}

void check_squares_below_s16(struct check *check, fv_k_squares_below_s16_fn *reference,
                             fv_k_squares_below_s16_fn *variant)
{
    const int32_t count = FV_BOUND_GROUP * check_between(check, 0, 6);
    const int16_t limit = (int16_t)check_between(check, -32768, 32767);
    int16_t *row = check_buffer(check, 2 * (size_t)count, 64, 0);
    check_fill(check, row, 2 * (size_t)count);
    for (int32_t i = 0; i < count; i += check_between(check, 1, 9))
        row[i] = limit;
    uint16_t *found[2];
    int32_t counts[2];
    for (int i = 0; i < 2; i++) {
        found[i] = check_buffer(check, 2 * (size_t)count, 2, 0);
        counts[i] = (i == 0 ? reference : variant)(found[i], row, count, limit);
    }
    check_equal(check, "count", &counts[0], &counts[1], sizeof counts[0]);
    check_equal(check, "indices", found[0], found[1], 2 * (size_t)counts[0]);
}

void bench_squares_below_s16(struct check *check, fv_k_squares_below_s16_fn *variant)
{
    static int16_t row[BENCH_BOUNDS] __attribute__((aligned(64)));
    static uint16_t found[BENCH_BOUNDS];
    strcpy(check->size, "992 x 992, 2 % below");
    if (row[0] == 0)
        for (int i = 0; i < BENCH_BOUNDS; i++)
            row[i] = (int16_t)(1 + (i * 37) % 997);
    for (int q = 0; q < BENCH_BOUNDS; q++)
        variant(found, row, BENCH_BOUNDS, 20);
}

void check_squares_some_u8(struct check *check, fv_k_squares_some_u8_fn *reference,
                           fv_k_squares_some_u8_fn *variant)
{
    const int32_t bytes = check_between(check, 1, 128), trains = check_between(check, 1, 20);
    const int32_t count = check_between(check, 0, 30);
    const size_t size = (size_t)bytes * (size_t)trains;
    uint8_t *query = check_buffer(check, (size_t)bytes, 1, 0);
    uint8_t *descriptors = check_buffer(check, size, 1, 0);
    uint16_t *indices = check_buffer(check, 2 * (size_t)count, 2, 0);
    check_fill(check, query, (size_t)bytes);
    check_fill(check, descriptors, size);
    if (check_between(check, 0, 3) == 0) {
        memset(query, 255, (size_t)bytes);
        memset(descriptors, 0, size);
    }
    for (int32_t i = 0; i < count; i++)
        indices[i] = (uint16_t)check_between(check, 0, trains - 1);
    int32_t *expected = check_buffer(check, 4 * (size_t)count, 4, 0);
    int32_t *found = check_buffer(check, 4 * (size_t)count, 4, 0);
    reference(expected, query, descriptors, bytes, indices, count);
    variant(found, query, descriptors, bytes, indices, count);
    check_equal(check, "distances", expected, found, 4 * (size_t)count);
}

void bench_squares_some_u8(struct check *check, fv_k_squares_some_u8_fn *variant)
{
    enum { CANDIDATES = 30, BYTES = 128 };
    int32_t distances[CANDIDATES];
    uint16_t indices[CANDIDATES];
    strcpy(check->size, "992 x 30 of 128 bytes");
    for (int q = 0; q < BENCH_BOUNDS; q++) {
        for (int i = 0; i < CANDIDATES; i++)
            indices[i] = (uint16_t)((q + 37 * i) % BENCH_BOUNDS);
        variant(distances, bench_image() + BYTES * (size_t)q, bench_image() + 64, BYTES, indices,
                CANDIDATES);
    }
}

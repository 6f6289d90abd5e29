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

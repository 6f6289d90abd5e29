#include "kernels/check.h"

#include <string.h>

/* Descriptors, some of them near or equal to earlier ones, so that distances tie and reach 0 and
 * 256. */
static uint8_t *random_descriptors(struct check *check, int32_t count)
{
    uint8_t *all = check_buffer(check, FV_DESCRIPTOR_BYTES * (size_t)count, 8, 0);
    check_fill(check, all, FV_DESCRIPTOR_BYTES * (size_t)count);
    for (int32_t i = 1; i < count; i++) {
        uint8_t *one = all + FV_DESCRIPTOR_BYTES * i;
        const int32_t kind = check_between(check, 0, 3);
        if (kind < 2) memcpy(one, one - FV_DESCRIPTOR_BYTES, FV_DESCRIPTOR_BYTES);
        if (kind == 1)
            for (int k = 0; k < FV_DESCRIPTOR_BYTES; k++)
                one[k] = (uint8_t)~one[k];
    }
    return all;
}

/* Up to four trains become queries, at a distance of 0, or complements of queries, at a distance of
 * 256 or a little less. */
static void put_queries(struct check *check, uint8_t *train, int32_t trains, const uint8_t *query,
                        int32_t queries)
{
    const int32_t count = check_between(check, 0, 4), kind = check_between(check, 0, 2);
    for (int32_t i = 0; i < count && queries > 0 && trains > 0; i++) {
        uint8_t *to = train + FV_DESCRIPTOR_BYTES * check_between(check, 0, trains - 1);
        const uint8_t *from = query + FV_DESCRIPTOR_BYTES * check_between(check, 0, queries - 1);
        for (int k = 0; k < FV_DESCRIPTOR_BYTES; k++)
            to[k] = kind == 0 ? from[k] : (uint8_t)~from[k];
        if (kind == 1) to[0] ^= (uint8_t)check_random(check);
    }
}

/* Trains of up to three blocks of the kernel for AVX2. */
void check_hamming_two_u8(struct check *check, fv_k_hamming_two_u8_fn *reference,
                          fv_k_hamming_two_u8_fn *variant)
{
    const int32_t queries = check_between(check, 0, 40);
    const int32_t trains = check_between(check, 0, check_between(check, 0, 1) == 0 ? 40 : 300);
    const uint8_t *query = random_descriptors(check, queries);
    uint8_t *train = random_descriptors(check, trains);
    put_queries(check, train, trains, query, queries);
    const size_t bytes = 4 * (size_t)queries;
    uint32_t *expected = check_buffer(check, bytes, 4, 0),
             *found = check_buffer(check, bytes, 4, 0);
    uint32_t *expected_2 = check_buffer(check, bytes, 4, 0),
             *found_2 = check_buffer(check, bytes, 4, 0);
    reference(expected, expected_2, query, queries, train, trains);
    variant(found, found_2, query, queries, train, trains);
    check_equal(check, "nearest", expected, found, bytes);
    check_equal(check, "second", expected_2, found_2, bytes);
}

enum { BENCH_DESCRIPTORS = 1000 };

static const uint8_t *bench_descriptors(void)
{
    static uint8_t all[2 * BENCH_DESCRIPTORS * FV_DESCRIPTOR_BYTES] __attribute__((aligned(8)));
    struct check draw = {.random = 3};
    for (size_t i = 0; all[0] == 0 && i < sizeof all; i++)
        all[i] = (uint8_t)(check_random(&draw) | (i == 0));
    return all;
}

void bench_hamming_two_u8(struct check *check, fv_k_hamming_two_u8_fn *variant)
{
    strcpy(check->size, "1000 x 1000");
    const uint8_t *all = bench_descriptors();
    uint32_t *out = (uint32_t *)(void *)bench_scratch();
    variant(out, out + BENCH_DESCRIPTORS, all, BENCH_DESCRIPTORS,
            all + BENCH_DESCRIPTORS * FV_DESCRIPTOR_BYTES, BENCH_DESCRIPTORS);
}

void check_hamming_some_u8(struct check *check, fv_k_hamming_some_u8_fn *reference,
                           fv_k_hamming_some_u8_fn *variant)
{
    const int32_t trains = check_between(check, 1, 40), count = check_between(check, 0, 60);
    const uint8_t *query = random_descriptors(check, 1), *train = random_descriptors(check, trains);
    uint16_t *indices = check_buffer(check, 2 * (size_t)count, 2, 0);
    for (int32_t i = 0; i < count; i++)
        indices[i] = (uint16_t)check_between(check, 0, trains - 1);
    uint16_t *expected = check_buffer(check, 2 * (size_t)count, 2, 0),
             *found = check_buffer(check, 2 * (size_t)count, 2, 0);
    reference(expected, query, train, indices, count);
    variant(found, query, train, indices, count);
    check_equal(check, "distances", expected, found, 2 * (size_t)count);
}

void bench_hamming_some_u8(struct check *check, fv_k_hamming_some_u8_fn *variant)
{
    enum { CANDIDATES = 30 };
    strcpy(check->size, "1000 x 30");
    const uint8_t *all = bench_descriptors();
    uint16_t indices[CANDIDATES], *out = (uint16_t *)(void *)bench_scratch();
    for (int q = 0; q < BENCH_DESCRIPTORS; q++) {
        for (int i = 0; i < CANDIDATES; i++)
            indices[i] = (uint16_t)((q + 37 * i) % BENCH_DESCRIPTORS);
        variant(out + CANDIDATES * q, all + FV_DESCRIPTOR_BYTES * q,
                all + BENCH_DESCRIPTORS * FV_DESCRIPTOR_BYTES, indices, CANDIDATES);
    }
}

/* The search by bounds against plain loops: every pair that passes the ratio test, to the last bit,
 * with ties, values that were clipped, few descriptors, and on the C kernels as on the best. */
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/elementary.h"
#include "features/bounded.h"

enum { COUNT = 700, CENTRES = 40 };

static uint8_t descriptors[2][COUNT * FV_BOUNDED_SIZE_MAX];
static int32_t distance[COUNT], second[COUNT];
static uint32_t nearest[COUNT];

/* Descriptors about a few centres; some the same as the one before, some far from all. Of 700,
 * every third is looked at to choose steps, and none of the far ones, so that their values are
 * clipped. */
static void fill(uint32_t bytes, uint64_t seed)
{
    static uint8_t centres[CENTRES * FV_BOUNDED_SIZE_MAX];
    struct fv_random random;
    fv_random_seed(&random, seed);
    for (size_t i = 0; i < sizeof centres; i++)
        centres[i] = (uint8_t)(fv_random_below(&random, 4) == 0 ? fv_random_below(&random, 150)
                                                                : fv_random_below(&random, 40));
    for (int k = 0; k < 2; k++)
        for (size_t i = 0; i < COUNT; i++) {
            uint8_t *one = descriptors[k] + bytes * i;
            const uint8_t *centre = centres + bytes * fv_random_below(&random, CENTRES);
            const uint32_t kind = fv_random_below(&random, 50);
            const uint32_t noise = 1 + fv_random_below(&random, 60);
            for (uint32_t b = 0; b < bytes; b++)
                one[b] = (uint8_t)(centre[b] + fv_random_below(&random, noise));
            if (kind < 4 && i % 3 == 1) memset(one, 255 - (int)kind % 2, bytes);
            if (kind == 4 && i % 3 == 2)
                for (uint32_t b = 0; b < bytes; b++)
                    one[b] = (uint8_t)(b % 2 * 255);
            if (kind == 5 && i > 0) memcpy(one, one - bytes, bytes);
        }
}

/* Descriptors that few coefficients describe: bounds are as large as distances. */
static void fill_smooth(uint32_t bytes)
{
    struct fv_random random;
    fv_random_seed(&random, 3);
    for (int k = 0; k < 2; k++)
        for (size_t i = 0; i < COUNT; i++) {
            const uint32_t low = fv_random_below(&random, 100),
                           high = fv_random_below(&random, 100);
            for (uint32_t b = 0; b < bytes; b++)
                descriptors[k][bytes * i + b] = (uint8_t)(b % 2 != 0 ? high : low);
        }
}

static int32_t distance_of(uint32_t bytes, uint32_t i, uint32_t j)
{
    int32_t sum = 0;
    for (uint32_t b = 0; b < bytes; b++) {
        const int32_t apart = descriptors[0][bytes * i + b] - descriptors[1][bytes * j + b];
        sum += apart * apart;
    }
    return sum;
}

struct plain {
    int32_t distance, second;
    uint32_t index;
};

static struct plain plain_two(uint32_t bytes, uint32_t i, uint32_t count)
{
    struct plain two = {FV_SQUARES_NONE, FV_SQUARES_NONE, 0};
    for (uint32_t j = 0; j < count; j++) {
        const int32_t found = distance_of(bytes, i, j);
        if (found < two.distance)
            two = (struct plain){found, two.distance, j};
        else if (found < two.second)
            two.second = found;
    }
    return two;
}

static bool passes(int32_t found, int32_t other, float ratio)
{
    return ratio >= 1 || __builtin_sqrtf((float)found) < ratio * __builtin_sqrtf((float)other);
}

static void check_back(struct fv_bounded *bounded, const struct fv_kernels *kernels, uint32_t bytes,
                       const uint32_t counts[2])
{
    static uint32_t back[COUNT];
    fv_bounded_back(bounded, kernels, nearest, distance, counts[0], back);
    for (uint32_t i = 0; i < counts[0]; i++) {
        uint32_t best = 0;
        for (uint32_t a = 1; a < counts[0]; a++)
            if (distance_of(bytes, a, nearest[i]) < distance_of(bytes, best, nearest[i])) best = a;
        assert_int_equal(back[i], best);
    }
}

static uint32_t check(struct fv_bounded *bounded, const struct fv_kernels *kernels, uint32_t bytes,
                      const uint32_t counts[2], float ratio)
{
    const uint8_t *const both[2] = {descriptors[0], descriptors[1]};
    uint32_t kept = 0;
    assert_true(fv_bounded_pack(bounded, both, counts));
    fv_bounded_two(bounded, kernels, ratio, distance, second, nearest);
    for (uint32_t i = 0; i < counts[0]; i++) {
        const struct plain expected = plain_two(bytes, i, counts[1]);
        const bool pass = passes(expected.distance, expected.second, ratio);
        assert_int_equal(passes(distance[i], second[i], ratio), pass);
        if (!pass) continue;
        assert_int_equal(distance[i], expected.distance);
        assert_int_equal(second[i], expected.second);
        assert_int_equal(nearest[i], expected.index);
        kept++;
    }
    if (ratio >= 1) check_back(bounded, kernels, bytes, counts);
    return kept;
}

static void pairs_are_those_of_plain_loops(void **state)
{
    (void)state;
    static const uint32_t sizes[] = {33, 64, 81, 128},
                          counts[][2] = {{COUNT, COUNT - 1}, {33, 129}, {5, 1}};
    static const float ratios[] = {1, .8f};
    for (size_t s = 0; s < sizeof sizes / sizeof sizes[0]; s++)
        for (int set = 0; set < 2; set++) {
            struct fv_arena arena;
            struct fv_bounded bounded;
            struct fv_kernels kernels;
            fv_arena_count(&arena);
            fv_bounded_carve(&bounded, COUNT, sizes[s], &arena);
            const size_t bytes = arena.used;
            void *memory = aligned_alloc(64, (bytes + 63) / 64 * 64);
            assert_non_null(memory);
            fv_arena_init(&arena, memory, bytes);
            fv_bounded_carve(&bounded, COUNT, sizes[s], &arena);
            assert_false(arena.exhausted);
            enum fv_cpu_set best;
            assert_int_equal(fv_cpu_from_environment(&best, NULL), FOVEA_OK);
            fv_kernels_init(&kernels, set == 0 ? FV_CPU_C : best);
            fill(sizes[s], 7 + s);
            for (size_t c = 0; c < sizeof counts / sizeof counts[0]; c++)
                for (size_t r = 0; r < 2; r++) {
                    const uint32_t kept = check(&bounded, &kernels, sizes[s], counts[c], ratios[r]);
                    if (c == 0 && r == 1) assert_in_range(kept, 1, COUNT - 1);
                }
            fill_smooth(sizes[s]);
            check(&bounded, &kernels, sizes[s], counts[0], 1);
            free(memory);
        }
}

static void noise_is_refused(void **state)
{
    (void)state;
    struct fv_arena arena;
    struct fv_bounded bounded;
    fv_arena_count(&arena);
    fv_bounded_carve(&bounded, COUNT, FV_BOUNDED_SIZE_MAX, &arena);
    const size_t bytes = arena.used;
    void *memory = aligned_alloc(64, (bytes + 63) / 64 * 64);
    fv_arena_init(&arena, memory, bytes);
    fv_bounded_carve(&bounded, COUNT, FV_BOUNDED_SIZE_MAX, &arena);
    const uint8_t *const both[2] = {descriptors[0], descriptors[1]};
    memset(descriptors, 0, sizeof descriptors);
    memset(descriptors[0], 255, FV_BOUNDED_SIZE_MAX);
    assert_false(fv_bounded_pack(&bounded, both, (const uint32_t[2]){COUNT, COUNT}));
    free(memory);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(pairs_are_those_of_plain_loops),
        cmocka_unit_test(noise_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

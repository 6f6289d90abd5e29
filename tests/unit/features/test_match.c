/* Matching against plain loops over all pairs. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "common/carved.h"
#include "features/match.h"
#include "base/elementary.h"

enum { COUNT = 300 };

struct world {
    struct fv_kernels kernels;
    struct fv_matcher matcher;
    void *memory;
    _Alignas(8) uint8_t queries[COUNT][FV_DESCRIPTOR_BYTES];
    _Alignas(8) uint8_t trains[COUNT][FV_DESCRIPTOR_BYTES];
    struct fv_match matches[COUNT];
};

static void carve(void *context, struct fv_arena *arena)
{
    struct world *world = context;
    fv_matcher_carve(&world->matcher, COUNT, arena);
}

/* Trains: random points; queries: the trains in reverse order with some bits turned over, two of
 * them twice.
 */
static int set_up(void **state)
{
    struct world *world = calloc(1, sizeof *world);
    struct fv_random random;
    fv_random_seed(&random, 5);
    fv_kernels_init(&world->kernels, fv_cpu_best(fv_cpu_detect()));
    world->memory = carved(carve, world);
    for (int t = 0; t < COUNT; t++) {
        for (int i = 0; i < FV_DESCRIPTOR_BYTES; i++)
            world->trains[t][i] = (uint8_t)fv_random_u32(&random);
        if (t % 50 == 49) memcpy(world->trains[t], world->trains[t - 1], FV_DESCRIPTOR_BYTES);
    }
    for (int q = 0; q < COUNT; q++) {
        memcpy(world->queries[q], world->trains[COUNT - 1 - q], FV_DESCRIPTOR_BYTES);
        for (uint32_t i = fv_random_below(&random, 60); i > 0; i--)
            world->queries[q][fv_random_below(&random, 32)] ^=
                (uint8_t)(1u << fv_random_below(&random, 8));
    }
    *state = world;
    return 0;
}

static int tear_down(void **state)
{
    struct world *world = *state;
    free(world->memory);
    free(world);
    return 0;
}

static int distance(const uint8_t *a, const uint8_t *b)
{
    int sum = 0;
    for (int i = 0; i < FV_DESCRIPTOR_BYTES; i++)
        sum += __builtin_popcount((unsigned)(a[i] ^ b[i]));
    return sum;
}

/* Nearest and second of the rows; the lower index wins ties. */
static struct fv_match nearest(const uint8_t *query, uint8_t (*rows)[FV_DESCRIPTOR_BYTES])
{
    struct fv_match match = {0, 0xffff, 257, 257};
    for (int t = 0; t < COUNT; t++) {
        const int d = distance(query, rows[t]);
        if (d < match.distance) {
            match.second = match.distance;
            match.distance = (uint16_t)d;
            match.train = (uint16_t)t;
        } else if (d < match.second) {
            match.second = (uint16_t)d;
        }
    }
    return match;
}

static void same(const struct fv_match *found, const struct fv_match *expected)
{
    assert_int_equal(found->query, expected->query);
    assert_int_equal(found->train, expected->train);
    assert_int_equal(found->distance, expected->distance);
    assert_int_equal(found->second, expected->second);
}

static void all_follow_the_rules(void **state)
{
    struct world *world = *state;
    const struct fv_match_rules rules[] = {
        {256, 256, false}, {40, 256, false}, {256, 205, false}, {256, 256, true}, {60, 128, true}};
    uint32_t counts[5];
    for (size_t r = 0; r < 5; r++) {
        const uint32_t count =
            fv_match_all(&world->matcher, &world->kernels, world->queries[0], COUNT,
                         world->trains[0], COUNT, &rules[r], world->matches);
        uint32_t k = 0;
        for (int q = 0; q < COUNT; q++) {
            struct fv_match expected = nearest(world->queries[q], world->trains);
            expected.query = (uint16_t)q;
            if (expected.distance > rules[r].distance_max) continue;
            if (rules[r].ratio_q8 < 256 &&
                256 * expected.distance >= rules[r].ratio_q8 * expected.second)
                continue;
            if (rules[r].mutual &&
                nearest(world->trains[expected.train], world->queries).train != q)
                continue;
            assert_true(k < count);
            same(&world->matches[k++], &expected);
        }
        assert_int_equal(k, count);
        counts[r] = count;
    }
    /* Each rule does something. */
    assert_int_equal(counts[0], COUNT);
    for (size_t r = 1; r < 5; r++)
        assert_in_range(counts[r], COUNT / 4, COUNT - 1);
}

static void empty_sets_match_nothing(void **state)
{
    struct world *world = *state;
    const struct fv_match_rules rules = {256, 256, true};
    assert_int_equal(fv_match_all(&world->matcher, &world->kernels, world->queries[0], COUNT,
                                  world->trains[0], 0, &rules, world->matches),
                     0);
    assert_int_equal(fv_match_all(&world->matcher, &world->kernels, world->queries[0], 0,
                                  world->trains[0], COUNT, &rules, world->matches),
                     0);
    /* One train: no second, so the ratio test passes. */
    const struct fv_match_rules ratio = {256, 205, false};
    assert_int_equal(fv_match_all(&world->matcher, &world->kernels, world->trains[0], 1,
                                  world->trains[0], 1, &ratio, world->matches),
                     1);
    assert_int_equal(world->matches[0].second, 257);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(all_follow_the_rules, set_up, tear_down),
        cmocka_unit_test_setup_teardown(empty_sets_match_nothing, set_up, tear_down),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

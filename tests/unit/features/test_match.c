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
#include "fovea/elementary.h"

enum { COUNT = 300, WIDTH = 640, HEIGHT = 480 };

struct world {
    struct fv_kernels kernels;
    struct fv_matcher matcher;
    struct fv_grid grid;
    void *memory;
    struct fv_grid_point points[COUNT];
    _Alignas(8) uint8_t queries[COUNT][FV_DESCRIPTOR_BYTES];
    _Alignas(8) uint8_t trains[COUNT][FV_DESCRIPTOR_BYTES];
    struct fv_match matches[COUNT];
};

static void carve(void *context, struct fv_arena *arena)
{
    struct world *world = context;
    fv_matcher_carve(&world->matcher, COUNT, arena);
    fv_grid_carve(&world->grid, WIDTH, HEIGHT, COUNT, arena);
}

/* Trains: random points; queries: the trains in reverse order with some bits turned over, two of
 * them twice.
 */
static int set_up(void **state)
{
    struct world *world = calloc(1, sizeof *world);
    struct fovea_random random;
    fovea_random_seed(&random, 5);
    fv_kernels_init(&world->kernels, fv_cpu_best(fv_cpu_detect()));
    world->memory = carved(carve, world);
    for (int t = 0; t < COUNT; t++) {
        world->points[t] = (struct fv_grid_point){
            (float)fovea_random_below(&random, WIDTH), (float)fovea_random_below(&random, HEIGHT),
            (uint16_t)t, (uint8_t)fovea_random_below(&random, 8), 0};
        for (int i = 0; i < FV_DESCRIPTOR_BYTES; i++)
            world->trains[t][i] = (uint8_t)fovea_random_u32(&random);
        if (t % 50 == 49) memcpy(world->trains[t], world->trains[t - 1], FV_DESCRIPTOR_BYTES);
    }
    for (int q = 0; q < COUNT; q++) {
        memcpy(world->queries[q], world->trains[COUNT - 1 - q], FV_DESCRIPTOR_BYTES);
        for (uint32_t i = fovea_random_below(&random, 60); i > 0; i--)
            world->queries[q][fovea_random_below(&random, 32)] ^=
                (uint8_t)(1u << fovea_random_below(&random, 8));
    }
    fv_grid_build(&world->grid, world->points, COUNT);
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

/* Nearest and second among the rows for which `allowed` holds; the lower index wins ties. */
static struct fv_match nearest(const uint8_t *query, uint8_t (*rows)[FV_DESCRIPTOR_BYTES],
                               const bool *allowed)
{
    struct fv_match match = {0, 0xffff, 257, 257};
    for (int t = 0; t < COUNT; t++) {
        if (allowed != NULL && !allowed[t]) continue;
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
            struct fv_match expected = nearest(world->queries[q], world->trains, NULL);
            expected.query = (uint16_t)q;
            if (expected.distance > rules[r].distance_max) continue;
            if (rules[r].ratio_q8 < 256 &&
                256 * expected.distance >= rules[r].ratio_q8 * expected.second)
                continue;
            if (rules[r].mutual &&
                nearest(world->trains[expected.train], world->queries, NULL).train != q)
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

static struct fv_match_window window_of(const struct fv_grid_point *point, int q)
{
    const float off = (float)(q % 7 - 3);
    return (struct fv_match_window){point->x_px + off, point->y_px - off, 30,
                                    (uint8_t)(point->level > 0 ? point->level - 1 : 0),
                                    (uint8_t)(point->level + 1)};
}

static void windows_restrict_the_search(void **state)
{
    struct world *world = *state;
    const struct fv_match_rules rules = {256, 256, false};
    int fewer = 0;
    for (int q = 0; q < COUNT; q++) {
        const struct fv_match_window window = window_of(&world->points[COUNT - 1 - q], q);
        bool allowed[COUNT];
        for (int t = 0; t < COUNT; t++) {
            const struct fv_grid_point *p = &world->points[t];
            const float dx = p->x_px - window.x_px, dy = p->y_px - window.y_px;
            allowed[t] = dx <= 30 && dx >= -30 && dy <= 30 && dy >= -30 &&
                         p->level >= window.level_min && p->level <= window.level_max;
        }
        struct fv_match expected = nearest(world->queries[q], world->trains, allowed),
                        found = {(uint16_t)q, 0, 0, 0};
        expected.query = (uint16_t)q;
        assert_true(fv_match_window(&world->kernels, &world->grid, world->trains[0],
                                    world->queries[q], &window, &rules, &found));
        same(&found, &expected);
        fewer += found.second > nearest(world->queries[q], world->trains, NULL).second;
    }
    assert_true(fewer > COUNT / 2);
    const struct fv_match_window nowhere = {-500, -500, 10, 0, 7};
    struct fv_match untouched = {1, 2, 3, 4};
    assert_false(fv_match_window(&world->kernels, &world->grid, world->trains[0], world->queries[0],
                                 &nowhere, &rules, &untouched));
    assert_int_equal(untouched.distance, 3);
}

static void guided_gives_a_train_once(void **state)
{
    struct world *world = *state;
    struct fv_match_window windows[COUNT];
    /* All queries look everywhere: trains that are nearest to several queries go to one of them. */
    for (int q = 0; q < COUNT; q++)
        windows[q] = (struct fv_match_window){WIDTH / 2, HEIGHT / 2, 60, 0, 7};
    struct fv_match_rules rules = {256, 256, false};
    const uint32_t loose =
        fv_match_guided(&world->matcher, &world->kernels, &world->grid, world->trains[0], COUNT,
                        world->queries[0], COUNT, windows, &rules, world->matches);
    assert_int_equal(loose, COUNT);
    uint16_t best[COUNT];
    memset(best, 0xff, sizeof best);
    for (uint32_t i = 0; i < loose; i++)
        if (world->matches[i].distance < best[world->matches[i].train])
            best[world->matches[i].train] = world->matches[i].distance;
    rules.mutual = true;
    const uint32_t count =
        fv_match_guided(&world->matcher, &world->kernels, &world->grid, world->trains[0], COUNT,
                        world->queries[0], COUNT, windows, &rules, world->matches);
    bool taken[COUNT] = {false};
    uint32_t claimed = 0;
    for (int t = 0; t < COUNT; t++)
        claimed += best[t] != 0xffff;
    assert_int_equal(count, claimed);
    for (uint32_t i = 0; i < count; i++) {
        assert_false(taken[world->matches[i].train]);
        taken[world->matches[i].train] = true;
        assert_int_equal(world->matches[i].distance, best[world->matches[i].train]);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(all_follow_the_rules, set_up, tear_down),
        cmocka_unit_test_setup_teardown(empty_sets_match_nothing, set_up, tear_down),
        cmocka_unit_test_setup_teardown(windows_restrict_the_search, set_up, tear_down),
        cmocka_unit_test_setup_teardown(guided_gives_a_train_once, set_up, tear_down),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

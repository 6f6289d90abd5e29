/* Spread: counts, cover, thresholds, order and bounds, on made-up corners. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdlib.h>
#include <string.h>

#include "common/carved.h"
#include "features/spread.h"
#include "base/elementary.h"
#include "image/pyramid.h"

enum { LEVELS = 3, COUNT_MAX = 600 };

static const int32_t width[LEVELS] = {640, 533, 444}, height[LEVELS] = {480, 400, 333};

static void carve(void *context, struct fv_arena *arena)
{
    fv_spread_carve(context, LEVELS, width, height, COUNT_MAX, arena);
}

/* Corners in raster order, at each place with a chance of one in `rarity`. */
static void offer_random(struct fv_spread *spread, uint32_t level, uint32_t rarity, uint32_t seed)
{
    struct fv_random random;
    fv_random_seed(&random, seed + level);
    for (int32_t y = 19; y < height[level] - 19; y += 2)
        for (int32_t x = 19; x < width[level] - 19; x += 2)
            if (fv_random_below(&random, rarity) == 0)
                fv_spread_offer(spread, level, x, y, (uint8_t)(7 + fv_random_below(&random, 120)));
}

static uint32_t fields_with_corner(const struct fv_corner *corners, uint32_t count)
{
    bool has[FV_SPREAD_COVER][FV_SPREAD_COVER] = {{false}};
    uint32_t fields = 0;
    for (uint32_t i = 0; i < count; i++) {
        const float x = fv_pyramid_to_raw(corners[i].level, corners[i].x) + 0.5f;
        const float y = fv_pyramid_to_raw(corners[i].level, corners[i].y) + 0.5f;
        bool *field = &has[(int)(y * FV_SPREAD_COVER / (float)height[0])]
                          [(int)(x * FV_SPREAD_COVER / (float)width[0])];
        fields += !*field;
        *field = true;
    }
    return fields;
}

static void picks_exactly_what_is_asked_where_there_is_enough(void **state)
{
    (void)state;
    struct fv_spread spread;
    struct fv_corner corners[COUNT_MAX];
    void *memory = carved(carve, &spread);
    for (uint32_t count = 1; count <= COUNT_MAX; count += 37) {
        fv_spread_begin(&spread, count, 20, 3);
        for (uint32_t level = LEVELS; level-- > 0;)
            offer_random(&spread, level, 4, 1);
        assert_int_equal(fv_spread_pick(&spread, corners), count);
        for (uint32_t i = 0; i < count; i++)
            for (uint32_t k = 0; k < i; k++)
                assert_memory_not_equal(&corners[i], &corners[k], sizeof corners[i]);
        for (uint32_t i = 1; i < count; i++)
            assert_true(corners[i].level <= corners[i - 1].level);
        if (count >= 256) assert_true(fields_with_corner(corners, count) >= FV_SPREAD_WANTED);
    }
    free(memory);
}

static void picks_all_where_there_are_few(void **state)
{
    (void)state;
    struct fv_spread spread;
    struct fv_corner corners[COUNT_MAX];
    void *memory = carved(carve, &spread);
    fv_spread_begin(&spread, 100, 20, 3);
    assert_int_equal(fv_spread_pick(&spread, corners), 0);
    fv_spread_begin(&spread, 100, 20, 3);
    fv_spread_offer(&spread, 2, 30, 30, 9);
    fv_spread_offer(&spread, 0, 639, 479, 9);
    assert_int_equal(fv_spread_pick(&spread, corners), 2);
    assert_int_equal(corners[0].level, 2);
    assert_int_equal(corners[1].x, 639);
    free(memory);
}

static void a_strong_corner_silences_the_weak_ones_of_its_cell(void **state)
{
    (void)state;
    struct fv_spread spread;
    struct fv_corner corners[COUNT_MAX];
    void *memory = carved(carve, &spread);
    fv_spread_begin(&spread, 100, 20, 3);
    fv_spread_offer(&spread, 0, 100, 100, 19);
    fv_spread_offer(&spread, 0, 104, 100, 20);
    fv_spread_offer(&spread, 0, 108, 100, 19);
    assert_int_equal(fv_spread_pick(&spread, corners), 1);
    assert_int_equal(corners[0].x, 104);
    fv_spread_begin(&spread, 100, 21, 3);
    fv_spread_offer(&spread, 0, 100, 100, 19);
    fv_spread_offer(&spread, 0, 104, 100, 20);
    fv_spread_offer(&spread, 0, 108, 100, 19);
    assert_int_equal(fv_spread_pick(&spread, corners), 3);
    free(memory);
}

static void the_strongest_win_and_ties_go_to_the_first(void **state)
{
    (void)state;
    struct fv_spread spread;
    struct fv_corner corners[COUNT_MAX];
    void *memory = carved(carve, &spread);
    fv_spread_begin(&spread, 3, 20, 3);
    for (int32_t i = 0; i < 10; i++)
        fv_spread_offer(&spread, 0, 20 + 60 * i, 20, i == 7 ? 90 : 40);
    assert_int_equal(fv_spread_pick(&spread, corners), 3);
    uint32_t places = 0; /* in no order that is promised within a cell */
    for (int i = 0; i < 3; i++)
        places |= 1u << (corners[i].x - 20) / 60;
    assert_int_equal(places, 1u << 0 | 1u << 1 | 1u << 7);
    free(memory);
}

/* The later of a row the better: what is kept is picked by the other measure. */
static uint8_t by_place(const void *context, uint32_t level, int32_t x, int32_t y)
{
    (void)level;
    (void)y;
    ++*(uint32_t *)(uintptr_t)context;
    return (uint8_t)(x / 10 + 1);
}

static void another_measure_decides_among_those_that_are_kept(void **state)
{
    (void)state;
    struct fv_spread spread;
    struct fv_corner corners[COUNT_MAX];
    uint32_t calls = 0;
    void *memory = carved(carve, &spread);
    fv_spread_begin(&spread, 3, 20, 3);
    for (int32_t i = 0; i < 10; i++)
        fv_spread_offer(&spread, 0, 20 + 60 * i, 20, i == 9 ? 15 : (uint8_t)(90 - i));
    fv_spread_offer(&spread, 0, 26 + 60 * 9, 20, 25); /* silences the weak one beside it */
    fv_spread_score(&spread, by_place, &calls);
    assert_true(calls >= 10 && calls <= 20);
    assert_int_equal(fv_spread_pick(&spread, corners), 3);
    uint32_t places = 0;
    for (int i = 0; i < 3; i++) {
        places |= 1u << (corners[i].x - 20) / 60;
        assert_int_equal(corners[i].score, corners[i].x / 10 + 1);
        assert_true(corners[i].x != 20 + 60 * 9);
    }
    assert_int_equal(places, 1u << 7 | 1u << 8 | 1u << 9);
    free(memory);
}

/* Adding weak corners must not move the picks that strong ones made: what noise brings does not
 * disturb the rest. */
static void weak_corners_do_not_displace_strong_ones(void **state)
{
    (void)state;
    struct fv_spread spread;
    struct fv_corner before[COUNT_MAX], after[COUNT_MAX];
    void *memory = carved(carve, &spread);
    for (int with_noise = 0; with_noise < 2; with_noise++) {
        fv_spread_begin(&spread, 300, 20, 3);
        for (int32_t y = 20; y < 460; y += 2)
            for (int32_t x = 20; x < 620; x += 2) {
                if (x % 40 == 20 && y % 40 == 20) fv_spread_offer(&spread, 0, x, y, 100);
                if (with_noise && (x * 7 + y * 13) % 101 == 0)
                    fv_spread_offer(&spread, 0, x, y, 10);
            }
        const uint32_t count = fv_spread_pick(&spread, with_noise ? after : before);
        if (!with_noise) assert_int_equal(count, 15 * 11);
        uint32_t strong = 0;
        for (uint32_t i = 0; i < count; i++)
            strong += (with_noise ? after : before)[i].score == 100;
        assert_int_equal(strong, 15 * 11);
    }
    free(memory);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(picks_exactly_what_is_asked_where_there_is_enough),
        cmocka_unit_test(picks_all_where_there_are_few),
        cmocka_unit_test(a_strong_corner_silences_the_weak_ones_of_its_cell),
        cmocka_unit_test(the_strongest_win_and_ties_go_to_the_first),
        cmocka_unit_test(another_measure_decides_among_those_that_are_kept),
        cmocka_unit_test(weak_corners_do_not_displace_strong_ones),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

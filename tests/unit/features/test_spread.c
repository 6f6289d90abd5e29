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

/* ---- thresholds of rows ---------------------------------------------------------------------- */

enum { LEAST = 7, STRONG = 20, REGION_PX = 72, BORDER = 19 };

static uint8_t scores[480 * 640], seen[3][640];

/* Scores that crowd, in regions where none, weak ones, strong ones or very strong ones occur. */
static void fill_scores(uint32_t level, uint32_t seed)
{
    static const uint32_t most[] = {1, STRONG - LEAST, 60, 240};
    struct fv_random random;
    uint32_t strength[8][10];
    fv_random_seed(&random, seed + level);
    for (int r = 0; r < 8; r++)
        for (int c = 0; c < 10; c++)
            strength[r][c] = most[fv_random_below(&random, 4)];
    for (int32_t y = 0; y < height[level]; y++)
        for (int32_t x = 0; x < width[level]; x++) {
            const uint32_t some = strength[y / REGION_PX][x / REGION_PX],
                           value = fv_random_below(&random, some);
            scores[y * 640 + x] =
                some > 1 && fv_random_below(&random, 3) > 0 ? (uint8_t)(LEAST + value) : 0;
        }
}

static bool is_peak(const uint8_t *above, const uint8_t *row, const uint8_t *below, int32_t x)
{
    bool greater = row[x] > row[x - 1] && row[x] > row[x + 1];
    for (int32_t i = x - 1; i <= x + 1; i++)
        greater = greater && row[x] > above[i] && row[x] > below[i];
    return greater;
}

/* Offer the peaks of a level among the scores that reach the thresholds, which are asked for row by
 * row; or, with `all`, among all. Returns how many scores were left out. */
static uint32_t offer_peaks(struct fv_spread *spread, uint32_t level, bool all)
{
    uint8_t thresholds[640 + 64];
    uint32_t left_out = 0;
    memset(thresholds, LEAST, sizeof thresholds);
    for (int32_t y = BORDER - 1; y < height[level] - BORDER + 1; y++) {
        uint8_t *row = seen[y % 3];
        for (int32_t x = 0; x < width[level]; x++) {
            const uint8_t score = scores[y * 640 + x];
            row[x] = all || score >= thresholds[x] ? score : 0;
            left_out += row[x] != score;
        }
        const int32_t before = y - 1;
        if (before < BORDER) continue;
        for (int32_t x = BORDER; x < width[level] - BORDER; x++)
            if (is_peak(seen[(before + 2) % 3], seen[before % 3], row, x))
                fv_spread_offer(spread, level, x, before, seen[before % 3][x]);
        fv_spread_thresholds(spread, level, before + 2, LEAST, thresholds);
    }
    return left_out;
}

static void scores_below_the_thresholds_of_rows_change_nothing(void **state)
{
    (void)state;
    struct fv_spread whole, spared;
    struct fv_corner expected[COUNT_MAX], found[COUNT_MAX];
    void *memory[2] = {carved(carve, &whole), carved(carve, &spared)};
    for (uint32_t seed = 0; seed < 12; seed++) {
        const uint32_t asked = 100 + 40 * seed;
        const uint8_t per_cell = seed % 2 ? 3 : FV_SPREAD_KEPT;
        uint32_t left_out = 0;
        fv_spread_begin(&whole, asked, STRONG, per_cell);
        fv_spread_begin(&spared, asked, STRONG, per_cell);
        for (uint32_t level = LEVELS; level-- > 0;) {
            fill_scores(level, 10 * seed);
            assert_int_equal(offer_peaks(&whole, level, true), 0);
            left_out += offer_peaks(&spared, level, false);
            for (int32_t i = 0; i < whole.level[level].columns * whole.level[level].rows; i++) {
                const struct fv_spread_cell *a = &whole.level[level].cells[i],
                                            *b = &spared.level[level].cells[i];
                assert_memory_equal(a->best, b->best, sizeof a->best);
                assert_int_equal(a->count, b->count);
            }
            assert_memory_equal(whole.cover, spared.cover, FV_SPREAD_FIELDS * sizeof *whole.cover);
        }
        assert_true(left_out > 20000);
        const uint32_t count = fv_spread_pick(&whole, expected);
        assert_int_equal(fv_spread_pick(&spared, found), count);
        assert_memory_equal(expected, found, count * sizeof *expected);
    }
    free(memory[0]);
    free(memory[1]);
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
        cmocka_unit_test(scores_below_the_thresholds_of_rows_change_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

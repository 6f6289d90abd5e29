/* Maps taken whole in place of others: what was read from a file is there without loss, also edges
 * of closures, measured distances and maps that were left; ids, numbers and generations go on from
 * what there was; and the map that is taken can grow on. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
/* cmocka needs the above */
#include <cmocka.h>

#include "common/small_map.h"
#include "fovea/odometry.h"

enum { LATER = 1000 };

static struct small_map read, to;

static void measure(struct fv_map *map)
{
    for (uint32_t k = 0; k < map->limits.keyframes; k++)
        for (uint32_t f = 0; f < map->keyframes[k].features; f++)
            fv_map_distances(map, k)[f] =
                (struct fv_inverse_distance){.value = 1 + (float)f, .weight = (float)k};
}

/* A map that was saved and read, in `read`; its keyframes belong to three maps, of which the one
 * with the most keyframes was left with a scale. */
static void make_read(uint64_t seed)
{
    struct small_map from;
    struct fv_random random;
    struct fovea_error error;
    struct fv_archive_info info;
    size_t bytes;
    fv_random_seed(&random, seed);
    small_map_make_measured(&from);
    small_map_make_measured(&read);
    for (uint32_t k = 0; k < 15; k++) { /* five of them have to go again */
        if (k == 2) fv_map_begin_another(&from.map);
        if (k == 13) {
            from.map.state->scale = (struct fv_map_scale){FOVEA_SCALE_STEREO, 0, .25, 1e-4};
            fv_map_begin_another(&from.map);
        }
        small_map_grow(&from, &random);
    }
    measure(&from.map);
    uint8_t *data = small_map_save(&from, &bytes);
    small_map_free(&from);
    if (fv_archive_read(data, bytes, "a.map", &read.map, &info, &error) != FOVEA_OK)
        fail_msg("%s", error.text);
    free(data);
}

/* Another map with more keyframes than fit, some of which are gone. */
static void make_to(uint64_t seed)
{
    struct fv_random random;
    fv_random_seed(&random, seed);
    small_map_make_measured(&to);
    for (uint32_t k = 0; k < 13; k++)
        small_map_grow(&to, &random);
    fv_map_remove_keyframe(&to.map, fv_map_most_redundant(&to.map));
}

static void free_both(void)
{
    small_map_free(&read);
    small_map_free(&to);
}

/* ---- settling -------------------------------------------------------------------------------- */

static void ids_and_numbers_are_settled_without_gaps(void **state)
{
    (void)state;
    for (uint64_t seed = 1; seed <= 8; seed++) {
        uint64_t before[SMALL_MAP_KEYFRAMES];
        uint32_t ids[SMALL_MAP_KEYFRAMES], highest = 0;
        make_read(seed);
        make_to(seed);
        for (uint32_t k = 0; k < SMALL_MAP_KEYFRAMES; k++) {
            before[k] = read.map.keyframes[k].number;
            ids[k] = read.map.keyframes[k].map_id;
        }
        assert_true(read.map.state->keyframe_number > read.map.state->keyframe_count);
        fv_map_settle(&read.map);
        const struct fv_map_state *s = read.map.state;
        assert_int_equal(s->keyframe_number, s->keyframe_count);
        uint64_t seen = 0;
        for (uint32_t k = 0; k < SMALL_MAP_KEYFRAMES; k++) {
            const struct fv_keyframe *a = &read.map.keyframes[k];
            if (!a->used) continue;
            seen |= UINT64_C(1) << a->number;
            if (a->map_id > highest) highest = a->map_id;
            for (uint32_t i = 0; i < SMALL_MAP_KEYFRAMES; i++) {
                const struct fv_keyframe *b = &read.map.keyframes[i];
                if (!b->used) continue;
                assert_true((before[k] < before[i]) == (a->number < b->number));
                assert_true((ids[k] < ids[i]) == (a->map_id < b->map_id));
                assert_true((ids[k] == ids[i]) == (a->map_id == b->map_id));
            }
        }
        assert_int_equal(seen, (UINT64_C(1) << s->keyframe_count) - 1);
        assert_int_equal(s->map_id, highest); /* the last one is the current one */
        assert_int_equal(s->odom_id, highest);
        assert_int_equal(s->map_next, highest + 1);
        assert_int_equal(s->left_count, 1);
        assert_int_equal(s->left[0].map_id, highest - 1);
        free_both();
    }
}

/* ---- taking ---------------------------------------------------------------------------------- */

static void assert_same_frame(uint32_t slot, uint32_t generation, uint32_t first_id,
                              uint64_t first_number)
{
    const struct fv_map_frame a = fv_map_frame_at(&read.map, slot),
                              b = fv_map_frame_at(&to.map, slot);
    assert_int_equal(b.keyframe->used, a.keyframe->used);
    assert_true(b.keyframe->generation > generation);
    if (!a.keyframe->used) return;
    struct fv_keyframe expected = *a.keyframe;
    expected.generation = b.keyframe->generation;
    expected.map_id += first_id;
    expected.number += first_number;
    assert_memory_equal(b.keyframe, &expected, sizeof expected);
    const size_t features = expected.features, cells = (size_t)(to.map.columns * to.map.rows) + 1;
    assert_memory_equal(b.points, a.points, features * sizeof *a.points);
    assert_memory_equal(b.descriptors, a.descriptors, features * FV_MAP_DESCRIPTOR_BYTES);
    assert_memory_equal(b.landmark, a.landmark, features * sizeof *a.landmark);
    assert_memory_equal(b.cells, a.cells, cells * sizeof *a.cells);
    assert_memory_equal(fv_map_distances(&to.map, slot), fv_map_distances(&read.map, slot),
                        features * sizeof(struct fv_inverse_distance));
}

static void assert_same_landmark(uint32_t slot, uint32_t generation)
{
    const struct fv_landmark *a = &read.map.landmarks[slot], *b = &to.map.landmarks[slot];
    assert_int_equal(b->used, a->used);
    assert_true(b->generation > generation);
    if (!a->used) return;
    struct fv_landmark expected = *a;
    expected.generation = b->generation;
    expected.born += LATER;
    expected.seen += LATER;
    assert_memory_equal(b, &expected, sizeof expected);
}

static void assert_same_edges(void)
{
    const uint32_t count = read.map.state->edge_count;
    assert_int_equal(to.map.state->edge_count, count);
    assert_in_range(count, 1, FV_MAP_EDGES_MAX);
    for (uint32_t i = 0; i < count; i++) {
        const struct fv_map_edge *a = &read.map.edges[i], *b = &to.map.edges[i];
        assert_int_equal(b->a, a->a);
        assert_int_equal(b->b, a->b);
        assert_true(fv_map_holds(&to.map, b->a, b->generation_a));
        assert_true(fv_map_holds(&to.map, b->b, b->generation_b));
        assert_true(to.map.keyframes[b->a].held && to.map.keyframes[b->b].held);
    }
}

static void a_map_is_taken_without_loss(void **state)
{
    (void)state;
    for (uint64_t seed = 1; seed <= 8; seed++) {
        uint32_t keyframes[SMALL_MAP_KEYFRAMES], landmarks[SMALL_MAP_LANDMARKS];
        struct fv_random random;
        make_read(seed);
        make_to(seed + 20);
        fv_map_settle(&read.map);
        const uint32_t first_id = to.map.state->map_next;
        const uint64_t first_number = to.map.state->keyframe_number;
        for (uint32_t k = 0; k < SMALL_MAP_KEYFRAMES; k++)
            keyframes[k] = to.map.keyframes[k].generation;
        for (uint32_t i = 0; i < SMALL_MAP_LANDMARKS; i++)
            landmarks[i] = to.map.landmarks[i].generation;
        fv_map_take(&to.map, &read.map, LATER);
        assert_null(small_map_trouble(&to.map));
        for (uint32_t k = 0; k < SMALL_MAP_KEYFRAMES; k++)
            assert_same_frame(k, keyframes[k], first_id, first_number);
        for (uint32_t i = 0; i < SMALL_MAP_LANDMARKS; i++)
            assert_same_landmark(i, landmarks[i]);
        assert_same_edges();
        const struct fv_map_state *a = read.map.state, *b = to.map.state;
        assert_int_equal(b->map_id, first_id + a->map_id);
        assert_int_equal(b->odom_id, first_id + a->odom_id);
        assert_int_equal(b->map_next, first_id + a->map_next);
        assert_int_equal(b->keyframe_number, first_number + a->keyframe_number);
        assert_int_equal(b->left_count, 1);
        assert_int_equal(b->left[0].map_id, first_id + a->left[0].map_id);
        assert_int_equal(b->left[0].odom_id, first_id + a->left[0].odom_id);
        assert_memory_equal(&b->left[0].scale, &a->left[0].scale, sizeof b->left[0].scale);
        fv_random_seed(&random, seed);
        to.map.keyframes[fv_map_current(&to.map)].parent = FV_MAP_NONE;
        for (int k = 0; k < 12; k++) {
            small_map_grow(&to, &random);
            assert_null(small_map_trouble(&to.map));
        }
        free_both();
    }
}

static void limits_that_differ_are_seen(void **state)
{
    (void)state;
    make_read(1);
    make_to(1);
    assert_true(fv_map_same_limits(&to.map, &read.map));
    const struct fv_map_limits
        limits = to.map.limits,
        others[] = {{limits.keyframes - 1, limits.landmarks, limits.features, 320, 240, true},
                    {limits.keyframes, limits.landmarks - 1, limits.features, 320, 240, true},
                    {limits.keyframes, limits.landmarks, limits.features - 1, 320, 240, true},
                    {limits.keyframes, limits.landmarks, limits.features, 319, 240, true},
                    {limits.keyframes, limits.landmarks, limits.features, 320, 239, true},
                    {limits.keyframes, limits.landmarks, limits.features, 320, 240, false}};
    for (size_t i = 0; i < sizeof others / sizeof *others; i++) {
        to.map.limits = others[i];
        assert_false(fv_map_same_limits(&to.map, &read.map));
    }
    free_both();
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(ids_and_numbers_are_settled_without_gaps),
        cmocka_unit_test(a_map_is_taken_without_loss),
        cmocka_unit_test(limits_that_differ_are_seen),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

/* The vocabulary and the place index: words against an exhaustive search of the tree, the index
 * against sets counted one by one, and frames of one simulated place found among others. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
/* cmocka needs the above */
#include <cmocka.h>

#include "app/lab/extract.h"
#include "common/carved.h"
#include "base/elementary.h"
#include "drivers/table.h"
#include "fovea/source.h"
#include "map/place.h"

enum { SLOTS = 100, DESCRIPTORS = 600 };

static void carve(void *place, struct fv_arena *arena)
{
    fv_place_carve(place, SLOTS, arena);
}

static uint32_t distance(const uint8_t *a, const uint8_t *b)
{
    uint32_t sum = 0;
    for (int i = 0; i < 32; i++)
        sum += (uint32_t)__builtin_popcount((unsigned)(a[i] ^ b[i]));
    return sum;
}

/* Descriptors around centres of the vocabulary, so that they spread over its words. */
static void draw_descriptors(struct fv_random *random, uint8_t *descriptors, uint32_t count)
{
    for (uint32_t i = 0; i < count; i++) {
        uint32_t centre = fv_random_below(random, FV_VOCABULARY_CENTRES);
        memcpy(descriptors + 32 * (size_t)i, fv_vocabulary_data + 32 * (size_t)centre, 32);
        for (int flip = 0; flip < 20; flip++) {
            uint32_t bit = fv_random_below(random, 256);
            descriptors[32 * (size_t)i + bit / 8] ^= (uint8_t)(1u << (bit % 8));
        }
    }
}

static uint32_t word_by_search(const uint8_t *descriptor)
{
    uint32_t node = 0, first = 0, nodes = 1;
    for (int depth = 0; depth < FV_VOCABULARY_DEPTH; depth++) {
        uint32_t best = 0, least = 1000;
        for (uint32_t k = 0; k < FV_VOCABULARY_BRANCH; k++) {
            uint32_t d =
                distance(descriptor, fv_vocabulary_data +
                                         32 * (size_t)(first + node * FV_VOCABULARY_BRANCH + k));
            if (d < least) {
                least = d;
                best = k;
            }
        }
        nodes *= FV_VOCABULARY_BRANCH;
        first += nodes;
        node = node * FV_VOCABULARY_BRANCH + best;
    }
    return node;
}

static void test_words(void **state)
{
    (void)state;
    struct fv_random random;
    fv_random_seed(&random, 5);
    _Alignas(8) static uint8_t descriptors[32 * DESCRIPTORS];
    uint16_t words[DESCRIPTORS], same[DESCRIPTORS];
    draw_descriptors(&random, descriptors, DESCRIPTORS);
    for (int set = 0; set < FV_CPU_SET_COUNT; set++) {
        struct fv_kernels kernels;
        fv_kernels_init(&kernels, (enum fv_cpu_set)set);
        fv_vocabulary_words(&kernels, descriptors, DESCRIPTORS, set == 0 ? words : same);
        if (set > 0) assert_memory_equal(words, same, sizeof words);
    }
    uint32_t different = 0;
    static bool seen[FV_VOCABULARY_WORDS];
    for (int i = 0; i < DESCRIPTORS; i++) {
        assert_int_equal(words[i], word_by_search(descriptors + 32 * i));
        different += !seen[words[i]];
        seen[words[i]] = true;
    }
    assert_in_range(different, DESCRIPTORS / 2, DESCRIPTORS);
    uint32_t common = 0;
    for (uint32_t w = 0; w < FV_VOCABULARY_WORDS;
         w++) { /* at most log(images)^2 with less than 10,000 images */
        assert_in_range(fv_vocabulary_weight(w), 0, 85 * FV_VOCABULARY_WEIGHT_ONE);
        common += fv_vocabulary_weight(w) < FV_VOCABULARY_WEIGHT_ONE / 2;
    }
    assert_in_range(common, 0, FV_VOCABULARY_WORDS / 10);
}

/* The index after random insertions and removals scores as sets that are compared one by one. */
static void test_index(void **state)
{
    (void)state;
    static struct fv_place_words kept[SLOTS], query;
    _Alignas(8) static uint8_t descriptors[32 * DESCRIPTORS];
    struct fv_place place;
    struct fv_kernels kernels;
    struct fv_random random;
    uint32_t generation[SLOTS] = {0}, scores[SLOTS];
    void *memory = carved(carve, &place);
    fv_kernels_init(&kernels, FV_CPU_SET_COUNT - 1);
    fv_random_seed(&random, 9);
    fv_place_clear(&place);
    for (uint32_t step = 1; step <= 400; step++) {
        uint32_t slot = fv_random_below(&random, SLOTS);
        if (fv_random_below(&random, 4) == 0) {
            fv_place_remove(&place, slot);
            generation[slot] = 0;
            continue;
        }
        draw_descriptors(&random, descriptors, DESCRIPTORS);
        fv_place_words_begin(&kept[slot]);
        fv_place_words_add(&kept[slot], &kernels, descriptors, DESCRIPTORS);
        fv_place_insert(&place, slot, step, &kept[slot]);
        generation[slot] = step;
    }
    struct fv_place_set among = {{UINT64_C(0x5555555555555555), ~UINT64_C(0)}};
    draw_descriptors(&random, descriptors, DESCRIPTORS);
    fv_place_words_begin(&query);
    fv_place_words_add(&query, &kernels, descriptors, DESCRIPTORS);
    fv_place_scores(&place, &query, &among, scores);
    for (uint32_t slot = 0; slot < SLOTS; slot++) {
        double shared = 0, own = 0, asked = 0;
        for (uint32_t w = 0; w < FV_VOCABULARY_WORDS; w++) {
            bool in = kept[slot].present[w / 64] >> (w % 64) & 1,
                 out = query.present[w / 64] >> (w % 64) & 1;
            shared += in && out ? fv_vocabulary_weight(w) : 0;
            own += in ? fv_vocabulary_weight(w) : 0;
            asked += out ? fv_vocabulary_weight(w) : 0;
        }
        bool counts = generation[slot] != 0 && (slot >= 64 || slot % 2 == 0);
        assert_int_equal(fv_place_holds(&place, slot, generation[slot]), generation[slot] != 0);
        assert_false(fv_place_holds(&place, slot, generation[slot] + 1));
        assert_int_equal(scores[slot],
                         counts ? (uint32_t)(FV_PLACE_ONE * shared / __builtin_sqrt(own * asked))
                                : 0);
    }
    struct fv_place_candidate best[7];
    uint32_t count = fv_place_best(scores, SLOTS, 1, best, 7);
    assert_int_equal(count, 7);
    uint32_t better = 0;
    for (uint32_t slot = 0; slot < SLOTS; slot++)
        better +=
            scores[slot] > best[6].score || (scores[slot] == best[6].score && slot < best[6].slot);
    assert_int_equal(better, 6);
    for (uint32_t i = 1; i < 7; i++)
        assert_true(best[i - 1].score > best[i].score ||
                    (best[i - 1].score == best[i].score && best[i - 1].slot < best[i].slot));
    assert_int_equal(fv_place_best(scores, SLOTS, FV_PLACE_ONE + 1, best, 7), 0);
    free(memory);
}

/* Words of two frames of a world, a second apart. */
static void words_of_world(uint32_t world, struct fv_place_words words[2])
{
    const struct fovea_source_ops *ops;
    const char *address;
    struct fovea_source *source;
    struct fovea_error error;
    struct fovea_frame frame;
    struct fovea_extract_config config;
    struct fv_kernels kernels;
    const struct fovea_source_selection selection = {.start = 60, .step = 30, .frames = 2};
    char uri[96];
    snprintf(uri, sizeof uri, "sim:orbit?seed=%u&width=480&height=360&objects=0", world);
    assert_int_equal(fv_source_find(uri, &ops, &address, &error), FOVEA_OK);
    assert_int_equal(ops->open(address, &selection, &source, &error), FOVEA_OK);
    assert_int_equal(ops->start(source, &error), FOVEA_OK);
    fv_kernels_init(&kernels, fv_cpu_best(fv_cpu_detect()));
    fovea_extract_config_default(&config, FOVEA_FEATURES_ORB);
    config.count_max = 600;
    for (int i = 0; i < 2; i++) {
        struct fv_extract extract;
        assert_int_equal(ops->dequeue(source, INT64_MAX, &frame), FOVEA_OK);
        assert_int_equal(fv_extract_image(&frame.images[0], NULL, &config, &extract, &error),
                         FOVEA_OK);
        fv_place_words_begin(&words[i]);
        fv_place_words_add(&words[i], &kernels, extract.found.descriptors, extract.found.count);
        fv_extract_free(&extract);
        ops->requeue(source, &frame);
    }
    ops->stop(source);
    ops->close(source);
}

/* Frames of several worlds, each seen again a second later: the same world comes first, and clearly
 * so. */
static void test_places(void **state)
{
    (void)state;
    enum { WORLDS = 6 };
    static struct fv_place_words words[WORLDS][2];
    struct fv_place place;
    struct fv_place_candidate best[2];
    uint32_t scores[SLOTS];
    const struct fv_place_set all = {{~UINT64_C(0), ~UINT64_C(0)}};
    void *memory = carved(carve, &place);
    fv_place_clear(&place);
    for (uint32_t world = 0; world < WORLDS; world++) {
        words_of_world(50 + world, words[world]);
        fv_place_insert(&place, world, 1, &words[world][0]);
    }
    for (uint32_t world = 0; world < WORLDS; world++) {
        fv_place_scores(&place, &words[world][1], &all, scores);
        assert_int_equal(fv_place_best(scores, SLOTS, 1, best, 2), 2);
        assert_int_equal(best[0].slot, world);
        assert_true(best[0].score > best[1].score + best[1].score / 4);
    }
    free(memory);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_words),
        cmocka_unit_test(test_index),
        cmocka_unit_test(test_places),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

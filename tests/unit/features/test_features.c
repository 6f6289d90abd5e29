/* The feature stage with every method: places, mask, borders, grants, the same features with every
 * kernel set, compiler and architecture, and memory of the method alone. Corners by Harris' and Shi
 * and Tomasi's measure are those of pictures (harris.h), which OpenCV's are compared with. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdlib.h>
#include <string.h>

#include "common/carved.h"
#include "features/features.h"
#include "features/harris.h"
#include "features/ranked.h"
#include "base/elementary.h"
#include "base/hash.h"

enum { WIDTH = 320, HEIGHT = 240 };

/* The method is that of the test in work. */
static struct fovea_features_config config = {
    .count_max = 500, .pyramid_levels = 8, .threshold = 20, .threshold_min = 7, .per_cell = 3};

enum { METHODS = FOVEA_FEATURES_SHI_TOMASI + 1 };

struct stage {
    struct fv_pyramid pyramid;
    struct fv_features features;
    struct fv_kernels kernels;
};

static uint8_t pixels[WIDTH * HEIGHT], mask[WIDTH * HEIGHT];

static void carve(void *context, struct fv_arena *arena)
{
    struct stage *stage = context;
    fv_pyramid_carve(&stage->pyramid, WIDTH, HEIGHT, config.pyramid_levels, arena);
    fv_features_carve(&stage->features, &config, &stage->pyramid, arena);
}

static void draw_rectangles(void)
{
    struct fv_random random;
    fv_random_seed(&random, 11);
    memset(pixels, 100, sizeof pixels);
    for (int n = 0; n < 400; n++) {
        const uint32_t x = fv_random_below(&random, WIDTH), y = fv_random_below(&random, HEIGHT);
        const uint32_t w = 4 + fv_random_below(&random, 40), h = 4 + fv_random_below(&random, 40);
        const uint8_t grey = (uint8_t)fv_random_below(&random, 256);
        for (uint32_t v = y; v < y + h && v < HEIGHT; v++)
            for (uint32_t u = x; u < x + w && u < WIDTH; u++)
                pixels[v * WIDTH + u] = grey;
    }
}

static uint32_t find(struct stage *stage, enum fv_cpu_set set, bool masked, uint32_t asked)
{
    const struct fovea_image frame = {pixels,       WIDTH, HEIGHT, WIDTH, FOVEA_PIXEL_GREY8,
                                      sizeof pixels};
    fv_kernels_init(&stage->kernels, set);
    fv_pyramid_build(&stage->pyramid, &stage->kernels, &frame);
    const struct fv_plane plane = {mask, WIDTH, HEIGHT, WIDTH};
    return fv_features_find(&stage->features, &stage->kernels, &stage->pyramid,
                            masked ? &plane : NULL, asked);
}

static void of_each_method(void (*test)(void))
{
    for (int m = 0; m < METHODS; m++) {
        config.method = (enum fovea_feature_method)m;
        test();
    }
    config.method = FOVEA_FEATURES_FAST;
}

static void lie_where_their_corners_are(void)
{
    struct stage stage;
    void *memory = carved(carve, &stage);
    draw_rectangles();
    const uint32_t count = find(&stage, FV_CPU_C, false, 500);
    assert_int_equal(count, 500);
    assert_int_equal(count, stage.features.count);
    for (uint32_t i = 0; i < count; i++) {
        const struct fovea_feature *f = &stage.features.list[i];
        const struct fv_corner *c = &stage.features.corners[i];
        const struct fv_plane *level = &stage.pyramid.level[c->level];
        assert_int_equal(f->level, c->level);
        assert_int_equal(f->score, c->score);
        assert_int_equal(f->reserved, 0);
        assert_true(f->score >= (config.method == FOVEA_FEATURES_ORB ? 1 : config.threshold_min));
        /* Refined within three quarters of a pixel of the level. */
        const float reach = 0.751f * fv_pyramid_scale(c->level);
        assert_float_equal(f->x_px, fv_pyramid_to_raw(c->level, c->x), reach);
        assert_float_equal(f->y_px, fv_pyramid_to_raw(c->level, c->y), reach);
        assert_float_equal(f->size_px, 31.0f * fv_pyramid_scale(c->level), 1e-4f);
        assert_true(c->x >= FV_FEATURES_BORDER_PX && c->x < level->width - FV_FEATURES_BORDER_PX);
        assert_true(c->y >= FV_FEATURES_BORDER_PX && c->y < level->height - FV_FEATURES_BORDER_PX);
    }
    free(memory);
}

/* The numbers are those of gcc on x86-64; clang, sanitizers and aarch64 must give them too. */
static const uint64_t hash_expected[METHODS] = {0xf3152f044eee359d, 0x00b55b0594a2b6b0,
                                                0x2d79a2240d39aa88, 0x18ff17282ea260e7};

static void find_the_same_on_every_kernel_set(void)
{
    struct stage expected, found;
    void *memory = carved(carve, &expected), *other = carved(carve, &found);
    draw_rectangles();
    const uint32_t count = find(&expected, FV_CPU_C, false, 500);
    for (int set = 1; set < FV_CPU_SET_COUNT; set++) {
        assert_int_equal(find(&found, (enum fv_cpu_set)set, false, 500), count);
        assert_memory_equal(expected.features.list, found.features.list,
                            count * sizeof *found.features.list);
    }
    const uint64_t hash =
        fv_hash(FV_HASH_START, expected.features.list, count * sizeof *expected.features.list);
    if (hash != hash_expected[config.method])
        fail_msg("method %d: hash 0x%016llx", (int)config.method, (unsigned long long)hash);
    free(memory);
    free(other);
}

static void have_none_where_masked(void)
{
    struct stage stage;
    void *memory = carved(carve, &stage);
    draw_rectangles();
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        mask[i] = i % WIDTH < WIDTH / 2 ? 0 : 255;
    const uint32_t count = find(&stage, FV_CPU_C, true, 500);
    assert_true(count > 100);
    for (uint32_t i = 0; i < count; i++) {
        const struct fv_corner *c = &stage.features.corners[i];
        assert_true(fv_pyramid_to_raw(c->level, c->x) >= WIDTH * 0.5f - 0.5f);
    }
    memset(mask, 0, sizeof mask);
    assert_int_equal(find(&stage, FV_CPU_C, true, 500), 0);
    free(memory);
}

static void are_as_many_as_granted(void)
{
    struct stage stage;
    void *memory = carved(carve, &stage);
    draw_rectangles();
    assert_int_equal(find(&stage, FV_CPU_C, false, 130), 130);
    assert_int_equal(find(&stage, FV_CPU_C, false, 100000), 500);
    assert_int_equal(find(&stage, FV_CPU_C, false, 0), 0);
    free(memory);
}

static void has_none_in_a_flat_image(void)
{
    struct stage stage;
    void *memory = carved(carve, &stage);
    memset(pixels, 128, sizeof pixels);
    assert_int_equal(find(&stage, fv_cpu_best(fv_cpu_detect()), false, 500), 0);
    free(memory);
}

/* Of the measure's corners of at least the threshold, all that lie apart by cells are there: with
 * room for all, all are. Places to the bit. */
static void finds_the_corners_of_pictures(enum fovea_feature_method method)
{
    enum { ALL = 4000 };
    struct fv_harris harris;
    struct fv_response response;
    struct fv_response_scratch scratch;
    struct fv_pyramid pyramid;
    struct fv_kernels kernels;
    static uint8_t memory[8 << 20] __attribute__((aligned(64)));
    static struct fovea_feature refined[ALL];
    static struct fv_corner corners[ALL];
    const struct fovea_extract_config all = {
        .method = method, .count_max = ALL, .harris_k = .04f, .quality = 0};
    const struct fovea_image frame = {pixels,       WIDTH, HEIGHT, WIDTH, FOVEA_PIXEL_GREY8,
                                      sizeof pixels};
    const struct fv_plane no_mask = {0};
    struct fv_arena arena;
    memset(memory, 0, sizeof memory);
    fv_arena_init(&arena, memory, sizeof memory);
    fv_harris_carve(&harris, &all, WIDTH, HEIGHT, 19, &arena);
    fv_response_carve(&scratch, WIDTH, method == FOVEA_FEATURES_HARRIS ? .04f : -1, &arena);
    fv_pyramid_carve(&pyramid, WIDTH, HEIGHT, 1, &arena);
    assert_false(arena.exhausted);
    draw_rectangles();
    fv_kernels_init(&kernels, fv_cpu_best(fv_cpu_detect()));
    fv_pyramid_build(&pyramid, &kernels, &frame);
    const uint32_t there = fv_harris_find(&harris, &kernels, &pyramid.level[0], &no_mask);
    assert_true(there > 500 && there < ALL);

    uint32_t count = 0, strong = 0;
    fv_response_begin(&response, &kernels, &pyramid.level[0], 19, 30, &scratch);
    while (fv_response_next(&response))
        for (int32_t i = 0; i < response.count; i++)
            corners[count++] = (struct fv_corner){
                .x = response.columns[i], .y = (uint16_t)response.y, .score = response.scores[i]};
    fv_response_refine(&pyramid, scratch.harris_k, corners, count, refined);
    for (uint32_t k = 0; k < there; k++) {
        const struct fv_harris_corner *h = &harris.corners[k];
        const double root = __builtin_sqrt((double)h->response);
        const double score = 4 * (method == FOVEA_FEATURES_HARRIS ? __builtin_sqrt(root) : root);
        if (score < 30) continue;
        strong++;
        uint32_t i = 0;
        while (i < count && (corners[i].x != h->x || corners[i].y != h->y))
            i++;
        assert_true(i < count);
        assert_true(corners[i].score == (score >= 255 ? 255 : (int)score) ||
                    __builtin_fabs(score - __builtin_round(score)) < 1e-4);
        assert_true(refined[i].x_px == fv_pyramid_to_raw(0, h->x_px));
        assert_true(refined[i].y_px == fv_pyramid_to_raw(0, h->y_px));
    }
    assert_true(strong > 100 && strong < there && strong == count);
}

static void measures_find_the_corners_of_pictures(void **state)
{
    (void)state;
    finds_the_corners_of_pictures(FOVEA_FEATURES_HARRIS);
    finds_the_corners_of_pictures(FOVEA_FEATURES_SHI_TOMASI);
}

/* ORB takes FAST's corners, and of a cell those of the best measure. */
static void orb_ranks_corners_by_harris(void **state)
{
    (void)state;
    struct stage fast, orb;
    config.method = FOVEA_FEATURES_FAST;
    void *memory = carved(carve, &fast);
    config.method = FOVEA_FEATURES_ORB;
    void *other = carved(carve, &orb);
    draw_rectangles();
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        pixels[i] = (uint8_t)(100 + pixels[i] / 6); /* none of the highest score */
    find(&fast, FV_CPU_C, false, 200);
    find(&orb, FV_CPU_C, false, 200);
    double sum[2] = {0, 0};
    for (uint32_t i = 0; i < 200; i++) {
        const struct fv_corner *c[2] = {&fast.features.corners[i], &orb.features.corners[i]};
        for (int k = 0; k < 2; k++) {
            const double measure =
                (double)fv_ranked_measure(&orb.pyramid.level[c[k]->level], c[k]->x, c[k]->y);
            const double score = 4 * __builtin_sqrt(__builtin_sqrt(measure / (25.0 * (1 << 24))));
            sum[k] += score;
            if (k == 0) continue;
            const int whole = score > 255 ? 255 : score < 1 ? 1 : (int)score;
            assert_true(c[k]->score == whole ||
                        __builtin_fabs(score - __builtin_round(score)) < 1e-4);
        }
    }
    assert_true(sum[1] > 1.01 * sum[0]);
    config.method = FOVEA_FEATURES_FAST;
    free(memory);
    free(other);
}

static void memory_is_of_the_method_alone(void **state)
{
    (void)state;
    for (int m = 0; m < METHODS; m++) {
        struct stage stage = {0};
        config.method = (enum fovea_feature_method)m;
        void *memory = carved(carve, &stage);
        assert_true((stage.features.fast.scores != NULL) == (m <= FOVEA_FEATURES_ORB));
        assert_true((stage.features.response.responses != NULL) == (m > FOVEA_FEATURES_ORB));
        free(memory);
    }
    config.method = FOVEA_FEATURES_FAST;
}

static void features_lie_where_their_corners_are(void **state)
{
    (void)state;
    of_each_method(lie_where_their_corners_are);
}

static void every_kernel_set_finds_the_same(void **state)
{
    (void)state;
    of_each_method(find_the_same_on_every_kernel_set);
}

static void masked_places_have_no_features(void **state)
{
    (void)state;
    of_each_method(have_none_where_masked);
}

static void a_grant_lowers_the_count(void **state)
{
    (void)state;
    of_each_method(are_as_many_as_granted);
}

static void a_flat_image_has_none(void **state)
{
    (void)state;
    of_each_method(has_none_in_a_flat_image);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(features_lie_where_their_corners_are),
        cmocka_unit_test(every_kernel_set_finds_the_same),
        cmocka_unit_test(masked_places_have_no_features),
        cmocka_unit_test(a_grant_lowers_the_count),
        cmocka_unit_test(a_flat_image_has_none),
        cmocka_unit_test(measures_find_the_corners_of_pictures),
        cmocka_unit_test(orb_ranks_corners_by_harris),
        cmocka_unit_test(memory_is_of_the_method_alone),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

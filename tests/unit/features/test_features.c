/* The feature stage: places, mask, borders, grants, and the same features with every kernel set. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdlib.h>
#include <string.h>

#include "common/carved.h"
#include "features/features.h"
#include "base/elementary.h"

enum { WIDTH = 320, HEIGHT = 240 };

static const struct fovea_features_config config = {
    .count_max = 500, .pyramid_levels = 8, .threshold = 20, .threshold_min = 7, .per_cell = 3};

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

static void features_lie_where_their_corners_are(void **state)
{
    (void)state;
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
        assert_true(f->score >= config.threshold_min);
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

static void every_kernel_set_finds_the_same(void **state)
{
    (void)state;
    struct stage expected, found;
    void *memory = carved(carve, &expected), *other = carved(carve, &found);
    draw_rectangles();
    const uint32_t count = find(&expected, FV_CPU_C, false, 500);
    for (int set = 1; set < FV_CPU_SET_COUNT; set++) {
        assert_int_equal(find(&found, (enum fv_cpu_set)set, false, 500), count);
        assert_memory_equal(expected.features.list, found.features.list,
                            count * sizeof *found.features.list);
    }
    free(memory);
    free(other);
}

static void masked_places_have_no_features(void **state)
{
    (void)state;
    struct stage stage;
    void *memory = carved(carve, &stage);
    draw_rectangles();
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        mask[i] = i % WIDTH < WIDTH / 2 ? 0 : 255;
    const uint32_t count = find(&stage, FV_CPU_C, true, 500);
    assert_true(count > 100);
    for (uint32_t i = 0; i < count; i++) {
        const struct fv_corner *c = &stage.features.corners[i];
        assert_true(fv_pyramid_to_raw(c->level, c->x) >= WIDTH / 2 - 0.5f);
    }
    memset(mask, 0, sizeof mask);
    assert_int_equal(find(&stage, FV_CPU_C, true, 500), 0);
    free(memory);
}

static void a_grant_lowers_the_count(void **state)
{
    (void)state;
    struct stage stage;
    void *memory = carved(carve, &stage);
    draw_rectangles();
    assert_int_equal(find(&stage, FV_CPU_C, false, 130), 130);
    assert_int_equal(find(&stage, FV_CPU_C, false, 100000), 500);
    assert_int_equal(find(&stage, FV_CPU_C, false, 0), 0);
    free(memory);
}

static void a_flat_image_has_none(void **state)
{
    (void)state;
    struct stage stage;
    void *memory = carved(carve, &stage);
    memset(pixels, 128, sizeof pixels);
    assert_int_equal(find(&stage, fv_cpu_best(fv_cpu_detect()), false, 500), 0);
    free(memory);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(features_lie_where_their_corners_are),
        cmocka_unit_test(every_kernel_set_finds_the_same),
        cmocka_unit_test(masked_places_have_no_features),
        cmocka_unit_test(a_grant_lowers_the_count),
        cmocka_unit_test(a_flat_image_has_none),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

/* Masks: boxes are drawn to the pixel, and no feature of any level lies where the mask is 0. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "common/carved.h"
#include "features/features.h"
#include "features/mask.h"
#include "base/elementary.h"
#include "fovea/fovea.h"

enum { WIDTH = 320, HEIGHT = 240 };

static bool touches(const struct fv_mask_box *box, int x, int y)
{
    return (float)x + 1 > box->x_min && (float)x < box->x_max && (float)y + 1 > box->y_min &&
           (float)y < box->y_max;
}

static void boxes_are_drawn_to_the_pixel(void **state)
{
    (void)state;
    static uint8_t fixed[WIDTH * HEIGHT], mask[WIDTH * HEIGHT];
    const struct fv_mask_box boxes[] = {{10, 20, 30, 40},    {50.5f, 60.25f, 51.5f, 60.75f},
                                        {-100, -5, 4.5f, 3}, {300, 200, 1e30f, 1e30f},
                                        {90, 90, 80, 100},   {NAN, 0, 10, 10},
                                        {400, 10, 500, 20},  {-INFINITY, 100, -1, 110}};
    const uint32_t count = sizeof boxes / sizeof *boxes;
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        fixed[i] = i % 7 == 0 ? 0 : 200;
    const struct fv_plane fixed_plane = {fixed, WIDTH, HEIGHT, WIDTH},
                          plane = {mask, WIDTH, HEIGHT, WIDTH};
    for (int with_fixed = 0; with_fixed < 2; with_fixed++) {
        fv_mask_compose(&plane, with_fixed ? &fixed_plane : NULL, boxes, count);
        for (int y = 0; y < HEIGHT; y++)
            for (int x = 0; x < WIDTH; x++) {
                uint8_t expected = with_fixed ? fixed[y * WIDTH + x] : 255;
                for (uint32_t i = 0; i < count; i++)
                    if (boxes[i].x_max > boxes[i].x_min && boxes[i].y_max > boxes[i].y_min &&
                        touches(&boxes[i], x, y))
                        expected = 0;
                assert_int_equal(mask[y * WIDTH + x], expected);
            }
    }
    fv_mask_compose(&fixed_plane, &fixed_plane, NULL, 0);
    assert_int_equal(fixed[7], 0);
    assert_int_equal(fixed[8], 200);
}

struct stage {
    const struct fovea_features_config *config;
    struct fv_pyramid pyramid;
    struct fv_features features;
};

static void carve(void *context, struct fv_arena *arena)
{
    struct stage *stage = context;
    fv_pyramid_carve(&stage->pyramid, WIDTH, HEIGHT, stage->config->pyramid_levels, arena);
    fv_features_carve(&stage->features, stage->config, &stage->pyramid, arena);
}

static void features_keep_out_of_masks(void **state)
{
    (void)state;
    static struct stage stage;
    static struct fovea_config defaults;
    static uint8_t pixels[WIDTH * HEIGHT], mask[WIDTH * HEIGHT];
    struct fv_random random;
    struct fv_kernels kernels;
    fv_random_seed(&random, 8);
    memset(pixels, 90, sizeof pixels);
    for (int n = 0; n < 500; n++) { /* overlapping rectangles: corners everywhere */
        const int x = (int)fv_random_below(&random, WIDTH - 20),
                  y = (int)fv_random_below(&random, HEIGHT - 20);
        const int grey = (int)fv_random_below(&random, 256),
                  size = 4 + (int)fv_random_below(&random, 16);
        for (int row = y; row < y + size; row++)
            memset(pixels + row * WIDTH + x, grey, (size_t)size);
    }
    fovea_config_default(&defaults);
    defaults.features.count_max = 500;
    fv_kernels_init(&kernels, fv_cpu_best(fv_cpu_detect()));
    stage.config = &defaults.features;
    void *memory = carved(carve, &stage);
    const struct fovea_image image = {pixels,       WIDTH, HEIGHT, WIDTH, FOVEA_PIXEL_GREY8,
                                      sizeof pixels};
    fv_pyramid_build(&stage.pyramid, &kernels, &image);

    const struct fv_mask_box boxes[] = {{60, 50, 140, 190}, {200, 0, 260, 90}};
    const struct fv_plane plane = {mask, WIDTH, HEIGHT, WIDTH};
    fv_mask_compose(&plane, NULL, boxes, 2);
    int inside[2] = {0, 0};
    for (int masked = 0; masked < 2; masked++) {
        const uint32_t count = fv_features_find(&stage.features, &kernels, &stage.pyramid,
                                                masked ? &plane : NULL, 500);
        assert_true(count > 200);
        for (uint32_t i = 0; i < count; i++) {
            /* The mask is asked for the whole pixel of the level; refinement moves less than a
             * pixel of it.
             */
            const struct fv_corner *corner = &stage.features.corners[i];
            const int x = (int)(fv_pyramid_to_raw(corner->level, corner->x) + 0.5f);
            const int y = (int)(fv_pyramid_to_raw(corner->level, corner->y) + 0.5f);
            for (int b = 0; b < 2; b++)
                inside[masked] += (float)x > boxes[b].x_min && (float)x < boxes[b].x_max - 1 &&
                                  (float)y > boxes[b].y_min && (float)y < boxes[b].y_max - 1;
        }
    }
    assert_true(inside[0] > 30);
    assert_int_equal(inside[1], 0);
    free(memory);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(boxes_are_drawn_to_the_pixel),
        cmocka_unit_test(features_keep_out_of_masks),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

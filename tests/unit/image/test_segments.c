/* Line segments: ends of drawn edges, sides, steps, bounds, refusals. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/elementary.h"
#include "common/grey_frame.h"
#include "image/segments.h"

enum { WIDTH = 321, HEIGHT = 243, MEMORY = 8 << 20 };

static _Alignas(64) uint8_t memory[MEMORY];
static uint8_t picture[WIDTH * HEIGHT];
static struct fovea_error error;

static struct fovea_segments_found run(const struct fovea_segments_config *config)
{
    struct fovea_segments *segments;
    struct fovea_segments_found found;
    const struct fovea_frame frame = grey_frame(picture, WIDTH, HEIGHT, 0, 0);
    const size_t bytes = fovea_segments_size(config, WIDTH, HEIGHT, &error);
    assert_in_range(bytes, 1, MEMORY);
    memset(memory, 0xa5, sizeof memory);
    assert_int_equal(fovea_segments_init(&segments, config, WIDTH, HEIGHT, memory, bytes, &error),
                     FOVEA_OK);
    assert_int_equal(fovea_segments_run(segments, &frame.images[0], &found), FOVEA_OK);
    return found;
}

static struct fovea_segments_config defaults(void)
{
    struct fovea_segments_config config;
    fovea_segments_config_default(&config);
    return config;
}

/* A pixel is bright by the fraction of its area that lies inside of a turned square. */
static void draw_square(double cx, double cy, double half, double angle)
{
    const double c = cos(angle), s = sin(angle);
    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < WIDTH; x++) {
            int inside = 0;
            for (int k = 0; k < 64; k++) {
                const double dx = x + (k % 8 - 3.5) / 8 - cx, dy = y + (k / 8 - 3.5) / 8 - cy;
                inside += fabs(c * dx + s * dy) < half && fabs(c * dy - s * dx) < half;
            }
            picture[y * WIDTH + x] = (uint8_t)(40 + 160 * inside / 64);
        }
}

/* Each side of a square is one segment, on the side to a tenth of a pixel, with the bright side on
 * the right, at any angle. */
static void the_sides_of_a_square_are_its_segments(void **state)
{
    (void)state;
    const struct fovea_segments_config config = defaults();
    for (int turn = 0; turn < 12; turn++) {
        const double cx = 160.3, cy = 121.8, half = 60, angle = 0.13 * turn;
        draw_square(cx, cy, half, angle);
        const struct fovea_segments_found found = run(&config);
        assert_int_equal(found.count, 4);
        for (uint32_t i = 0; i < 4; i++) {
            const struct fovea_segment *s = &found.list[i];
            const double dx = (double)(s->x1_px - s->x0_px), dy = (double)(s->y1_px - s->y0_px),
                         length = hypot(dx, dy);
            /* distance of the line from the centre, which lies on its right */
            const double rx = cx - (double)s->x0_px, ry = cy - (double)s->y0_px;
            const double right = (dx * ry - dy * rx) / length;
            assert_true(fabs(right - half) < 0.12);
            assert_true(length > 2 * half - 8 && length < 2 * half + 1);
            assert_true((double)s->width_px < 8);
        }
    }
}

static void draw_noise(uint64_t seed, uint32_t levels)
{
    struct fv_random random;
    fv_random_seed(&random, seed);
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        picture[i] = (uint8_t)(i % WIDTH / 9 * 25 + i / WIDTH / 7 * 40 +
                               (int)fv_random_below(&random, levels));
}

static void steps_of_any_size_give_the_same(void **state)
{
    (void)state;
    static _Alignas(64) uint8_t other[MEMORY];
    const struct fovea_segments_config config = defaults();
    struct fv_kernels kernels;
    struct fv_arena arena;
    struct fv_segments segments;
    struct fv_segments_state progress;
    draw_noise(3, 20);
    const struct fovea_segments_found found = run(&config);
    const struct fv_plane plane = {picture, WIDTH, HEIGHT, WIDTH};
    fv_kernels_init(&kernels, FV_CPU_C);
    fv_arena_init(&arena, other, sizeof other);
    fv_segments_carve(&segments, &config, WIDTH, HEIGHT, &arena, &arena);
    assert_true(found.count > 100);
    for (int32_t pixels = 1; pixels < 2000000; pixels *= 11) {
        fv_segments_begin(&segments, &progress);
        while (!fv_segments_advance(&segments, &progress, &kernels, &plane, pixels)) {
        }
        assert_int_equal(progress.count, found.count);
        assert_memory_equal(segments.found, found.list, found.count * sizeof *found.list);
    }
}

/* Noise and stripes that join everything: the visits are counted, and end. */
static void work_is_bounded_by_the_pixels(void **state)
{
    (void)state;
    const struct fovea_segments_config config = defaults();
    struct fv_kernels kernels;
    struct fv_arena arena;
    struct fv_segments segments;
    struct fv_segments_state progress;
    fv_kernels_init(&kernels, FV_CPU_C);
    fv_arena_init(&arena, memory, sizeof memory);
    fv_segments_carve(&segments, &config, WIDTH, HEIGHT, &arena, &arena);
    for (int kind = 0; kind < 6; kind++) {
        if (kind < 3) draw_noise((uint64_t)kind, 6u << 2 * kind);
        for (int i = 0; kind >= 3 && i < WIDTH * HEIGHT; i++)
            picture[i] = (uint8_t)(kind == 3   ? i % WIDTH
                                   : kind == 4 ? (i % WIDTH * i / WIDTH) >> 4
                                               : 255 * (i / 3 % 2));
        const struct fv_plane plane = {picture, WIDTH, HEIGHT, WIDTH};
        int64_t steps = 0;
        fv_segments_begin(&segments, &progress);
        while (!fv_segments_advance(&segments, &progress, &kernels, &plane, 1000))
            steps++;
        /* what the last region may take beyond the budget is bounded too */
        assert_true(progress.visits_left > -200000);
        assert_true(steps < 30 * WIDTH * HEIGHT / 1000);
    }
}

static void short_ones_and_those_beyond_the_count_are_left_out(void **state)
{
    (void)state;
    struct fovea_segments_config config = defaults();
    draw_noise(3, 20);
    const uint32_t all = run(&config).count;
    config.length_min_px = 12;
    const struct fovea_segments_found some = run(&config);
    assert_in_range(some.count, 1, all - 1);
    for (uint32_t i = 0; i < some.count; i++)
        assert_true(hypot((double)(some.list[i].x1_px - some.list[i].x0_px),
                          (double)(some.list[i].y1_px - some.list[i].y0_px)) > 11.99);
    config.length_min_px = 0;
    config.count_max = 7;
    assert_int_equal(run(&config).count, 7);
    memset(picture, 128, sizeof picture);
    assert_int_equal(run(&config).count, 0);
}

static void wrong_parameters_and_images_are_refused(void **state)
{
    (void)state;
    struct fovea_segments_config config = defaults();
    struct fovea_segments *segments;
    struct fovea_segments_found found;
    const struct fovea_frame small = grey_frame(picture, 100, 90, 0, 0);
    assert_int_equal(fovea_segments_init(&segments, &config, WIDTH, HEIGHT, memory, MEMORY, &error),
                     FOVEA_OK);
    assert_int_equal(fovea_segments_run(segments, &small.images[0], &found), FOVEA_ERROR_ARGUMENT);
    assert_int_equal(fovea_segments_init(&segments, &config, WIDTH, HEIGHT, memory, 1000, &error),
                     FOVEA_ERROR_MEMORY);
    config.count_max = 0;
    assert_int_equal(fovea_segments_size(&config, WIDTH, HEIGHT, &error), 0);
    assert_string_equal(error.text, "count_max: found 0, expected 1 to 20000");
    config = defaults();
    config.length_min_px = NAN;
    assert_int_equal(fovea_segments_size(&config, WIDTH, HEIGHT, &error), 0);
    assert_int_equal(fovea_segments_size(&config, 3, HEIGHT, &error), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_sides_of_a_square_are_its_segments),
        cmocka_unit_test(steps_of_any_size_give_the_same),
        cmocka_unit_test(work_is_bounded_by_the_pixels),
        cmocka_unit_test(short_ones_and_those_beyond_the_count_are_left_out),
        cmocka_unit_test(wrong_parameters_and_images_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

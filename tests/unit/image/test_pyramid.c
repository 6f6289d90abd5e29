/* The pyramid: sizes, places, exactness over kernel sets, every capture format, and accuracy on a
 * ramp. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdlib.h>
#include <string.h>

#include "common/carved.h"
#include "base/elementary.h"
#include "image/pyramid.h"

enum { WIDTH = 203, HEIGHT = 149, LEVELS = 8 };

static uint8_t pixels[3 * 256 * 256];

static void carve(void *context, struct fv_arena *arena)
{
    fv_pyramid_carve(context, WIDTH, HEIGHT, LEVELS, arena);
}

static struct fovea_image grey(void)
{
    return (struct fovea_image){pixels, WIDTH, HEIGHT, WIDTH, FOVEA_PIXEL_GREY8, WIDTH * HEIGHT};
}

static void fill_random(void)
{
    struct fv_random random;
    fv_random_seed(&random, 3);
    for (size_t i = 0; i < sizeof pixels; i++)
        pixels[i] = (uint8_t)fv_random_u32(&random);
}

static void no_sample_lies_outside(void **state)
{
    (void)state;
    for (int32_t width = 12; width <= 4096; width++) {
        const int32_t next = fv_pyramid_next(width);
        const int32_t last = next - 1 + (next - 1) / 5 + 1; /* right neighbour of the last output */
        assert_true(last <= width - 1);
        assert_true(next + next / 5 + 1 > width - 1); /* one more would not fit */
    }
    assert_int_equal(fv_pyramid_next(752), 626);
    assert_int_equal(fv_pyramid_next(480), 400);
}

static void places_map_by_exactly_one_point_two(void **state)
{
    (void)state;
    assert_float_equal(fv_pyramid_to_raw(0, 17.0f), 17.0f, 1e-6f);
    assert_float_equal(fv_pyramid_to_raw(1, 10.0f), 12.1f, 1e-5f);
    assert_float_equal(fv_pyramid_to_raw(2, 0.0f), 0.22f, 1e-6f);
}

/* On a ramp, bilinear samples are exact: each level shows the ramp at the mapped places, to the
 * rounding of its parents. */
static void a_ramp_stays_a_ramp(void **state)
{
    (void)state;
    struct fv_pyramid pyramid;
    struct fv_kernels kernels;
    void *memory = carved(carve, &pyramid);
    for (int32_t y = 0; y < HEIGHT; y++)
        for (int32_t x = 0; x < WIDTH; x++)
            pixels[y * WIDTH + x] = (uint8_t)(x / 2 + y);
    const struct fovea_image frame = grey();
    fv_kernels_init(&kernels, FV_CPU_C);
    fv_pyramid_build(&pyramid, &kernels, &frame);
    for (uint32_t i = 0; i < LEVELS; i++) {
        const struct fv_plane *level = &pyramid.level[i];
        for (int32_t y = 0; y < level->height; y++)
            for (int32_t x = 0; x < level->width; x++) {
                const float expected =
                    fv_pyramid_to_raw(i, (float)x) / 2 + fv_pyramid_to_raw(i, (float)y) - 0.25f;
                assert_float_equal(level->pixels[y * level->stride + x], expected,
                                   0.75f + 0.55f * (float)i);
            }
    }
    free(memory);
}

static void every_kernel_set_gives_the_same_levels(void **state)
{
    (void)state;
    struct fv_pyramid expected, found;
    void *memory = carved(carve, &expected), *other = carved(carve, &found);
    fill_random();
    const struct fovea_image frame = grey();
    struct fv_kernels kernels;
    fv_kernels_init(&kernels, FV_CPU_C);
    fv_pyramid_build(&expected, &kernels, &frame);
    for (int set = 1; set < FV_CPU_SET_COUNT; set++) {
        fv_kernels_init(&kernels, (enum fv_cpu_set)set);
        fv_pyramid_build(&found, &kernels, &frame);
        for (uint32_t i = 0; i < LEVELS; i++)
            for (int32_t y = 0; y < expected.level[i].height; y++) {
                const ptrdiff_t row = (ptrdiff_t)y * expected.level[i].stride;
                assert_memory_equal(expected.level[i].pixels + row, found.level[i].pixels + row,
                                    (size_t)expected.level[i].width);
            }
    }
    free(memory);
    free(other);
}

/* The grey level of one pixel by the words of grey.h, written out anew. */
static int32_t grey_of(enum fovea_pixel_format format, int32_t stride, int32_t x, int32_t y)
{
    const uint8_t *row = pixels + y * stride;
    const int32_t word = row[2 * x] + 256 * row[2 * x + 1];
    switch (format) {
    case FOVEA_PIXEL_Y10:
        return word / 4 > 255 ? 255 : word / 4;
    case FOVEA_PIXEL_Y12:
        return word / 16 > 255 ? 255 : word / 16;
    case FOVEA_PIXEL_Y14:
        return word / 64 > 255 ? 255 : word / 64;
    case FOVEA_PIXEL_Y16:
        return word / 256;
    case FOVEA_PIXEL_YUYV:
        return row[2 * x];
    case FOVEA_PIXEL_UYVY:
        return row[2 * x + 1];
    case FOVEA_PIXEL_RGB24:
        return (9798 * row[3 * x] + 19235 * row[3 * x + 1] + 3735 * row[3 * x + 2] + 16384) / 32768;
    case FOVEA_PIXEL_BGR24:
        return (3735 * row[3 * x] + 19235 * row[3 * x + 1] + 9798 * row[3 * x + 2] + 16384) / 32768;
    case FOVEA_PIXEL_BAYER_RGGB8:
    case FOVEA_PIXEL_BAYER_BGGR8:
    case FOVEA_PIXEL_BAYER_GRBG8:
    case FOVEA_PIXEL_BAYER_GBRG8: {
        int32_t sum = 8;
        for (int32_t dy = -1; dy <= 1; dy++)
            for (int32_t dx = -1; dx <= 1; dx++) {
                int32_t u = abs(x + dx), v = abs(y + dy);
                if (u > 199) u = 398 - u;
                if (v > 147) v = 294 - v;
                sum += (2 - abs(dx)) * (2 - abs(dy)) * pixels[v * stride + u];
            }
        return sum / 16;
    }
    default:
        return row[x];
    }
}

static void every_format_becomes_grey_as_documented(void **state)
{
    (void)state;
    enum { W = 200, H = 148 };
    struct fv_pyramid pyramid;
    void *memory = carved(carve, &pyramid);
    fill_random();
    for (int set = 0; set < FV_CPU_SET_COUNT; set++) {
        struct fv_kernels kernels;
        fv_kernels_init(&kernels, (enum fv_cpu_set)set);
        for (int format = 0; format < FOVEA_PIXEL_FORMAT_COUNT; format++) {
            if (format == FOVEA_PIXEL_MJPEG) continue;
            const enum fovea_pixel_format f = (enum fovea_pixel_format)format;
            const int32_t stride = fovea_image_stride_min(f, W) + 6;
            const struct fovea_image frame = {pixels, W, H,
                                              stride, f, fovea_image_bytes(f, H, stride)};
            assert_int_equal(fovea_image_check(&frame), FOVEA_OK);
            pyramid.level[0].width = W;
            pyramid.level[0].height = H;
            pyramid.levels = 1;
            fv_pyramid_build(&pyramid, &kernels, &frame);
            for (int32_t y = 0; y < H; y++)
                for (int32_t x = 0; x < W; x++)
                    if (pyramid.level[0].pixels[y * pyramid.level[0].stride + x] !=
                        grey_of(f, stride, x, y))
                        fail_msg("%s, kernels %s: (%d, %d) is %d, expected %d",
                                 fovea_pixel_format_name(f), fv_cpu_set_name(kernels.set), x, y,
                                 pyramid.level[0].pixels[y * pyramid.level[0].stride + x],
                                 grey_of(f, stride, x, y));
        }
    }
    free(memory);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(no_sample_lies_outside),
        cmocka_unit_test(places_map_by_exactly_one_point_two),
        cmocka_unit_test(a_ramp_stays_a_ramp),
        cmocka_unit_test(every_kernel_set_gives_the_same_levels),
        cmocka_unit_test(every_format_becomes_grey_as_documented),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

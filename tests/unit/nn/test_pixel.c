/* Pixels that get another luma, in every format that frames may have. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "base/elementary.h"
#include "image/grey.h"
#include "nn/pixel.h"

enum { WIDTH = 66, HEIGHT = 50, BYTES_MAX = WIDTH * HEIGHT * 3 };

static uint8_t pixels[BYTES_MAX], kept[BYTES_MAX], grey[2][WIDTH * HEIGHT], wanted[WIDTH * HEIGHT];

static struct fovea_image image_of(const uint8_t *data, enum fovea_pixel_format format)
{
    const int32_t stride = fovea_image_stride_min(format, WIDTH);
    return (struct fovea_image){.data = data,
                                .width = WIDTH,
                                .height = HEIGHT,
                                .stride_bytes = stride,
                                .format = format,
                                .size_bytes = fovea_image_bytes(format, HEIGHT, stride)};
}

static void grey_levels(enum fovea_pixel_format format, uint8_t *to)
{
    struct fv_kernels kernels;
    const struct fv_plane plane = {to, WIDTH, HEIGHT, WIDTH};
    const struct fovea_image image = image_of(pixels, format);
    fv_kernels_init(&kernels, FV_CPU_C);
    fv_grey_convert(&plane, &kernels, &image);
}

/* Random pixels of a format, and a luma for them. */
static void begin(enum fovea_pixel_format format, uint64_t seed)
{
    struct fv_random random;
    fv_random_seed(&random, seed);
    for (int k = 0; k < BYTES_MAX; k++)
        pixels[k] = (uint8_t)fv_random_below(&random, 256);
    const uint8_t bits = format == FOVEA_PIXEL_Y10 ? 3 : format == FOVEA_PIXEL_Y12 ? 15 : 63;
    if (format == FOVEA_PIXEL_Y10 || format == FOVEA_PIXEL_Y12 || format == FOVEA_PIXEL_Y14)
        for (int k = 1; k < BYTES_MAX; k += 2)
            pixels[k] &= bits;
    for (int k = 0; k < WIDTH * HEIGHT; k++)
        wanted[k] = (uint8_t)fv_random_below(&random, 256);
    memcpy(kept, pixels, sizeof kept);
    grey_levels(format, grey[0]);
}

static void relight(enum fovea_pixel_format format)
{
    const struct fovea_image image = image_of(pixels, format),
                             before = image_of(grey[0], FOVEA_PIXEL_GREY8),
                             after = image_of(wanted, FOVEA_PIXEL_GREY8);
    fv_pixel_relight(&image, pixels, &before, &after);
}

static void luma_is_the_new_one_where_a_format_has_luma(void **state)
{
    (void)state;
    static const enum fovea_pixel_format formats[] = {
        FOVEA_PIXEL_GREY8, FOVEA_PIXEL_Y10,  FOVEA_PIXEL_Y12,  FOVEA_PIXEL_Y14, FOVEA_PIXEL_Y16,
        FOVEA_PIXEL_YUYV,  FOVEA_PIXEL_UYVY, FOVEA_PIXEL_NV12, FOVEA_PIXEL_YU12};
    for (size_t f = 0; f < sizeof formats / sizeof formats[0]; f++) {
        begin(formats[f], f);
        relight(formats[f]);
        grey_levels(formats[f], grey[1]);
        assert_memory_equal(grey[1], wanted, sizeof wanted);
        /* the colours, and what lies behind the image, are as they were */
        const bool packed = formats[f] == FOVEA_PIXEL_YUYV || formats[f] == FOVEA_PIXEL_UYVY;
        for (int k = formats[f] == FOVEA_PIXEL_UYVY ? 0 : 1; packed && k < 2 * WIDTH * HEIGHT;
             k += 2)
            assert_int_equal(pixels[k], kept[k]);
        const size_t behind = formats[f] == FOVEA_PIXEL_NV12 || formats[f] == FOVEA_PIXEL_YU12
                                  ? WIDTH * HEIGHT
                                  : image_of(pixels, formats[f]).size_bytes;
        assert_memory_equal(pixels + behind, kept + behind, BYTES_MAX - behind);
    }
}

static void values_of_colours_rise_by_the_difference(void **state)
{
    (void)state;
    static const enum fovea_pixel_format formats[] = {
        FOVEA_PIXEL_RGB24,       FOVEA_PIXEL_BGR24,       FOVEA_PIXEL_BAYER_RGGB8,
        FOVEA_PIXEL_BAYER_BGGR8, FOVEA_PIXEL_BAYER_GRBG8, FOVEA_PIXEL_BAYER_GBRG8};
    for (size_t f = 0; f < sizeof formats / sizeof formats[0]; f++) {
        const int values = f < 2 ? 3 : 1;
        begin(formats[f], 100 + f);
        relight(formats[f]);
        for (int k = 0; k < values * WIDTH * HEIGHT; k++) {
            const int at = k / values, risen = kept[k] + wanted[at] - grey[0][at];
            assert_int_equal(pixels[k], risen < 0 ? 0 : risen > 255 ? 255 : risen);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(luma_is_the_new_one_where_a_format_has_luma),
        cmocka_unit_test(values_of_colours_rise_by_the_difference),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

/* Image views: names, sizes, and what the check lets through. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "fovea/image.h"

static uint8_t pixels[8 << 20];

static struct fovea_image view(enum fovea_pixel_format format, int32_t width, int32_t height)
{
    const int32_t stride = fovea_image_stride_min(format, width);
    return (struct fovea_image){pixels, width,  height,
                                stride, format, fovea_image_bytes(format, height, stride)};
}

static void sizes_are_those_of_the_formats(void **state)
{
    (void)state;
    assert_int_equal(fovea_image_stride_min(FOVEA_PIXEL_GREY8, 640), 640);
    assert_int_equal(fovea_image_stride_min(FOVEA_PIXEL_Y12, 640), 1280);
    assert_int_equal(fovea_image_stride_min(FOVEA_PIXEL_YUYV, 640), 1280);
    assert_int_equal(fovea_image_stride_min(FOVEA_PIXEL_RGB24, 641), 1923);
    assert_int_equal(fovea_image_stride_min(FOVEA_PIXEL_NV12, 640), 640);
    assert_int_equal(fovea_image_stride_min(FOVEA_PIXEL_MJPEG, 640), 0);
    assert_int_equal(fovea_image_bytes(FOVEA_PIXEL_NV12, 480, 640), 460800);
    assert_int_equal(fovea_image_bytes(FOVEA_PIXEL_YU12, 480, 640), 460800);
    assert_int_equal(fovea_image_bytes(FOVEA_PIXEL_BGR24, 480, 1920), 921600);
    assert_int_equal(fovea_image_bytes(FOVEA_PIXEL_MJPEG, 480, 640), 0);
    assert_int_equal(fovea_image_stride_min((enum fovea_pixel_format)99, 640), 0);
    assert_int_equal(fovea_image_stride_min(FOVEA_PIXEL_RGB24, INT32_MAX), 0);
}

static void every_format_has_a_name_and_passes_at_its_size(void **state)
{
    (void)state;
    for (int format = 0; format < FOVEA_PIXEL_FORMAT_COUNT; format++) {
        assert_string_not_equal(fovea_pixel_format_name((enum fovea_pixel_format)format),
                                "unknown");
        if (format == FOVEA_PIXEL_MJPEG) continue;
        struct fovea_image image = view((enum fovea_pixel_format)format, 64, 66);
        assert_int_equal(fovea_image_check(&image), FOVEA_OK);
        image.size_bytes--;
        assert_int_equal(fovea_image_check(&image), FOVEA_ERROR_ARGUMENT);
        image.size_bytes++;
        image.stride_bytes--;
        assert_int_equal(fovea_image_check(&image), FOVEA_ERROR_ARGUMENT);
    }
    assert_string_equal(fovea_pixel_format_name((enum fovea_pixel_format) - 1), "unknown");
}

static void the_last_row_needs_no_padding(void **state)
{
    (void)state;
    struct fovea_image image = view(FOVEA_PIXEL_GREY8, 100, 80);
    image.stride_bytes = 128;
    image.size_bytes = 79 * 128 + 100;
    assert_int_equal(fovea_image_check(&image), FOVEA_OK);
    image.size_bytes--;
    assert_int_equal(fovea_image_check(&image), FOVEA_ERROR_ARGUMENT);
    image = view(FOVEA_PIXEL_YU12, 100, 80);
    image.stride_bytes = 128;
    image.size_bytes = 80 * 128 + 79 * 64 + 50;
    assert_int_equal(fovea_image_check(&image), FOVEA_OK);
    image.size_bytes--;
    assert_int_equal(fovea_image_check(&image), FOVEA_ERROR_ARGUMENT);
}

static void what_does_not_fit_is_refused(void **state)
{
    (void)state;
    struct fovea_image good = view(FOVEA_PIXEL_GREY8, 640, 480), image;
    assert_int_equal(fovea_image_check(NULL), FOVEA_ERROR_ARGUMENT);
    image = good, image.data = NULL;
    assert_int_equal(fovea_image_check(&image), FOVEA_ERROR_ARGUMENT);
    image = good, image.width = 63;
    assert_int_equal(fovea_image_check(&image), FOVEA_ERROR_ARGUMENT);
    image = good, image.height = 4097;
    assert_int_equal(fovea_image_check(&image), FOVEA_ERROR_ARGUMENT);
    image = good, image.format = FOVEA_PIXEL_FORMAT_COUNT;
    assert_int_equal(fovea_image_check(&image), FOVEA_ERROR_ARGUMENT);
    image = good, image.stride_bytes = -640;
    assert_int_equal(fovea_image_check(&image), FOVEA_ERROR_ARGUMENT);
    image = view(FOVEA_PIXEL_YUYV, 65, 64);
    assert_int_equal(fovea_image_check(&image), FOVEA_ERROR_ARGUMENT);
    image = view(FOVEA_PIXEL_NV12, 64, 65);
    assert_int_equal(fovea_image_check(&image), FOVEA_ERROR_ARGUMENT);
}

static void compressed_images_have_no_stride(void **state)
{
    (void)state;
    struct fovea_image image = {pixels, 640, 480, 0, FOVEA_PIXEL_MJPEG, 1000};
    assert_int_equal(fovea_image_check(&image), FOVEA_OK);
    image.size_bytes = 0;
    assert_int_equal(fovea_image_check(&image), FOVEA_ERROR_ARGUMENT);
    image.size_bytes = 10, image.stride_bytes = 640;
    assert_int_equal(fovea_image_check(&image), FOVEA_ERROR_ARGUMENT);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sizes_are_those_of_the_formats),
        cmocka_unit_test(every_format_has_a_name_and_passes_at_its_size),
        cmocka_unit_test(the_last_row_needs_no_padding),
        cmocka_unit_test(what_does_not_fit_is_refused),
        cmocka_unit_test(compressed_images_have_no_stride),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

/* Image views: names, sizes, and what the check lets through. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <cmocka.h>

#include "fovea/image.h"
#include "support/image_pack.h"

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

/* Fill the rows of a plane, the gaps with 0xEE. */
static uint8_t *plane_fill(uint8_t *to, int32_t rows, int32_t row, int32_t stride, uint8_t first)
{
    memset(to, 0xEE, (size_t)rows * (size_t)stride);
    for (int32_t y = 0; y < rows; y++, to += stride)
        for (int32_t x = 0; x < row; x++)
            to[x] = (uint8_t)((first + 3 * x + 7 * y) & 127);
    return to;
}

static void check_planes(enum fovea_pixel_format format, int32_t chroma_rows, int32_t chroma_row,
                         int32_t gap)
{
    enum { W = 70, H = 66 };
    static uint8_t expected[6 * W * H], packed[6 * W * H];
    const int32_t row = fovea_image_stride_min(format, W), stride = row + gap,
                  narrower = chroma_row < row ? 2 : 1;
    struct fovea_image image = view(format, W, H);
    image.stride_bytes = stride;
    image.size_bytes = fovea_image_bytes(format, H, stride);
    assert_int_equal(fovea_image_check(&image), FOVEA_OK);
    plane_fill(plane_fill(pixels, H, row, stride, 1), chroma_rows, chroma_row, stride / narrower,
               50);
    const size_t bytes = (size_t)(plane_fill(plane_fill(expected, H, row, row, 1), chroma_rows,
                                             chroma_row, chroma_row, 50) -
                                  expected);
    assert_int_equal(fv_image_packed_bytes(&image), bytes);
    memset(packed, 0xDD, sizeof packed);
    const struct fovea_image copy = fv_image_pack(&image, packed);
    assert_int_equal(fovea_image_check(&copy), FOVEA_OK);
    assert_true(copy.data == packed && copy.stride_bytes == row && copy.size_bytes == bytes);
    assert_memory_equal(packed, expected, bytes);
    assert_int_equal(packed[bytes], 0xDD);
}

static void packed_images_have_all_planes_and_no_gaps(void **state)
{
    (void)state;
    for (int32_t gap = 0; gap <= 300; gap += 30) {
        check_planes(FOVEA_PIXEL_GREY8, 0, 0, gap);
        check_planes(FOVEA_PIXEL_YUYV, 0, 0, gap);
        check_planes(FOVEA_PIXEL_RGB24, 0, 0, gap);
        check_planes(FOVEA_PIXEL_NV12, 33, 70, gap);
        check_planes(FOVEA_PIXEL_YU12, 66, 35, gap);
    }
    const struct fovea_image absent = {.data = NULL, .width = 70, .height = 66},
                             jpeg = {pixels, 70, 66, 0, FOVEA_PIXEL_MJPEG, 123};
    uint8_t to[124] = {[123] = 0xDD};
    assert_int_equal(fv_image_packed_bytes(&absent), 0);
    assert_int_equal(fv_image_packed_bytes(&jpeg), 123);
    assert_int_equal(fv_image_pack(&jpeg, to).size_bytes, 123);
    assert_memory_equal(to, pixels, 123);
    assert_int_equal(to[123], 0xDD);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(packed_images_have_all_planes_and_no_gaps),
        cmocka_unit_test(sizes_are_those_of_the_formats),
        cmocka_unit_test(every_format_has_a_name_and_passes_at_its_size),
        cmocka_unit_test(the_last_row_needs_no_padding),
        cmocka_unit_test(what_does_not_fit_is_refused),
        cmocka_unit_test(compressed_images_have_no_stride),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

/* The preview's JPEG encoder, with libjpeg as the judge: what it writes decodes without a warning,
 * to a picture as close to the original as libjpeg's own at the same quality, and in any slicing to
 * the same bytes. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <jpeglib.h>

#include "base/elementary.h"
#include "image/jpeg.h"

static uint8_t *picture(int width, int height, int kind)
{
    uint8_t *pixels = malloc((size_t)width * (size_t)height);
    struct fv_random random;
    fv_random_seed(&random, 5);
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) {
            const int smooth = (x * 3 + y * 2 + (x / 16 + y / 16) % 2 * 90) & 255;
            const int noise = (int)fv_random_below(&random, 256);
            const int extreme = (x ^ y) & 1 ? 255 : 0;
            pixels[y * width + x] = (uint8_t)(kind == 0 ? smooth : kind == 1 ? noise : extreme);
        }
    }
    return pixels;
}

static size_t encode(const uint8_t *pixels, int width, int height, unsigned quality, unsigned slice,
                     uint8_t **output)
{
    struct fv_jpeg jpeg;
    const struct fv_plane plane = fv_plane_of(pixels, width, height, width);
    const size_t capacity = 4 * fv_jpeg_capacity(width, height);
    *output = malloc(capacity);
    fv_jpeg_start(&jpeg, width, height, quality, *output, capacity);
    while (!fv_jpeg_encode(&jpeg, &plane, slice, *output)) {
    }
    assert_false(jpeg.overflow);
    return jpeg.used;
}

/* Mean squared error after libjpeg decoded it. */
static double decode_error(const uint8_t *jpeg, size_t bytes, const uint8_t *pixels, int width,
                           int height)
{
    struct jpeg_decompress_struct decoder;
    struct jpeg_error_mgr errors;
    decoder.err = jpeg_std_error(&errors);
    jpeg_create_decompress(&decoder);
    jpeg_mem_src(&decoder, jpeg, bytes);
    jpeg_read_header(&decoder, TRUE);
    jpeg_start_decompress(&decoder);
    assert_int_equal(decoder.output_width, width);
    assert_int_equal(decoder.output_height, height);
    assert_int_equal(decoder.output_components, 1);
    uint8_t *row = malloc((size_t)width);
    double sum = 0;
    for (int y = 0; y < height; y++) {
        jpeg_read_scanlines(&decoder, &row, 1);
        for (int x = 0; x < width; x++) {
            const double d = row[x] - pixels[y * width + x];
            sum += d * d;
        }
    }
    jpeg_finish_decompress(&decoder);
    assert_int_equal(errors.num_warnings, 0);
    jpeg_destroy_decompress(&decoder);
    free(row);
    return sum / (width * height);
}

static size_t encode_with_libjpeg(const uint8_t *pixels, int width, int height, int quality,
                                  uint8_t **output)
{
    struct jpeg_compress_struct encoder;
    struct jpeg_error_mgr errors;
    unsigned long bytes = 0;
    *output = NULL;
    encoder.err = jpeg_std_error(&errors);
    jpeg_create_compress(&encoder);
    jpeg_mem_dest(&encoder, output, &bytes);
    encoder.image_width = (JDIMENSION)width;
    encoder.image_height = (JDIMENSION)height;
    encoder.input_components = 1;
    encoder.in_color_space = JCS_GRAYSCALE;
    jpeg_set_defaults(&encoder);
    jpeg_set_quality(&encoder, quality, TRUE);
    jpeg_start_compress(&encoder, TRUE);
    for (int y = 0; y < height; y++) {
        JSAMPROW row = (JSAMPROW)(uintptr_t)(pixels + y * width);
        jpeg_write_scanlines(&encoder, &row, 1);
    }
    jpeg_finish_compress(&encoder);
    jpeg_destroy_compress(&encoder);
    return bytes;
}

static void as_good_as_libjpeg(void **state)
{
    (void)state;
    static const int sizes[][2] = {{64, 64}, {100, 67}, {313, 200}};
    static const int qualities[] = {5, 40, 70, 95, 100};
    for (int kind = 0; kind < 3; kind++) {
        for (size_t s = 0; s < 3; s++) {
            for (size_t q = 0; q < 5; q++) {
                const int width = sizes[s][0], height = sizes[s][1];
                uint8_t *pixels = picture(width, height, kind), *ours, *theirs;
                const size_t our_bytes =
                    encode(pixels, width, height, (unsigned)qualities[q], 7, &ours);
                const size_t their_bytes =
                    encode_with_libjpeg(pixels, width, height, qualities[q], &theirs);
                const double our_error = decode_error(ours, our_bytes, pixels, width, height);
                const double their_error = decode_error(theirs, their_bytes, pixels, width, height);
                assert_true(our_error <= 1.02 * their_error + 0.1);
                assert_true(our_bytes <= their_bytes * 1.02 + 64);
                free(pixels);
                free(ours);
                free(theirs);
            }
        }
    }
}

static void slicing_changes_nothing(void **state)
{
    (void)state;
    uint8_t *pixels = picture(130, 90, 0), *whole, *sliced;
    const size_t bytes = encode(pixels, 130, 90, 70, 100000, &whole);
    assert_int_equal(encode(pixels, 130, 90, 70, 1, &sliced), bytes);
    assert_memory_equal(whole, sliced, bytes);
    free(pixels);
    free(whole);
    free(sliced);
}

static void small_buffer_overflows_honestly(void **state)
{
    (void)state;
    uint8_t *pixels = picture(130, 90, 1);
    uint8_t output[1200];
    memset(output, 0x5a, sizeof output);
    struct fv_jpeg jpeg;
    const struct fv_plane plane = fv_plane_of(pixels, 130, 90, 130);
    fv_jpeg_start(&jpeg, 130, 90, 100, output, 1000);
    assert_true(fv_jpeg_encode(&jpeg, &plane, 100000, output));
    assert_true(jpeg.overflow);
    for (size_t i = 1000; i < sizeof output; i++)
        assert_int_equal(output[i], 0x5a);
    free(pixels);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(as_good_as_libjpeg),
        cmocka_unit_test(slicing_changes_nothing),
        cmocka_unit_test(small_buffer_overflows_honestly),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

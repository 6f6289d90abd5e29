/* Masks: dark is ignored, whatever kind of PNG the picture is saved as. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>
#include <png.h>

#include "app/config/mask.h"

enum { WIDTH = 96, HEIGHT = 80, BYTES = WIDTH * HEIGHT };

static char path[] = "/tmp/fovea_mask_XXXXXX";
static uint16_t pixels[4 * BYTES]; /* room for every format */

static void save(png_uint_32 format)
{
    png_image png = {
        .version = PNG_IMAGE_VERSION, .width = WIDTH, .height = HEIGHT, .format = format};
    assert_true(png_image_write_to_file(&png, path, 0, pixels, 0, NULL));
}

/* The left half is to be ignored, the right half not. Memory that the reader gets holds anything.
 */
static void assert_halves(void)
{
    for (int fill = 0; fill < 256; fill += 255) {
        uint8_t *before = malloc(BYTES), *mask = NULL;
        memset(before, fill, BYTES);
        free(before);
        assert_int_equal(fv_mask_read(path, WIDTH, HEIGHT, &mask, NULL), FOVEA_OK);
        for (int i = 0; i < BYTES; i++)
            assert_int_equal(mask[i], i % WIDTH < WIDTH / 2 ? 0 : 255);
        free(mask);
    }
}

static void test_grey(void **state)
{
    (void)state;
    for (int i = 0; i < BYTES; i++)
        ((uint8_t *)pixels)[i] = i % WIDTH < WIDTH / 2 ? 20 : 240;
    save(PNG_FORMAT_GRAY);
    assert_halves();
    for (int i = 0; i < BYTES; i++)
        pixels[i] = i % WIDTH < WIDTH / 2 ? 300 : 60000;
    save(PNG_FORMAT_LINEAR_Y);
    assert_halves();
}

static void test_colour(void **state)
{
    uint8_t *rgb = (uint8_t *)pixels;
    (void)state;
    for (int i = 0; i < BYTES; i++)
        memcpy(rgb + 3 * (size_t)i, i % WIDTH < WIDTH / 2 ? "\x10\x00\x20" : "\xff\xf0\xe0", 3);
    save(PNG_FORMAT_RGB);
    assert_halves();
}

/* As painted in black over nothing: where there is nothing, nothing is ignored. */
static void test_transparent(void **state)
{
    uint8_t *rgba = (uint8_t *)pixels;
    (void)state;
    for (int i = 0; i < BYTES; i++)
        memcpy(rgba + 4 * (size_t)i, i % WIDTH < WIDTH / 2 ? "\0\0\0\xff" : "\0\0\0\0", 4);
    save(PNG_FORMAT_RGBA);
    assert_halves();
    for (int i = 0; i < BYTES; i++)
        memcpy(rgba + 2 * (size_t)i, i % WIDTH < WIDTH / 2 ? "\0\xff" : "\0\0", 2);
    save(PNG_FORMAT_GA);
    assert_halves();
}

static void test_another_size(void **state)
{
    uint8_t *mask = NULL;
    struct fovea_error error;
    (void)state;
    memset(pixels, 0, sizeof pixels);
    save(PNG_FORMAT_GRAY);
    assert_int_equal(fv_mask_read(path, WIDTH + 1, HEIGHT, &mask, &error), FOVEA_ERROR_INPUT);
    assert_null(mask);
    assert_non_null(strstr(error.text, "found 96 x 80 pixels, expected 97 x 80"));
}

static int make(void **state)
{
    (void)state;
    const int file = mkstemp(path);
    return file < 0 ? -1 : close(file);
}

static int drop(void **state)
{
    (void)state;
    return unlink(path);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_grey),
        cmocka_unit_test(test_colour),
        cmocka_unit_test(test_transparent),
        cmocka_unit_test(test_another_size),
    };
    return cmocka_run_group_tests(tests, make, drop);
}

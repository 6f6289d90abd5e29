/* The noise of a picture: white noise is measured, a little too low; what covers less than three
 * quarters of a picture, planes and edges along rows and columns are none; the smallest and
 * narrowest pictures, without a pixel beyond them. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdlib.h>
#include <string.h>

#include "base/elementary.h"
#include "fovea/image.h"
#include "image/noise.h"

enum { WIDTH = 320, HEIGHT = 240 };

static uint8_t pixels[WIDTH * HEIGHT];
static const struct fv_plane plane = {pixels, WIDTH, HEIGHT, WIDTH};

static double measured(void)
{
    return (double)fv_noise(&plane) / FV_NOISE_ONE;
}

static uint8_t clamped(double value)
{
    return (uint8_t)(value < 0 ? 0 : value > 255 ? 255 : value + 0.5);
}

static void add_noise(double deviation, int32_t rows)
{
    struct fv_random random;
    fv_random_seed(&random, 7);
    for (int32_t i = 0; i < rows * WIDTH; i++)
        pixels[i] = clamped(pixels[i] + deviation * fv_random_normal(&random));
}

static void a_ramp_with_edges(void)
{
    for (int32_t y = 0; y < HEIGHT; y++)
        for (int32_t x = 0; x < WIDTH; x++)
            pixels[y * WIDTH + x] = (uint8_t)(60 + x / 8 + (x % 37 < 18 ? 60 : 0) + y / 5);
}

static void white_noise_is_measured(void **state)
{
    static const double deviations[] = {1, 2, 5, 10, 20, 30};
    (void)state;
    for (size_t i = 0; i < sizeof deviations / sizeof *deviations; i++) {
        const double deviation = deviations[i];
        memset(pixels, 128, sizeof pixels);
        add_noise(deviation, HEIGHT);
        print_message("noise of %g: measured %g\n", deviation, measured());
        assert_true(fabs(measured() - 0.93 * deviation) < 0.03 * deviation + 0.1);
    }
    memset(pixels, 128, sizeof pixels);
    add_noise(60, HEIGHT); /* cut off at both ends */
    assert_true(measured() > 48 && measured() < 60);
    memset(pixels, 255, sizeof pixels);
    add_noise(60, HEIGHT); /* half of it cut off */
    assert_true(measured() > 25);
}

static void what_is_plain_is_no_noise(void **state)
{
    (void)state;
    memset(pixels, 200, sizeof pixels);
    assert_int_equal(fv_noise(&plane), 0);
    a_ramp_with_edges();
    print_message("a ramp with edges: measured %g\n", measured());
    assert_true(measured() < 0.5);
    add_noise(40, HEIGHT * 2 / 3); /* texture over two thirds of the picture */
    print_message("a third of it without noise: measured %g\n", measured());
    assert_true(measured() < 0.5);
    a_ramp_with_edges();
    add_noise(40, HEIGHT * 5 / 6);
    assert_true(measured() > 20);
}

/* Every second pixel black, the others white: the strongest response that there is. */
static void the_most_is_bounded(void **state)
{
    (void)state;
    for (int32_t i = 0; i < WIDTH * HEIGHT; i++)
        pixels[i] = (i / WIDTH + i) % 2 != 0 ? 255 : 0;
    assert_int_equal(fv_noise(&plane), FV_NOISE_MAX);
}

/* All pixels lie in a buffer of just their size, whose end sanitizers watch; nothing of the gap
 * behind a row counts. */
static void the_smallest_picture_is_enough(void **state)
{
    static const int32_t sizes[][2] = {{FOVEA_IMAGE_WIDTH_MIN, FOVEA_IMAGE_HEIGHT_MIN},
                                       {FOVEA_IMAGE_WIDTH_MAX, FOVEA_IMAGE_HEIGHT_MIN},
                                       {FOVEA_IMAGE_WIDTH_MIN, FOVEA_IMAGE_HEIGHT_MAX},
                                       {77, 101}};
    (void)state;
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++) {
        const int32_t width = sizes[i][0], height = sizes[i][1], stride = width + 5;
        const size_t bytes = (size_t)stride * (size_t)(height - 1) + (size_t)width;
        uint8_t *data = malloc(bytes);
        assert_non_null(data);
        struct fv_random random;
        fv_random_seed(&random, i);
        for (size_t k = 0; k < bytes; k++)
            data[k] = clamped(128 + 10 * fv_random_normal(&random));
        const struct fv_plane small = fv_plane_of(data, width, height, stride);
        const uint32_t noise = fv_noise(&small);
        assert_in_range(noise, 9 * FV_NOISE_ONE, 11 * FV_NOISE_ONE);
        for (int32_t y = 0; y + 1 < height; y++)
            memset(data + (ptrdiff_t)y * stride + width, y % 2 != 0 ? 255 : 0, 5);
        assert_int_equal(fv_noise(&small), noise);
        free(data);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(white_noise_is_measured),
        cmocka_unit_test(what_is_plain_is_no_noise),
        cmocka_unit_test(the_most_is_bounded),
        cmocka_unit_test(the_smallest_picture_is_enough),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

/* Previews made smaller: they fit, still show the picture, and damaged ones are given up. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdlib.h>
#include <string.h>

#include "app/network/sender_preview.h"
#include "image/jpeg.h"
#include "message/message.h"

#include "fovea_preview_t.h"

enum { WIDTH = 376, HEIGHT = 240, MOST = 60000 };

static uint8_t message[MOST], shrunk[MOST];
static uint32_t message_bytes;

/* Waves and noise; the brighter half is on the right. */
static int setup(void **state)
{
    (void)state;
    static uint8_t pixels[WIDTH * HEIGHT], jpeg[WIDTH * HEIGHT];
    const struct fv_plane plane = {pixels, WIDTH, HEIGHT, WIDTH};
    struct fv_jpeg encoder;
    uint32_t noise = 1;
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        pixels[i] = (uint8_t)(((noise = noise * 1664525u + 1013904223u) >> 25) +
                              (uint32_t)(i % WIDTH < WIDTH / 2 ? 10 : 110));
    fv_message_prepare();
    fv_jpeg_start(&encoder, WIDTH, HEIGHT, 70, jpeg, sizeof jpeg);
    while (!fv_jpeg_encode(&encoder, &plane, 64, jpeg))
        ;
    const struct fv_message_preview preview = {.stamp = {.time_ns = 77},
                                               .width = WIDTH,
                                               .height = HEIGHT,
                                               .scale = 2.0,
                                               .jpeg = jpeg,
                                               .jpeg_bytes = (uint32_t)encoder.used};
    message_bytes = fv_message_preview_encode(&preview, message, sizeof message);
    return message_bytes > 0 ? 0 : -1;
}

static void expect_picture(uint32_t bytes, size_t most)
{
    fovea_preview_t preview;
    assert_in_range(bytes, 1, most);
    assert_int_equal(fovea_preview_t_decode(shrunk, 0, (int)bytes, &preview), bytes);
    assert_int_equal(preview.stamp.time_ns, 77);
    assert_true(preview.width * preview.scale >= 2 * WIDTH - 16 &&
                preview.width * preview.scale <= 2 * WIDTH + 1);
    assert_true(preview.jpeg[0] == 0xff && preview.jpeg[1] == 0xd8);
    assert_true(preview.jpeg[preview.size_bytes - 2] == 0xff &&
                preview.jpeg[preview.size_bytes - 1] == 0xd9);
    fovea_preview_t_decode_cleanup(&preview);
}

static void quality_falls_before_size(void **state)
{
    (void)state;
    struct fv_preview_fit fit = {0};
    size_t width = WIDTH, last = message_bytes;
    for (size_t most = message_bytes; most > 1500; most = most * 3 / 4) {
        fovea_preview_t preview;
        const uint32_t bytes = fv_preview_shrink(&fit, message, message_bytes, shrunk, most);
        expect_picture(bytes, most);
        assert_true(fovea_preview_t_decode(shrunk, 0, (int)bytes, &preview) > 0);
        if (most > message_bytes / 2) assert_int_equal(preview.width, WIDTH);
        assert_true((size_t)preview.width <= width && bytes <= last);
        width = (size_t)preview.width;
        last = bytes;
        fovea_preview_t_decode_cleanup(&preview);
    }
    assert_true(width < WIDTH);
}

static void more_room_gives_a_better_picture_again(void **state)
{
    (void)state;
    struct fv_preview_fit fit = {0};
    const uint32_t small = fv_preview_shrink(&fit, message, message_bytes, shrunk, 2000);
    uint32_t bytes = small;
    for (int i = 0; i < 16; i++)
        bytes = fv_preview_shrink(&fit, message, message_bytes, shrunk, 20000);
    assert_true(bytes > 3 * small);
}

static void what_cannot_fit_or_is_damaged_is_given_up(void **state)
{
    (void)state;
    struct fv_preview_fit fit = {0};
    assert_int_equal(fv_preview_shrink(&fit, message, message_bytes, shrunk, 200), 0);
    expect_picture(fv_preview_shrink(&fit, message, message_bytes, shrunk, 8000), 8000);
    for (uint32_t bytes = 0; bytes < message_bytes; bytes += 97)
        assert_int_equal(fv_preview_shrink(&fit, message, bytes, shrunk, 8000), 0);
    static uint8_t damaged[MOST];
    uint32_t noise = 7;
    for (int i = 0; i < 300; i++) {
        memcpy(damaged, message, message_bytes);
        for (int k = 0; k < 20; k++) {
            noise = noise * 1664525u + 1013904223u;
            damaged[8 + noise % (message_bytes - 8)] ^= (uint8_t)(noise >> 20);
        }
        assert_true(fv_preview_shrink(&fit, damaged, message_bytes, shrunk, 8000) <= 8000);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(quality_falls_before_size),
        cmocka_unit_test(more_room_gives_a_better_picture_again),
        cmocka_unit_test(what_cannot_fit_or_is_damaged_is_given_up),
    };
    return cmocka_run_group_tests(tests, setup, NULL);
}

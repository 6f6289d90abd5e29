/* Colours of recorded pictures: given when they are asked for and there, weighed into the same grey
 * levels. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <stdlib.h>
#include <string.h>

#include "support/decode.h"
#include "common/datasets.h"
#include "drivers/table.h"
#include "fovea/source.h"

enum { W = FV_TEST_WIDTH, H = FV_TEST_HEIGHT, STRIDE = 3 * W + 7 };

static char *const folder = fv_test_place;

static void decode(const char *path, bool colour, uint8_t *pixels)
{
    size_t bytes;
    uint8_t *file = fv_test_read(path, &bytes);
    const struct fv_decode_image image = {
        .pixels = pixels, .width = W, .height = H, .stride_bytes = STRIDE, .colour = colour};
    struct fovea_error reason = {.text = ""};
    memset(pixels, 0xEE, (size_t)STRIDE * H);
    if (fv_decode(file, bytes, &image, &reason) != FOVEA_OK) fail_msg("%s", reason.text);
    free(file);
}

static bool has_colour(const char *path)
{
    size_t bytes;
    uint8_t *file = fv_test_read(path, &bytes);
    const bool colour = fv_decode_has_colour(file, bytes);
    for (size_t i = 0; i < bytes && i < 700;
         ++i) { /* in memory of just that size: a header that is cut off */
        uint8_t *part = malloc(i + 1);
        memcpy(part, file, i + 1);
        fv_decode_has_colour(part, i + 1);
        free(part);
    }
    free(file);
    return colour;
}

static void test_png(void **state)
{
    (void)state;
    static uint8_t picture[W * H * 4], rgb[STRIDE * H], grey[STRIDE * H];
    const char *path = fv_test_path(folder, "kind.png");
    for (int kind = 0; kind < 8; kind++) {
        const struct fv_test_png form = {
            .width = W, .height = H, .channels = 1 + kind % 4, .depth = 8, .interlaced = kind >= 4};
        fv_test_picture((uint32_t)kind, W, H, form.channels, picture);
        fv_test_write_png(path, &form, picture);
        assert_true(has_colour(path) == (form.channels >= 3));
        decode(path, true, rgb);
        decode(path, false, grey);
        for (int i = 0; i < W * H; i++) {
            const uint8_t *sample = &picture[i * form.channels],
                          *found = &rgb[i / W * STRIDE + i % W * 3];
            for (int c = 0; c < 3; c++)
                assert_int_equal(found[c], form.channels < 3 ? sample[0] : sample[c]);
            const int weighed =
                (9798 * found[0] + 19235 * found[1] + 3735 * found[2] + 16384) >> 15;
            assert_int_equal(weighed, grey[i / W * STRIDE + i % W]);
        }
        assert_int_equal(rgb[3 * W], 0xEE); /* nothing past the row */
    }
}

static void test_jpeg(void **state)
{
    (void)state;
    static uint8_t picture[W * H * 3], rgb[STRIDE * H];
    const char *path = fv_test_path(folder, "kind.jpg");
    for (int kind = 0; kind < 6; kind++) {
        const int channels = kind < 2 ? 1 : 3;
        for (int i = 0; i < W * H * channels; i++) /* smooth, so that compression changes little */
            picture[i] = (uint8_t)(i / channels % W + i / channels / W + 30 * (i % channels));
        fv_test_write_jpeg(path, W, H, channels, kind % 2 == 1, kind >= 4, picture);
        assert_true(has_colour(path) == (channels == 3));
        decode(path, true, rgb);
        for (int i = 0; i < W * H; i++) {
            for (int c = 0; c < 3; c++) {
                const int expected = picture[i * channels + (channels == 3 ? c : 0)];
                assert_true(abs(rgb[i / W * STRIDE + i % W * 3 + c] - expected) <= 8);
            }
        }
        assert_int_equal(rgb[3 * W], 0xEE);
    }
}

/* A source gives colours only where both sides have them. */
static void test_source(void **state)
{
    (void)state;
    static uint8_t picture[W * H * 3];
    for (int channels = 1; channels <= 3; channels += 2) {
        const struct fv_test_png form = {.width = W, .height = H, .channels = channels, .depth = 8};
        const char *path = fv_test_path(folder, channels == 3 ? "colour.png" : "grey.png");
        fv_test_picture(5, W, H, channels, picture);
        fv_test_write_png(path, &form, picture);
        for (int wanted = 0; wanted <= 1; wanted++) {
            const struct fovea_source_selection selection = {.step = 1, .colour = wanted == 1};
            const struct fovea_source_ops *ops;
            const char *address;
            char uri[FV_TEST_PATH_BYTES + 8] = "images:";
            struct fovea_source *source = NULL;
            struct fovea_error error;
            struct fovea_frame frame;
            strcat(uri, path);
            if (fv_source_find(uri, &ops, &address, &error) != FOVEA_OK ||
                ops->open(address, &selection, &source, &error) != FOVEA_OK ||
                ops->start(source, &error) != FOVEA_OK ||
                ops->dequeue(source, INT64_MAX, &frame) != FOVEA_OK)
                fail_msg("%s", error.text);
            const bool colour = wanted == 1 && channels == 3;
            assert_int_equal(frame.images[0].format,
                             colour ? FOVEA_PIXEL_RGB24 : FOVEA_PIXEL_GREY8);
            if (colour)
                assert_memory_equal(frame.images[0].data + frame.images[0].stride_bytes,
                                    picture + (size_t)3 * W, 3 * W);
            ops->requeue(source, &frame);
            ops->close(source);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_png), cmocka_unit_test(test_jpeg),
                                       cmocka_unit_test(test_source)};
    return cmocka_run_group_tests(tests, fv_test_place_set_up, fv_test_place_tear_down);
}

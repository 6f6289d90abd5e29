/* Masks in the loop: classes are laid over previews where the mask has them, each with a brightness
 * of its own, with borders between them. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdlib.h>
#include <string.h>

#include "common/detector.h"
#include "common/grey_frame.h"
#include "fovea/fovea.h"
#include "nn/model.h"
#include "support/decode.h"

#include "fovea_preview_t.h"

enum { WIDTH = 320, HEIGHT = 240, FRAMES = 40, BLOCK = 8 };

static uint8_t picture[WIDTH * HEIGHT];

static int brightness[256]; /* of each place of the mask's list; -1: there is none */

/* Pixels of the last preview of level 0; `places`: the mask at its size. */
static void last_preview(bool drawn, uint8_t *pixels, uint8_t *places)
{
    struct fovea_config config;
    struct fovea_error error;
    struct fovea_segmentation seen;
    struct fovea *rt;
    size_t bytes;
    int previews = 0;
    fovea_config_default(&config);
    config.rig.cameras[0].camera = (struct fovea_camera){
        .width = WIDTH, .height = HEIGHT, .fx = 200, .fy = 200, .cx = 160, .cy = 120};
    assert_int_equal(fovea_camera_prepare(&config.rig.cameras[0].camera, &error), FOVEA_OK);
    config.odometry.enabled = false;
    config.detect.model = detector_as_segmenter(&config.detect.model_bytes);
    assert_non_null(config.detect.model);
    config.preview = (struct fovea_preview_config){
        .cameras = 1, .period_frames = 1, .quality = 95, .level = 0, .segmentation = drawn};
    if (fovea_size(&config, &bytes, &error) != FOVEA_OK) fail_msg("%s", error.text);
    void *memory = aligned_alloc(FOVEA_BLOCK_ALIGNMENT, (bytes + 63) / 64 * 64);
    assert_int_equal(fovea_init(memory, bytes, &config, &rt, &error), FOVEA_OK);
    for (int i = 0; i < FRAMES; i++) {
        struct fovea_outputs outputs;
        const struct fovea_frame frame =
            grey_frame(picture, WIDTH, HEIGHT, (i + 1) * 1000, (uint64_t)i);
        struct fovea_inputs inputs = {.frame = &frame, .now_ns = frame.stamp_ns};
        fovea_grants_fixed(&config, &inputs.grants);
        fovea_step(rt, &inputs, &outputs);
        fovea_work(rt, &inputs.grants, &outputs);
        for (uint32_t m = 0; m < outputs.message_count; m++) {
            fovea_preview_t preview;
            if (strcmp(outputs.messages[m].channel, "FOVEA_PREVIEW") != 0) continue;
            assert_true(fovea_preview_t_decode(outputs.messages[m].data, 0,
                                               (int)outputs.messages[m].bytes, &preview) > 0);
            assert_true(preview.width == WIDTH && preview.height == HEIGHT);
            const struct fv_decode_image into = {
                .pixels = pixels, .width = WIDTH, .height = HEIGHT, .stride_bytes = WIDTH};
            assert_int_equal(fv_decode(preview.jpeg, (size_t)preview.size_bytes, &into, &error),
                             FOVEA_OK);
            fovea_preview_t_decode_cleanup(&preview);
            previews++;
        }
    }
    assert_true(previews > 2);
    fovea_segmentation_get(rt, 0, &seen);
    assert_true(seen.inferences > 2 && seen.count > 1);
    fovea_segmentation_enlarge(&seen, NULL, places);
    static const int of_class[] = {0, 255, 128, 64, 192, 32};
    for (uint32_t i = 0; i < 256; i++) {
        brightness[i] = -1;
        if (i >= seen.count) continue;
        assert_in_range(seen.list[i].class_id, 0, sizeof of_class / sizeof *of_class - 1);
        brightness[i] = of_class[seen.list[i].class_id];
    }
    free(memory);
}

/* Two fifths of the way to its class's. */
static int laid_over(int pixel, uint8_t place)
{
    return brightness[place] < 0 ? pixel : (int)lround(.6 * pixel + .4 * brightness[place]);
}

static bool is_border(const uint8_t *places, int x, int y)
{
    const uint8_t *at = places + y * WIDTH + x;
    return (x > 0 && at[-1] != at[0]) || (y > 0 && at[-WIDTH] != at[0]);
}

static bool is_plain_block(const uint8_t *places, int x, int y)
{
    for (int i = 0; i < BLOCK * BLOCK; i++)
        if (is_border(places, x + i % BLOCK, y + i / BLOCK)) return false;
    return true;
}

static void classes_are_laid_over_previews(void **state)
{
    (void)state;
    static uint8_t plain[WIDTH * HEIGHT], drawn[WIDTH * HEIGHT], places[WIDTH * HEIGHT];
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        picture[i] = (uint8_t)(60 + (i % WIDTH / 40 * 37 + i / WIDTH / 30 * 91) % 130);
    last_preview(false, plain, places);
    last_preview(true, drawn, places);
    int borders = 0, seen = 0, blocks = 0, worst = 0;
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        if (!is_border(places, i % WIDTH, i / WIDTH)) continue;
        const int way = abs(drawn[i] - laid_over(plain[i], places[i]));
        borders++;
        seen += way > 35;
    }
    print_message("%d pixels of borders, %d seen in the preview\n", borders, seen);
    assert_true(borders > 300);
    assert_true(seen > borders * 97 / 100); /* a JPEG */
    for (int y = 0; y < HEIGHT; y += BLOCK) {
        for (int x = 0; x < WIDTH; x += BLOCK) {
            if (!is_plain_block(places, x, y)) continue;
            blocks++;
            for (int i = 0; i < BLOCK * BLOCK; i++) {
                const int at = (y + i / BLOCK) * WIDTH + x + i % BLOCK,
                          off = drawn[at] - laid_over(plain[at], places[at]);
                worst = off > worst ? off : -off > worst ? -off : worst;
            }
        }
    }
    print_message("%d blocks without borders, off by %d at most\n", blocks, worst);
    assert_true(worst <= 6); /* a JPEG of quality 95 */
    assert_true(blocks > 20);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(classes_are_laid_over_previews)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}

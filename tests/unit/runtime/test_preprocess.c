/* The preprocessing chain in the loop: each viewer sees the result or the image as it came, as
 * configured, and nobody pays for what nobody sees. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/elementary.h"
#include "fovea/fovea.h"
#include "nn/model.h"

enum { WIDTH = 320, HEIGHT = 240, MODEL_MAX = 1 << 16, FRAMES = 12, CHANNELS = 4, KEPT = 1 << 17 };

/* What of a run each viewer makes: the last message of a channel. */
static const char *const channels[CHANNELS] = {"FOVEA_FEATURES", "FOVEA_TENSORS", "FOVEA_PREVIEW",
                                               "FOVEA_EDGES"};
static const uint32_t viewers[CHANNELS] = {FOVEA_VIEWER_FEATURES, FOVEA_VIEWER_NETWORKS,
                                           FOVEA_VIEWER_PREVIEW, FOVEA_VIEWER_EDGES};

struct kept {
    uint8_t data[CHANNELS][KEPT];
    uint32_t bytes[CHANNELS];
};

static _Alignas(64) uint8_t model[MODEL_MAX];
static size_t model_bytes;
static uint8_t picture[WIDTH * HEIGHT], changed[WIDTH * HEIGHT];
static struct fovea_config config;
static struct fovea_error error;

static const enum fovea_operation operations[] = {
    FOVEA_OPERATION_DENOISE, FOVEA_OPERATION_CONTRAST_ENHANCEMENT, FOVEA_OPERATION_GAMMA};
enum { OPERATIONS = sizeof operations / sizeof operations[0] };

static void *memory_of(size_t bytes)
{
    void *memory = aligned_alloc(64, (bytes + 63) / 64 * 64);
    assert_non_null(memory);
    return memory;
}

/* The picture after the chain by itself. */
static void change(const struct fovea_preprocess_config *chain_config)
{
    struct fovea_preprocess *chain;
    const struct fovea_image image = {.data = picture,
                                      .width = WIDTH,
                                      .height = HEIGHT,
                                      .stride_bytes = WIDTH,
                                      .format = FOVEA_PIXEL_GREY8,
                                      .size_bytes = sizeof picture};
    const size_t bytes = fovea_preprocess_size(chain_config, WIDTH, HEIGHT, &error);
    assert_int_not_equal(bytes, 0);
    void *memory = memory_of(bytes);
    assert_int_equal(
        fovea_preprocess_init(&chain, chain_config, WIDTH, HEIGHT, memory, bytes, &error),
        FOVEA_OK);
    assert_int_equal(fovea_preprocess_run(chain, &image, changed, WIDTH), FOVEA_OK);
    free(memory);
}

/* The golden network without its decoder, whose outputs are messages. */
static int setup(void **state)
{
    (void)state;
    struct fv_random random;
    FILE *file = fopen("tests/golden/detector.fvm", "rb");
    if (file == NULL) return -1;
    model_bytes = fread(model, 1, MODEL_MAX - 64, file);
    fclose(file);
    struct fv_model_header *header = (struct fv_model_header *)(void *)model;
    header->decode.kind = FV_DECODER_NONE;
    header->checksum = fv_model_checksum(model + 16, model_bytes - 16);
    fv_random_seed(&random, 5);
    for (int k = 0; k < WIDTH * HEIGHT; k++)
        picture[k] = (uint8_t)(60 + ((k % WIDTH / 20 * 37 + k / WIDTH / 15 * 91) & 63) +
                               (int)fv_random_below(&random, 12));
    fovea_config_default(&config);
    config.rig.cameras[0].camera = (struct fovea_camera){
        .width = WIDTH, .height = HEIGHT, .fx = 200, .fy = 200, .cx = 160, .cy = 120};
    if (fovea_camera_prepare(&config.rig.cameras[0].camera, &error) != FOVEA_OK) return -1;
    config.detect.model = model;
    config.detect.model_bytes = model_bytes;
    config.preview.period_frames = 1;
    config.preview.quality = 100;
    config.edge_job.period_frames = 1;
    config.image.preprocess.gamma = 0.7;
    memcpy(config.image.preprocess.operations.items, operations, sizeof operations);
    config.image.preprocess.operations.count = OPERATIONS;
    change(&config.image.preprocess);
    return 0;
}

static void keep(struct kept *kept, const struct fovea_outputs *outputs)
{
    for (uint32_t i = 0; i < outputs->message_count; i++)
        for (int c = 0; c < CHANNELS; c++) {
            const struct fovea_message *message = &outputs->messages[i];
            if (strcmp(message->channel, channels[c]) != 0) continue;
            assert_in_range(message->bytes, 1, KEPT);
            memcpy(kept->data[c], message->data, message->bytes);
            kept->bytes[c] = message->bytes;
        }
}

static void one_frame(struct fovea *rt, const struct fovea_config *run, uint64_t number,
                      const struct fovea_image *image, struct kept *kept)
{
    struct fovea_outputs outputs;
    struct fovea_frame frame = {.stamp_ns = 1000000 * (int64_t)number,
                                .sequence = number,
                                .image_count = 1,
                                .images = {*image}};
    struct fovea_inputs inputs = {.frame = &frame, .now_ns = frame.stamp_ns};
    fovea_grants_fixed(run, &inputs.grants);
    assert_int_equal(fovea_step(rt, &inputs, &outputs), FOVEA_OK);
    keep(kept, &outputs);
    fovea_work(rt, &inputs.grants, &outputs);
    keep(kept, &outputs);
}

/* A run over the same image; halfway it moves to a copy of its block. */
static void run_of(const struct fovea_config *run, const struct fovea_image *image,
                   struct kept *kept)
{
    struct fovea *rt, *copy;
    size_t bytes;
    memset(kept, 0, sizeof *kept);
    assert_int_equal(fovea_size(run, &bytes, &error), FOVEA_OK);
    void *memory = memory_of(bytes), *second = memory_of(bytes);
    assert_int_equal(fovea_init(memory, bytes, run, &rt, &error), FOVEA_OK);
    for (uint64_t i = 0; i < FRAMES / 2; i++)
        one_frame(rt, run, i, image, kept);
    assert_int_equal(fovea_copy(rt, second, bytes, &copy), FOVEA_OK);
    memset(memory, 0xa5, bytes);
    free(memory);
    for (uint64_t i = FRAMES / 2; i < FRAMES; i++)
        one_frame(copy, run, i, image, kept);
    free(second);
    for (int c = 0; c < CHANNELS; c++)
        assert_int_not_equal(kept->bytes[c], 0);
}

static struct fovea_image grey_image(const uint8_t *pixels)
{
    return (struct fovea_image){.data = pixels,
                                .width = WIDTH,
                                .height = HEIGHT,
                                .stride_bytes = WIDTH,
                                .format = FOVEA_PIXEL_GREY8,
                                .size_bytes = WIDTH * HEIGHT};
}

static bool same(const struct kept *a, const struct kept *b, int channel)
{
    return a->bytes[channel] == b->bytes[channel] &&
           memcmp(a->data[channel], b->data[channel], a->bytes[channel]) == 0;
}

/* For every set of viewers, against runs without a chain on `plain` and on `after`. */
static void assert_each_sees_as_configured(const struct fovea_image *plain,
                                           const struct fovea_image *after)
{
    static struct kept kept_plain, kept_after, kept;
    struct fovea_config none = config;
    none.image.preprocess.operations.count = 0;
    run_of(&none, plain, &kept_plain);
    run_of(&none, after, &kept_after);
    for (int c = 0; c < CHANNELS; c++)
        assert_false(same(&kept_plain, &kept_after, c));
    for (uint32_t set = 0; set <= FOVEA_VIEWERS_ALL; set++) {
        struct fovea_config run = config;
        run.image.seen_by = set;
        run_of(&run, plain, &kept);
        for (int c = 0; c < CHANNELS; c++)
            if (!same(&kept, (set & viewers[c]) != 0 ? &kept_after : &kept_plain, c))
                fail_msg("seen_by %u: %s is of the other image", set, channels[c]);
    }
}

static void each_viewer_sees_the_image_as_configured(void **state)
{
    (void)state;
    const struct fovea_image plain = grey_image(picture), after = grey_image(changed);
    assert_each_sees_as_configured(&plain, &after);
}

/* A frame of colours: the chain works on its luma, and the colour differences stay. */
static void colours_keep_their_differences(void **state)
{
    (void)state;
    static uint8_t pixels[2][2 * WIDTH * HEIGHT];
    struct fovea_image images[2];
    for (int i = 0; i < 2; i++) {
        const uint8_t *luma = i == 0 ? picture : changed;
        for (int k = 0; k < WIDTH * HEIGHT; k++) {
            pixels[i][2 * k] = luma[k];
            pixels[i][2 * k + 1] = (uint8_t)(100 + k % 57);
        }
        images[i] = (struct fovea_image){.data = pixels[i],
                                         .width = WIDTH,
                                         .height = HEIGHT,
                                         .stride_bytes = 2 * WIDTH,
                                         .format = FOVEA_PIXEL_YUYV,
                                         .size_bytes = sizeof pixels[i]};
    }
    assert_each_sees_as_configured(&images[0], &images[1]);
}

/* Networks alone see balanced colours: of a flat frame those that 350 / 3 rounds to. */
static void networks_see_balanced_colours(void **state)
{
    (void)state;
    static uint8_t pixels[2][3 * WIDTH * HEIGHT];
    static struct kept kept_tinted, kept_grey, kept;
    static const uint8_t tinted[3] = {200, 100, 50};
    struct fovea_image images[2];
    for (int i = 0; i < 2; i++) {
        for (int k = 0; k < 3 * WIDTH * HEIGHT; k++)
            pixels[i][k] = i == 0 ? tinted[k % 3] : 117;
        images[i] = (struct fovea_image){.data = pixels[i],
                                         .width = WIDTH,
                                         .height = HEIGHT,
                                         .stride_bytes = 3 * WIDTH,
                                         .format = FOVEA_PIXEL_RGB24,
                                         .size_bytes = sizeof pixels[i]};
    }
    struct fovea_config run = config;
    run.image.preprocess.operations.count = 0;
    run_of(&run, &images[0], &kept_tinted);
    run_of(&run, &images[1], &kept_grey);
    run.image.preprocess.operations =
        (struct fovea_operation_list){1, {FOVEA_OPERATION_WHITE_BALANCE}};
    run.image.seen_by = FOVEA_VIEWER_NETWORKS;
    run_of(&run, &images[0], &kept);
    for (int c = 0; c < CHANNELS; c++)
        assert_true(
            same(&kept, viewers[c] == FOVEA_VIEWER_NETWORKS ? &kept_grey : &kept_tinted, c));
    assert_false(same(&kept_tinted, &kept_grey, 1));
}

static size_t size_of(uint32_t operation_count, uint32_t seen_by)
{
    struct fovea_config run = config;
    size_t bytes;
    run.image.preprocess.operations.count = operation_count;
    run.image.seen_by = seen_by;
    assert_int_equal(fovea_size(&run, &bytes, &error), FOVEA_OK);
    return bytes;
}

static void memory_is_taken_only_where_somebody_looks(void **state)
{
    (void)state;
    const size_t none = size_of(0, FOVEA_VIEWERS_ALL), nobody = size_of(OPERATIONS, 0),
                 all = size_of(OPERATIONS, FOVEA_VIEWERS_ALL & ~(uint32_t)FOVEA_VIEWER_NETWORKS),
                 features = size_of(OPERATIONS, FOVEA_VIEWER_FEATURES);
    assert_int_equal(nobody, none);
    assert_true(all > none && all < none + WIDTH * HEIGHT * 3 / 2);
    assert_true(features > all + WIDTH * HEIGHT);
}

static void a_wrong_chain_is_refused(void **state)
{
    (void)state;
    size_t bytes;
    struct fovea_config run = config;
    run.image.preprocess.operations.items[1] = FOVEA_OPERATION_COUNT;
    assert_int_equal(fovea_size(&run, &bytes, &error), FOVEA_ERROR_ARGUMENT);
    assert_non_null(strstr(error.text, "image.operations"));
    run = config;
    run.image.preprocess.operations.items[1] = FOVEA_OPERATION_WHITE_BALANCE;
    run.image.seen_by = FOVEA_VIEWERS_ALL & ~(uint32_t)FOVEA_VIEWER_NETWORKS;
    assert_int_equal(fovea_size(&run, &bytes, &error), FOVEA_ERROR_ARGUMENT);
    assert_non_null(strstr(error.text, "expected networks in image.seen_by"));
    run = config;
    run.image.preprocess.denoise_size = 4;
    assert_int_equal(fovea_size(&run, &bytes, &error), FOVEA_ERROR_ARGUMENT);
    assert_string_equal(error.text, "image.denoise_size: found 4, expected 3, 5 or 7");
    run = config;
    run.image.preprocess.normalize_low = run.image.preprocess.normalize_high = 9;
    assert_int_equal(fovea_size(&run, &bytes, &error), FOVEA_ERROR_ARGUMENT);
    assert_non_null(strstr(error.text, "image.normalize_low: found 9"));
}

static void defaults_of_the_keys_are_those_of_the_chain(void **state)
{
    (void)state;
    struct fovea_config by_keys;
    struct fovea_preprocess_config alone;
    memset(&alone, 0, sizeof alone);
    fovea_config_default(&by_keys);
    fovea_preprocess_config_default(&alone);
    assert_memory_equal(&by_keys.image.preprocess, &alone, sizeof alone);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_viewer_sees_the_image_as_configured),
        cmocka_unit_test(colours_keep_their_differences),
        cmocka_unit_test(networks_see_balanced_colours),
        cmocka_unit_test(memory_is_taken_only_where_somebody_looks),
        cmocka_unit_test(a_wrong_chain_is_refused),
        cmocka_unit_test(defaults_of_the_keys_are_those_of_the_chain),
    };
    return cmocka_run_group_tests(tests, setup, NULL);
}

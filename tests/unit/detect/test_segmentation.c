/* Networks that label pixels: classes, confidence and colours of a mask, and the mask at the size
 * of the image by its rule, computed here with whole fractions. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "detect/decode.h"
#include "detect/segmentation.h"

enum { SIDE_MAX = 150, CLASSES = 5, COLOURS = 3 };

/* A file's head with colours and labels behind it. */
static struct {
    struct fv_model_header header;
    uint8_t colours[COLOURS * 3 + 3];
    char labels[64];
} file;
static struct fv_model_tensor tensors[2];
static const int32_t inputs[1] = {0}, outputs[1] = {1};
static const struct fv_model model = {.base = (const uint8_t *)&file,
                                      .header = &file.header,
                                      .tensors = tensors,
                                      .inputs = inputs,
                                      .outputs = outputs};
static _Alignas(64) uint8_t arena[SIDE_MAX * SIDE_MAX * CLASSES];
static struct fv_detect_scratch scratch;
static struct fv_detect_mask mask;
static uint8_t pixels[SIDE_MAX * SIDE_MAX], confidence[SIDE_MAX * SIDE_MAX];
static const struct fv_detect_room room = {
    .mask = &mask, .pixels = pixels, .confidence = confidence};

/* Input of width x height, output of mask_width x mask_height x channels bytes. */
static void describe(int32_t width, int32_t height, int32_t mask_width, int32_t mask_height,
                     int32_t channels)
{
    memset(&file, 0, sizeof file);
    file.header.input_count = file.header.output_count = 1;
    file.header.file_bytes = sizeof file;
    file.header.preprocess =
        (struct fv_model_preprocess){.width = width, .height = height, .channels = 3};
    file.header.decode = (struct fv_model_decode){.kind = FV_DECODER_SEGMENT,
                                                  .classes = channels,
                                                  .score_threshold = 0.5f,
                                                  .probabilities = 1};
    tensors[0] = (struct fv_model_tensor){.rank = 4, .dims = {1, height, width, 3}};
    tensors[1] = (struct fv_model_tensor){.type = FV_TYPE_U8,
                                          .rank = 4,
                                          .dims = {1, mask_height, mask_width, channels},
                                          .scale = 1.0f / 256,
                                          .storage = 1};
}

static struct fv_nn_input_fit fit_of(int32_t width, int32_t height)
{
    const uint8_t pixel = 0;
    const struct fovea_image image = {.data = &pixel,
                                      .width = width,
                                      .height = height,
                                      .stride_bytes = width,
                                      .format = FOVEA_PIXEL_GREY8};
    struct fv_nn_input_fit fit;
    assert_int_equal(fv_nn_input_fit_of(&model, &image, &fit), FOVEA_OK);
    return fit;
}

static void see(const struct fv_nn_input_fit *fit, struct fovea_segmentation *seen)
{
    struct fovea_detection none[1];
    assert_int_equal(fv_detect_decode(&model, arena, fit, &scratch, &room, none, 1), 0);
    fv_segmentation_view(&model, fit, &mask, pixels, confidence, seen);
}

/* Byte `c` of pixel `at`, the same in every run. */
static uint8_t score_at(int32_t at, int32_t c)
{
    return (uint8_t)((uint32_t)(at * CLASSES + c + 1) * 2654435761u >> 24);
}

static void fill(int32_t count, int32_t channels)
{
    for (int32_t at = 0; at < count; at++)
        for (int32_t c = 0; c < channels; c++)
            arena[at * channels + c] = score_at(at, c);
}

static void a_pixel_has_its_best_class_with_its_confidence_and_area(void **state)
{
    (void)state;
    enum { W = 40, H = 30 };
    struct fovea_segmentation seen;
    uint32_t areas[CLASSES] = {0};
    describe(W, H, W, H, CLASSES);
    fill(W * H, CLASSES);
    arena[7] = arena[6] = arena[5] = arena[8] = arena[9] =
        77; /* pixel 1: the first of equal ones */
    const struct fv_nn_input_fit fit = fit_of(W, H);
    see(&fit, &seen);
    assert_true(seen.width == W && seen.height == H && seen.count == CLASSES);
    assert_int_equal(seen.list[seen.index[seen.pixels[1]]].class_id, 0);
    for (int32_t at = 0; at < W * H; at++) {
        int32_t best = 0;
        for (int32_t c = 1; c < CLASSES; c++)
            if (arena[at * CLASSES + c] > arena[at * CLASSES + best]) best = c;
        assert_int_equal(seen.list[seen.index[seen.pixels[at]]].class_id, best);
        assert_int_equal(seen.confidence[at], lround(arena[at * CLASSES + best] / 256.0 * 255));
        areas[best]++;
    }
    for (int c = 0; c < CLASSES; c++)
        assert_int_equal(seen.list[c].pixels, areas[seen.list[c].class_id]);
}

/* One score: the class, or none. */
static void one_score_is_a_class_from_its_threshold_on(void **state)
{
    (void)state;
    enum { W = 20, H = 20 };
    struct fovea_segmentation seen;
    describe(W, H, W, H, 1);
    fill(W * H, 1);
    const struct fv_nn_input_fit fit = fit_of(W, H);
    see(&fit, &seen);
    assert_int_equal(seen.count, 1);
    for (int32_t at = 0; at < W * H; at++) {
        const bool is_it = arena[at] >= 128;
        const double sure = is_it ? arena[at] / 256.0 : 1 - arena[at] / 256.0;
        assert_int_equal(seen.index[seen.pixels[at]], is_it ? 0 : FOVEA_SEGMENTATION_NONE);
        assert_int_equal(seen.confidence[at], (int)(sure * 255 + 0.5));
    }
}

/* Each class of a network is listed, however few pixels it has: what reads a mask, such as the
 * grid, would take one that is left out for no class at all. */
static void no_class_is_left_out(void **state)
{
    (void)state;
    enum { W = 20, H = 20, MOST = FOVEA_SEGMENTATION_CLASSES_MAX };
    struct fovea_segmentation seen;
    for (int numbers = 0; numbers < 2; numbers++) {
        describe(W, H, W, H, numbers ? 1 : MOST);
        memset(arena, 0, sizeof arena);
        if (numbers) {
            tensors[1].scale = 1;
            file.header.decode.classes = 0;
        }
        for (int32_t at = 0; at < W * H; at++) { /* the last ones only once */
            const int32_t class_id = at < MOST ? at : at % 99;
            arena[numbers ? at : at * MOST + class_id] = numbers ? (uint8_t)class_id : 200;
        }
        const struct fv_nn_input_fit fit = fit_of(W, H);
        see(&fit, &seen);
        assert_int_equal(seen.count, MOST);
        for (int c = 0; c < MOST; c++)
            assert_int_equal(seen.list[c].class_id, c);
        assert_int_equal(seen.list[MOST - 1].pixels, 1);
        for (int32_t at = 0; at < W * H; at++)
            assert_int_equal(seen.list[seen.index[seen.pixels[at]]].class_id,
                             at < MOST ? at : at % 99);
    }
}

/* A mask of more than a unit, beside a picture that is narrower than the input: what lies left and
 * right of it has no class, in the rows too in which a unit ends. */
static void what_is_beside_the_picture_has_no_class(void **state)
{
    (void)state;
    enum { W = 150, H = 130 };
    struct fovea_segmentation seen;
    describe(W, H, W, H, 1);
    file.header.preprocess.fit = FV_FIT_LETTERBOX;
    memset(arena, 200, W * H);
    const struct fv_nn_input_fit fit = fit_of(H / 2, H);
    assert_true(fit.left > 20 && fit.width < W - 40);
    see(&fit, &seen);
    for (int32_t at = 0; at < W * H; at++) {
        const int32_t x = at % W;
        assert_int_equal(seen.pixels[at], seen.pixels[x]); /* each row as the first */
        if (x < fit.left - 1 || x > fit.left + fit.width)
            assert_int_equal(seen.pixels[at], FOVEA_SEGMENTATION_NONE);
        if (x > fit.left && x < fit.left + fit.width - 1) assert_int_equal(seen.pixels[at], 0);
    }
}

static void expect_colour(int32_t class_id, int32_t object, uint32_t rgb)
{
    uint8_t found[3];
    fv_segmentation_colour(&model, class_id, object, found);
    assert_int_equal(found[0] << 16 | found[1] << 8 | found[2], rgb);
}

/* VOC's palette begins: black, 800000, 008000, 808000, 000080... */
static void colours_are_the_files_or_vocs(void **state)
{
    (void)state;
    describe(20, 20, 20, 20, CLASSES);
    expect_colour(0, -1, 0x000000);
    expect_colour(1, -1, 0x800000);
    expect_colour(15, -1, 0xc08080);
    expect_colour(1, 3, 0x000080); /* of an object: that of its number, from 1 on */
    file.header.labels = (uint32_t)offsetof(__typeof__(file), labels);
    file.header.label_count = 2;
    memcpy(file.labels, "floor\0wall", 11);
    expect_colour(0, -1, 0x800000); /* no background: nothing is black */
    expect_colour(1, -1, 0x008000);
    memcpy(file.labels, "background\0wall", 16);
    expect_colour(0, -1, 0x000000);
    file.header.decode.colours = (int32_t)offsetof(__typeof__(file), colours);
    file.header.decode.colour_count = COLOURS;
    memcpy(file.colours, "\x01\x02\x03\x10\x20\x30\xff\xfe\xfd", 9);
    expect_colour(0, -1, 0x010203);
    expect_colour(2, -1, 0xfffefd);
    expect_colour(3, -1, 0x808000); /* the file has no fourth one */
    expect_colour(1, 0, 0x800000);
}

/* Whether the centre of the mask's pixel k, (k + 1/2) input / size, is in [first, first + part). */
static bool shows(int32_t k, int32_t first, int32_t part, int32_t size, int32_t input)
{
    const int64_t centre = (int64_t)(2 * k + 1) * input;
    return centre >= (int64_t)2 * first * size && centre < (int64_t)2 * (first + part) * size;
}

/* The pixel of the mask that pixel x of the image takes its class from: the nearest one by their
 * centres, of two as near the later one, of those whose centre is in the image. All in whole
 * fractions of the input; -1: no centre is in it. */
static int32_t holder(int32_t x, int32_t first, int32_t part, int32_t image, int32_t size,
                      int32_t input)
{
    /* first + (2 x + 1) part / (2 image) and (2 k + 1) input / (2 size), times 2 image size */
    const int64_t at = ((int64_t)first * 2 * image + (int64_t)(2 * x + 1) * part) * size;
    int64_t least = INT64_MAX;
    int32_t best = -1;
    for (int32_t k = 0; k < size; k++) {
        const int64_t away = (int64_t)(2 * k + 1) * input * image - at,
                      distance = away < 0 ? -away : away;
        if (!shows(k, first, part, size, input) || distance > least) continue;
        least = distance;
        best = k;
    }
    return best;
}

/* What shows the image has a class, nothing else has one, and areas are shares of it. */
static void expect_part(const struct fovea_segmentation *seen, const struct fv_nn_input_fit *fit,
                        int32_t width, int32_t height)
{
    int32_t there = 0;
    uint32_t sum = 0;
    for (int32_t at = 0; at < seen->width * seen->height; at++) {
        const bool is_shown = shows(at % seen->width, fit->left, fit->width, seen->width, width) &&
                              shows(at / seen->width, fit->top, fit->height, seen->height, height);
        assert_int_equal(is_shown, seen->index[seen->pixels[at]] != FOVEA_SEGMENTATION_NONE);
        there += is_shown;
    }
    for (uint32_t i = 0; i < seen->count; i++)
        sum += seen->list[i].pixels;
    assert_int_equal(there, seen->part.width * seen->part.height);
    assert_int_equal(there, sum);
}

static void expect_rule(int32_t width, int32_t height, int32_t mask_width, int32_t mask_height,
                        int32_t letterbox, int32_t image_width, int32_t image_height)
{
    struct fovea_segmentation seen;
    describe(width, height, mask_width, mask_height, CLASSES);
    file.header.preprocess.fit = letterbox;
    fill(mask_width * mask_height, CLASSES);
    const struct fv_nn_input_fit fit = fit_of(image_width, image_height);
    see(&fit, &seen);
    expect_part(&seen, &fit, width, height);
    uint8_t *large = malloc((size_t)image_width * (size_t)image_height), values[256];
    for (int i = 0; i < 256; i++)
        values[i] = (uint8_t)(i ^ 0x55);
    for (int with = 0; with < 2; with++) {
        fovea_segmentation_enlarge(&seen, with ? values : NULL, large);
        for (int32_t y = 0; y < image_height; y++) {
            const int32_t row = holder(y, fit.top, fit.height, image_height, mask_height, height);
            for (int32_t x = 0; x < image_width; x++) {
                const int32_t column =
                    holder(x, fit.left, fit.width, image_width, mask_width, width);
                const uint8_t place = seen.index[seen.pixels[row * mask_width + column]];
                assert_int_not_equal(place, FOVEA_SEGMENTATION_NONE);
                assert_int_equal(large[y * image_width + x], with ? values[place] : place);
            }
        }
    }
    free(large);
}

static void the_mask_at_the_size_of_the_image_follows_its_rule(void **state)
{
    (void)state;
    expect_rule(33, 33, 33, 33, FV_FIT_STRETCH, 80, 71);
    expect_rule(64, 48, 16, 12, FV_FIT_STRETCH, 64, 48);
    expect_rule(64, 48, 64, 48, FV_FIT_STRETCH, 20, 17);
    expect_rule(64, 64, 16, 16, FV_FIT_LETTERBOX, 101, 67);
    expect_rule(64, 64, 63, 64, FV_FIT_LETTERBOX, 40, 99);
    expect_rule(16, 16, 64, 64, FV_FIT_LETTERBOX, 33, 32);
    expect_rule(160, 120, 40, 30, FV_FIT_LETTERBOX, 310, 94);
    expect_rule(160, 120, 20, 15, FV_FIT_LETTERBOX, 94, 310);
}

/* So narrow that no pixel of the mask has its centre in it: those around its centre show it. */
static void a_strip_of_a_picture_has_classes_too(void **state)
{
    (void)state;
    enum { SIDE = 8, LONG = 200 };
    struct fovea_segmentation seen;
    uint8_t large[LONG];
    describe(64, 64, SIDE, SIDE, CLASSES);
    file.header.preprocess.fit = FV_FIT_LETTERBOX;
    fill(SIDE * SIDE, CLASSES);
    for (int upright = 0; upright < 2; upright++) {
        const struct fv_nn_input_fit fit = fit_of(upright ? 1 : LONG, upright ? LONG : 1);
        see(&fit, &seen);
        assert_true(seen.part.width == (upright ? 1 : SIDE) &&
                    seen.part.height == (upright ? SIDE : 1));
        assert_true((upright ? seen.part.left : seen.part.top) == 3); /* 31 of 64, 8 each */
        fovea_segmentation_enlarge(&seen, NULL, large);
        for (int i = 0; i < LONG; i++) {
            const int along = i * SIDE / LONG, at = upright ? along * SIDE + 3 : 3 * SIDE + along;
            assert_int_equal(large[i], seen.index[seen.pixels[at]]);
            assert_int_not_equal(large[i], FOVEA_SEGMENTATION_NONE);
        }
    }
}

/* Rows of a picture: a bright class, a dark class beside it, and pixels that have none. */
static void what_has_no_class_keeps_its_pixels(void **state)
{
    (void)state;
    enum { WIDTH = 6 };
    static const uint8_t values[WIDTH] = {0, 0, 1, 1, 2, 2};
    static const struct fovea_segmentation_class list[2] = {{.class_id = 1, .object = -1},
                                                            {.class_id = 0, .object = -1}};
    static uint8_t index[256] = {0, 1, FOVEA_SEGMENTATION_NONE};
    const struct fovea_segmentation seen = {
        .width = WIDTH,
        .height = 1,
        .fit = {.width = WIDTH, .height = 1, .input_width = WIDTH, .input_height = 1},
        .part = {0, 0, WIDTH, 1},
        .count = 2,
        .list = list,
        .pixels = values,
        .index = index};
    uint8_t picture[WIDTH] = {100, 100, 100, 100, 100, 100};
    fv_segmentation_overlay(&seen, picture, WIDTH, 1, 0, 1);
    const uint8_t expected[WIDTH] = {161, 161, 255, 60, 255, 100}; /* borders are white */
    assert_memory_equal(picture, expected, WIDTH);
}

/* As the segmenter that comes with Fovea has them: in colours of which three are equally bright.
 * Each is as bright in one mask as in the next, whichever classes that has, in any order. */
static void classes_are_told_apart_in_grey(void **state)
{
    (void)state;
    enum { WIDTH = 2 * CLASSES };
    static const uint8_t colours[CLASSES][3] = {
        {128, 0, 0}, {0, 128, 0}, {128, 128, 0}, {0, 0, 128}, {128, 0, 128}};
    uint8_t seen_as[2][CLASSES];
    for (int turned = 0; turned < 2; turned++) {
        struct fovea_segmentation_class list[CLASSES];
        uint8_t values[WIDTH], index[256], picture[WIDTH];
        memset(index, FOVEA_SEGMENTATION_NONE, sizeof index);
        memset(picture, 100, sizeof picture);
        for (int c = 0; c < CLASSES; c++) {
            const int place = turned ? CLASSES - 1 - c : c;
            values[2 * c] = values[2 * c + 1] = (uint8_t)c;
            index[c] = (uint8_t)place;
            list[place] = (struct fovea_segmentation_class){.class_id = c,
                                                            .object = -1,
                                                            .red = colours[c][0],
                                                            .green = colours[c][1],
                                                            .blue = colours[c][2]};
        }
        const struct fovea_segmentation seen = {
            .width = WIDTH,
            .height = 1,
            .fit = {.width = WIDTH, .height = 1, .input_width = WIDTH, .input_height = 1},
            .part = {0, 0, WIDTH, 1},
            .count = CLASSES,
            .list = list,
            .pixels = values,
            .index = index};
        fv_segmentation_overlay(&seen, picture, WIDTH, 1, 0, 1);
        for (int c = 0; c < CLASSES; c++)
            seen_as[turned][c] = picture[2 * c + 1]; /* beside the border */
    }
    assert_memory_equal(seen_as[0], seen_as[1], CLASSES);
    for (int a = 0; a < CLASSES; a++)
        for (int b = 0; b < a; b++)
            assert_true(abs(seen_as[0][a] - seen_as[0][b]) >= 25);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_pixel_has_its_best_class_with_its_confidence_and_area),
        cmocka_unit_test(one_score_is_a_class_from_its_threshold_on),
        cmocka_unit_test(no_class_is_left_out),
        cmocka_unit_test(what_is_beside_the_picture_has_no_class),
        cmocka_unit_test(colours_are_the_files_or_vocs),
        cmocka_unit_test(the_mask_at_the_size_of_the_image_follows_its_rule),
        cmocka_unit_test(a_strip_of_a_picture_has_classes_too),
        cmocka_unit_test(what_has_no_class_keeps_its_pixels),
        cmocka_unit_test(classes_are_told_apart_in_grey),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

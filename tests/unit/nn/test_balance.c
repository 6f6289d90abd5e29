/* White balance of what a network sees: in every format that frames may have it is that of
 * fovea_white_balance on the same pixels, however the job is sliced; of a large picture a grid is
 * enough; and no colour, no change. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdlib.h>
#include <string.h>

#include "app/config/model_file.h"
#include "base/elementary.h"
#include "common/carved.h"
#include "fovea/preprocess.h"
#include "nn/job.h"
#include "nn/pixel.h"

/* Of the network's input, so that nothing is interpolated. */
enum { WIDTH = 64, HEIGHT = 64, INPUT_BYTES = 3 * WIDTH * HEIGHT };
enum { LARGE_WIDTH = 642, LARGE_HEIGHT = 490, LARGE_BYTES = 3 * LARGE_WIDTH * LARGE_HEIGHT };

static struct fv_model_file file;
/* The golden network with an input of this size; it is never run. */
static struct fv_model model;
static struct fv_model_header header;
static struct fv_model_tensor input_tensor;
static const int32_t input_number = 0;
static struct fv_kernels kernels;
static uint8_t pixels[INPUT_BYTES], rgb[INPUT_BYTES], balanced[INPUT_BYTES], large[LARGE_BYTES];

static int set_up(void **state)
{
    struct fovea_error error;
    (void)state;
    fv_kernels_init(&kernels, FV_CPU_C);
    if (fv_model_file_read("tests/golden/detector.fvm", &file, &error) != FOVEA_OK) return -1;
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    fv_model_file_free(&file);
    return 0;
}

static int with_model(void **state)
{
    (void)state;
    model = file.model;
    header = *model.header;
    input_tensor = model.tensors[model.inputs[0]];
    header.preprocess.width = input_tensor.dims[2] = WIDTH;
    header.preprocess.height = input_tensor.dims[1] = HEIGHT;
    model.header = &header;
    model.tensors = &input_tensor;
    model.inputs = &input_number;
    return header.preprocess.channels == 3 &&
                   (size_t)input_tensor.offset + INPUT_BYTES <= fv_nn_arena_bytes(&model)
               ? 0
               : -1;
}

static struct fovea_image image_of(const uint8_t *data, enum fovea_pixel_format format,
                                   int32_t width, int32_t height)
{
    const int32_t stride = fovea_image_stride_min(format, width);
    return (struct fovea_image){.data = data,
                                .width = width,
                                .height = height,
                                .stride_bytes = stride,
                                .format = format,
                                .size_bytes = fovea_image_bytes(format, height, stride)};
}

struct own {
    struct fv_nn_job job;
    struct fv_nn_job_state state;
};

static void carve(void *own, struct fv_arena *arena)
{
    struct own *o = own;
    fv_nn_job_carve(&o->job, &model, &o->state, LARGE_BYTES, arena);
}

/* What the network gets of an image, in slices of `units`, of which so many or one make its input;
 * returns the units that it took. */
static uint32_t input_of(const struct fovea_image *image, bool balance, uint32_t units,
                         uint8_t input[INPUT_BYTES])
{
    struct own own = {.state = {.phase = FV_NN_JOB_IDLE}};
    void *block = carved(carve, &own);
    uint32_t done, all = 0;
    assert_int_equal(fv_nn_job_start(&own.job, image), FOVEA_OK);
    if (balance) fv_nn_job_balance(&own.job);
    while (own.state.phase != FV_NN_JOB_RUN) {
        assert_int_equal(fv_nn_job_advance(&own.job, &kernels, units, &done), FOVEA_AGAIN);
        all += done;
    }
    memcpy(input, fv_nn_tensor(&model, fv_nn_job_arena(&own.job), model.inputs[0]), INPUT_BYTES);
    free(block);
    return all;
}

static bool is_words(enum fovea_pixel_format format)
{
    return format == FOVEA_PIXEL_Y10 || format == FOVEA_PIXEL_Y12 || format == FOVEA_PIXEL_Y14 ||
           format == FOVEA_PIXEL_Y16;
}

/* Random pixels with a tint, and what they are in red, green and blue. */
static void tint(enum fovea_pixel_format format)
{
    struct fv_random random;
    const struct fovea_image image = image_of(pixels, format, WIDTH, HEIGHT);
    fv_random_seed(&random, 3 + (uint64_t)format);
    for (int k = 0; k < INPUT_BYTES; k++)
        pixels[k] = (uint8_t)(fv_random_below(&random, 120) + (k % 3 == 0 ? 90 : 10));
    if (is_words(format))
        for (int k = 1; k < INPUT_BYTES; k += 2)
            pixels[k] &= 3; /* significant in all of them */
    for (int k = 0; k < WIDTH * HEIGHT; k++)
        fv_pixel_fetch(&image, k % WIDTH, k / WIDTH, false, &rgb[3 * k]);
}

static void equal_to_the_balance_of_the_pixels(void)
{
    static uint8_t expected[INPUT_BYTES], found[INPUT_BYTES], plain[INPUT_BYTES];
    const struct fovea_image colours = image_of(rgb, FOVEA_PIXEL_RGB24, WIDTH, HEIGHT),
                             after = image_of(balanced, FOVEA_PIXEL_RGB24, WIDTH, HEIGHT);
    for (int f = 0; f < FOVEA_PIXEL_FORMAT_COUNT; f++) {
        const enum fovea_pixel_format format = (enum fovea_pixel_format)f;
        if (!fv_pixel_known(format)) continue;
        const struct fovea_image image = image_of(pixels, format, WIDTH, HEIGHT);
        tint(format);
        assert_int_equal(fovea_white_balance(&colours, balanced, 3 * WIDTH), FOVEA_OK);
        (void)input_of(&after, false, 1, expected);
        (void)input_of(&image, false, 1, plain);
        const uint32_t all = input_of(&image, true, 1, found);
        assert_memory_equal(found, expected, INPUT_BYTES);
        assert_int_equal(input_of(&image, true, all, found), all);
        assert_memory_equal(found, expected, INPUT_BYTES);
        const bool grey = format == FOVEA_PIXEL_GREY8 || is_words(format);
        assert_int_equal(memcmp(found, plain, INPUT_BYTES) == 0, grey);
    }
}

static void every_format_is_balanced_as_its_pixels_are(void **state)
{
    (void)state;
    equal_to_the_balance_of_the_pixels();
    header.preprocess.order = 1 - header.preprocess.order;
    equal_to_the_balance_of_the_pixels();
}

static void a_large_picture_is_balanced_by_a_grid_within_two_units(void **state)
{
    (void)state;
    static uint8_t input[INPUT_BYTES];
    struct fv_nn_balance balance = {.sums = {0}}, parts = {.sums = {0}};
    struct fv_random random;
    double sums[3] = {0};
    const struct fovea_image image = image_of(large, FOVEA_PIXEL_RGB24, LARGE_WIDTH, LARGE_HEIGHT);
    fv_random_seed(&random, 8);
    for (int k = 0; k < LARGE_BYTES; k++) {
        large[k] = (uint8_t)(fv_random_below(&random, 80) + (uint32_t)(k % 3 * 40) +
                             (uint32_t)(k / 3 % LARGE_WIDTH / 16));
        sums[k % 3] += large[k];
    }
    const int32_t rows = fv_nn_balance_rows(&image);
    assert_int_equal(rows, FV_NN_BALANCE_ROWS);
    fv_nn_balance_add(&balance, &image, 0, rows);
    fv_nn_balance_add(&parts, &image, 0, 7);
    fv_nn_balance_add(&parts, &image, 7, rows);
    assert_memory_equal(&parts, &balance, sizeof parts);
    for (int c = 0; c < 3; c++) {
        const double mean = balance.sums[c] / (double)(FV_NN_BALANCE_COLUMNS * rows),
                     exact = sums[c] / (LARGE_WIDTH * LARGE_HEIGHT);
        assert_true(mean > exact - .5 && mean < exact + .5);
    }
    assert_int_equal(input_of(&image, true, 1, input), input_of(&image, false, 1, input) + 2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(every_format_is_balanced_as_its_pixels_are, with_model),
        cmocka_unit_test_setup(a_large_picture_is_balanced_by_a_grid_within_two_units, with_model),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}

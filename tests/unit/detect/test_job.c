/* The detection job: the same boxes however it is sliced, with the stamp of the image that was
 * looked at. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/carved.h"
#include "detect/job.h"

enum { WIDTH = 160, HEIGHT = 90 };

static uint8_t *file;
static struct fv_model model;
static uint8_t pixels[WIDTH * HEIGHT];

static int set_up(void **state)
{
    (void)state;
    FILE *in = fopen("tests/golden/detector.fvm", "rb");
    if (in == NULL) return -1;
    fseek(in, 0, SEEK_END);
    const size_t bytes = (size_t)ftell(in);
    rewind(in);
    file = aligned_alloc(64, (bytes + 63) / 64 * 64);
    const int good = file != NULL && fread(file, 1, bytes, in) == bytes;
    fclose(in);
    struct fovea_error error;
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        pixels[i] = (uint8_t)((i % WIDTH / 20 * 37 + i / WIDTH / 15 * 91) ^ (i * 7 & 15));
    return good && fv_model_open(file, bytes, "detector", &model, &error) == FOVEA_OK ? 0 : -1;
}

static int tear_down(void **state)
{
    (void)state;
    free(file);
    return 0;
}

static void carve(void *memory, struct fv_arena *arena)
{
    fv_detect_carve(memory, arena, &model, NULL, sizeof pixels);
}

static const struct fovea_image image = {.data = pixels,
                                         .width = WIDTH,
                                         .height = HEIGHT,
                                         .stride_bytes = WIDTH,
                                         .format = FOVEA_PIXEL_GREY8,
                                         .size_bytes = sizeof pixels};

static void slices_give_the_same(void **state)
{
    (void)state;
    struct fv_kernels kernels;
    struct fv_detect_memory whole, sliced;
    void *a = carved(carve, &whole), *b = carved(carve, &sliced);
    uint32_t done;
    fv_kernels_init(&kernels, FV_CPU_C);
    assert_int_equal(fv_detect_start(&whole, &image, 77, 5), FOVEA_OK);
    assert_int_equal(fv_detect_start(&whole, &image, 78, 6), FOVEA_AGAIN);
    assert_int_equal(fv_detect_advance(&whole, &kernels, UINT32_MAX, &done), FOVEA_OK);
    const uint32_t units = done;
    assert_int_equal(fv_detect_start(&sliced, &image, 77, 5), FOVEA_OK);
    uint32_t steps = 0;
    while (fv_detect_advance(&sliced, &kernels, 1, &done) == FOVEA_AGAIN) {
        assert_int_equal(done, 1);
        assert_int_equal(sliced.job->found_sequence, 0);
        ++steps;
    }
    assert_int_equal(steps + 1, units);
    assert_in_range(whole.job->count, 1, 100);
    assert_int_equal(whole.job->count, sliced.job->count);
    assert_memory_equal(whole.job->found, sliced.job->found, sizeof whole.job->found);
    assert_int_equal(sliced.job->found_sequence, 5);
    assert_int_equal(sliced.job->found_stamp_ns, 77);
    for (int32_t i = 0; i < whole.job->count; i++) {
        const struct fovea_detection *d = &whole.job->found[i];
        assert_true(d->x_min_px >= -0.5f && d->x_max_px <= WIDTH - 0.5f &&
                    d->x_min_px < d->x_max_px);
        assert_true(d->y_min_px >= -0.5f && d->y_max_px <= HEIGHT - 0.5f &&
                    d->y_min_px < d->y_max_px);
        assert_true(i == 0 || d->score <= whole.job->found[i - 1].score);
    }
    free(a);
    free(b);
}

static void what_does_not_fit_is_refused(void **state)
{
    (void)state;
    struct fv_detect_memory memory;
    void *block = carved(carve, &memory);
    struct fovea_image wrong = image;
    wrong.format = FOVEA_PIXEL_YUYV;
    assert_int_equal(fv_detect_start(&memory, &wrong, 1, 1), FOVEA_ERROR_UNSUPPORTED);
    wrong = image;
    wrong.height = HEIGHT * 2;
    assert_int_equal(fv_detect_start(&memory, &wrong, 1, 1), FOVEA_ERROR_UNSUPPORTED);
    free(block);
}

/* A letterboxed fit maps the input back to the image. */
static void letterbox_keeps_the_shape(void **state)
{
    (void)state;
    struct fv_nn_input_fit fit;
    struct fv_model_header header = *model.header;
    struct fv_model boxed = model;
    header.preprocess.fit = FV_FIT_LETTERBOX;
    boxed.header = &header;
    assert_int_equal(fv_nn_input_fit_of(&boxed, &image, &fit), FOVEA_OK);
    assert_int_equal(fit.width, 64);
    assert_int_equal(fit.height, 36);
    assert_int_equal(fit.left, 0);
    assert_int_equal(fit.top, 6);
    assert_true(fit.scale_x == fit.scale_y);
}

/* Grey frames of the network's own size take a short way; the long one, which other formats take,
 * gives the same. */
static void grey_of_the_right_size_is_filled_alike(void **state)
{
    (void)state;
    enum { IN_WIDTH = 64, IN_HEIGHT = 48, SHOWN = 30 };
    static uint8_t grey[SHOWN][IN_WIDTH + 5], colour[SHOWN][IN_WIDTH][3];
    struct fv_model_header header = *model.header;
    struct fv_model boxed = model;
    struct fv_model_tensor tensor = model.tensors[model.inputs[0]];
    const int32_t first = 0;
    header.preprocess.fit = FV_FIT_LETTERBOX;
    header.preprocess.channels = 1;
    header.preprocess.width = tensor.dims[2] = IN_WIDTH;
    header.preprocess.height = tensor.dims[1] = IN_HEIGHT;
    tensor.dims[3] = 1;
    boxed.header = &header;
    boxed.tensors = &tensor;
    boxed.inputs = &first;
    for (int y = 0; y < SHOWN; y++) {
        for (int x = 0; x < IN_WIDTH; x++)
            memset(colour[y][x], grey[y][x] = (uint8_t)(37 * y + 11 * x + x * y), 3);
    }
    const struct fovea_image images[2] = {
        {&grey[0][0], IN_WIDTH, SHOWN, IN_WIDTH + 5, FOVEA_PIXEL_GREY8, sizeof grey},
        {&colour[0][0][0], IN_WIDTH, SHOWN, 3 * IN_WIDTH, FOVEA_PIXEL_RGB24, sizeof colour}};
    uint8_t *filled[2];
    const size_t bytes = fv_nn_arena_bytes(&model);
    for (int i = 0; i < 2; i++) {
        struct fv_nn_input_fit fit;
        filled[i] = calloc(1, bytes);
        assert_int_equal(fv_nn_input_fit_of(&boxed, &images[i], &fit), FOVEA_OK);
        assert_int_equal(fit.top, (IN_HEIGHT - SHOWN) / 2);
        fv_nn_fill(&boxed, &images[i], &fit, NULL, filled[i], 0, 7);
        fv_nn_fill(&boxed, &images[i], &fit, NULL, filled[i], 7, IN_HEIGHT);
    }
    assert_memory_equal(filled[0], filled[1], bytes);
    for (int i = 0; i < 2; i++)
        free(filled[i]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(slices_give_the_same),
        cmocka_unit_test(what_does_not_fit_is_refused),
        cmocka_unit_test(letterbox_keeps_the_shape),
        cmocka_unit_test(grey_of_the_right_size_is_filled_alike),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}

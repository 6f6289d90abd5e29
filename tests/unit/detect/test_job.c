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

/* The input of a network that takes one channel, of `width` x `height`. */
struct grey_network {
    struct fv_model model;
    struct fv_model_header header;
    struct fv_model_tensor tensor;
    int32_t first;
};

static void make_grey_network(struct grey_network *n, int32_t width, int32_t height, int32_t fit)
{
    n->model = model;
    n->header = *model.header;
    n->tensor = model.tensors[model.inputs[0]];
    n->first = 0;
    n->header.preprocess.fit = fit;
    n->header.preprocess.channels = 1;
    n->header.preprocess.width = n->tensor.dims[2] = width;
    n->header.preprocess.height = n->tensor.dims[1] = height;
    n->tensor.dims[3] = 1;
    n->model.header = &n->header;
    n->model.tensors = &n->tensor;
    n->model.inputs = &n->first;
}

/* What it is filled with, in two parts; from malloc. */
static uint8_t *filled(const struct grey_network *n, const struct fovea_image *seen, size_t bytes)
{
    struct fv_nn_input_fit fit;
    uint8_t *arena = calloc(1, bytes);
    assert_non_null(arena);
    assert_int_equal(fv_nn_input_fit_of(&n->model, seen, &fit), FOVEA_OK);
    fv_nn_fill(&n->model, seen, &fit, NULL, arena, 0, 7);
    fv_nn_fill(&n->model, seen, &fit, NULL, arena, 7, n->header.preprocess.height);
    return arena;
}

/* Grey frames take shorter ways, one of them at the network's own size; the long one, which colours
 * take, gives the same. */
static void grey_is_filled_as_colours_are(void **state)
{
    enum { MOST = 200, PAD = 5 };
    static const int32_t sizes[][4] = {/* of the image, of the input */
                                       {64, 30, 64, 48},    {97, 41, 64, 48}, {31, 77, 150, 50},
                                       {200, 199, 150, 50}, {1, 1, 9, 8},     {150, 50, 150, 50}};
    static uint8_t grey[MOST * (MOST + PAD)], colour[MOST * MOST * 3];
    const size_t bytes = fv_nn_arena_bytes(&model) + (size_t)MOST * MOST;
    (void)state;
    for (size_t k = 0; k < 2 * (sizeof sizes / sizeof sizes[0]); k++) {
        const int32_t *size = sizes[k / 2], w = size[0], h = size[1];
        struct grey_network network;
        make_grey_network(&network, size[2], size[3], k % 2 ? FV_FIT_LETTERBOX : FV_FIT_STRETCH);
        for (int32_t y = 0; y < h; y++)
            for (int32_t x = 0; x < w; x++)
                memset(colour + (y * w + x) * 3,
                       grey[y * (w + PAD) + x] = (uint8_t)(37 * y + 11 * x + x * y), 3);
        const struct fovea_image images[2] = {
            {grey, w, h, w + PAD, FOVEA_PIXEL_GREY8, sizeof grey},
            {colour, w, h, 3 * w, FOVEA_PIXEL_RGB24, sizeof colour}};
        uint8_t *short_way = filled(&network, &images[0], bytes),
                *long_way = filled(&network, &images[1], bytes);
        assert_memory_equal(short_way, long_way, bytes);
        free(short_way);
        free(long_way);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(slices_give_the_same),
        cmocka_unit_test(what_does_not_fit_is_refused),
        cmocka_unit_test(letterbox_keeps_the_shape),
        cmocka_unit_test(grey_is_filled_as_colours_are),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}

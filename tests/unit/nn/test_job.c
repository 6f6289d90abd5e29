/* A network's job: the same outputs however it is sliced; two jobs under way at once, of different
 * models, change nothing for each other; what is under way can be given up. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdlib.h>
#include <string.h>

#include "app/config/model_file.h"
#include "common/carved.h"
#include "nn/job.h"

enum { WIDTH = 160, HEIGHT = 90, MODELS = 2, OUTPUT_BYTES_MAX = 1 << 20 };

static struct fv_model_file files[MODELS];
static struct fv_kernels kernels;
static uint8_t pixels[WIDTH * HEIGHT];
static const struct fovea_image picture = {.data = pixels,
                                           .width = WIDTH,
                                           .height = HEIGHT,
                                           .stride_bytes = WIDTH,
                                           .format = FOVEA_PIXEL_GREY8,
                                           .size_bytes = sizeof pixels};

static int set_up(void **state)
{
    (void)state;
    static const char *const paths[MODELS] = {"tests/golden/detector.fvm",
                                              "src/detect/shipped.fvm"};
    struct fovea_error error;
    fv_kernels_init(&kernels, FV_CPU_C);
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        pixels[i] = (uint8_t)((i % WIDTH / 20 * 37 + i / WIDTH / 15 * 91) ^ (i * 7 & 15));
    for (int i = 0; i < MODELS; i++)
        if (fv_model_file_read(paths[i], &files[i], &error) != FOVEA_OK) return -1;
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    for (int i = 0; i < MODELS; i++)
        fv_model_file_free(&files[i]);
    return 0;
}

/* A job with memory of its own. */
struct own {
    struct fv_nn_job job;
    struct fv_nn_job_state state;
    const struct fv_model *model;
    void *block;
};

static void carve(void *own, struct fv_arena *arena)
{
    struct own *o = own;
    fv_nn_job_carve(&o->job, o->model, &o->state, sizeof pixels, arena);
}

static void open_job(struct own *own, int model)
{
    *own = (struct own){.model = &files[model].model};
    own->block = carved(carve, own);
    assert_true(fv_nn_job_idle(&own->job));
}

/* All bytes of the first output. */
static size_t output_of(const struct own *own, uint8_t *bytes)
{
    const struct fv_model_tensor *t = &own->model->tensors[own->model->outputs[0]];
    size_t count = t->type == FV_TYPE_U8 ? 1 : 4;
    for (int32_t d = 0; d < t->rank; d++)
        count *= (size_t)t->dims[d];
    assert_in_range(count, 16, OUTPUT_BYTES_MAX);
    memcpy(bytes, fv_nn_tensor(own->model, own->job.arena, own->model->outputs[0]), count);
    return count;
}

static uint8_t alone[MODELS][OUTPUT_BYTES_MAX], beside[OUTPUT_BYTES_MAX];

static uint32_t run_alone(int model)
{
    struct own own;
    uint32_t units;
    open_job(&own, model);
    assert_int_equal(fv_nn_job_start(&own.job, &picture), FOVEA_OK);
    assert_int_equal(fv_nn_job_start(&own.job, &picture), FOVEA_AGAIN);
    assert_int_equal(fv_nn_job_advance(&own.job, &kernels, UINT32_MAX, &units), FOVEA_OK);
    assert_true(fv_nn_job_done(&own.job));
    assert_int_equal(fv_nn_job_start(&own.job, &picture), FOVEA_AGAIN); /* outputs still wanted */
    output_of(&own, alone[model]);
    fv_nn_job_end(&own.job);
    assert_true(fv_nn_job_idle(&own.job));
    free(own.block);
    return units;
}

static void two_models_in_turns_give_what_each_gives_alone(void **state)
{
    (void)state;
    struct own own[MODELS];
    uint32_t units[MODELS] = {0}, expected[MODELS];
    for (int i = 0; i < MODELS; i++) {
        expected[i] = run_alone(i);
        open_job(&own[i], i);
        assert_int_equal(fv_nn_job_start(&own[i].job, &picture), FOVEA_OK);
    }
    for (bool left = true; left;) {
        left = false;
        for (int i = 0; i < MODELS; i++) {
            uint32_t done;
            left |= fv_nn_job_advance(&own[i].job, &kernels, 1, &done) == FOVEA_AGAIN;
            units[i] += done;
        }
    }
    for (int i = 0; i < MODELS; i++) {
        assert_int_equal(units[i], expected[i]);
        assert_memory_equal(beside, alone[i], output_of(&own[i], beside));
        free(own[i].block);
    }
}

static void a_picture_that_is_given_up_leaves_no_trace(void **state)
{
    (void)state;
    struct own own;
    uint32_t done;
    (void)run_alone(0);
    open_job(&own, 0);
    assert_int_equal(fv_nn_job_start(&own.job, &picture), FOVEA_OK);
    assert_int_equal(fv_nn_job_advance(&own.job, &kernels, 3, &done), FOVEA_AGAIN);
    assert_int_equal(done, 3);
    fv_nn_job_end(&own.job);
    assert_int_equal(fv_nn_job_advance(&own.job, &kernels, 3, &done), FOVEA_OK);
    assert_int_equal(done, 0);
    assert_int_equal(fv_nn_job_start(&own.job, &picture), FOVEA_OK);
    while (fv_nn_job_advance(&own.job, &kernels, 2, &done) == FOVEA_AGAIN)
        continue;
    assert_memory_equal(beside, alone[0], output_of(&own, beside));
    free(own.block);
}

static void what_does_not_fit_is_refused(void **state)
{
    (void)state;
    struct own own;
    struct fovea_image wrong = picture;
    open_job(&own, 0);
    wrong.format = FOVEA_PIXEL_MJPEG;
    assert_int_equal(fv_nn_job_start(&own.job, &wrong), FOVEA_ERROR_UNSUPPORTED);
    wrong = picture;
    wrong.height = HEIGHT * 2;
    assert_int_equal(fv_nn_job_start(&own.job, &wrong), FOVEA_ERROR_UNSUPPORTED);
    assert_true(fv_nn_job_idle(&own.job));
    free(own.block);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(two_models_in_turns_give_what_each_gives_alone),
        cmocka_unit_test(a_picture_that_is_given_up_leaves_no_trace),
        cmocka_unit_test(what_does_not_fit_is_refused),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}

/* States go from run to run as if they were fed back by hand, on every kernel set, in units and
 * with the memory moved between runs; they begin as real zeros, and again after a reset; files
 * whose states anything else could change are refused. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "base/elementary.h"
#include "common/carved.h"
#include "common/nn_golden.h"
#include "common/nn_mutant.h"
#include "detect/job.h"
#include "fovea/network.h"
#include "nn/job.h"
#include "nn/tensor.h"

enum { RUNS = 12, INPUT = 8, HIDDEN = 12, OUTPUT = 5, WIDTH = 20, HEIGHT = 16 };

static const struct nn_golden_model *named(const char *name)
{
    for (int i = 0; i < golden.count; i++)
        if (strcmp(golden.models[i].name, name) == 0) return &golden.models[i];
    fail_msg("no golden model %s", name);
    return NULL;
}

static void open_model(const char *name, struct fv_model *model)
{
    const struct nn_golden_model *g = named(name);
    struct fovea_error error;
    if (fv_model_open(g->model, g->model_bytes, g->name, model, &error) != FOVEA_OK)
        fail_msg("%s", error.text);
}

static uint8_t *new_arena(const struct fv_model *model)
{
    const size_t bytes = nn_golden_padded(fv_nn_arena_bytes(model));
    uint8_t *arena = aligned_alloc(64, bytes);
    assert_non_null(arena);
    memset(arena, 0, bytes);
    return arena;
}

static void draw_input(int run, int8_t input[INPUT])
{
    struct fv_random random;
    fv_random_seed(&random, (uint64_t)run + 7);
    for (int i = 0; i < INPUT; i++)
        input[i] = (int8_t)fv_random_below(&random, 256);
}

static void run_all(const struct fv_model *model, const struct fv_kernels *kernels, uint8_t *arena)
{
    struct fv_nn_progress progress = {0, 0};
    uint32_t done;
    assert_int_equal(fv_nn_run(model, kernels, arena, &progress, UINT32_MAX, &done), FOVEA_OK);
}

/* The network whose state is an input and an output: scale 1/256 and zero point 5, 1/128 and 0. */
static void by_hand(int8_t expected[RUNS][OUTPUT])
{
    struct fv_model model;
    struct fv_kernels kernels;
    int8_t input[INPUT], held[HIDDEN], next[HIDDEN];
    fv_kernels_init(&kernels, FV_CPU_C);
    open_model("recurrent open", &model);
    uint8_t *arena = new_arena(&model);
    memset(held, 5, sizeof held);
    for (int run = 0; run < RUNS; run++) {
        draw_input(run, input);
        fv_tensor_write(&model, model.inputs[0], arena, input);
        fv_tensor_write(&model, model.inputs[1], arena, held);
        run_all(&model, &kernels, arena);
        fv_tensor_read(&model, model.outputs[0], arena, expected[run]);
        fv_tensor_read(&model, model.outputs[1], arena, next);
        for (int i = 0; i < HIDDEN; i++) {
            const int value = 2 * next[i] + 5;
            held[i] = (int8_t)(value > 127 ? 127 : value < -128 ? -128 : value);
        }
    }
    free(arena);
}

static void kept_as_if_fed_back_by_hand_on_every_kernel_set(void **state)
{
    (void)state;
    int8_t expected[RUNS][OUTPUT], found[OUTPUT], input[INPUT], first[OUTPUT];
    struct fv_model model;
    by_hand(expected);
    open_model("recurrent kept", &model);
    assert_int_equal(fv_model_state_count(&model), 1);
    for (int set = 0; set < FV_CPU_SET_COUNT; set++) {
        struct fv_kernels kernels;
        int other = 0;
        fv_kernels_init(&kernels, (enum fv_cpu_set)set);
        uint8_t *arena = new_arena(&model), *fresh = new_arena(&model);
        for (int run = 0; run < RUNS; run++) {
            draw_input(run, input);
            fv_tensor_write(&model, model.inputs[0], arena, input);
            run_all(&model, &kernels, arena);
            fv_tensor_read(&model, model.outputs[0], arena, found);
            assert_memory_equal(found, expected[run], sizeof found);
            memset(fresh, 0, fv_nn_arena_bytes(&model));
            fv_tensor_write(&model, model.inputs[0], fresh, input);
            run_all(&model, &kernels, fresh);
            fv_tensor_read(&model, model.outputs[0], fresh, first);
            other += memcmp(first, found, sizeof found) != 0;
        }
        assert_in_range(other, RUNS / 2, RUNS); /* the state matters */
        free(arena);
        free(fresh);
    }
}

static void in_units_and_again_after_a_reset(void **state)
{
    (void)state;
    int8_t expected[RUNS][OUTPUT], input[INPUT];
    const struct nn_golden_model *g = named("recurrent kept");
    struct fovea_network *network = NULL;
    struct fovea_error error;
    struct fovea_tensor t;
    size_t bytes;
    by_hand(expected);
    assert_int_equal(fovea_network_size(g->model, g->model_bytes, &bytes, &error), FOVEA_OK);
    void *memory = aligned_alloc(64, nn_golden_padded(bytes));
    memset(memory, 0xA5, nn_golden_padded(bytes));
    assert_int_equal(fovea_network_init(memory, bytes, g->model, g->model_bytes, &network, &error),
                     FOVEA_OK);
    assert_int_equal(fovea_network_input_count(network), 1);
    assert_int_equal(fovea_network_output_count(network), 1);
    for (int round = 0; round < 2; round++) {
        for (int run = 0; run < RUNS; run++) {
            draw_input(run, input);
            assert_int_equal(fovea_network_set(network, 0, input, sizeof input), FOVEA_OK);
            while (fovea_network_run(network, 1) == FOVEA_AGAIN)
                continue;
            assert_int_equal(fovea_network_output(network, 0, &t), FOVEA_OK);
            assert_memory_equal(t.data, expected[run], OUTPUT);
        }
        assert_int_equal(fovea_network_set(network, 0, input, sizeof input), FOVEA_OK);
        assert_int_equal(fovea_network_run(network, 1), FOVEA_AGAIN);
        fovea_network_reset(network); /* in the middle of a run */
        assert_int_equal(fovea_network_output(network, 0, &t), FOVEA_OK);
        assert_null(t.data);
        assert_int_equal(fovea_network_run(network, 1), FOVEA_ERROR_ARGUMENT);
    }
    free(memory);
}

/* ---- in a job -------------------------------------------------------------------------------- */

static uint8_t pixels[RUNS][WIDTH * HEIGHT];

static struct fv_model seen;

static void carve(void *memory, struct fv_arena *arena)
{
    fv_detect_carve(memory, arena, &seen, NULL, sizeof pixels[0]);
}

static uint32_t job_run(const struct fv_nn_job *job, const struct fv_kernels *kernels, int run)
{
    const struct fovea_image image = {.data = pixels[run],
                                      .width = WIDTH,
                                      .height = HEIGHT,
                                      .stride_bytes = WIDTH,
                                      .format = FOVEA_PIXEL_GREY8,
                                      .size_bytes = sizeof pixels[run]};
    uint8_t output[6 * 5 * 16];
    uint32_t done;
    assert_int_equal(fv_nn_job_start(job, &image), FOVEA_OK);
    while (fv_nn_job_advance(job, kernels, 1, &done) == FOVEA_AGAIN)
        continue;
    assert_int_equal(fv_tensor_bytes(job->model, job->model->outputs[0]), sizeof output);
    fv_tensor_read(job->model, job->model->outputs[0], fv_nn_job_arena(job), output);
    fv_nn_job_end(job);
    return fv_model_checksum(output, sizeof output);
}

static void a_job_keeps_states_until_it_is_stopped(void **state)
{
    (void)state;
    struct fv_detect_memory memory;
    struct fv_kernels kernels;
    struct fv_random random;
    uint32_t first[RUNS], done;
    fv_random_seed(&random, 3);
    for (int i = 0; i < RUNS; i++) /* the same picture twice is two different runs */
        for (int k = 0; k < WIDTH * HEIGHT; k++)
            pixels[i][k] = i % 2 == 1 ? pixels[i - 1][k] : (uint8_t)fv_random_below(&random, 256);
    open_model("recurrent picture", &seen);
    assert_int_equal(fv_model_state_count(&seen), 2);
    fv_kernels_init(&kernels, fv_cpu_best(fv_cpu_detect()));
    void *block = carved(carve, &memory);
    const struct fv_nn_job *job = fv_detect_network(&memory);
    for (int i = 0; i < RUNS; i++)
        first[i] = job_run(job, &kernels, i);
    for (int i = 1; i < RUNS; i += 2)
        assert_int_not_equal(first[i], first[i - 1]);
    const struct fovea_image image = {.data = pixels[0],
                                      .width = WIDTH,
                                      .height = HEIGHT,
                                      .stride_bytes = WIDTH,
                                      .format = FOVEA_PIXEL_GREY8,
                                      .size_bytes = sizeof pixels[0]};
    assert_int_equal(fv_detect_start(&memory, &image, 1, 1), FOVEA_OK);
    assert_int_equal(fv_detect_advance(&memory, &kernels, 3, &done), FOVEA_AGAIN);
    fv_detect_stop(&memory);
    for (int i = 0; i < RUNS; i++)
        assert_int_equal(job_run(job, &kernels, i), first[i]);
    free(block);
}

/* ---- files ----------------------------------------------------------------------------------- */

/* Places in the file, as 32-bit words. */
static uint32_t word(const uint8_t *data, size_t at)
{
    uint32_t value;
    memcpy(&value, data + at, sizeof value);
    return value;
}

static void put(uint8_t *data, size_t at, uint32_t value)
{
    memcpy(data + at, &value, sizeof value);
}

static size_t op_at(const uint8_t *data, uint32_t op, uint32_t index)
{
    return word(data, 32) + 256 * (size_t)op + 4 * (size_t)index;
}

static size_t tensor_at(const uint8_t *data, uint32_t tensor, uint32_t index)
{
    return word(data, 24) + 64 * (size_t)tensor + 4 * (size_t)index;
}

static void refused(const char *name, void (*damage)(uint8_t *data), const char *text)
{
    const struct nn_golden_model *g = named(name);
    struct fv_model model = {.base = NULL};
    struct fovea_error error = {.status = FOVEA_OK};
    uint8_t *data = aligned_alloc(64, nn_golden_padded(g->model_bytes));
    assert_non_null(data);
    memcpy(data, g->model, g->model_bytes);
    damage(data);
    nn_mutant_seal(data, g->model_bytes);
    if (fv_model_open(data, g->model_bytes, "file", &model, &error) != FOVEA_ERROR_INPUT)
        fail_msg("taken, expected '%s'", text);
    if (strstr(error.text, text) == NULL) fail_msg("found '%s', expected '%s'", error.text, text);
    assert_null(strchr(error.text, '\n'));
    free(data);
}

enum { STATE_COUNT = 480, STATES = 484, OPERANDS_IN = 5, OPERANDS_OUT = 9 };

static void no_states(uint8_t *data)
{
    put(data, STATE_COUNT, 0);
}

static void too_many(uint8_t *data)
{
    put(data, STATE_COUNT, 17);
}

static void outside(uint8_t *data)
{
    put(data, STATES, word(data, 8));
}

static void old_version(uint8_t *data)
{
    put(data, 4, 2);
}

static void no_tensor(uint8_t *data)
{
    put(data, word(data, STATES), word(data, 20));
}

static void constant(uint8_t *data)
{
    const uint32_t state = word(data, word(data, STATES)),
                   tensors[2] = {state, word(data, tensor_at(data, state, 14))};
    for (int i = 0; i < 2; i++) {
        put(data, tensor_at(data, tensors[i], 1), FV_TENSOR_CONST);
        put(data, tensor_at(data, tensors[i], 10), FV_MODEL_HEADER_BYTES);
    }
}

static void twice(uint8_t *data)
{
    put(data, word(data, STATES) + 4, word(data, word(data, STATES)));
}

/* Another operator that reads it. */
static void read_twice(uint8_t *data)
{
    const uint32_t copy = word(data, op_at(data, 0, OPERANDS_IN)), last = word(data, 28) - 1;
    put(data, op_at(data, last, OPERANDS_IN), copy);
}

/* An operator that needs none has it as scratch. */
static void written_twice(uint8_t *data)
{
    put(data, op_at(data, 3, 14), word(data, word(data, STATES)));
}

static void as_output(uint8_t *data)
{
    put(data, word(data, 48), word(data, word(data, STATES)));
}

/* Half of it is copied: dims from word 16 on, of which the last is the whole. */
static void in_part(uint8_t *data)
{
    put(data, op_at(data, 0, 16 + 5), HIDDEN / 2);
}

static void of_another_shape(uint8_t *data)
{
    const uint32_t t = word(data, op_at(data, 0, OPERANDS_OUT));
    put(data, tensor_at(data, t, 3), HIDDEN);
    put(data, tensor_at(data, t, 4), 1);
    put(data, tensor_at(data, t, 15), 1);
}

/* It lies where the input lies. */
static void shared(uint8_t *data)
{
    const uint32_t state = word(data, word(data, STATES)),
                   at = word(data, tensor_at(data, word(data, word(data, 40)), 10));
    put(data, tensor_at(data, state, 10), at);
    put(data, tensor_at(data, word(data, tensor_at(data, state, 14)), 10), at);
}

static void states_that_something_else_could_change(void **state)
{
    (void)state;
    refused("recurrent kept", no_states, "byte 480: the number of states is 0, expected");
    refused("recurrent kept", too_many, "the number of states is 17, expected");
    refused("recurrent kept", outside, "byte 480: the number of states is 1, expected");
    refused("recurrent kept", old_version, "expected 0 in version 2");
    refused("recurrent kept", no_tensor, "expected one that exists");
    refused("recurrent kept", constant, "is no constant");
    refused("recurrent picture", twice, "shares no bytes with another state");
    refused("recurrent kept", read_twice, "one operator reads and a later one writes");
    refused("recurrent kept", written_twice, "one operator reads and a later one writes");
    refused("recurrent kept", as_output, "neither input nor output");
    refused("recurrent kept", in_part, "of its type and shape");
    refused("recurrent kept", of_another_shape, "of its type and shape");
    refused("recurrent kept", shared, "shares no bytes of the arena");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(kept_as_if_fed_back_by_hand_on_every_kernel_set),
        cmocka_unit_test(in_units_and_again_after_a_reset),
        cmocka_unit_test(a_job_keeps_states_until_it_is_stopped),
        cmocka_unit_test(states_that_something_else_could_change),
    };
    return cmocka_run_group_tests(tests, nn_golden_set_up, nn_golden_tear_down);
}

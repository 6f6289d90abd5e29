/* Damaged model files are refused with a reason, or run within their memory (the sanitizer build
 * watches). FOVEA_MUTANTS=N: as many at random (default 20,000). */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>

#include <stdio.h>

#include "common/nn_golden.h"
#include "common/nn_mutant.h"
#include "base/elementary.h"

static uint8_t *copy_of(const struct nn_golden_model *g)
{
    void *copy = NULL;
    if (posix_memalign(&copy, 64, g->model_bytes) != 0) abort();
    memcpy(copy, g->model, g->model_bytes);
    return copy;
}

static void refused(const uint8_t *data, size_t bytes, const char *text)
{
    struct fv_model model = {.base = NULL};
    struct fovea_error error = {.status = FOVEA_OK};
    assert_int_equal(fv_model_open(data, bytes, "file", &model, &error), FOVEA_ERROR_INPUT);
    if (strstr(error.text, text) == NULL) fail_msg("found '%s', expected '%s'", error.text, text);
    assert_null(model.base);
}

static void foreign_and_cut_files(void **state)
{
    (void)state;
    const struct nn_golden_model *g = &golden.models[0];
    uint8_t *data = copy_of(g);
    refused(data, 100, "file's size is 100");
    char sizes[96];
    snprintf(sizes, sizeof sizes, "stated size is %zu, expected the file's %zu",
             (size_t)g->model_bytes, (size_t)g->model_bytes - 64);
    refused(data, g->model_bytes - 64, sizes);
    data[g->model_bytes - 100] ^= 1;
    refused(data, g->model_bytes, "checksum");
    data[0] = 'X';
    refused(data, g->model_bytes, "not a Fovea model");
    memcpy(data, g->model, g->model_bytes);
    data[4] = 9;
    refused(data, g->model_bytes,
            "the version of the model format is 9, expected 2 to 5: a later Fovea made it");
    data[4] = 1;
    refused(data, g->model_bytes,
            "the version of the model format is 1, expected 2 to 5: only the Fovea before 0.1");
    free(data);
}

static int32_t *op_words(uint8_t *data, int32_t op)
{
    uint32_t ops;
    memcpy(&ops, data + 32, 4);
    return (int32_t *)(void *)(data + ops + 256 * (size_t)op);
}

static const struct nn_golden_model *named(const char *start)
{
    for (int i = 0; i < golden.count; i++) {
        if (strstr(golden.models[i].name, start) == golden.models[i].name) return &golden.models[i];
    }
    fail_msg("no golden model %s", start);
    return NULL;
}

/* One word of the first operator record set to a value, sealed, and the reason for which it is
 * refused. */
static void hostile_words(void **state)
{
    (void)state;
    const struct {
        int32_t word, value;
        const char *text;
    } cases[] = {
        {0, 99, "unknown kind"},
        {3, 7, "operand count"},
        {5, 100000, "no such tensor"},
        {13, 1000000, "rows do not match"},
        {14, 100000, "no such tensor"},
        {15, 0, "row cost"},
        {16, -1, "side of the image"},
        {17, 1 << 19, "does not fit its tensor"},
        {20, 1, "pixels overlap"},
        {25, 0, "window"},
        {31, -1, "window"},
        {32, -4096, "window"},
        {33, 3, "kernel height"},
        {34, 1, "k / 4"},
        {35, 300, "zero points"},
        {41, 1 << 30, "weights lie outside"},
        {42, 4, "biases lie outside"},
        {45, 1 << 28, "table lies outside"},
    };
    const struct nn_golden_model *g = named("CONV_2D int8");
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        uint8_t *data = copy_of(g);
        op_words(data, 0)[cases[i].word] = cases[i].value;
        if (cases[i].word == 20) op_words(data, 0)[19] = 2; /* two channels at a distance of one */
        nn_mutant_seal(data, g->model_bytes);
        refused(data, g->model_bytes, cases[i].text);
        free(data);
    }
}

/* The same of a product of matrices: one that is rounded once needs room for its sums. */
static void hostile_products(void **state)
{
    (void)state;
    const struct {
        int32_t word, value;
        const char *text;
    } cases[] = {{32, 31, "shift is out of range"},
                 {33, 1, "scratch is too small"},
                 {33, 2, "not 0 or 1"},
                 {34, 1 << 28, "biases lie outside"}};
    const struct nn_golden_model *g = named("BATCH_MATMUL int8");
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        uint8_t *data = copy_of(g);
        int32_t op = 0;
        while (op_words(data, op)[0] != FV_OP_BATCH_MATMUL)
            op++;
        op_words(data, op)[cases[i].word] = cases[i].value;
        nn_mutant_seal(data, g->model_bytes);
        refused(data, g->model_bytes, cases[i].text);
        free(data);
    }
}

/* A function of two bytes needs a table of 65,536, and a row's squares must fit their sum. */
static void hostile_functions(void **state)
{
    (void)state;
    const struct {
        const char *model;
        int32_t word, value, from_end; /* counted from the end of the file */
        const char *text;
    } cases[] = {{"DIV", 52, 0, 0, "table or slopes are out of range"},
                 {"DIV", 52, 65535 + 64, 1, "table or slopes are out of range"},
                 {"DIV", 16, 8, 0, "no such function"},
                 {"channel slopes", 16, FV_BINARY_PRELU, 0, "wrong number of operands"},
                 {"channel slopes", 28, 2, 0, "not packed"},
                 {"channel slopes", 40, 2, 0, "not packed"},
                 {"channel slopes", 41, 256, 0, "zero points"},
                 {"channel slopes", 52, 0, 0, "table or slopes are out of range"},
                 {"L2_NORMALIZATION", 17, 1 << 20, 0, "does not fit the tensors"},
                 {"L2_NORMALIZATION", 18, 256, 0, "no byte"},
                 {"L2_NORMALIZATION", 19, 2, 0, "not 0 or 1"}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const struct nn_golden_model *g = named(cases[i].model);
        uint8_t *data = copy_of(g);
        const int32_t end = cases[i].from_end ? (int32_t)g->model_bytes : 0;
        op_words(data, 0)[cases[i].word] = end == 0 ? cases[i].value : end - cases[i].value;
        nn_mutant_seal(data, g->model_bytes);
        refused(data, g->model_bytes, cases[i].text);
        free(data);
    }
}

/* A slope that a kernel could not round: too steep, infinite, no number. */
static void hostile_slopes(void **state)
{
    (void)state;
    const float slopes[] = {16385.0f, -16385.0f, INFINITY, NAN};
    const struct nn_golden_model *g = named("channel slopes");
    for (size_t i = 0; i < sizeof slopes / sizeof *slopes; i++) {
        uint8_t *data = copy_of(g);
        memcpy(data + op_words(data, 0)[52], &slopes[i], 4);
        nn_mutant_seal(data, g->model_bytes);
        refused(data, g->model_bytes, "table or slopes are out of range");
        free(data);
    }
}

/* Slopes in a file of a version that had none: another Fovea made it, and meant something else. */
static void slopes_of_an_earlier_version(void **state)
{
    (void)state;
    const uint32_t version = FV_MODEL_VERSION_STATELESS;
    const struct nn_golden_model *g = named("channel slopes");
    uint8_t *data = copy_of(g);
    memcpy(data + 4, &version, 4);
    nn_mutant_seal(data, g->model_bytes);
    refused(data, g->model_bytes,
            "not of this version of the format: import the .tflite file again");
    free(data);
}

/* A walk over a tensor that stays where it is along one axis is in bounds however long it is. */
static void more_work_than_data(void **state)
{
    (void)state;
    const int32_t copy = FV_OP_COPY, reduce = FV_OP_REDUCE;
    int copies = 0, sums = 0;
    for (int i = 0; i < golden.count; i++) {
        const struct nn_golden_model *g = &golden.models[i];
        uint8_t *data = copy_of(g);
        int32_t *word = op_words(data, 0);
        if (word[0] == copy && word[16] == 1) { /* dims from 16 on, strides from 22 and 28 on */
            word[16] = 1000;
            word[22] = word[28] = 0;
            word[13] *= 1000; /* rows */
            nn_mutant_seal(data, g->model_bytes);
            refused(data, g->model_bytes, "target does not fit its tensor");
            copies++;
        } else if (word[0] == reduce &&
                   word[25] == 1) { /* lengths of dropped axes from 25 on, strides from 29 on */
            word[25] = 1000;
            word[29] = 0;
            word[33] *= 1000; /* elements */
            nn_mutant_seal(data, g->model_bytes);
            refused(data, g->model_bytes, "more than the input has");
            sums++;
        }
        free(data);
    }
    assert_true(copies > 0 && sums > 0);
}

/* The operator's own output as its input: read before it is written. */
static void cycle(void **state)
{
    (void)state;
    const struct nn_golden_model *g = &golden.models[0];
    uint8_t *data = copy_of(g);
    op_words(data, 0)[5] = op_words(data, 0)[9];
    nn_mutant_seal(data, g->model_bytes);
    refused(data, g->model_bytes, "nothing wrote before");
    free(data);
}

static void mutate(struct fv_random *random, uint8_t *data, uint32_t bytes)
{
    uint32_t tensors, ops, tensor_count, op_count;
    memcpy(&tensor_count, data + 20, 4);
    memcpy(&tensors, data + 24, 4);
    memcpy(&op_count, data + 28, 4);
    memcpy(&ops, data + 32, 4);
    static const int32_t values[8] = {0, 1, -1, 0x7FFFFFFF, (int32_t)0x80000000, 255, 65536, 3};
    const uint32_t starts[4] = {16, tensors, ops, 512},
                   sizes[4] = {496, tensor_count * 64, op_count * 256, bytes - 512};
    for (uint32_t n = fv_random_below(random, 3) + 1; n > 0; --n) {
        const uint32_t part = fv_random_below(random, 4),
                       at = starts[part] + fv_random_below(random, sizes[part] / 4) * 4;
        int32_t word;
        if (at + 4 > bytes) continue;
        memcpy(&word, data + at, 4);
        switch (fv_random_below(random, 4)) {
        case 0:
            word ^= (int32_t)(1u << fv_random_below(random, 32));
            break;
        case 1:
            word = values[fv_random_below(random, 8)];
            break;
        case 2:
            word = (int32_t)((uint32_t)word + fv_random_below(random, 17) - 8);
            break;
        default:
            word = (int32_t)((uint32_t)word << fv_random_below(random, 4));
            break;
        }
        memcpy(data + at, &word, 4);
    }
}

static void mutants_at_random(void **state)
{
    (void)state;
    struct fv_random random;
    const char *wanted = getenv("FOVEA_MUTANTS");
    const int count = wanted == NULL ? 20000 : (int)strtol(wanted, NULL, 10);
    int taken = 0;
    fv_random_seed(&random, 20);
    for (int i = 0; i < count; i++) {
        const struct nn_golden_model *g = &golden.models[i % golden.count];
        uint8_t *data = copy_of(g);
        mutate(&random, data, g->model_bytes);
        nn_mutant_seal(data, g->model_bytes);
        taken += nn_mutant_run(data, g->model_bytes);
        free(data);
    }
    printf("%d of %d mutants were harmless enough to run\n", taken, count);
    assert_in_range(taken, count / 20, count * 9L / 10);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(foreign_and_cut_files), cmocka_unit_test(hostile_words),
        cmocka_unit_test(hostile_products),      cmocka_unit_test(hostile_functions),
        cmocka_unit_test(hostile_slopes),        cmocka_unit_test(slopes_of_an_earlier_version),
        cmocka_unit_test(more_work_than_data),   cmocka_unit_test(cycle),
        cmocka_unit_test(mutants_at_random),
    };
    return cmocka_run_group_tests(tests, nn_golden_set_up, nn_golden_tear_down);
}

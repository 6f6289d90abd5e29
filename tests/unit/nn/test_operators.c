/* Small models, one for each operator, give the reference interpreter's outputs bit for bit (floats
 * to 1e-5): with every kernel set, unit by unit, and with the state moved between units. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "base/elementary.h"
#include "common/nn_golden.h"
#include "common/nn_mutant.h"
#include "nn/real.h"
#include "nn/run.h"
#include "support/aligned.h"

static uint8_t *new_arena(const struct fv_model *model, const struct nn_golden_model *g)
{
    uint8_t *arena = aligned_alloc(64, nn_golden_padded(fv_nn_arena_bytes(model)));
    assert_non_null(arena);
    memset(arena, 0xA5, nn_golden_padded(fv_nn_arena_bytes(model)));
    fv_nn_clear_states(model, arena);
    const uint8_t *from = g->inputs;
    for (uint32_t i = 0; i < model->header->input_count; i++) {
        const size_t bytes = (size_t)model->tensors[model->inputs[i]].bytes;
        memcpy(fv_nn_tensor(model, arena, model->inputs[i]), from, bytes);
        from += bytes;
    }
    assert_int_equal(from - g->inputs, g->input_bytes);
    return arena;
}

static void compare(const struct fv_model *model, const struct nn_golden_model *g, uint8_t *arena,
                    const char *how)
{
    const uint8_t *expected = g->outputs;
    for (uint32_t i = 0; i < model->header->output_count; i++) {
        const struct fv_model_tensor *t = &model->tensors[model->outputs[i]];
        const uint8_t *found = fv_nn_tensor(model, arena, model->outputs[i]);
        if (t->type == FV_TYPE_F32) {
            for (int32_t k = 0; k < t->bytes / 4; k++) {
                float a, b;
                memcpy(&a, found + 4 * k, 4);
                memcpy(&b, expected + 4 * k, 4);
                if (!(a - b < 1e-5f && b - a < 1e-5f))
                    fail_msg("%s, %s: output %u[%d] is %g, expected %g", g->name, how, i, k,
                             (double)a, (double)b);
            }
        } else {
            for (int32_t k = 0; k < t->bytes; k++) {
                if (found[k] != expected[k])
                    fail_msg("%s, %s: output %u byte %d is %d, expected %d", g->name, how, i, k,
                             found[k], expected[k]);
            }
        }
        expected += t->bytes;
    }
    assert_int_equal(expected - g->outputs, g->output_bytes);
}

static void open_model(const struct nn_golden_model *g, struct fv_model *model)
{
    struct fovea_error error;
    if (fv_model_open(g->model, g->model_bytes, g->name, model, &error) != FOVEA_OK)
        fail_msg("%s", error.text);
}

/* The arena after a run; its bytes are compared, too, as what a run leaves is state. */
static uint8_t *arena_of_run(const struct nn_golden_model *g, const struct fv_model *model,
                             enum fv_cpu_set set)
{
    struct fv_kernels kernels;
    struct fv_nn_progress progress = {0, 0};
    uint32_t done;
    fv_kernels_init(&kernels, set);
    fv_nn_real_fill(model, &kernels);
    uint8_t *arena = new_arena(model, g);
    assert_int_equal(fv_nn_run(model, &kernels, arena, &progress, UINT32_MAX, &done), FOVEA_OK);
    assert_int_equal(done, fv_nn_units(model));
    compare(model, g, arena, fv_cpu_set_name(set));
    return arena;
}

static void with_every_kernel_set(void **state)
{
    (void)state;
    int tables = 0;
    for (int i = 0; i < golden.count; i++) {
        const struct nn_golden_model *g = &golden.models[i];
        struct fv_model model;
        open_model(g, &model);
        uint8_t *plain = arena_of_run(g, &model, FV_CPU_C);
        for (int set = 0; set < 2 * FV_CPU_SET_COUNT; set++) { /* without a table, and with one */
            const size_t bytes = set < FV_CPU_SET_COUNT ? 0 : fv_nn_real_bytes(&model);
            if (bytes > 0) model.real = fv_aligned_zeroed(bytes);
            tables += bytes > 0;
            uint8_t *arena = arena_of_run(g, &model, (enum fv_cpu_set)(set % FV_CPU_SET_COUNT));
            if (memcmp(arena, plain, fv_nn_arena_bytes(&model)) != 0)
                fail_msg("%s, %s: the arena differs", g->name,
                         fv_cpu_set_name((enum fv_cpu_set)(set % FV_CPU_SET_COUNT)));
            free(arena);
            free(model.real);
            model.real = NULL;
        }
        free(plain);
    }
    assert_true(tables > 0);
}

/* After each unit the arena and the progress are copied elsewhere and the run goes on there. */
static void unit_by_unit_while_moving(void **state)
{
    (void)state;
    struct fv_kernels kernels;
    fv_kernels_init(&kernels, FV_CPU_C);
    for (int i = 0; i < golden.count; i++) {
        struct fv_model model;
        struct fv_nn_progress progress = {0, 0};
        enum fovea_status status = FOVEA_AGAIN;
        uint32_t units = 0;
        open_model(&golden.models[i], &model);
        uint8_t *arena = new_arena(&model, &golden.models[i]);
        while (status == FOVEA_AGAIN) {
            uint32_t done;
            status = fv_nn_run(&model, &kernels, arena, &progress, 1, &done);
            units += done;
            uint8_t *other = aligned_alloc(64, nn_golden_padded(fv_nn_arena_bytes(&model)));
            memcpy(other, arena, fv_nn_arena_bytes(&model));
            memset(arena, 0x5A, fv_nn_arena_bytes(&model));
            free(arena);
            arena = other;
        }
        assert_int_equal(units, fv_nn_units(&model));
        compare(&model, &golden.models[i], arena, "moved");
        free(arena);
    }
}

/* A copy of the file; its only operator, of which each row shall be a unit. */
static uint8_t *file_of(const struct nn_golden_model *g, struct fv_model_op **op)
{
    uint32_t ops;
    uint8_t *data = aligned_alloc(64, nn_golden_padded(g->model_bytes));
    assert_non_null(data);
    memcpy(data, g->model, g->model_bytes);
    memcpy(&ops, data + 32, 4);
    *op = (struct fv_model_op *)(void *)(data + ops);
    (*op)->row_cost = FV_NN_UNIT_COST;
    return data;
}

/* Seal and open it; NULL, and it is freed, where it is refused with `refusal`. */
static uint8_t *opened(const struct nn_golden_model *g, uint8_t *data, struct fv_model *model,
                       const char *refusal)
{
    struct fovea_error error;
    nn_mutant_seal(data, g->model_bytes);
    if (fv_model_open(data, g->model_bytes, g->name, model, &error) == FOVEA_OK) return data;
    if (strstr(error.text, refusal) == NULL) fail_msg("%s", error.text);
    free(data);
    return NULL;
}

static uint8_t *with_rows(const struct nn_golden_model *g, int32_t rows, struct fv_model *model)
{
    struct fv_model_op *op;
    uint8_t *data = file_of(g, &op);
    op->rows = rows;
    return opened(g, data, model, "rows is not what its steps make");
}

/* Runs unit by unit, and moves the state between units: nothing but the arena may hold it. */
static void check_run(const struct nn_golden_model *g, const struct fv_model *model,
                      const struct fv_kernels *kernels, int32_t units)
{
    struct fv_nn_progress progress = {0, 0};
    uint8_t *arena = new_arena(model, g), *other = new_arena(model, g);
    uint32_t done;
    enum fovea_status status = FOVEA_AGAIN;
    for (int32_t i = 0; i < units; i++) {
        assert_int_equal(status, FOVEA_AGAIN);
        status = fv_nn_run(model, kernels, arena, &progress, 1, &done);
        uint8_t *last = arena;
        memcpy(other, last, fv_nn_arena_bytes(model));
        memset(last, 0x5A, fv_nn_arena_bytes(model));
        arena = other;
        other = last;
    }
    assert_int_equal(status, FOVEA_OK);
    compare(model, g, arena, "in parts");
    free(arena);
    free(other);
}

/* A class's suppression in as many steps as the file says, from one to one for each box. */
static void suppression_in_any_steps(void **state)
{
    (void)state;
    const struct nn_golden_model *g = golden.models;
    while (strcmp(g->name, "regular suppression") != 0)
        assert_true(++g < golden.models + golden.count);
    struct fv_kernels kernels;
    struct fv_model model;
    fv_kernels_init(&kernels, FV_CPU_C);
    open_model(g, &model);
    const struct fv_op_detection p = model.ops[0].u.detection;
    const int32_t steps = p.per_class < p.anchors ? p.per_class : p.anchors;
    const int32_t others = (p.anchors - 1) / 64 + 2;
    assert_true(p.regular_nms && steps > 3);
    for (int32_t k = 1; k <= steps; k++) {
        uint8_t *data = with_rows(g, others + p.classes * k, &model);
        assert_non_null(data);
        struct fv_nn_progress progress = {0, 0};
        uint8_t *arena = new_arena(&model, g);
        uint32_t done, units = 0;
        while (fv_nn_run(&model, &kernels, arena, &progress, 1, &done) == FOVEA_AGAIN)
            units++;
        assert_int_equal(units + 1, others + p.classes * k);
        compare(&model, g, arena, "in steps");
        free(arena);
        free(data);
    }
    assert_null(with_rows(g, others, &model));
    assert_null(with_rows(g, others + p.classes + 1, &model));
    assert_null(with_rows(g, others + p.classes * (steps + 1), &model));
}

/* The columns of a convolution from `from` on alone: its output's bytes before them stay. */
static void check_columns(const struct nn_golden_model *g, const struct fv_kernels *kernels,
                          int32_t from)
{
    uint8_t *data = aligned_alloc(64, nn_golden_padded(g->model_bytes));
    uint32_t at, done;
    struct fv_model model;
    struct fovea_error error;
    struct fv_nn_progress progress = {0, 0};
    assert_non_null(data);
    memcpy(data, g->model, g->model_bytes);
    memcpy(&at, data + 32, 4);
    struct fv_op_conv *c = &((struct fv_model_op *)(void *)(data + at))->u.conv;
    const int32_t pixel = c->image.out_stride, width = c->image.out_w;
    c->image.out_w -= from;
    c->window.pad_left -= from * c->window.stride_x;
    c->out_first = from * pixel;
    c->out_row = width * pixel;
    nn_mutant_seal(data, g->model_bytes);
    if (fv_model_open(data, g->model_bytes, g->name, &model, &error) != FOVEA_OK)
        fail_msg("%s", error.text);
    uint8_t *arena = new_arena(&model, g), *out = fv_nn_tensor(&model, arena, model.outputs[0]);
    memset(out, 0x5A, (size_t)model.tensors[model.outputs[0]].bytes);
    assert_int_equal(fv_nn_run(&model, kernels, arena, &progress, UINT32_MAX, &done), FOVEA_OK);
    for (int32_t i = 0; i < model.tensors[model.outputs[0]].bytes; i++)
        assert_int_equal(out[i], i / pixel % width < from ? 0x5A : g->outputs[i]);
    free(arena);
    free(data);
}

static void columns_of_convolutions(void **state)
{
    (void)state;
    int checked = 0;
    for (int i = 0; i < golden.count; i++) {
        struct fv_model model;
        open_model(&golden.models[i], &model);
        const struct fv_op_conv c = model.ops[0].u.conv;
        if (model.header->op_count != 1 || model.ops[0].kind != FV_OP_CONV || c.single_rounding ||
            c.out_row != 0 || model.ops[0].scratch < 0)
            continue;
        for (int32_t from = 1; from < c.image.out_w; from++) {
            for (int set = 0; set < FV_CPU_SET_COUNT; set++) {
                struct fv_kernels kernels;
                fv_kernels_init(&kernels, (enum fv_cpu_set)set);
                check_columns(&golden.models[i], &kernels, from);
                checked++;
            }
        }
    }
    assert_true(checked > 0);
}

/* Where an operator says in how many parts it goes; how many rows the parts are of, and how many
 * others there are; how many parts there may be. */
static int32_t *parts_of(struct fv_model_op *op, int32_t *whole, int32_t *others, int32_t *most)
{
    int32_t *parts = op->kind == FV_OP_CONV           ? &op->u.conv.parts
                     : op->kind == FV_OP_POOL         ? &op->u.pool.parts
                     : op->kind == FV_OP_REDUCE       ? &op->u.reduce.parts
                     : op->kind == FV_OP_BATCH_MATMUL ? &op->u.matmul.parts
                                                      : &op->u.detection.parts;
    *others = 0;
    *most = *parts;
    if (op->kind == FV_OP_BATCH_MATMUL)
        *others =
            op->rows - op->u.matmul.batch[0] * op->u.matmul.batch[1] * op->u.matmul.m * *parts;
    if (op->kind == FV_OP_DETECTION)
        *others = (op->u.detection.anchors - 1) / 64 + (op->u.detection.regular_nms ? 2 : 3);
    *whole = (op->rows - *others) / *parts;
    return parts;
}

static void check_parts(const struct nn_golden_model *g, const struct fv_kernels *kernels)
{
    static const char *const no_parts = "not of this version of the format";
    int32_t most = 1, whole, others;
    struct fv_model model;
    for (int32_t parts = 1; parts <= most + 1; parts += most < 100 ? 1 : 1 + parts / 3) {
        struct fv_model_op *op;
        uint8_t *data = file_of(g, &op);
        int32_t *of_op = parts_of(op, &whole, &others, &most);
        *of_op = parts;
        op->rows = others + whole * parts;
        const int32_t rows = op->rows;
        data = opened(g, data, &model, no_parts);
        if (parts > most) {
            assert_null(data);
            break;
        }
        assert_non_null(data);
        check_run(g, &model, kernels, rows);
        free(data);
    }
}

static int is_in_parts(const struct nn_golden_model *g)
{
    const size_t length = strlen(g->name);
    return length > 9 && strcmp(g->name + length - 9, " in parts") == 0;
}

/* Whatever the cut, results are those of the whole. */
static void in_any_parts(void **state)
{
    (void)state;
    int checked = 0;
    for (int set = 0; set < FV_CPU_SET_COUNT; set++) {
        struct fv_kernels kernels;
        fv_kernels_init(&kernels, (enum fv_cpu_set)set);
        for (int i = 0; i < golden.count; i++) {
            if (!is_in_parts(&golden.models[i])) continue;
            check_parts(&golden.models[i], &kernels);
            checked++;
        }
    }
    assert_int_equal(checked, 9 * FV_CPU_SET_COUNT);
}

static const struct nn_golden_model *golden_of(const char *name)
{
    const struct nn_golden_model *g = golden.models;
    while (strcmp(g->name, name) != 0)
        assert_true(++g < golden.models + golden.count);
    return g;
}

/* Fewer than one part, more than there may be, or rows that are not theirs. */
static void parts_that_are_refused(void **state)
{
    static const char *const no_parts = "not of this version of the format";
    (void)state;
    struct fv_model model;
    for (int i = 0; i < golden.count; i++) {
        const struct nn_golden_model *g = &golden.models[i];
        int32_t whole, others, most;
        struct fv_model_op *op;
        if (!is_in_parts(g)) continue;
        uint8_t *data = file_of(g, &op);
        *parts_of(op, &whole, &others, &most) = -1;
        op->rows = others + whole;
        assert_null(opened(g, data, &model, no_parts));
        data = file_of(g, &op);
        *parts_of(op, &whole, &others, &most) = most + 1;
        op->rows = others + whole * (most + 1);
        assert_null(opened(g, data, &model, no_parts));
        for (int sign = -1; sign <= 1; sign += 2) {
            data = file_of(g, &op);
            const struct fv_op_detection *p = &op->u.detection;
            const int classes = op->kind == FV_OP_DETECTION && p->regular_nms;
            op->rows += sign * (classes ? p->classes * p->parts : 1); /* a step of each */
            assert_null(opened(g, data, &model, ": rows "));
        }
    }
}

/* Only a fully connected layer has its products in parts, whose results are rounded once. */
static void parts_of_another_layer(void **state)
{
    (void)state;
    const struct nn_golden_model *g = golden_of("FULLY_CONNECTED in parts");
    struct fv_model_op *op;
    struct fv_model model;
    uint8_t *data = file_of(g, &op);
    op->u.conv.single_rounding = 0;
    assert_null(opened(g, data, &model, "or not for this layer"));
    data = file_of(g, &op);
    struct fv_op_conv *p = &op->u.conv; /* the same pixels, in a row */
    assert_true(p->image.in_h > 1 && p->image.in_w == 1);
    op->rows = p->parts;
    p->image.in_w = p->image.out_w = p->image.in_h;
    p->image.in_h = p->image.out_h = 1;
    assert_null(opened(g, data, &model, "or not for this layer"));
}

/* As many parts as a file may ask for, of as many taps as a row may have: the last part is the last
 * taps, which finish the last pixel. All of the image but one pixel is padding, and reads as the
 * least of the range. */
static void as_many_parts_as_there_may_be(void **state)
{
    enum { PIXELS = 1 << 20, SIDE = 1 << 10, PARTS = INT32_MAX, LEAST = 7, SEVERAL = 5000 };
    (void)state;
    struct fv_kernels kernels;
    struct fv_model_op op = {.rows = PARTS};
    struct fv_op_pool *p = &op.u.pool;
    uint8_t in[64] = {0}, *out = calloc(PIXELS, 1);
    assert_non_null(out);
    fv_kernels_init(&kernels, FV_CPU_C);
    p->image = (struct fv_op_image){.batch = 1,
                                    .in_h = 1,
                                    .in_w = 1,
                                    .in_c = 1,
                                    .in_stride = 1,
                                    .out_h = 1,
                                    .out_w = PIXELS,
                                    .out_c = 1,
                                    .out_stride = 1};
    p->window = (struct fv_op_window){SIDE, SIDE, 1, 1, 1, 1, 0, 0};
    p->act_min = LEAST;
    p->act_max = 255;
    p->parts = PARTS;
    const struct fv_nn_call call = {.kernels = &kernels, .op = &op, .in = {in}, .out = {out}};
    fv_nn_op_pool(&call, PARTS - SEVERAL, PARTS);
    for (int32_t i = 0; i < PIXELS; i++)
        assert_int_equal(out[i], i < PIXELS - 3 ? 0 : LEAST);
    free(out);
}

/* Columns of a product are packed together or in any smaller number. */
static void packed_in_any_number(void **state)
{
    (void)state;
    const struct nn_golden_model *g = golden_of("BATCH_MATMUL in parts");
    struct fv_kernels kernels;
    struct fv_model model;
    fv_kernels_init(&kernels, FV_CPU_C);
    for (int32_t pack = 1; pack <= 17; pack++) {
        struct fv_model_op *op;
        uint8_t *data = file_of(g, &op);
        struct fv_op_matmul *p = &op->u.matmul;
        const int32_t rows = p->batch[0] * p->batch[1] *
                             ((p->n + 15) / 16 * 16 / (pack > 16 ? 16 : pack) + p->m * p->parts);
        p->pack = pack;
        op->rows = rows;
        data = opened(g, data, &model, "or no divisor of 16");
        assert_true((data != NULL) == (pack <= 16 && 16 % pack == 0));
        if (data != NULL) check_run(g, &model, &kernels, rows);
        free(data);
    }
}

/* A matrix whose columns are packed gives the product of the same one whose rows are. */
static void packed_by_rows_and_by_columns(void **state)
{
    enum { M = 3, K = 131, N = 37, N16 = 48, K4 = 33, PACK = 4 };
    static uint8_t a[M * K + 64], by_rows[K * N + 64], by_columns[N * K + 64], out[2][M * N + 64];
    (void)state;
    struct fv_kernels kernels;
    struct fv_random random;
    fv_random_seed(&random, 9);
    for (int i = 0; i < M * K; i++)
        a[i] = (uint8_t)fv_random_below(&random, 256);
    for (int k = 0; k < K; k++) {
        for (int j = 0; j < N; j++)
            by_columns[j * K + k] = by_rows[k * N + j] = (uint8_t)fv_random_below(&random, 256);
    }
    fv_kernels_init(&kernels, FV_CPU_C);
    for (int way = 0; way < 2; way++) {
        struct fv_model_op op = {.rows = N16 / PACK + M};
        struct fv_op_matmul *p = &op.u.matmul;
        *p = (struct fv_op_matmul){.batch = {1, 1},
                                   .m = M,
                                   .k = K,
                                   .n = N,
                                   .a_row = K,
                                   .b_row = way == 0 ? N : 1,
                                   .b_column = way == 0 ? 1 : K,
                                   .zero_a = 120,
                                   .zero_b = 130,
                                   .zero_out = 128,
                                   .multiplier = 1 << 30,
                                   .shift = -10,
                                   .pack = PACK};
        const struct fv_nn_call call = {.kernels = &kernels,
                                        .op = &op,
                                        .in = {a, way == 0 ? by_rows : by_columns},
                                        .out = {out[way]},
                                        .scratch = aligned_alloc(64, N16 * (K4 * 4 + 12))};
        assert_non_null(call.scratch);
        fv_nn_op_matmul(&call, 0, op.rows);
        free(call.scratch);
    }
    assert_memory_equal(out[0], out[1], M * N);
    assert_int_not_equal(out[0][0], out[0][1]);
}

/* A file of a version that had no parts is refused, as is one whose scratch is too small. */
static void parts_of_an_earlier_version(void **state)
{
    (void)state;
    struct fv_model model;
    for (int i = 0; i < golden.count; i++) {
        struct fv_model_op *op;
        if (!is_in_parts(&golden.models[i])) continue;
        uint8_t *data = file_of(&golden.models[i], &op);
        ((struct fv_model_header *)(void *)data)->version = FV_MODEL_VERSION_SLOPES;
        assert_null(opened(&golden.models[i], data, &model, "not of this version of the format"));
        data = file_of(&golden.models[i], &op);
        const int needless = op->kind == FV_OP_POOL && !op->u.pool.average;
        op->scratch = -1;
        data = opened(&golden.models[i], data, &model, "scratch is too small");
        assert_true((data != NULL) == needless);
        free(data);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(with_every_kernel_set),
        cmocka_unit_test(unit_by_unit_while_moving),
        cmocka_unit_test(suppression_in_any_steps),
        cmocka_unit_test(columns_of_convolutions),
        cmocka_unit_test(in_any_parts),
        cmocka_unit_test(parts_that_are_refused),
        cmocka_unit_test(parts_of_another_layer),
        cmocka_unit_test(as_many_parts_as_there_may_be),
        cmocka_unit_test(packed_in_any_number),
        cmocka_unit_test(packed_by_rows_and_by_columns),
        cmocka_unit_test(parts_of_an_earlier_version),
    };
    return cmocka_run_group_tests(tests, nn_golden_set_up, nn_golden_tear_down);
}

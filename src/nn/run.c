#include "nn/run.h"

#include <string.h>

static fv_nn_op_fn *const operators[FV_OP_KIND_COUNT] = {
    [FV_OP_CONV] = fv_nn_op_conv,
    [FV_OP_DEPTHWISE] = fv_nn_op_depthwise,
    [FV_OP_BINARY] = fv_nn_op_binary,
    [FV_OP_POOL] = fv_nn_op_pool,
    [FV_OP_REDUCE] = fv_nn_op_reduce,
    [FV_OP_COPY] = fv_nn_op_copy,
    [FV_OP_FILL] = fv_nn_op_fill,
    [FV_OP_RESIZE] = fv_nn_op_resize,
    [FV_OP_SOFTMAX] = fv_nn_op_softmax,
    [FV_OP_ARG_MAX] = fv_nn_op_arg_max,
    [FV_OP_DEQUANTIZE] = fv_nn_op_dequantize,
    [FV_OP_QUANTIZE] = fv_nn_op_quantize,
    [FV_OP_CAST] = fv_nn_op_cast,
    [FV_OP_BATCH_MATMUL] = fv_nn_op_matmul,
    [FV_OP_DETECTION] = fv_nn_op_detection,
    [FV_OP_NORMALISE] = fv_nn_op_normalise,
};

size_t fv_nn_arena_bytes(const struct fv_model *model)
{
    return model->header->arena_bytes;
}

void fv_nn_clear_states(const struct fv_model *model, uint8_t *arena)
{
    for (uint32_t i = 0; i < model->header->state_count; i++) {
        const struct fv_model_tensor *t = &model->tensors[model->states[i]],
                                     *whole = &model->tensors[t->storage];
        memset(arena + whole->offset, 0, (size_t)whole->bytes);
    }
}

static int32_t unit_rows(const struct fv_model_op *op)
{
    const int32_t rows = FV_NN_UNIT_COST / op->row_cost;
    return rows < 1 ? 1 : rows;
}

/* Units that `rows` rows of an operator take. */
static uint32_t units_of(const struct fv_model_op *op, int32_t rows)
{
    return (uint32_t)((rows - 1) / unit_rows(op) + 1);
}

uint32_t fv_nn_units(const struct fv_model *model)
{
    uint32_t units = 0;
    for (uint32_t i = 0; i < model->header->op_count; i++)
        units += units_of(&model->ops[i], model->ops[i].rows);
    return units;
}

uint8_t *fv_nn_tensor(const struct fv_model *model, uint8_t *arena, int32_t tensor)
{
    const struct fv_model_tensor *t = &model->tensors[tensor];
    /* Constants are only ever read; one pointer type serves both. */
    uint8_t *base = (t->flags & FV_TENSOR_CONST) != 0 ? (uint8_t *)(uintptr_t)model->base : arena;
    return base + t->offset;
}

static void prepare(const struct fv_model *model, const struct fv_kernels *kernels, uint8_t *arena,
                    const struct fv_model_op *op, struct fv_nn_call *call)
{
    *call = (struct fv_nn_call){.model = model, .kernels = kernels, .op = op};
    for (int32_t i = 0; i < op->input_count; i++)
        call->in[i] = fv_nn_tensor(model, arena, op->inputs[i]);
    for (int32_t i = 0; i < op->output_count; i++)
        call->out[i] = fv_nn_tensor(model, arena, op->outputs[i]);
    if (op->scratch >= 0) call->scratch = fv_nn_tensor(model, arena, op->scratch);
}

/* The units of an operator that are granted at once run in one call: their rows share what is
 * prepared for a call, and weights that do not fit the caches are read once for all. */
enum fovea_status fv_nn_run(const struct fv_model *model, const struct fv_kernels *kernels,
                            uint8_t *arena, struct fv_nn_progress *progress, uint32_t units,
                            uint32_t *done)
{
    const int32_t op_count = (int32_t)model->header->op_count;
    uint32_t count = 0;
    while (count < units && progress->op < op_count) {
        const struct fv_model_op *op = &model->ops[progress->op];
        struct fv_nn_call call;
        prepare(model, kernels, arena, op, &call);
        const uint32_t left = units_of(op, op->rows - progress->row),
                       some = units - count < left ? units - count : left;
        const int32_t end = some == left ? op->rows : progress->row + (int32_t)some * unit_rows(op);
        operators[op->kind](&call, progress->row, end);
        progress->row = end;
        if (end == op->rows) *progress = (struct fv_nn_progress){.op = progress->op + 1, .row = 0};
        count += some;
    }
    *done = count;
    return progress->op < op_count ? FOVEA_AGAIN : FOVEA_OK;
}

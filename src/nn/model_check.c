#include "nn/model_check.h"

#include <string.h>

#include "nn/model_check_help.h"
#include "nn/run.h"

/* Bytes that strides reach, both ends, over axes of the given lengths; false when a length is out
 * of range.
 */
static int reach(const int32_t *dims, const int32_t *strides, int32_t axes, int64_t *low,
                 int64_t *high)
{
    int64_t count = 1;
    for (int32_t i = 0; i < axes; i++) {
        if (dims[i] < 1 || count > (INT64_C(1) << 30) / dims[i]) return 0;
        count *= dims[i];
        const int64_t far = (int64_t)(dims[i] - 1) * strides[i];
        *(far < 0 ? low : high) += far;
    }
    return 1;
}

static int64_t product(const int32_t *dims, int32_t axes)
{
    int64_t count = 1;
    for (int32_t i = 0; i < axes; i++)
        count *= dims[i];
    return count;
}

/* A strided walk from `first` with elements of `size` bytes stays inside the tensor. */
static int walk_fits(const int32_t *dims, const int32_t *strides, int32_t axes, int64_t first,
                     int32_t size, const struct fv_model_tensor *t)
{
    int64_t low = first, high = first;
    return reach(dims, strides, axes, &low, &high) && low >= 0 && high + size <= t->bytes;
}

/* Likewise of an output, of which no byte is written twice: a file makes no more work than its
 * size. */
static int walk_fills(const int32_t *dims, const int32_t *strides, int32_t axes, int64_t first,
                      int32_t size, const struct fv_model_tensor *t)
{
    return walk_fits(dims, strides, axes, first, size, t) && product(dims, axes) <= t->bytes / size;
}

/* Slopes that a kernel may multiply a byte by and round to a word. */
static int slopes_fit(const struct fv_check *c, int32_t offset, int32_t count)
{
    if (!fv_check_constant(c, offset, ((int64_t)count + 1) * 4, 64)) return 0;
    const float *slopes = (const float *)(const void *)(c->m->base + offset);
    int good = 1;
    for (int32_t i = 0; i <= count; i++)
        good &= slopes[i] >= -16384.0f && slopes[i] <= 16384.0f;
    return good;
}

static int binary_table_fits(const struct fv_check *c, const struct fv_op_binary *p)
{
    if (p->function == FV_BINARY_SLOPES) return slopes_fit(c, p->table, p->dims[5]);
    return p->function == FV_BINARY_TABLE ? fv_check_constant(c, p->table, 65536, 1)
                                          : fv_check_table_fits(c, p->table);
}

static const char *check_binary(const struct fv_check *c)
{
    const struct fv_op_binary *p = &c->op->u.binary;
    const int32_t alone = p->function == FV_BINARY_SLOPES; /* there is no second operand */
    const char *fault = fv_check_operands(c, alone ? 1 : 2, 1);
    if (fault != NULL) return fault;
    *c->word = 5;
    if (fv_check_input(c, 0)->type != FV_TYPE_U8 ||
        fv_check_input(c, alone ? 0 : 1)->type != FV_TYPE_U8 ||
        fv_check_output(c, 0)->type != FV_TYPE_U8)
        return "operands are not bytes";
    FV_CHECK_REQUIRE(binary.function,
                     fv_check_between(p->function, FV_BINARY_ADD, FV_BINARY_SLOPES),
                     "no such function");
    FV_CHECK_REQUIRE(binary.function, !alone || c->m->header->version >= FV_MODEL_VERSION_SLOPES,
                     "slopes are not of this version of the format: import the .tflite file again");
    FV_CHECK_REQUIRE(binary.a,
                     walk_fits(p->dims, p->a, 6, 0, 1, fv_check_input(c, 0)) &&
                         (!alone || p->a[5] == 1),
                     "the first input does not fit its tensor, or is not packed");
    FV_CHECK_REQUIRE(binary.b, alone || walk_fits(p->dims, p->b, 6, 0, 1, fv_check_input(c, 1)),
                     "the second input does not fit its tensor");
    FV_CHECK_REQUIRE(binary.out,
                     walk_fills(p->dims, p->out, 6, 0, 1, fv_check_output(c, 0)) &&
                         (!alone || p->out[5] == 1),
                     "the output does not fit its tensor, or is not packed");
    FV_CHECK_REQUIRE(binary.zero_a,
                     fv_check_activation_fits(p->zero_a, p->zero_out, p->act_min, p->act_max) &&
                         fv_check_between(p->zero_b, 0, 255),
                     "zero points or range are not bytes");
    const int32_t most = p->function <= FV_BINARY_SUB ? 0 : 30;
    FV_CHECK_REQUIRE(binary.s_a, fv_check_between(p->s_a, -31, most), "the shift is out of range");
    FV_CHECK_REQUIRE(binary.s_b, fv_check_between(p->s_b, -31, most), "the shift is out of range");
    FV_CHECK_REQUIRE(binary.s_out, fv_check_between(p->s_out, -31, 30),
                     "the shift is out of range");
    FV_CHECK_REQUIRE(binary.table, binary_table_fits(c, p), "the table or slopes are out of range");
    *c->word = 13;
    return c->op->rows == product(p->dims, 5) ? NULL : "rows do not match the shape";
}

static const char *check_reduce(const struct fv_check *c)
{
    const struct fv_op_reduce *p = &c->op->u.reduce;
    const char *fault = fv_check_operands(c, 1, 1);
    if (fault != NULL) return fault;
    FV_CHECK_REQUIRE(reduce.function, fv_check_between(p->function, FV_REDUCE_MEAN, FV_REDUCE_MIN),
                     "no such function");
    int64_t low = 0, high = 0;
    *c->word = FV_CHECK_WORD(reduce.dims);
    const int good =
        reach(p->dims, p->outer, 4, &low, &high) && reach(p->count, p->inner, 4, &low, &high);
    if (!good || low < 0 || high + 1 > fv_check_input(c, 0)->bytes ||
        fv_check_input(c, 0)->type != FV_TYPE_U8)
        return "the input does not fit its tensor";
    if (product(p->dims, 4) > fv_check_output(c, 0)->bytes ||
        fv_check_output(c, 0)->type != FV_TYPE_U8)
        return "the output does not fit its tensor";
    FV_CHECK_REQUIRE(reduce.elements, p->elements == product(p->count, 4) && p->elements <= 1 << 22,
                     "not the product of the dropped axes");
    FV_CHECK_REQUIRE(reduce.elements,
                     product(p->dims, 4) * p->elements <= fv_check_input(c, 0)->bytes,
                     "more than the input has");
    FV_CHECK_REQUIRE(reduce.shift, fv_check_between(p->shift, -31, 30),
                     "the shift is out of range");
    FV_CHECK_REQUIRE(reduce.zero_in,
                     fv_check_between(p->zero_in, 0, 255) && fv_check_between(p->zero_out, 0, 255),
                     "zero points are not bytes");
    const int64_t lanes = p->outer[3] == 1 ? FV_MODEL_REDUCE_LANES : 1;
    FV_CHECK_REQUIRE(
        reduce.parts,
        fv_check_parts_fit(c, p->parts, (p->dims[3] + lanes - 1) / lanes * p->elements),
        "not of this version of the format, or more than a row has elements");
    *c->word = 14;
    if (p->parts > 1 && fv_check_scratch_bytes(c) < FV_MODEL_REDUCE_LANES * 4)
        return "scratch is too small";
    *c->word = 13;
    return fv_check_rows_are(c, product(p->dims, 3), p->parts) ? NULL
                                                               : "rows do not match the shape";
}

static const char *check_copy(const struct fv_check *c)
{
    const struct fv_op_copy *p = &c->op->u.copy;
    const char *fault = fv_check_operands(c, 1, 1);
    if (fault != NULL) return fault;
    const int32_t size = p->element_bytes;
    FV_CHECK_REQUIRE(copy.element_bytes, size == 1 || size == 4 || size == 8, "not 1, 4 or 8");
    FV_CHECK_REQUIRE(copy.src,
                     walk_fits(p->dims, p->src, 6, p->src_first, size, fv_check_input(c, 0)),
                     "the source does not fit its tensor");
    FV_CHECK_REQUIRE(copy.dst,
                     walk_fills(p->dims, p->dst, 6, p->dst_first, size, fv_check_output(c, 0)),
                     "the target does not fit its tensor");
    FV_CHECK_REQUIRE(copy.table, fv_check_table_fits(c, p->table) && (p->table == 0 || size == 1),
                     "the table lies outside the file");
    *c->word = 13;
    return c->op->rows == product(p->dims, 5) ? NULL : "rows do not match the shape";
}

static const char *check_fill(const struct fv_check *c)
{
    const struct fv_op_fill *p = &c->op->u.fill;
    const char *fault = fv_check_operands(c, 0, 1);
    if (fault != NULL) return fault;
    FV_CHECK_REQUIRE(fill.bytes, fv_check_between(p->bytes, 1, fv_check_output(c, 0)->bytes),
                     "does not fit the tensor");
    FV_CHECK_REQUIRE(fill.value, fv_check_between(p->value, 0, 255), "not a byte");
    *c->word = 13;
    return c->op->rows == (p->bytes - 1) / 16384 + 1 ? NULL : "rows do not match the size";
}

/* Exponentials fall from one and end with -1 for what is left out. */
static int exps_fit(const int32_t *exps)
{
    int good = exps[0] == INT32_MAX;
    for (int32_t i = 1; i < 256; i++)
        good &= exps[i] >= -1 && exps[i] <= exps[i - 1];
    return good;
}

static const char *check_softmax(const struct fv_check *c)
{
    const struct fv_op_softmax *p = &c->op->u.softmax;
    const char *fault = fv_check_operands(c, 1, 1);
    if (fault != NULL) return fault;
    const int64_t bytes = (int64_t)p->outer * p->depth;
    FV_CHECK_REQUIRE(softmax.depth,
                     p->outer >= 1 && p->depth >= 1 && bytes <= fv_check_input(c, 0)->bytes &&
                         bytes <= fv_check_output(c, 0)->bytes,
                     "does not fit the tensors");
    FV_CHECK_REQUIRE(softmax.depth, p->depth <= 8191, "more values than the sum can hold");
    FV_CHECK_REQUIRE(softmax.table,
                     fv_check_constant(c, p->table, 1024, 4) &&
                         exps_fit(fv_check_words_at(c, p->table)),
                     "the table is outside the file or no exponential");
    *c->word = 13;
    return c->op->rows == p->outer ? NULL : "rows do not match the shape";
}

static const char *check_normalise(const struct fv_check *c)
{
    const struct fv_op_normalise *p = &c->op->u.normalise;
    const char *fault = fv_check_operands(c, 1, 1);
    if (fault != NULL) return fault;
    const int64_t bytes = (int64_t)p->outer * p->depth;
    FV_CHECK_REQUIRE(normalise.depth,
                     p->outer >= 1 && fv_check_between(p->depth, 1, 32768) &&
                         bytes <= fv_check_input(c, 0)->bytes &&
                         bytes <= fv_check_output(c, 0)->bytes,
                     "does not fit the tensors, or more values than the sum can hold");
    FV_CHECK_REQUIRE(normalise.zero_in, fv_check_between(p->zero_in, 0, 255),
                     "the zero point is no byte");
    FV_CHECK_REQUIRE(normalise.is_signed, fv_check_between(p->is_signed, 0, 1), "not 0 or 1");
    *c->word = 13;
    return c->op->rows == p->outer ? NULL : "rows do not match the shape";
}

static const char *check_arg_max(const struct fv_check *c)
{
    const struct fv_op_arg_max *p = &c->op->u.arg_max;
    const char *fault = fv_check_operands(c, 1, 1);
    if (fault != NULL) return fault;
    const int good = fv_check_between(p->outer, 1, 1 << 24) &&
                     fv_check_between(p->axis, 1, 1 << 24) &&
                     fv_check_between(p->inner, 1, 1 << 14);
    FV_CHECK_REQUIRE(arg_max.outer,
                     good && (int64_t)p->outer * p->axis <= fv_check_input(c, 0)->bytes / p->inner,
                     "does not fit the input");
    const int32_t size = fv_check_output(c, 0)->type == FV_TYPE_I64   ? 8
                         : fv_check_output(c, 0)->type == FV_TYPE_I32 ? 4
                                                                      : 0;
    FV_CHECK_REQUIRE(arg_max.element_bytes,
                     p->element_bytes == size &&
                         (int64_t)p->outer * p->inner * size <= fv_check_output(c, 0)->bytes,
                     "does not fit the output");
    *c->word = 13;
    return c->op->rows == p->outer ? NULL : "rows do not match the shape";
}

/* Element-wise conversion of `count` elements in slices of 4096. */
static const char *check_convert(const struct fv_check *c, int32_t count)
{
    static const int32_t size[FV_TYPE_COUNT] = {1, 4, 8, 4};
    const char *fault = fv_check_operands(c, 1, 1);
    if (fault != NULL) return fault;
    *c->word = 16;
    if (count < 1 ||
        (int64_t)count * size[fv_check_input(c, 0)->type] > fv_check_input(c, 0)->bytes)
        return "does not fit the input";
    if ((int64_t)count * size[fv_check_output(c, 0)->type] > fv_check_output(c, 0)->bytes)
        return "does not fit the output";
    *c->word = 13;
    return c->op->rows == (count - 1) / 4096 + 1 ? NULL : "rows do not match the count";
}

static const char *check_dequantize(const struct fv_check *c)
{
    const char *fault = check_convert(c, c->op->u.dequantize.count);
    if (fault != NULL) return fault;
    *c->word = 5;
    if (fv_check_input(c, 0)->type != FV_TYPE_U8 || fv_check_output(c, 0)->type != FV_TYPE_F32)
        return "not from bytes to floats";
    FV_CHECK_REQUIRE(dequantize.table, fv_check_constant(c, c->op->u.dequantize.table, 1024, 4),
                     "the table lies outside the file");
    return NULL;
}

static const char *check_quantize(const struct fv_check *c)
{
    const struct fv_op_quantize *p = &c->op->u.quantize;
    const char *fault = check_convert(c, p->count);
    if (fault != NULL) return fault;
    *c->word = 5;
    if (fv_check_input(c, 0)->type != FV_TYPE_F32 || fv_check_output(c, 0)->type != FV_TYPE_U8)
        return "not from floats to bytes";
    FV_CHECK_REQUIRE(quantize.scale, p->scale > 1e-30f && p->scale < 1e30f,
                     "the scale is not a positive number");
    FV_CHECK_REQUIRE(quantize.zero, fv_check_between(p->zero, 0, 255),
                     "the zero point is not a byte");
    return NULL;
}

static const char *check_cast(const struct fv_check *c)
{
    return check_convert(c, c->op->u.cast.count);
}

static int32_t pack_of(const struct fv_op_matmul *p)
{
    return p->pack == 0 ? 16 : p->pack;
}

static const char *check_matmul(const struct fv_check *c)
{
    const struct fv_op_matmul *p = &c->op->u.matmul;
    const char *fault = fv_check_operands(c, 2, 1);
    if (fault != NULL) return fault;
    const int32_t dims_a[4] = {p->batch[0], p->batch[1], p->m, p->k},
                  strides_a[4] = {p->a_batch[0], p->a_batch[1], p->a_row, 1};
    const int32_t dims_b[4] = {p->batch[0], p->batch[1], p->k, p->n},
                  strides_b[4] = {p->b_batch[0], p->b_batch[1], p->b_row, p->b_column};
    FV_CHECK_REQUIRE(matmul.m, walk_fits(dims_a, strides_a, 4, 0, 1, fv_check_input(c, 0)),
                     "the first input does not fit its tensor");
    FV_CHECK_REQUIRE(matmul.n, walk_fits(dims_b, strides_b, 4, 0, 1, fv_check_input(c, 1)),
                     "the second input does not fit its tensor");
    const int64_t batches = (int64_t)p->batch[0] * p->batch[1],
                  n16 = ((int64_t)p->n + 15) / 16 * 16, k4 = ((int64_t)p->k + 3) / 4;
    FV_CHECK_REQUIRE(matmul.k, p->k <= 1 << 22, "out of range");
    const int fits = fv_check_input(c, 0)->type == FV_TYPE_U8 &&
                     fv_check_input(c, 1)->type == FV_TYPE_U8 &&
                     fv_check_output(c, 0)->type == FV_TYPE_U8;
    FV_CHECK_REQUIRE(matmul.n, fits && batches * p->m * p->n <= fv_check_output(c, 0)->bytes,
                     "the output does not fit its tensor");
    FV_CHECK_REQUIRE(matmul.zero_a,
                     fv_check_between(p->zero_a, 0, 255) && fv_check_between(p->zero_b, 0, 255) &&
                         fv_check_between(p->zero_out, 0, 255),
                     "zero points are not bytes");
    FV_CHECK_REQUIRE(matmul.single_rounding, fv_check_between(p->single_rounding, 0, 1),
                     "not 0 or 1");
    FV_CHECK_REQUIRE(matmul.shift, p->single_rounding || fv_check_between(p->shift, -31, 30),
                     "the shift is out of range");
    FV_CHECK_REQUIRE(matmul.bias,
                     p->bias == 0 || fv_check_constant(c, p->bias, (int64_t)p->n * 4, 4),
                     "the biases lie outside the file");
    FV_CHECK_REQUIRE(matmul.pack, fv_check_parts_fit(c, p->pack, 16) && 16 % pack_of(p) == 0,
                     "not of this version of the format, or no divisor of 16");
    FV_CHECK_REQUIRE(matmul.parts, fv_check_parts_fit(c, p->parts, n16 / 16),
                     "not of this version of the format, or more than there are blocks");
    *c->word = 14;
    const int64_t sums = p->single_rounding ? n16 * 4 * FV_MODEL_CONV_PIXELS : 0;
    if (fv_check_scratch_bytes(c) < n16 * (k4 * 4 + 12) + sums) return "scratch is too small";
    *c->word = 13;
    const int64_t rows = n16 / pack_of(p) + (int64_t)p->m * (p->parts > 1 ? p->parts : 1);
    return c->op->rows == batches * rows ? NULL : "rows do not match the shape";
}

static int usable(float value)
{
    return (value > 1e-20f && value < 1e20f);
}

static int floats_fit(const struct fv_check *c, int32_t offset, int64_t count)
{
    if (!fv_check_constant(c, offset, count * 4, 4)) return 0;
    const float *value = (const float *)(const void *)(c->m->base + offset);
    int good = 1;
    for (int64_t i = 0; i < count; i++)
        good &= value[i] > -1e6f && value[i] < 1e6f;
    return good;
}

static const char *check_detection(const struct fv_check *c)
{
    const struct fv_op_detection *p = &c->op->u.detection;
    const char *fault = fv_check_operands(c, 2, 4);
    if (fault != NULL) return fault;
    FV_CHECK_REQUIRE(detection.anchors, fv_check_between(p->anchors, 1, 1 << 17), "out of range");
    FV_CHECK_REQUIRE(detection.classes, fv_check_between(p->classes, 1, 4096), "out of range");
    FV_CHECK_REQUIRE(detection.class_offset, fv_check_between(p->class_offset, 0, 16),
                     "out of range");
    FV_CHECK_REQUIRE(detection.max_detections, fv_check_between(p->max_detections, 1, 4096),
                     "out of range");
    FV_CHECK_REQUIRE(detection.max_per_anchor, fv_check_between(p->max_per_anchor, 1, 64),
                     "out of range");
    FV_CHECK_REQUIRE(detection.per_class, fv_check_between(p->per_class, 0, 1 << 17),
                     "out of range");
    FV_CHECK_REQUIRE(detection.score_threshold,
                     p->score_threshold > -1e6f && p->score_threshold < 1e6f,
                     "not a number in range");
    FV_CHECK_REQUIRE(detection.iou_threshold, p->iou_threshold >= 0.0f && p->iou_threshold <= 1.0f,
                     "not in [0, 1]");
    FV_CHECK_REQUIRE(detection.y_scale,
                     usable(p->y_scale) && usable(p->x_scale) && usable(p->h_scale) &&
                         usable(p->w_scale),
                     "a box scale is not a positive number");
    FV_CHECK_REQUIRE(detection.anchor_data, floats_fit(c, p->anchor_data, (int64_t)p->anchors * 4),
                     "anchors are outside the file or no numbers");
    FV_CHECK_REQUIRE(detection.box_table, floats_fit(c, p->box_table, 256),
                     "the table is outside the file or holds no numbers");
    FV_CHECK_REQUIRE(detection.score_table, floats_fit(c, p->score_table, 256),
                     "the table is outside the file or holds no numbers");
    *c->word = 5;
    if (fv_check_input(c, 0)->bytes < (int64_t)p->anchors * 4)
        return "boxes do not fit their tensor";
    *c->word = 6;
    if (fv_check_input(c, 1)->bytes < (int64_t)p->anchors * (p->classes + p->class_offset))
        return "scores do not fit their tensor";
    const int64_t slots = (int64_t)p->max_detections * p->max_per_anchor;
    const int64_t need[4] = {slots * 16, slots * 4, slots * 4, 4};
    for (int32_t i = 0; i < 4; i++) {
        *c->word = 9 + i;
        if (fv_check_output(c, i)->type != FV_TYPE_F32 || fv_check_output(c, i)->bytes < need[i])
            return "the output does not fit its tensor";
    }
    FV_CHECK_REQUIRE(detection.parts, fv_check_parts_fit(c, p->parts, p->anchors),
                     "not of this version of the format, or more than there are boxes");
    *c->word = 14;
    if (fv_check_scratch_bytes(c) < (int64_t)p->anchors * 32 + slots * 64 + 64)
        return "scratch is too small";
    *c->word = 13;
    return fv_nn_detection_rows_fit(p, c->op->rows) ? NULL : "rows is not what its steps make";
}

const char *fv_model_check_op(const struct fv_model *model, const struct fv_model_op *op,
                              int32_t *word)
{
    static const char *(*const checks[FV_OP_KIND_COUNT])(const struct fv_check *) = {
        [FV_OP_CONV] = fv_check_conv,
        [FV_OP_DEPTHWISE] = fv_check_depthwise,
        [FV_OP_BINARY] = check_binary,
        [FV_OP_POOL] = fv_check_pool,
        [FV_OP_REDUCE] = check_reduce,
        [FV_OP_COPY] = check_copy,
        [FV_OP_FILL] = check_fill,
        [FV_OP_RESIZE] = fv_check_resize,
        [FV_OP_SOFTMAX] = check_softmax,
        [FV_OP_ARG_MAX] = check_arg_max,
        [FV_OP_DEQUANTIZE] = check_dequantize,
        [FV_OP_QUANTIZE] = check_quantize,
        [FV_OP_CAST] = check_cast,
        [FV_OP_BATCH_MATMUL] = check_matmul,
        [FV_OP_DETECTION] = check_detection,
        [FV_OP_NORMALISE] = check_normalise};
    const struct fv_check c = {.m = model, .op = op, .word = word};
    return checks[op->kind](&c);
}

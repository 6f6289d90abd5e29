#include "nn/model_check.h"

#include <string.h>

#include "nn/run.h"

/* One operator under inspection; `word` is the record word looked at, for the error text. */
struct check {
    const struct fv_model *m;
    const struct fv_model_op *op;
    int32_t *word;
};

#define WORD(member) ((int32_t)(offsetof(struct fv_model_op, u.member) / 4))
#define REQUIRE(member, condition, text)                                                           \
    do {                                                                                           \
        *c->word = WORD(member);                                                                   \
        if (!(condition)) return text;                                                             \
    } while (0)

static int between(int64_t value, int64_t low, int64_t high)
{
    return value >= low && value <= high;
}

static const struct fv_model_tensor *input(const struct check *c, int32_t i)
{
    return &c->m->tensors[c->op->inputs[i]];
}

static const struct fv_model_tensor *output(const struct check *c, int32_t i)
{
    return &c->m->tensors[c->op->outputs[i]];
}

static int64_t scratch_bytes(const struct check *c)
{
    return c->op->scratch < 0 || c->m->tensors[c->op->scratch].offset % 64 != 0
               ? 0
               : c->m->tensors[c->op->scratch].bytes;
}

/* Constant data of `bytes` bytes at a multiple of `alignment`, with the slack that kernels may read
 * behind it. */
static int constant(const struct check *c, int32_t offset, int64_t bytes, int32_t alignment)
{
    return offset >= FV_MODEL_HEADER_BYTES && offset % alignment == 0 &&
           offset + bytes + FV_MODEL_SLACK_BYTES <= (int64_t)c->m->header->file_bytes;
}

static int table_fits(const struct check *c, int32_t offset)
{
    return offset == 0 || constant(c, offset, 256, 1);
}

static const int32_t *words_at(const struct check *c, int32_t offset)
{
    return (const int32_t *)(const void *)(c->m->base + offset);
}

static int shifts_fit(const struct check *c, int32_t offset, int32_t count)
{
    const int32_t *shift = words_at(c, offset);
    int good = 1;
    for (int32_t i = 0; i < count; i++)
        good &= shift[i] >= -31 && shift[i] <= 30;
    return good;
}

static int activation_fits(int32_t zero_in, int32_t zero_out, int32_t low, int32_t high)
{
    return between(zero_in, 0, 255) && between(zero_out, 0, 255) && low >= 0 && low <= high &&
           high <= 255;
}

static const char *operands(const struct check *c, int32_t inputs, int32_t outputs)
{
    *c->word = 3;
    return c->op->input_count == inputs && c->op->output_count == outputs
               ? NULL
               : "wrong number of operands";
}

/* An image of bytes inside its tensor, from byte `first` on; `row`: bytes from row to row, 0 where
 * rows follow without gap. */
static const char *half_image(const struct fv_model_tensor *t, int32_t batch, int32_t h, int32_t w,
                              int32_t channels, int32_t stride, int32_t first, int32_t row)
{
    if (!between(batch, 1, 4096) || !between(h, 1, 1 << 20) || !between(w, 1, 1 << 20) ||
        !between(channels, 1, 1 << 20)) {
        return "a side of the image is out of range";
    }
    if (stride < channels) return "pixels overlap";
    const int64_t lines = (int64_t)batch * h, line = (int64_t)(w - 1) * stride + channels;
    if (lines > (INT64_C(1) << 28) / w) return "the image is too large";
    if (first < 0 || row < 0 || (row != 0 && row < line))
        return "the first pixel or the distance of rows is out of range";
    const int64_t last = (lines - 1) * (row != 0 ? row : (int64_t)w * stride) + line;
    if (t->type != FV_TYPE_U8 || first + last > t->bytes)
        return "the image does not fit its tensor";
    return NULL;
}

/* Input and output image; the output's pixels may have gaps (`first` and `row` as above). */
static const char *check_images(const struct check *c, const struct fv_op_image *im, int32_t first,
                                int32_t row)
{
    *c->word = 16;
    const char *fault = operands(c, 1, 1);
    if (fault != NULL) return fault;
    *c->word = 16;
    fault = half_image(input(c, 0), im->batch, im->in_h, im->in_w, im->in_c, im->in_stride, 0, 0);
    if (fault != NULL) return fault;
    *c->word = 21;
    fault = half_image(output(c, 0), im->batch, im->out_h, im->out_w, im->out_c, im->out_stride,
                       first, row);
    if (fault != NULL) return fault;
    *c->word = 13;
    return c->op->rows == im->batch * im->out_h ? NULL : "rows do not match the image";
}

static const char *check_image(const struct check *c, const struct fv_op_image *im)
{
    return check_images(c, im, 0, 0);
}

static const char *check_window(const struct check *c, const struct fv_op_window *w)
{
    const int32_t *v = &w->kh;
    for (int32_t i = 0; i < 8; i++) {
        *c->word = 25 + i;
        if (!between(v[i], i < 6 ? 1 : 0, i < 4 ? 1024 : 4096)) return "the window is out of range";
    }
    return NULL;
}

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

static int is_pointwise(const struct fv_op_image *im, const struct fv_op_window *w)
{
    return w->kh == 1 && w->kw == 1 && w->stride_x == 1 && w->stride_y == 1 && w->pad_top == 0 &&
           w->pad_left == 0 && im->in_h == im->out_h && im->in_w == im->out_w;
}

static const char *check_conv(const struct check *c)
{
    const struct fv_op_conv *p = &c->op->u.conv;
    const char *fault = check_images(c, &p->image, p->out_first, p->out_row);
    if (fault == NULL) fault = check_window(c, &p->window);
    if (fault != NULL) return fault;
    const int64_t k = (int64_t)p->window.kh * p->window.kw * p->image.in_c;
    REQUIRE(conv.k, p->k == k && k <= 1 << 22, "not kernel height x width x channels");
    REQUIRE(conv.k4, p->k4 == (p->k + 3) / 4, "not k / 4 rounded up");
    REQUIRE(conv.zero_in, activation_fits(p->zero_in, p->zero_out, p->act_min, p->act_max),
            "zero points or range are not bytes");
    REQUIRE(conv.row_sum_factor, between(p->row_sum_factor, -256, 256), "out of range");
    const int32_t n16 = (p->image.out_c + 15) / 16 * 16;
    REQUIRE(conv.weights, constant(c, p->weights, (int64_t)n16 * p->k4 * 4, 64),
            "weights lie outside the file");
    REQUIRE(conv.bias, constant(c, p->bias, (int64_t)n16 * 4, 64), "biases lie outside the file");
    REQUIRE(conv.multiplier, constant(c, p->multiplier, (int64_t)n16 * 4, 64),
            "multipliers lie outside the file");
    REQUIRE(conv.shift, constant(c, p->shift, (int64_t)n16 * 4, 64), "shifts lie outside the file");
    REQUIRE(conv.table, table_fits(c, p->table), "the table lies outside the file");
    const int pointwise = is_pointwise(&p->image, &p->window);
    const int64_t pitch = ((int64_t)p->k4 * 4 + 15 + 63) / 64 * 64;
    REQUIRE(conv.single_rounding, between(p->single_rounding, 0, pointwise),
            "not 0 or 1, or not for this window");
    REQUIRE(conv.shift, p->single_rounding || shifts_fit(c, p->shift, n16),
            "a shift is out of range");
    int64_t scratch = pointwise ? 0 : FV_MODEL_CONV_PIXELS * pitch + FV_MODEL_SLACK_BYTES;
    if (p->single_rounding) scratch += (int64_t)n16 * 4 * FV_MODEL_CONV_PIXELS;
    *c->word = 14;
    return scratch == 0 || scratch_bytes(c) >= scratch ? NULL : "scratch is too small";
}

static const char *check_depthwise(const struct check *c)
{
    const struct fv_op_depthwise *p = &c->op->u.depthwise;
    const char *fault = check_image(c, &p->image);
    if (fault == NULL) fault = check_window(c, &p->window);
    if (fault != NULL) return fault;
    REQUIRE(depthwise.image.out_c, p->image.in_c == p->image.out_c, "not the input's channels");
    REQUIRE(depthwise.zero_in, activation_fits(p->zero_in, p->zero_out, p->act_min, p->act_max),
            "zero points or range are not bytes");
    REQUIRE(depthwise.planes, between(p->planes, 1, 3), "out of range");
    REQUIRE(depthwise.c16, p->c16 == (p->image.in_c + 15) / 16 * 16,
            "not the channels rounded up to 16");
    const int64_t taps = (int64_t)p->window.kh * p->window.kw;
    REQUIRE(depthwise.weights,
            taps <= 1 << 16 && constant(c, p->weights, p->planes * taps * p->c16, 64),
            "weights lie outside the file");
    REQUIRE(depthwise.bias, constant(c, p->bias, (int64_t)p->c16 * 4, 64),
            "biases lie outside the file");
    REQUIRE(depthwise.multiplier, constant(c, p->multiplier, (int64_t)p->c16 * 4, 64),
            "multipliers lie outside the file");
    REQUIRE(depthwise.shift,
            constant(c, p->shift, (int64_t)p->c16 * 4, 64) && shifts_fit(c, p->shift, p->c16),
            "a shift is out of range");
    REQUIRE(depthwise.table, table_fits(c, p->table), "the table lies outside the file");
    const int64_t span = (int64_t)(p->window.kw - 1) * p->window.dilation_x + 1;
    const int64_t all = (int64_t)(p->image.out_w - 1) * p->window.stride_x + span;
    const int64_t most = span > FV_MODEL_DEPTHWISE_COLUMNS ? span : FV_MODEL_DEPTHWISE_COLUMNS;
    *c->word = 14;
    return scratch_bytes(c) >= (all < most ? all : most) * 256 * ((p->window.kh + 3) / 4)
               ? NULL
               : "scratch is too small";
}

/* Slopes that a kernel may multiply a byte by and round to a word. */
static int slopes_fit(const struct check *c, int32_t offset, int32_t count)
{
    if (!constant(c, offset, ((int64_t)count + 1) * 4, 64)) return 0;
    const float *slopes = (const float *)(const void *)(c->m->base + offset);
    int good = 1;
    for (int32_t i = 0; i <= count; i++)
        good &= slopes[i] >= -16384.0f && slopes[i] <= 16384.0f;
    return good;
}

static int binary_table_fits(const struct check *c, const struct fv_op_binary *p)
{
    if (p->function == FV_BINARY_SLOPES) return slopes_fit(c, p->table, p->dims[5]);
    return p->function == FV_BINARY_TABLE ? constant(c, p->table, 65536, 1)
                                          : table_fits(c, p->table);
}

static const char *check_binary(const struct check *c)
{
    const struct fv_op_binary *p = &c->op->u.binary;
    const int32_t alone = p->function == FV_BINARY_SLOPES; /* there is no second operand */
    const char *fault = operands(c, alone ? 1 : 2, 1);
    if (fault != NULL) return fault;
    *c->word = 5;
    if (input(c, 0)->type != FV_TYPE_U8 || input(c, alone ? 0 : 1)->type != FV_TYPE_U8 ||
        output(c, 0)->type != FV_TYPE_U8)
        return "operands are not bytes";
    REQUIRE(binary.function, between(p->function, FV_BINARY_ADD, FV_BINARY_SLOPES),
            "no such function");
    REQUIRE(binary.a, walk_fits(p->dims, p->a, 6, 0, 1, input(c, 0)) && (!alone || p->a[5] == 1),
            "the first input does not fit its tensor, or is not packed");
    REQUIRE(binary.b, alone || walk_fits(p->dims, p->b, 6, 0, 1, input(c, 1)),
            "the second input does not fit its tensor");
    REQUIRE(binary.out,
            walk_fills(p->dims, p->out, 6, 0, 1, output(c, 0)) && (!alone || p->out[5] == 1),
            "the output does not fit its tensor, or is not packed");
    REQUIRE(binary.zero_a,
            activation_fits(p->zero_a, p->zero_out, p->act_min, p->act_max) &&
                between(p->zero_b, 0, 255),
            "zero points or range are not bytes");
    const int32_t most = p->function <= FV_BINARY_SUB ? 0 : 30;
    REQUIRE(binary.s_a, between(p->s_a, -31, most), "the shift is out of range");
    REQUIRE(binary.s_b, between(p->s_b, -31, most), "the shift is out of range");
    REQUIRE(binary.s_out, between(p->s_out, -31, 30), "the shift is out of range");
    REQUIRE(binary.table, binary_table_fits(c, p), "the table or slopes are out of range");
    *c->word = 13;
    return c->op->rows == product(p->dims, 5) ? NULL : "rows do not match the shape";
}

static const char *check_pool(const struct check *c)
{
    const struct fv_op_pool *p = &c->op->u.pool;
    const char *fault = check_image(c, &p->image);
    if (fault == NULL) fault = check_window(c, &p->window);
    if (fault != NULL) return fault;
    REQUIRE(pool.image.out_c, p->image.in_c == p->image.out_c, "not the input's channels");
    REQUIRE(pool.average, between(p->average, 0, 1), "not 0 or 1");
    REQUIRE(pool.is_signed, between(p->is_signed, 0, 1), "not 0 or 1");
    REQUIRE(pool.act_min, activation_fits(0, 0, p->act_min, p->act_max), "the range is not bytes");
    return NULL;
}

static const char *check_reduce(const struct check *c)
{
    const struct fv_op_reduce *p = &c->op->u.reduce;
    const char *fault = operands(c, 1, 1);
    if (fault != NULL) return fault;
    REQUIRE(reduce.function, between(p->function, FV_REDUCE_MEAN, FV_REDUCE_MIN),
            "no such function");
    int64_t low = 0, high = 0;
    *c->word = WORD(reduce.dims);
    const int good =
        reach(p->dims, p->outer, 4, &low, &high) && reach(p->count, p->inner, 4, &low, &high);
    if (!good || low < 0 || high + 1 > input(c, 0)->bytes || input(c, 0)->type != FV_TYPE_U8)
        return "the input does not fit its tensor";
    if (product(p->dims, 4) > output(c, 0)->bytes || output(c, 0)->type != FV_TYPE_U8)
        return "the output does not fit its tensor";
    REQUIRE(reduce.elements, p->elements == product(p->count, 4) && p->elements <= 1 << 22,
            "not the product of the dropped axes");
    REQUIRE(reduce.elements, product(p->dims, 4) * p->elements <= input(c, 0)->bytes,
            "more than the input has");
    REQUIRE(reduce.shift, between(p->shift, -31, 30), "the shift is out of range");
    REQUIRE(reduce.zero_in, between(p->zero_in, 0, 255) && between(p->zero_out, 0, 255),
            "zero points are not bytes");
    *c->word = 13;
    return c->op->rows == product(p->dims, 3) ? NULL : "rows do not match the shape";
}

static const char *check_copy(const struct check *c)
{
    const struct fv_op_copy *p = &c->op->u.copy;
    const char *fault = operands(c, 1, 1);
    if (fault != NULL) return fault;
    const int32_t size = p->element_bytes;
    REQUIRE(copy.element_bytes, size == 1 || size == 4 || size == 8, "not 1, 4 or 8");
    REQUIRE(copy.src, walk_fits(p->dims, p->src, 6, p->src_first, size, input(c, 0)),
            "the source does not fit its tensor");
    REQUIRE(copy.dst, walk_fills(p->dims, p->dst, 6, p->dst_first, size, output(c, 0)),
            "the target does not fit its tensor");
    REQUIRE(copy.table, table_fits(c, p->table) && (p->table == 0 || size == 1),
            "the table lies outside the file");
    *c->word = 13;
    return c->op->rows == product(p->dims, 5) ? NULL : "rows do not match the shape";
}

static const char *check_fill(const struct check *c)
{
    const struct fv_op_fill *p = &c->op->u.fill;
    const char *fault = operands(c, 0, 1);
    if (fault != NULL) return fault;
    REQUIRE(fill.bytes, between(p->bytes, 1, output(c, 0)->bytes), "does not fit the tensor");
    REQUIRE(fill.value, between(p->value, 0, 255), "not a byte");
    *c->word = 13;
    return c->op->rows == (p->bytes - 1) / 16384 + 1 ? NULL : "rows do not match the size";
}

static int entries_fit(const struct check *c, int32_t offset, int32_t count, int32_t size)
{
    if (!constant(c, offset, (int64_t)count * 12, 4)) return 0;
    const int32_t *entry = words_at(c, offset);
    int good = 1;
    for (int32_t i = 0; i < count; i++, entry += 3)
        good &= between(entry[0], 0, size - 1) && between(entry[1], 0, size - 1);
    return good;
}

static int weights_fit(const struct check *c, int32_t offset, int32_t count, int32_t high)
{
    const int32_t *entry = words_at(c, offset);
    int good = 1;
    for (int32_t i = 0; i < count; i++, entry += 3)
        good &= between(entry[2], 0, high);
    return good;
}

static const char *check_resize(const struct check *c)
{
    const struct fv_op_resize *p = &c->op->u.resize;
    const char *fault = check_image(c, &p->image);
    if (fault != NULL) return fault;
    REQUIRE(resize.image.out_c, p->image.in_c == p->image.out_c, "not the input's channels");
    REQUIRE(resize.mode, between(p->mode, FV_RESIZE_NEAREST, FV_RESIZE_EXACT), "no such mode");
    REQUIRE(resize.rows, entries_fit(c, p->rows, p->image.out_h, p->image.in_h),
            "the table is outside the file or the image");
    REQUIRE(resize.columns, entries_fit(c, p->columns, p->image.out_w, p->image.in_w),
            "the table is outside the file or the image");
    if (p->mode != FV_RESIZE_SIGNED && p->mode != FV_RESIZE_EXACT) return NULL;
    REQUIRE(resize.bits, between(p->bits, 0, 10), "out of range");
    REQUIRE(resize.rows, weights_fit(c, p->rows, p->image.out_h, 1 << p->bits),
            "a weight is out of range");
    REQUIRE(resize.columns, weights_fit(c, p->columns, p->image.out_w, 1 << p->bits),
            "a weight is out of range");
    return NULL;
}

/* Exponentials fall from one and end with -1 for what is left out. */
static int exps_fit(const int32_t *exps)
{
    int good = exps[0] == INT32_MAX;
    for (int32_t i = 1; i < 256; i++)
        good &= exps[i] >= -1 && exps[i] <= exps[i - 1];
    return good;
}

static const char *check_softmax(const struct check *c)
{
    const struct fv_op_softmax *p = &c->op->u.softmax;
    const char *fault = operands(c, 1, 1);
    if (fault != NULL) return fault;
    const int64_t bytes = (int64_t)p->outer * p->depth;
    REQUIRE(softmax.depth,
            p->outer >= 1 && p->depth >= 1 && bytes <= input(c, 0)->bytes &&
                bytes <= output(c, 0)->bytes,
            "does not fit the tensors");
    REQUIRE(softmax.depth, p->depth <= 8191, "more values than the sum can hold");
    REQUIRE(softmax.table, constant(c, p->table, 1024, 4) && exps_fit(words_at(c, p->table)),
            "the table is outside the file or no exponential");
    *c->word = 13;
    return c->op->rows == p->outer ? NULL : "rows do not match the shape";
}

static const char *check_normalise(const struct check *c)
{
    const struct fv_op_normalise *p = &c->op->u.normalise;
    const char *fault = operands(c, 1, 1);
    if (fault != NULL) return fault;
    const int64_t bytes = (int64_t)p->outer * p->depth;
    REQUIRE(normalise.depth,
            p->outer >= 1 && between(p->depth, 1, 32768) && bytes <= input(c, 0)->bytes &&
                bytes <= output(c, 0)->bytes,
            "does not fit the tensors, or more values than the sum can hold");
    REQUIRE(normalise.zero_in, between(p->zero_in, 0, 255), "the zero point is no byte");
    REQUIRE(normalise.is_signed, between(p->is_signed, 0, 1), "not 0 or 1");
    *c->word = 13;
    return c->op->rows == p->outer ? NULL : "rows do not match the shape";
}

static const char *check_arg_max(const struct check *c)
{
    const struct fv_op_arg_max *p = &c->op->u.arg_max;
    const char *fault = operands(c, 1, 1);
    if (fault != NULL) return fault;
    const int good = between(p->outer, 1, 1 << 24) && between(p->axis, 1, 1 << 24) &&
                     between(p->inner, 1, 1 << 14);
    REQUIRE(arg_max.outer, good && (int64_t)p->outer * p->axis <= input(c, 0)->bytes / p->inner,
            "does not fit the input");
    const int32_t size = output(c, 0)->type == FV_TYPE_I64   ? 8
                         : output(c, 0)->type == FV_TYPE_I32 ? 4
                                                             : 0;
    REQUIRE(arg_max.element_bytes,
            p->element_bytes == size && (int64_t)p->outer * p->inner * size <= output(c, 0)->bytes,
            "does not fit the output");
    *c->word = 13;
    return c->op->rows == p->outer ? NULL : "rows do not match the shape";
}

/* Element-wise conversion of `count` elements in slices of 4096. */
static const char *check_convert(const struct check *c, int32_t count)
{
    static const int32_t size[FV_TYPE_COUNT] = {1, 4, 8, 4};
    const char *fault = operands(c, 1, 1);
    if (fault != NULL) return fault;
    *c->word = 16;
    if (count < 1 || (int64_t)count * size[input(c, 0)->type] > input(c, 0)->bytes)
        return "does not fit the input";
    if ((int64_t)count * size[output(c, 0)->type] > output(c, 0)->bytes)
        return "does not fit the output";
    *c->word = 13;
    return c->op->rows == (count - 1) / 4096 + 1 ? NULL : "rows do not match the count";
}

static const char *check_dequantize(const struct check *c)
{
    const char *fault = check_convert(c, c->op->u.dequantize.count);
    if (fault != NULL) return fault;
    *c->word = 5;
    if (input(c, 0)->type != FV_TYPE_U8 || output(c, 0)->type != FV_TYPE_F32)
        return "not from bytes to floats";
    REQUIRE(dequantize.table, constant(c, c->op->u.dequantize.table, 1024, 4),
            "the table lies outside the file");
    return NULL;
}

static const char *check_quantize(const struct check *c)
{
    const struct fv_op_quantize *p = &c->op->u.quantize;
    const char *fault = check_convert(c, p->count);
    if (fault != NULL) return fault;
    *c->word = 5;
    if (input(c, 0)->type != FV_TYPE_F32 || output(c, 0)->type != FV_TYPE_U8)
        return "not from floats to bytes";
    REQUIRE(quantize.scale, p->scale > 1e-30f && p->scale < 1e30f,
            "the scale is not a positive number");
    REQUIRE(quantize.zero, between(p->zero, 0, 255), "the zero point is not a byte");
    return NULL;
}

static const char *check_cast(const struct check *c)
{
    return check_convert(c, c->op->u.cast.count);
}

static const char *check_matmul(const struct check *c)
{
    const struct fv_op_matmul *p = &c->op->u.matmul;
    const char *fault = operands(c, 2, 1);
    if (fault != NULL) return fault;
    const int32_t dims_a[4] = {p->batch[0], p->batch[1], p->m, p->k},
                  strides_a[4] = {p->a_batch[0], p->a_batch[1], p->a_row, 1};
    const int32_t dims_b[4] = {p->batch[0], p->batch[1], p->k, p->n},
                  strides_b[4] = {p->b_batch[0], p->b_batch[1], p->b_row, p->b_column};
    REQUIRE(matmul.m, walk_fits(dims_a, strides_a, 4, 0, 1, input(c, 0)),
            "the first input does not fit its tensor");
    REQUIRE(matmul.n, walk_fits(dims_b, strides_b, 4, 0, 1, input(c, 1)),
            "the second input does not fit its tensor");
    const int64_t batches = (int64_t)p->batch[0] * p->batch[1],
                  n16 = ((int64_t)p->n + 15) / 16 * 16, k4 = ((int64_t)p->k + 3) / 4;
    REQUIRE(matmul.k, p->k <= 1 << 22, "out of range");
    const int fits = input(c, 0)->type == FV_TYPE_U8 && input(c, 1)->type == FV_TYPE_U8 &&
                     output(c, 0)->type == FV_TYPE_U8;
    REQUIRE(matmul.n, fits && batches * p->m * p->n <= output(c, 0)->bytes,
            "the output does not fit its tensor");
    REQUIRE(matmul.zero_a,
            between(p->zero_a, 0, 255) && between(p->zero_b, 0, 255) &&
                between(p->zero_out, 0, 255),
            "zero points are not bytes");
    REQUIRE(matmul.single_rounding, between(p->single_rounding, 0, 1), "not 0 or 1");
    REQUIRE(matmul.shift, p->single_rounding || between(p->shift, -31, 30),
            "the shift is out of range");
    REQUIRE(matmul.bias, p->bias == 0 || constant(c, p->bias, (int64_t)p->n * 4, 4),
            "the biases lie outside the file");
    *c->word = 14;
    const int64_t sums = p->single_rounding ? n16 * 4 * FV_MODEL_CONV_PIXELS : 0;
    if (scratch_bytes(c) < n16 * (k4 * 4 + 12) + sums) return "scratch is too small";
    *c->word = 13;
    return c->op->rows == batches * (n16 / 16 + p->m) ? NULL : "rows do not match the shape";
}

static int usable(float value)
{
    return (value > 1e-20f && value < 1e20f);
}

static int floats_fit(const struct check *c, int32_t offset, int64_t count)
{
    if (!constant(c, offset, count * 4, 4)) return 0;
    const float *value = (const float *)(const void *)(c->m->base + offset);
    int good = 1;
    for (int64_t i = 0; i < count; i++)
        good &= value[i] > -1e6f && value[i] < 1e6f;
    return good;
}

static const char *check_detection(const struct check *c)
{
    const struct fv_op_detection *p = &c->op->u.detection;
    const char *fault = operands(c, 2, 4);
    if (fault != NULL) return fault;
    REQUIRE(detection.anchors, between(p->anchors, 1, 1 << 17), "out of range");
    REQUIRE(detection.classes, between(p->classes, 1, 4096), "out of range");
    REQUIRE(detection.class_offset, between(p->class_offset, 0, 16), "out of range");
    REQUIRE(detection.max_detections, between(p->max_detections, 1, 4096), "out of range");
    REQUIRE(detection.max_per_anchor, between(p->max_per_anchor, 1, 64), "out of range");
    REQUIRE(detection.per_class, between(p->per_class, 0, 1 << 17), "out of range");
    REQUIRE(detection.score_threshold, p->score_threshold > -1e6f && p->score_threshold < 1e6f,
            "not a number in range");
    REQUIRE(detection.iou_threshold, p->iou_threshold >= 0.0f && p->iou_threshold <= 1.0f,
            "not in [0, 1]");
    REQUIRE(detection.y_scale,
            usable(p->y_scale) && usable(p->x_scale) && usable(p->h_scale) && usable(p->w_scale),
            "a box scale is not a positive number");
    REQUIRE(detection.anchor_data, floats_fit(c, p->anchor_data, (int64_t)p->anchors * 4),
            "anchors are outside the file or no numbers");
    REQUIRE(detection.box_table, floats_fit(c, p->box_table, 256),
            "the table is outside the file or holds no numbers");
    REQUIRE(detection.score_table, floats_fit(c, p->score_table, 256),
            "the table is outside the file or holds no numbers");
    *c->word = 5;
    if (input(c, 0)->bytes < (int64_t)p->anchors * 4) return "boxes do not fit their tensor";
    *c->word = 6;
    if (input(c, 1)->bytes < (int64_t)p->anchors * (p->classes + p->class_offset))
        return "scores do not fit their tensor";
    const int64_t slots = (int64_t)p->max_detections * p->max_per_anchor;
    const int64_t need[4] = {slots * 16, slots * 4, slots * 4, 4};
    for (int32_t i = 0; i < 4; i++) {
        *c->word = 9 + i;
        if (output(c, i)->type != FV_TYPE_F32 || output(c, i)->bytes < need[i])
            return "the output does not fit its tensor";
    }
    *c->word = 14;
    if (scratch_bytes(c) < (int64_t)p->anchors * 32 + slots * 64 + 64)
        return "scratch is too small";
    *c->word = 13;
    return c->op->rows == fv_nn_detection_rows(p) ? NULL : "rows is not what its steps make";
}

const char *fv_model_check_op(const struct fv_model *model, const struct fv_model_op *op,
                              int32_t *word)
{
    static const char *(*const checks[FV_OP_KIND_COUNT])(const struct check *) = {
        [FV_OP_CONV] = check_conv,
        [FV_OP_DEPTHWISE] = check_depthwise,
        [FV_OP_BINARY] = check_binary,
        [FV_OP_POOL] = check_pool,
        [FV_OP_REDUCE] = check_reduce,
        [FV_OP_COPY] = check_copy,
        [FV_OP_FILL] = check_fill,
        [FV_OP_RESIZE] = check_resize,
        [FV_OP_SOFTMAX] = check_softmax,
        [FV_OP_ARG_MAX] = check_arg_max,
        [FV_OP_DEQUANTIZE] = check_dequantize,
        [FV_OP_QUANTIZE] = check_quantize,
        [FV_OP_CAST] = check_cast,
        [FV_OP_BATCH_MATMUL] = check_matmul,
        [FV_OP_DETECTION] = check_detection,
        [FV_OP_NORMALISE] = check_normalise};
    const struct check c = {.m = model, .op = op, .word = word};
    return checks[op->kind](&c);
}

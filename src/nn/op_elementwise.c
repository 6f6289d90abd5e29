/* Operators that treat elements one by one: arithmetic with broadcasting, moves of bytes,
 * conversions. */
#include <string.h>

#include "kernels/nn_requantize.h"
#include "nn/copy.h"
#include "nn/run.h"

enum { CHUNK = 4096, FILL_CHUNK = 16384, SPREAD = 256 };

/* Byte offsets of row `row` of a six-axis walk, for operands with the strides given; the last axis
 * is the row. */
static void row_offsets(const int32_t dims[6], int32_t row, const int32_t *const *strides,
                        ptrdiff_t *offsets, int count)
{
    for (int i = 0; i < count; i++)
        offsets[i] = 0;
    for (int axis = 4; axis >= 0; --axis) {
        const int32_t at = row % dims[axis];
        row /= dims[axis];
        for (int i = 0; i < count; i++)
            offsets[i] += (ptrdiff_t)at * strides[i][axis];
    }
}

static int32_t binary_value(const struct fv_op_binary *p, int32_t a, int32_t b)
{
    if (p->function == FV_BINARY_MAX) return a > b ? a : b;
    if (p->function == FV_BINARY_MIN) return a < b ? a : b;
    const int32_t x = a - p->zero_a, y = b - p->zero_b;
    int32_t value;
    if (p->function == FV_BINARY_MUL) {
        value = fv_nn_requantize(x * y, p->m_out, p->s_out);
    } else if (p->function == FV_BINARY_PRELU) {
        value = x >= 0 ? fv_nn_requantize(x, p->m_a, p->s_a)
                       : fv_nn_requantize(x * y, p->m_out, p->s_out);
    } else {
        const int32_t u = fv_nn_requantize(x * (1 << 20), p->m_a, p->s_a);
        const int32_t v = fv_nn_requantize(y * (1 << 20), p->m_b, p->s_b);
        const uint32_t sum =
            p->function == FV_BINARY_ADD ? (uint32_t)u + (uint32_t)v : (uint32_t)u - (uint32_t)v;
        value = fv_nn_requantize((int32_t)sum, p->m_out, p->s_out);
    }
    return fv_nn_output(value, p->zero_out, p->act_min, p->act_max);
}

static struct fv_nn_add add_of(const struct fv_op_binary *p)
{
    return (struct fv_nn_add){.zero_a = p->zero_a,
                              .zero_b = p->zero_b,
                              .zero_out = p->zero_out,
                              .m_a = p->m_a,
                              .s_a = p->s_a,
                              .m_b = p->m_b,
                              .s_b = p->s_b,
                              .m_out = p->m_out,
                              .s_out = p->s_out,
                              .act_min = p->act_min,
                              .act_max = p->act_max};
}

/* The kernel for rows that are packed, but for the larger and smaller of two. */
static fv_k_nn_add_u8_fn *row_kernel(const struct fv_kernels *kernels, int32_t function)
{
    switch (function) {
    case FV_BINARY_ADD:
        return kernels->nn_add_u8;
    case FV_BINARY_SUB:
        return kernels->nn_sub_u8;
    case FV_BINARY_MUL:
        return kernels->nn_mul_u8;
    case FV_BINARY_PRELU:
        return kernels->nn_prelu_u8;
    default:
        return NULL;
    }
}

/* `rows` packed rows, which axis 4 tells apart. */
static void packed_rows(const struct fv_op_binary *p, const struct fv_kernels *kernels,
                        const struct fv_nn_add *add, const uint8_t *a, const uint8_t *b,
                        uint8_t *out, const uint8_t *table, int32_t rows)
{
    const int32_t count = p->dims[5];
    fv_k_nn_add_u8_fn *kernel = row_kernel(kernels, p->function);
    if (kernel != NULL) kernel(add, a, p->a[4], b, p->b[4], out, p->out[4], rows, count);
    for (int32_t r = 0; r < rows; r++, out += p->out[4]) {
        if (p->function == FV_BINARY_MAX)
            kernels->nn_max_u8(a + r * (ptrdiff_t)p->a[4], b + r * (ptrdiff_t)p->b[4], out, count);
        if (p->function == FV_BINARY_MIN)
            kernels->nn_min_u8(a + r * (ptrdiff_t)p->a[4], b + r * (ptrdiff_t)p->b[4], out, count);
        if (table != NULL) kernels->nn_table_u8(table, out, out, count);
    }
}

/* One row, of which one operand is the same byte for all elements. */
static void spread_row(const struct fv_op_binary *p, const struct fv_kernels *kernels,
                       const struct fv_nn_add *add, const uint8_t *a, const uint8_t *b,
                       uint8_t *out, const uint8_t *table)
{
    uint8_t same[SPREAD];
    struct fv_op_binary piece = *p;
    const int32_t count = p->dims[5], most = count < SPREAD ? count : SPREAD;
    const int is_a = p->a[5] == 0;
    memset(same, is_a ? *a : *b, (size_t)most);
    for (int32_t i = 0; i < count; i += SPREAD) {
        piece.dims[5] = count - i < SPREAD ? count - i : SPREAD;
        packed_rows(&piece, kernels, add, is_a ? same : a + i, is_a ? b + i : same, out + i, table,
                    1);
    }
}

/* Packed elements; eight are read before any is written, so that they wait for nothing. */
static void lookup_packed(const uint8_t *table, const uint8_t *a, const uint8_t *b, uint8_t *out,
                          int32_t count)
{
    int32_t i = 0;
    for (; i + 8 <= count; i += 8) {
        uint8_t found[8];
#pragma GCC unroll 8
        for (int j = 0; j < 8; j++)
            found[j] = table[256 * a[i + j] + b[i + j]];
#pragma GCC unroll 8
        for (int j = 0; j < 8; j++)
            out[i + j] = found[j];
    }
    for (; i < count; i++)
        out[i] = table[256 * a[i] + b[i]];
}

/* Rows of a function that a table holds, which axis 4 tells apart. */
static void lookup_rows(const struct fv_op_binary *p, const uint8_t *table, const uint8_t *a,
                        const uint8_t *b, uint8_t *out, int32_t rows)
{
    const ptrdiff_t step_a = p->a[5], step_b = p->b[5], step_out = p->out[5];
    const ptrdiff_t next_a = p->a[4], next_b = p->b[4], next_out = p->out[4];
    const int32_t count = p->dims[5];
    const int packed = step_a == 1 && step_b == 1 && step_out == 1;
    for (int32_t r = 0; r < rows; r++, a += next_a, b += next_b, out += next_out) {
        if (packed) lookup_packed(table, a, b, out, count);
        for (ptrdiff_t i = 0; !packed && i < count; i++)
            out[i * step_out] = table[256 * a[i * step_a] + b[i * step_b]];
    }
}

/* From row `row` to the end of axis 4, at most to row `end`: rows that lie one stride apart. */
static int32_t rows_of_axis(const struct fv_op_binary *p, int32_t row, int32_t end)
{
    const int32_t left = p->dims[4] - row % p->dims[4];
    return left < end - row ? left : end - row;
}

static void slopes_rows(const struct fv_nn_call *call, int32_t begin, int32_t end)
{
    const struct fv_op_binary *p = &call->op->u.binary;
    const int32_t *strides[2] = {p->a, p->out};
    const struct fv_nn_slopes slopes = {
        .zero_in = p->zero_a,
        .zero_out = p->zero_out,
        .slopes = (const float *)(const void *)(call->model->base + p->table)};
    for (int32_t row = begin, rows; row < end; row += rows) {
        ptrdiff_t at[2];
        rows = rows_of_axis(p, row, end);
        row_offsets(p->dims, row, strides, at, 2);
        call->kernels->nn_slopes_u8(&slopes, call->in[0] + at[0], p->a[4], call->out[0] + at[1],
                                    p->out[4], rows, p->dims[5]);
    }
}

void fv_nn_op_binary(const struct fv_nn_call *call, int32_t begin, int32_t end)
{
    const struct fv_op_binary *p = &call->op->u.binary;
    if (p->function == FV_BINARY_SLOPES) {
        slopes_rows(call, begin, end);
        return;
    }
    const int32_t *strides[3] = {p->a, p->b, p->out};
    const int32_t count = p->dims[5];
    const int packed = p->a[5] == 1 && p->b[5] == 1 && p->out[5] == 1;
    const int spread =
        p->out[5] == 1 && (p->a[5] == 1 ? p->b[5] == 0 : p->a[5] == 0 && p->b[5] == 1);
    const struct fv_nn_add add = add_of(p);
    const uint8_t *table = p->table == 0 ? NULL : call->model->base + p->table;
    const int looked_up = p->function == FV_BINARY_TABLE;
    for (int32_t row = begin, rows; row < end; row += rows) {
        ptrdiff_t at[3];
        row_offsets(p->dims, row, strides, at, 3);
        const uint8_t *a = call->in[0] + at[0], *b = call->in[1] + at[1];
        uint8_t *out = call->out[0] + at[2];
        rows = looked_up || packed ? rows_of_axis(p, row, end) : 1;
        if (looked_up) {
            lookup_rows(p, table, a, b, out, rows);
            continue;
        }
        if (packed) {
            packed_rows(p, call->kernels, &add, a, b, out, table, rows);
            continue;
        }
        if (spread) {
            spread_row(p, call->kernels, &add, a, b, out, table);
            continue;
        }
        for (int32_t i = 0; i < count; i++) {
            const int32_t v = binary_value(p, a[(ptrdiff_t)i * p->a[5]], b[(ptrdiff_t)i * p->b[5]]);
            out[(ptrdiff_t)i * p->out[5]] = table == NULL ? (uint8_t)v : table[v];
        }
    }
}

static void copy_row(const struct fv_op_copy *p, const uint8_t *table,
                     const struct fv_kernels *kernels, const uint8_t *src, uint8_t *dst)
{
    const int32_t count = p->dims[5], size = p->element_bytes;
    if (p->src[5] == size && p->dst[5] == size) {
        kernels->nn_table_u8(table, src, dst, count);
    } else if (size == 1) {
        for (int32_t i = 0; i < count; i++, src += p->src[5], dst += p->dst[5])
            *dst = table == NULL ? *src : table[*src];
    } else {
        for (int32_t i = 0; i < count; i++, src += p->src[5], dst += p->dst[5])
            fv_nn_copy(dst, src, (size_t)size);
    }
}

/* Rows of packed bytes, each from `step_in` past the one before. */
static void copy_packed(uint8_t *dst, ptrdiff_t step_out, const uint8_t *src, ptrdiff_t step_in,
                        size_t bytes, int32_t rows)
{
    for (int32_t i = 0; i < rows; i++, src += step_in, dst += step_out)
        fv_nn_copy(dst, src, bytes);
}

/* Rows that share all axes but the last two form a matrix; when bytes run along opposite axes it is
 * a transposition. */
static int is_transpose(const struct fv_op_copy *p)
{
    return p->element_bytes == 1 && p->table == 0 && p->src[4] == 1 && p->dst[5] == 1 &&
           p->src[5] > 1 && p->dst[4] > 1;
}

void fv_nn_op_copy(const struct fv_nn_call *call, int32_t begin, int32_t end)
{
    const struct fv_op_copy *p = &call->op->u.copy;
    const int32_t *strides[2] = {p->src, p->dst};
    const uint8_t *table = p->table == 0 ? NULL : call->model->base + p->table;
    const int transpose = is_transpose(p);
    const int packed =
        table == NULL && p->src[5] == p->element_bytes && p->dst[5] == p->element_bytes;
    const size_t bytes = (size_t)p->dims[5] * (size_t)p->element_bytes;
    for (int32_t row = begin, rows; row < end;
         row += rows) { /* rows up to the end of axis 4 at once */
        ptrdiff_t at[2];
        row_offsets(p->dims, row, strides, at, 2);
        const uint8_t *src = call->in[0] + p->src_first + at[0];
        uint8_t *dst = call->out[0] + p->dst_first + at[1];
        const int32_t left = p->dims[4] - row % p->dims[4];
        rows = left < end - row ? left : end - row;
        if (transpose) {
            call->kernels->nn_transpose_u8(src, p->src[5], dst, p->dst[4], p->dims[5], rows);
            continue;
        }
        if (packed) {
            copy_packed(dst, p->dst[4], src, p->src[4], bytes, rows);
            continue;
        }
        for (int32_t i = 0; i < rows; i++, src += p->src[4], dst += p->dst[4])
            copy_row(p, table, call->kernels, src, dst);
    }
}

void fv_nn_op_fill(const struct fv_nn_call *call, int32_t begin, int32_t end)
{
    const struct fv_op_fill *p = &call->op->u.fill;
    const int64_t first = (int64_t)begin * FILL_CHUNK, past = (int64_t)end * FILL_CHUNK;
    const int64_t last = past < p->bytes ? past : p->bytes;
    memset(call->out[0] + first, p->value, (size_t)(last - first));
}

static int32_t chunk_end(int32_t end, int32_t count)
{
    return (int64_t)end * CHUNK < count ? end * CHUNK : count;
}

void fv_nn_op_dequantize(const struct fv_nn_call *call, int32_t begin, int32_t end)
{
    const struct fv_op_dequantize *p = &call->op->u.dequantize;
    const float *table = (const float *)(const void *)(call->model->base + p->table);
    float *out = (float *)(void *)call->out[0];
    const int32_t last = chunk_end(end, p->count);
    for (int32_t i = begin * CHUNK; i < last; i++)
        out[i] = table[call->in[0][i]];
}

/* Nearest integer, halves away from zero, cut to [-512, 512]: all beyond ends at 0 or 255 whatever
 * the zero point. The size is cut as an integer, which a compiler can do for several values at
 * once, and which takes what is no number as well. */
static inline int32_t round_away(float value)
{
    const int32_t most = 0x44000000; /* the bits of 512.0f */
    int32_t bits;
    memcpy(&bits, &value, sizeof bits);
    int32_t size = bits & INT32_MAX;
    const int32_t sign = bits >> 31;
    size = size < most ? size : most;
    float whole;
    memcpy(&whole, &size, sizeof whole);
    const int32_t rounded = ((int32_t)(whole * 2.0f) + 1) >> 1;
    return (rounded ^ sign) - sign;
}

void fv_nn_op_quantize(const struct fv_nn_call *call, int32_t begin, int32_t end)
{
    const struct fv_op_quantize *p = &call->op->u.quantize;
    const float *in = (const float *)(const void *)call->in[0];
    uint8_t *restrict out = call->out[0];
    const float scale = p->scale;
    const int32_t last = chunk_end(end, p->count), zero = p->zero;
    for (int32_t i = begin * CHUNK; i < last; i++) {
        const int32_t value = round_away(in[i] / scale) + zero;
        out[i] = (uint8_t)(value < 0 ? 0 : value > 255 ? 255 : value);
    }
}

static int64_t load_integer(const struct fv_model_tensor *t, const uint8_t *in, int32_t i)
{
    if (t->type == FV_TYPE_I32) return ((const int32_t *)(const void *)in)[i];
    if (t->type == FV_TYPE_I64) return ((const int64_t *)(const void *)in)[i];
    if (t->type == FV_TYPE_U8) return in[i] - ((t->flags & FV_TENSOR_SIGNED) != 0 ? 128 : 0);
    const float value = ((const float *)(const void *)in)[i];
    if (!(value < 2147483520.0f)) return INT32_MAX;
    return value < -2147483520.0f ? INT32_MIN : (int64_t)value;
}

void fv_nn_op_cast(const struct fv_nn_call *call, int32_t begin, int32_t end)
{
    const struct fv_model_tensor *from = &call->model->tensors[call->op->inputs[0]];
    const struct fv_model_tensor *to = &call->model->tensors[call->op->outputs[0]];
    const int32_t last = chunk_end(end, call->op->u.cast.count);
    for (int32_t i = begin * CHUNK; i < last; i++) {
        const int64_t value = load_integer(from, call->in[0], i);
        if (to->type == FV_TYPE_I32)
            ((int32_t *)(void *)call->out[0])[i] = (int32_t)value;
        else if (to->type == FV_TYPE_I64)
            ((int64_t *)(void *)call->out[0])[i] = value;
        else if (to->type == FV_TYPE_F32)
            ((float *)(void *)call->out[0])[i] = (float)value;
        else
            call->out[0][i] = (uint8_t)(value + ((to->flags & FV_TENSOR_SIGNED) != 0 ? 128 : 0));
    }
}

/* Convolutions as matrix products: the inputs of an output pixel are a row of k bytes. A 1x1
 * convolution reads its rows where they lie; others gather FV_MODEL_CONV_PIXELS rows at a time. */
#include <string.h>

#include "kernels/nn_requantize.h"
#include "nn/conv.h"
#include "nn/copy.h"
#include "nn/real.h"

struct fv_nn_gemm fv_nn_gemm_of(const struct fv_model *model, const struct fv_model_op *op)
{
    const struct fv_op_conv *c = &op->u.conv;
    const uint8_t *base = model->base;
    return (struct fv_nn_gemm){
        .k = c->k,
        .k4 = c->k4,
        .n = c->image.out_c,
        .weights = (const int8_t *)(base + c->weights),
        .bias = (const int32_t *)(const void *)(base + c->bias),
        .multiplier = (const int32_t *)(const void *)(base + c->multiplier),
        .shift = (const int32_t *)(const void *)(base + c->shift),
        .table = c->table == 0 ? NULL : base + c->table,
        .zero_out = c->zero_out,
        .act_min = c->act_min,
        .act_max = c->act_max,
        .row_sum_factor = c->row_sum_factor,
        .real = fv_nn_real_of(model, op),
    };
}

/* Fill in pieces of 16 bytes, as fv_nn_copy_pieces copies. */
static inline void fill_run(uint8_t *to, uint8_t value, int32_t bytes)
{
    for (int32_t i = 0; i < bytes; i += 16)
        memset(to + i, value, 16);
}

static struct fv_nn_gathering gathering_of(const struct fv_nn_call *call)
{
    const struct fv_op_conv *c = &call->op->u.conv;
    const struct fv_op_image *im = &c->image;
    const struct fv_op_window *w = &c->window;
    struct fv_nn_gathering g = {.call = call, .c = c};
    const int32_t room = im->in_w - w->kw + w->pad_left; /* stride_x x for the last that fits */
    if (w->dilation_x == 1 && im->in_stride == im->in_c && room >= 0) {
        g.begin = (w->pad_left + w->stride_x - 1) / w->stride_x;
        g.end = room / w->stride_x + 1;
    }
    return g;
}

/* One kernel row of one output pixel at a side or with gaps: kw pixels of in_c bytes, zero_in
 * outside the line. Columns left of the image, inside, and right of it follow each other. */
static void gather_run(const struct fv_nn_gathering *g, const uint8_t *line, int32_t ix,
                       uint8_t *to)
{
    const struct fv_op_image *im = &g->c->image;
    const struct fv_op_window *w = &g->c->window;
    int32_t kx = 0;
    for (; kx < w->kw && ix < 0; kx++, ix += w->dilation_x)
        ;
    fill_run(to, g->c->zero_in, kx * im->in_c);
    to += kx * im->in_c;
    if (w->dilation_x == 1 && im->in_stride == im->in_c && kx < w->kw && ix < im->in_w) {
        const int32_t left = w->kw - kx, some = left < im->in_w - ix ? left : im->in_w - ix;
        fv_nn_copy_pieces(to, line + (ptrdiff_t)ix * im->in_stride, some * im->in_c);
        to += some * im->in_c;
        kx += some;
        ix += some;
    }
    for (; kx < w->kw && ix < im->in_w; kx++, ix += w->dilation_x, to += im->in_c)
        fv_nn_copy_pieces(to, line + (ptrdiff_t)ix * im->in_stride, im->in_c);
    fill_run(to, g->c->zero_in, (w->kw - kx) * im->in_c);
}

/* Kernel row ky of `count` neighbouring output pixels of one row, the first at x. */
static void gather_line(const struct fv_nn_gathering *g, const uint8_t *image, int32_t y, int32_t x,
                        int32_t ky, int32_t count, uint8_t *rows, ptrdiff_t pitch)
{
    const struct fv_op_image *im = &g->c->image;
    const struct fv_op_window *w = &g->c->window;
    const int32_t run = w->kw * im->in_c, iy = y * w->stride_y - w->pad_top + ky * w->dilation_y;
    const uint8_t *line =
        iy < 0 || iy >= im->in_h ? NULL : image + (ptrdiff_t)iy * im->in_w * im->in_stride;
    uint8_t *to = rows + (ptrdiff_t)ky * run;
    for (int32_t i = 0; line == NULL && i < count; i++)
        fill_run(to + i * pitch, g->c->zero_in, run);
    for (const int32_t end = x + count; line != NULL && x < end;) {
        const int32_t ix = x * w->stride_x - w->pad_left;
        int32_t some = 1;
        if (x >= g->begin && x < g->end) {
            some = (end < g->end ? end : g->end) - x;
            g->call->kernels->nn_gather_u8(line + (ptrdiff_t)ix * im->in_stride,
                                           (ptrdiff_t)w->stride_x * im->in_stride, to, pitch, run,
                                           some);
        } else {
            gather_run(g, line, ix, to);
        }
        x += some;
        to += some * pitch;
    }
}

void fv_nn_gather(const struct fv_nn_gathering *g, int32_t row, int32_t x, int32_t count,
                  uint8_t *rows, ptrdiff_t pitch)
{
    const struct fv_op_image *im = &g->c->image;
    const int32_t y = row % im->out_h, n = row / im->out_h;
    const uint8_t *image = g->call->in[0] + (ptrdiff_t)n * im->in_h * im->in_w * im->in_stride;
    for (int32_t ky = 0; ky < g->c->window.kh; ky++)
        gather_line(g, image, y, x, ky, count, rows, pitch);
}

/* Of pixels from `first` on, in as many rows of the image as they take. */
static void gather(const struct fv_nn_gathering *g, int32_t first, int32_t count, uint8_t *rows,
                   ptrdiff_t pitch)
{
    const int32_t width = g->c->image.out_w;
    for (int32_t x = first % width, row = first / width, part; count > 0; count -= part, row++) {
        part = width - x < count ? width - x : count;
        fv_nn_gather(g, row, x, part, rows, pitch);
        rows += part * pitch;
        x = 0;
    }
}

int32_t fv_nn_scale_once(int32_t acc, int32_t low, int32_t high)
{
    const uint64_t bits = (uint64_t)(uint32_t)high << 32 | (uint32_t)low;
    double scale;
    memcpy(&scale, &bits, sizeof scale);
    double value = (double)acc * scale;
    if (!(value < 100000.0)) value = 100000.0; /* also when not a number */
    if (value < -100000.0) value = -100000.0;
    const int32_t whole = (int32_t)value;
    const double rest = value - (double)whole;
    return whole + (rest >= 0.5 ? 1 : 0) - (rest <= -0.5 ? 1 : 0);
}

static void round_once(const struct fv_op_conv *c, const struct fv_nn_gemm *gemm,
                       const int32_t *acc, uint8_t *out)
{
    for (int32_t o = 0; o < gemm->n; o++) {
        const int32_t scaled = fv_nn_scale_once(acc[o], gemm->multiplier[o], gemm->shift[o]);
        const uint8_t value = (uint8_t)fv_nn_clamp(scaled + c->zero_out, c->act_min, c->act_max);
        out[o] = gemm->table == NULL ? value : gemm->table[value];
    }
}

/* `count` pixels from `first` on, whose inputs lie in `rows`; `out` is pixel `first`'s. */
static void fully_connected(const struct fv_nn_call *call, const struct fv_nn_gemm *gemm,
                            const uint8_t *rows, ptrdiff_t pitch, uint8_t *out, int32_t count)
{
    const struct fv_op_conv *c = &call->op->u.conv;
    int32_t *acc = (int32_t *)(void *)call->scratch;
    const int32_t n16 = (gemm->n + 15) / 16 * 16;
    call->kernels->nn_gemm_i32(gemm, rows, pitch, acc, n16, count);
    for (int32_t i = 0; i < count; i++, acc += n16, out += c->image.out_stride)
        round_once(c, gemm, acc, out);
}

/* Part `part` of the products of a row: the sums so far stand in scratch and are the biases of what
 * is added, by blocks of 16 channels. */
static void connect_part(const struct fv_nn_call *call, const struct fv_nn_gemm *gemm, int32_t row,
                         int32_t part)
{
    const struct fv_op_conv *c = &call->op->u.conv;
    const int32_t first = (int32_t)fv_nn_part_first(c->k4, part, c->parts),
                  end = (int32_t)fv_nn_part_first(c->k4, part + 1, c->parts);
    const uint8_t *in = call->in[0] + (ptrdiff_t)row * c->image.in_stride + (ptrdiff_t)first * 4;
    int32_t *sums = (int32_t *)(void *)call->scratch;
    if (part == 0) memcpy(sums, gemm->bias, (size_t)(gemm->n + 15) / 16 * 64);
    for (int32_t channel = 0; channel < gemm->n; channel += 16) {
        struct fv_nn_gemm some = *gemm;
        some.k = (end * 4 < c->k ? end * 4 : c->k) - first * 4;
        some.k4 = end - first;
        some.n = gemm->n - channel < 16 ? gemm->n - channel : 16;
        some.weights += ((ptrdiff_t)channel / 16 * c->k4 + first) * 64;
        _Alignas(64) int32_t bias[16];
        memcpy(bias, sums + channel, sizeof bias);
        some.bias = bias;
        call->kernels->nn_gemm_i32(&some, in, c->image.in_stride, sums + channel, 16, 1);
    }
    if (part < c->parts - 1) return;
    round_once(c, gemm, sums,
               call->out[0] + c->out_first +
                   (ptrdiff_t)row * (c->out_row != 0 ? c->out_row : c->image.out_stride));
}

static int is_pointwise(const struct fv_op_conv *c)
{
    const struct fv_op_window *w = &c->window;
    return w->kh == 1 && w->kw == 1 && w->stride_x == 1 && w->stride_y == 1 && w->pad_top == 0 &&
           w->pad_left == 0 && c->image.in_h == c->image.out_h && c->image.in_w == c->image.out_w;
}

/* Multiply `count` gathered rows, the first that of pixel `first`; in pieces that end with the
 * image's rows where those have gaps. */
static void multiply(const struct fv_nn_call *call, const struct fv_nn_gemm *gemm,
                     const uint8_t *rows, ptrdiff_t pitch, int32_t first, int32_t count)
{
    const struct fv_op_conv *c = &call->op->u.conv;
    const ptrdiff_t stride = c->image.out_stride,
                    row = c->out_row != 0 ? c->out_row : c->image.out_w * stride;
    while (count > 0) {
        const int32_t y = first / c->image.out_w, x = first % c->image.out_w,
                      left = c->image.out_w - x;
        const int32_t part = c->out_row == 0 || count < left ? count : left;
        uint8_t *out = call->out[0] + c->out_first + y * row + x * stride;
        if (c->single_rounding)
            fully_connected(call, gemm, rows, pitch, out, part);
        else
            call->kernels->nn_gemm_u8(gemm, rows, pitch, out, stride, part);
        rows += part * pitch;
        first += part;
        count -= part;
    }
}

/* What is left in the scratch depends on the kernel set, and the state of a run must not
 * (lock-step). */
static void clear_scratch(const struct fv_nn_call *call)
{
    memset(call->scratch, 0, (size_t)call->model->tensors[call->op->scratch].bytes);
}

void fv_nn_op_conv(const struct fv_nn_call *call, int32_t begin, int32_t end)
{
    const struct fv_op_conv *c = &call->op->u.conv;
    const struct fv_nn_gemm gemm = fv_nn_gemm_of(call->model, call->op);
    const int32_t first = begin * c->image.out_w, last = end * c->image.out_w;
    const ptrdiff_t pitch = (c->k4 * 4 + 15 + 63) / 64 * 64; /* room for fv_nn_copy_pieces */
    for (int32_t row = begin; c->parts > 1 && row < end; row++)
        connect_part(call, &gemm, row / c->parts, row % c->parts);
    if (c->parts > 1) return;
    if (is_pointwise(c)) {
        const ptrdiff_t step = c->image.in_stride;
        const int32_t most = c->single_rounding ? FV_MODEL_CONV_PIXELS
                                                : last - first; /* the scratch holds this number */
        for (int32_t p = first; p < last; p += most) {
            multiply(call, &gemm, call->in[0] + p * step, step, p,
                     last - p < most ? last - p : most);
        }
        return;
    }
    const struct fv_nn_gathering g = gathering_of(call);
    if (!fv_nn_conv_apart(&g, &gemm, begin, end, pitch)) {
        for (int32_t p = first; p < last; p += FV_MODEL_CONV_PIXELS) {
            const int32_t count = last - p < FV_MODEL_CONV_PIXELS ? last - p : FV_MODEL_CONV_PIXELS;
            gather(&g, p, count, call->scratch, pitch);
            multiply(call, &gemm, call->scratch, pitch, p, count);
        }
    }
    clear_scratch(call);
}

struct fv_nn_depthwise fv_nn_depthwise_of(const struct fv_model *model,
                                          const struct fv_model_op *op)
{
    const struct fv_op_depthwise *o = &op->u.depthwise;
    const struct fv_op_image *im = &o->image;
    const struct fv_op_window *w = &o->window;
    const uint8_t *base = model->base;
    return (struct fv_nn_depthwise){
        .in_h = im->in_h,
        .in_w = im->in_w,
        .channels = im->in_c,
        .in_stride = im->in_stride,
        .out_w = im->out_w,
        .out_stride = im->out_stride,
        .kh = w->kh,
        .kw = w->kw,
        .stride_y = w->stride_y,
        .stride_x = w->stride_x,
        .dilation_y = w->dilation_y,
        .dilation_x = w->dilation_x,
        .pad_top = w->pad_top,
        .pad_left = w->pad_left,
        .planes = o->planes,
        .c16 = o->c16,
        .weights = (const int8_t *)(base + o->weights),
        .bias = (const int32_t *)(const void *)(base + o->bias),
        .multiplier = (const int32_t *)(const void *)(base + o->multiplier),
        .shift = (const int32_t *)(const void *)(base + o->shift),
        .table = o->table == 0 ? NULL : base + o->table,
        .zero_in = o->zero_in,
        .zero_out = o->zero_out,
        .act_min = o->act_min,
        .act_max = o->act_max,
        .real = fv_nn_real_of(model, op),
    };
}

void fv_nn_op_depthwise(const struct fv_nn_call *call, int32_t begin, int32_t end)
{
    const struct fv_nn_depthwise d = fv_nn_depthwise_of(call->model, call->op);
    const struct fv_op_image *im = &call->op->u.depthwise.image;
    for (int32_t row = begin; row < end;) { /* image by image of the batch */
        const int32_t first = row % im->out_h, left = im->out_h - first,
                      rows = left < end - row ? left : end - row;
        const uint8_t *image =
            call->in[0] + (ptrdiff_t)(row / im->out_h) * im->in_h * im->in_w * im->in_stride;
        uint8_t *out = call->out[0] + (ptrdiff_t)row * im->out_w * im->out_stride;
        call->kernels->nn_depthwise_u8(&d, image, out, first, first + rows, call->scratch);
        row += rows;
    }
    clear_scratch(call);
}

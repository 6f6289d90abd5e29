/* Convolutions whose product reads the inputs where they lie: of output pixels whose kernel lies
 * inside the image, groups of four inputs lie at the same distances from the kernel's corner. The
 * rows of other pixels are gathered. */
#include <string.h>

#include "nn/conv.h"

enum { PIXELS = 144, BORDERS_LEAST = 6 };

/* Pixels that wait for one product. */
struct batch {
    const struct fv_nn_call *call;
    struct fv_nn_gemm gemm;
    int32_t *offsets;
    int32_t count, most;
    const uint8_t *in[PIXELS];
    uint8_t *out[PIXELS];
};

/* Pixels inside, and pixels at borders with room for their rows. */
struct apart {
    const struct fv_nn_gathering *g;
    struct batch inside, borders;
    int32_t begin_x, end_x, begin_y, end_y; /* output pixels whose kernel lies inside the image */
    uint8_t *rows;
    ptrdiff_t pitch;
};

static void flush(struct batch *b)
{
    if (b->count > 0) b->call->kernels->nn_apart_u8(&b->gemm, b->in, b->offsets, b->out, b->count);
    b->count = 0;
}

/* How many of `left` pixels there is room for, at least one. */
static int32_t room_of(struct batch *b, int32_t left)
{
    if (b->count == b->most) flush(b);
    return left < b->most - b->count ? left : b->most - b->count;
}

/* Output pixels of one axis whose kernel lies inside the image: [begin, end), none where end is not
 * larger. */
static void inside_of(int32_t in, int32_t out, int32_t span, int32_t stride, int32_t pad,
                      int32_t *begin, int32_t *end)
{
    const int32_t room = in - span + pad, first = (pad + stride - 1) / stride;
    const int32_t past = room < 0 ? 0 : room / stride + 1;
    *end = past < out ? past : out;
    *begin = first < *end ? first : *end;
    if (*begin < 0) *begin = 0;
}

/* Weights of 16 channels, from k on, four of each, of which `used` count: those of a group, or the
 * last ones of it and the first of the next. Words are little-endian, as the file's numbers are. */
static void four_weights(const struct fv_nn_gemm *gemm, int32_t block, int32_t k, int32_t used,
                         uint32_t to[16])
{
    uint32_t low[16], high[16] = {0};
    const int8_t *from = gemm->weights + ((ptrdiff_t)block * gemm->k4 + k / 4) * 64;
    const int32_t bits = k % 4 * 8;
    const uint32_t mask = used < 4 ? (UINT32_C(1) << used * 8) - 1 : UINT32_MAX;
    memcpy(low, from, sizeof low);
    if (bits > 0 && k / 4 + 1 < gemm->k4) memcpy(high, from + 64, sizeof high);
    for (int32_t c = 0; c < 16; c++)
        to[c] = (uint32_t)(((uint64_t)high[c] << 32 | low[c]) >> bits) & mask;
}

/* The weights of each run from a new group on, as its inputs begin there. */
static void pad_weights(const struct fv_nn_gemm *gemm, int32_t run, uint8_t *to)
{
    for (int32_t block = 0; block * 16 < gemm->n; block++) {
        for (int32_t k = 0; k < gemm->k; k += run) {
            for (int32_t i = 0; i < run; i += 4, to += 64) {
                uint32_t words[16];
                four_weights(gemm, block, k + i, run - i, words);
                memcpy(to, words, sizeof words);
            }
        }
    }
}

/* Where each group of inputs lies, from the kernel's corner on: runs of `taps` pixels. */
static void set_offsets(const struct fv_op_conv *c, int32_t taps, int32_t *to)
{
    const struct fv_op_window *w = &c->window;
    const int32_t line = c->image.in_w * c->image.in_stride, run = taps * c->image.in_c;
    for (int32_t ky = 0; ky < w->kh; ky++) {
        for (int32_t kx = 0; kx < w->kw; kx += taps) {
            const int32_t at = ky * w->dilation_y * line + kx * w->dilation_x * c->image.in_stride;
            for (int32_t i = 0; i < run; i += 4)
                *to++ = at + i;
        }
    }
}

/* Whether there are output pixels whose kernel lies inside the image: then distances in it are
 * smaller than the image. */
static int find_inside(struct apart *a, const struct fv_op_conv *c)
{
    const struct fv_op_window *w = &c->window;
    const struct fv_op_image *im = &c->image;
    inside_of(im->in_w, im->out_w, (w->kw - 1) * w->dilation_x + 1, w->stride_x, w->pad_left,
              &a->begin_x, &a->end_x);
    inside_of(im->in_h, im->out_h, (w->kh - 1) * w->dilation_y + 1, w->stride_y, w->pad_top,
              &a->begin_y, &a->end_y);
    return a->begin_x < a->end_x && a->begin_y < a->end_y;
}

/* Cut the scratch into what is needed; 0 where it is too small, or where padding costs too much. */
static int init_apart(struct apart *a, const struct fv_nn_gathering *g,
                      const struct fv_nn_gemm *gemm, ptrdiff_t pitch)
{
    const struct fv_nn_call *call = g->call;
    const struct fv_op_window *w = &g->c->window;
    const struct fv_op_image *im = &g->c->image;
    const int32_t taps = w->dilation_x == 1 && im->in_stride == im->in_c ? w->kw : 1,
                  run = taps * im->in_c, k4 = w->kh * (w->kw / taps) * ((run + 3) / 4);
    const int padded = run % 4 != 0 && run != gemm->k;
    const int64_t weights = padded ? (int64_t)(gemm->n + 15) / 16 * 64 * k4 : 0,
                  used = weights + 4 * ((int64_t)k4 + gemm->k4);
    const int64_t room = (call->model->tensors[call->op->scratch].bytes - used - 64) / pitch;
    if (k4 > gemm->k4 * 3 / 2 || room < BORDERS_LEAST) return 0;
    a->g = g;
    a->pitch = pitch;
    a->inside.call = a->borders.call = call;
    a->inside.gemm = a->borders.gemm = *gemm;
    a->inside.count = a->borders.count = 0;
    a->inside.most = PIXELS;
    a->borders.most = room < PIXELS ? (int32_t)room : PIXELS;
    a->inside.offsets = (int32_t *)(void *)(call->scratch + weights);
    a->borders.offsets = a->inside.offsets + k4;
    a->rows = (uint8_t *)(a->borders.offsets + gemm->k4);
    set_offsets(g->c, taps, a->inside.offsets);
    for (int32_t i = 0; i < gemm->k4; i++)
        a->borders.offsets[i] = 4 * i;
    if (padded) {
        pad_weights(gemm, run, call->scratch);
        a->inside.gemm.weights = (const int8_t *)call->scratch;
        a->inside.gemm.k4 = k4;
    }
    return 1;
}

/* `count` pixels of output row `row`, from column x on, whose rows are gathered. */
static void add_borders(struct apart *a, int32_t row, int32_t x, int32_t count, uint8_t *out)
{
    const int32_t step = a->g->c->image.out_stride;
    struct batch *b = &a->borders;
    for (int32_t some; count > 0; count -= some, x += some) {
        some = room_of(b, count);
        fv_nn_gather(a->g, row, x, some, a->rows + b->count * a->pitch, a->pitch);
        for (int32_t i = 0; i < some; i++, b->count++) {
            b->in[b->count] = a->rows + b->count * a->pitch;
            b->out[b->count] = out + (ptrdiff_t)(x + i) * step;
        }
    }
}

/* Likewise of pixels inside; `corner`: that of the kernel at column 0. */
static void add_inside(struct apart *a, const uint8_t *corner, int32_t x, int32_t count,
                       uint8_t *out)
{
    const struct fv_op_image *im = &a->g->c->image;
    const ptrdiff_t step = (ptrdiff_t)a->g->c->window.stride_x * im->in_stride;
    struct batch *b = &a->inside;
    for (int32_t some; count > 0; count -= some, x += some) {
        some = room_of(b, count);
        const uint8_t **in = b->in + b->count, *from = corner + x * step;
        uint8_t **to = b->out + b->count, *at = out + (ptrdiff_t)x * im->out_stride;
        for (int32_t i = 0; i < some; i++) {
            in[i] = from + i * step;
            to[i] = at + (ptrdiff_t)i * im->out_stride;
        }
        b->count += some;
    }
}

static void add_row(struct apart *a, int32_t row)
{
    const struct fv_op_conv *c = a->g->c;
    const struct fv_op_image *im = &c->image;
    const int32_t y = row % im->out_h;
    uint8_t *out = a->g->call->out[0] + c->out_first +
                   (ptrdiff_t)row * (c->out_row != 0 ? c->out_row : im->out_w * im->out_stride);
    if (y < a->begin_y || y >= a->end_y) {
        add_borders(a, row, 0, im->out_w, out);
        return;
    }
    const ptrdiff_t iy =
        (ptrdiff_t)(row / im->out_h) * im->in_h + y * c->window.stride_y - c->window.pad_top;
    const uint8_t *corner = a->g->call->in[0] + iy * im->in_w * im->in_stride -
                            (ptrdiff_t)c->window.pad_left * im->in_stride;
    add_borders(a, row, 0, a->begin_x, out);
    add_inside(a, corner, a->begin_x, a->end_x - a->begin_x, out);
    add_borders(a, row, a->end_x, im->out_w - a->end_x, out);
}

/* Whether all shifts are below zero, as the fast variants want them. */
static int are_down(const struct fv_nn_gemm *gemm)
{
    for (int32_t c = 0; c < gemm->n; c++) {
        if (gemm->shift[c] >= 0 && gemm->multiplier[c] != 0) return 0;
    }
    return 1;
}

int fv_nn_conv_apart(const struct fv_nn_gathering *g, const struct fv_nn_gemm *gemm, int32_t begin,
                     int32_t end, ptrdiff_t pitch)
{
    struct apart a;
    if (g->call->kernels->nn_apart_u8 == fv_k_nn_apart_u8__c || gemm->row_sum_factor != 0 ||
        !are_down(gemm) || !find_inside(&a, g->c) || !init_apart(&a, g, gemm, pitch))
        return 0;
    for (int32_t row = begin; row < end; row++)
        add_row(&a, row);
    flush(&a.inside);
    flush(&a.borders);
    return 1;
}

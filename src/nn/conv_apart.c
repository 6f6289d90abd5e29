/* Convolutions whose product reads the inputs where they lie: of output pixels whose kernel lies
 * inside the image, groups of four inputs lie at the same distances from the kernel's corner. Where
 * the scratch holds a band of some rows of the image, it is copied there with its borders, so that
 * the kernels of all pixels lie inside. Else the rows of pixels at borders are gathered. */
#include <string.h>

#include "nn/conv.h"
#include "nn/copy.h"

enum {
    PIXELS = 144, /* at borders that are gathered together, at most */
    RUNS = 24,
    BORDERS_LEAST = 6,
    BAND_LEAST = 3 /* output rows of a band: fewer copy most input rows again for the next band */
};

/* Runs of pixels that wait for one product. */
struct batch {
    const struct fv_nn_call *call;
    struct fv_nn_gemm gemm;
    int32_t *offsets;
    int32_t count;
    struct fv_nn_rows runs[RUNS];
};

/* Some rows of the image, as wide as the kernels of a row of output pixels reach. */
struct band {
    uint8_t *bytes;
    int32_t out_rows;      /* that it serves; 0: there is no band */
    ptrdiff_t line;        /* bytes from row to row */
    int32_t left, columns; /* pixels of a row: before the image, and of it */
    int32_t first;         /* column of the image that comes first */
};

/* Pixels inside, and pixels at borders with room for their rows. */
struct apart {
    const struct fv_nn_gathering *g;
    struct batch inside, borders;
    int32_t begin_x, end_x, begin_y, end_y; /* output pixels whose kernel lies inside the image */
    struct band band;
    uint8_t *rows;
    int32_t gathered, room; /* rows of pixels at borders: those that wait, and the most of them */
    ptrdiff_t pitch;
    ptrdiff_t step; /* bytes from the inputs of a pixel inside to those of the next */
};

static void flush(struct batch *b)
{
    if (b->count > 0) b->call->kernels->nn_apart_u8(&b->gemm, b->offsets, b->runs, b->count);
    b->count = 0;
}

static void add_run(struct batch *b, const struct fv_nn_rows *run)
{
    if (b->count == RUNS) flush(b);
    b->runs[b->count++] = *run;
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

/* Where each group of inputs lies, from the kernel's corner on: runs of `taps` pixels, where pixels
 * are `pixel` bytes apart and rows `line`. */
static void set_offsets(const struct fv_op_conv *c, int32_t taps, int32_t pixel, int32_t line,
                        int32_t *to)
{
    const struct fv_op_window *w = &c->window;
    const int32_t run = taps * c->image.in_c;
    for (int32_t ky = 0; ky < w->kh; ky++) {
        for (int32_t kx = 0; kx < w->kw; kx += taps) {
            const int32_t at = ky * w->dilation_y * line + kx * w->dilation_x * pixel;
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

static int64_t span_of(int32_t count, int32_t step)
{
    return (int64_t)(count - 1) * step + 1;
}

static int64_t between(int64_t value, int64_t low, int64_t high)
{
    return value < low ? low : value > high ? high : value;
}

/* A band in `room` bytes from `from` on, if it holds enough rows. */
static void init_band(struct band *b, const struct fv_op_conv *c, uint8_t *from, int64_t room)
{
    const struct fv_op_window *w = &c->window;
    const struct fv_op_image *im = &c->image;
    const int64_t width = span_of(im->out_w, w->stride_x) + span_of(w->kw, w->dilation_x) - 1,
                  line = width * im->in_c, over = room / line - span_of(w->kh, w->dilation_y),
                  rows = over < 0 ? 0 : over / w->stride_y + 1;
    if (rows < (im->out_h < BAND_LEAST ? im->out_h : BAND_LEAST)) {
        b->out_rows = 0;
        return;
    }
    b->bytes = from;
    b->out_rows = (int32_t)between(rows, 0, im->out_h);
    b->line = line;
    b->first = w->pad_left < 0 ? -w->pad_left : 0;
    b->left = (int32_t)between(w->pad_left, 0, width);
    b->columns = (int32_t)between(im->in_w - b->first, 0, width - b->left);
}

/* The inputs of `rows` output rows of an image, from y on, and up to 15 bytes after them. */
static void fill_band(const struct band *b, const struct fv_op_conv *c, const uint8_t *image,
                      int32_t y, int32_t rows)
{
    const struct fv_op_window *w = &c->window;
    const struct fv_op_image *im = &c->image;
    const ptrdiff_t left = (ptrdiff_t)b->left * im->in_c, width = (ptrdiff_t)b->columns * im->in_c;
    const int32_t first = y * w->stride_y - w->pad_top,
                  count = (rows - 1) * w->stride_y + (w->kh - 1) * w->dilation_y + 1;
    uint8_t *to = b->bytes;
    for (int32_t iy = first; iy < first + count; iy++, to += b->line) {
        if (iy < 0 || iy >= im->in_h) {
            memset(to, c->zero_in, (size_t)b->line);
            continue;
        }
        const uint8_t *from = image + ((ptrdiff_t)iy * im->in_w + b->first) * im->in_stride;
        fv_nn_fill_pieces(to, (uint8_t)c->zero_in, left);
        if (im->in_stride == im->in_c) {
            memcpy(to + left, from, (size_t)width);
        } else {
            for (int32_t x = 0; x < b->columns; x++)
                fv_nn_copy_pieces(to + left + (ptrdiff_t)x * im->in_c,
                                  from + (ptrdiff_t)x * im->in_stride, im->in_c);
        }
        fv_nn_fill_pieces(to + left + width, (uint8_t)c->zero_in, b->line - left - width);
    }
}

static uint8_t *align(uint8_t *at)
{
    return at + (64 - (uintptr_t)at % 64) % 64;
}

/* Cuts the scratch into weights, where runs of `taps` pixels are no whole groups, offsets, and rows
 * of pixels at borders, or a band. 0: it is too small, or padding the weights costs too much. */
static int cut_scratch(struct apart *a, const struct fv_nn_gemm *gemm, int32_t taps, int is_band)
{
    const struct fv_nn_call *call = a->g->call;
    const struct fv_op_conv *c = a->g->c;
    const struct fv_op_image *im = &c->image;
    const int32_t run = taps * im->in_c,
                  k4 = c->window.kh * (c->window.kw / taps) * ((run + 3) / 4);
    const int padded = run % 4 != 0 && run != gemm->k;
    const int64_t weights = padded ? (int64_t)(gemm->n + 15) / 16 * 64 * k4 : 0,
                  used = weights + 4 * ((int64_t)k4 + gemm->k4) + 64,
                  room = call->model->tensors[call->op->scratch].bytes - used - 64;
    if (k4 > gemm->k4 * 3 / 2 || room < BORDERS_LEAST * a->pitch) return 0;
    a->inside.offsets = (int32_t *)(void *)(call->scratch + weights);
    a->borders.offsets = a->inside.offsets + k4;
    a->rows = align((uint8_t *)(a->borders.offsets + gemm->k4));
    a->room = (int32_t)between(room / a->pitch, 0, PIXELS);
    if (is_band) {
        init_band(&a->band, c, a->rows, room);
        if (a->band.out_rows == 0) return 0;
    }
    set_offsets(c, taps, is_band ? im->in_c : im->in_stride,
                is_band ? (int32_t)a->band.line : im->in_w * im->in_stride, a->inside.offsets);
    for (int32_t i = 0; i < gemm->k4; i++)
        a->borders.offsets[i] = 4 * i;
    if (padded) {
        pad_weights(gemm, run, call->scratch);
        a->inside.gemm.weights = (const int8_t *)call->scratch;
        a->inside.gemm.k4 = k4;
    }
    return 1;
}

/* Whether no kernel reaches beyond the image. */
static int has_no_borders(const struct apart *a, const struct fv_op_image *im)
{
    return a->begin_x == 0 && a->begin_y == 0 && a->end_x == im->out_w && a->end_y == im->out_h;
}

static int init_apart(struct apart *a, const struct fv_nn_gathering *g,
                      const struct fv_nn_gemm *gemm, ptrdiff_t pitch)
{
    const struct fv_op_window *w = &g->c->window;
    const struct fv_op_image *im = &g->c->image;
    const int32_t taps = w->dilation_x == 1 ? w->kw : 1;
    *a = (struct apart){.g = g, .pitch = pitch};
    a->inside.call = a->borders.call = g->call;
    a->inside.gemm = a->borders.gemm = *gemm;
    const int is_any_inside = find_inside(a, g->c);
    a->step = (ptrdiff_t)w->stride_x * im->in_c;
    if (!has_no_borders(a, im) && cut_scratch(a, gemm, taps, 1)) return 1;
    a->step = (ptrdiff_t)w->stride_x * im->in_stride;
    return is_any_inside && cut_scratch(a, gemm, im->in_stride == im->in_c ? taps : 1, 0);
}

static void flush_borders(struct apart *a)
{
    flush(&a->borders);
    a->gathered = 0;
}

/* `count` pixels of output row `row`, from column x on, whose rows are gathered. */
static void add_borders(struct apart *a, int32_t row, int32_t x, int32_t count, uint8_t *out)
{
    const int32_t step = a->g->c->image.out_stride;
    for (int32_t some; count > 0; count -= some, x += some) {
        if (a->gathered == a->room || a->borders.count == RUNS) flush_borders(a);
        some = count < a->room - a->gathered ? count : a->room - a->gathered;
        uint8_t *rows = a->rows + a->gathered * a->pitch;
        fv_nn_gather(a->g, row, x, some, rows, a->pitch);
        add_run(&a->borders,
                &(struct fv_nn_rows){rows, out + (ptrdiff_t)x * step, a->pitch, step, some});
        a->gathered += some;
    }
}

/* Likewise of pixels inside; `corner`: that of the kernel at column 0. */
static void add_inside(struct apart *a, const uint8_t *corner, int32_t x, int32_t count,
                       uint8_t *out)
{
    const ptrdiff_t step = a->g->c->image.out_stride;
    add_run(&a->inside,
            &(struct fv_nn_rows){corner + x * a->step, out + x * step, a->step, step, count});
}

static uint8_t *row_of(const struct apart *a, int32_t row)
{
    const struct fv_op_conv *c = a->g->c;
    return a->g->call->out[0] + c->out_first +
           (ptrdiff_t)row * (c->out_row != 0 ? c->out_row : c->image.out_w * c->image.out_stride);
}

static const uint8_t *image_of(const struct apart *a, int32_t row)
{
    const struct fv_op_image *im = &a->g->c->image;
    return a->g->call->in[0] + (ptrdiff_t)(row / im->out_h) * im->in_h * im->in_w * im->in_stride;
}

/* An output row whose inputs are read from the image itself. */
static void add_row(struct apart *a, int32_t row)
{
    const struct fv_op_conv *c = a->g->c;
    const struct fv_op_image *im = &c->image;
    const int32_t y = row % im->out_h;
    uint8_t *out = row_of(a, row);
    if (y < a->begin_y || y >= a->end_y) {
        add_borders(a, row, 0, im->out_w, out);
        return;
    }
    const ptrdiff_t iy = (ptrdiff_t)y * c->window.stride_y - c->window.pad_top;
    const uint8_t *corner = image_of(a, row) + (iy * im->in_w - c->window.pad_left) * im->in_stride;
    add_borders(a, row, 0, a->begin_x, out);
    add_inside(a, corner, a->begin_x, a->end_x - a->begin_x, out);
    add_borders(a, row, a->end_x, im->out_w - a->end_x, out);
}

static void run_in_place(struct apart *a, int32_t begin, int32_t end)
{
    for (int32_t row = begin; row < end; row++)
        add_row(a, row);
    flush(&a->inside);
    flush_borders(a);
}

static void run_in_bands(struct apart *a, int32_t begin, int32_t end)
{
    const struct fv_op_conv *c = a->g->c;
    const ptrdiff_t step = c->window.stride_y * a->band.line;
    for (int32_t row = begin, rows; row < end; row += rows) {
        const int32_t y = row % c->image.out_h,
                      left = end - row < c->image.out_h - y ? end - row : c->image.out_h - y;
        rows = left < a->band.out_rows ? left : a->band.out_rows;
        fill_band(&a->band, c, image_of(a, row), y, rows);
        for (int32_t i = 0; i < rows; i++)
            add_inside(a, a->band.bytes + i * step, 0, c->image.out_w, row_of(a, row + i));
        flush(&a->inside);
    }
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
        !are_down(gemm) || !init_apart(&a, g, gemm, pitch))
        return 0;
    if (a.band.out_rows > 0)
        run_in_bands(&a, begin, end);
    else
        run_in_place(&a, begin, end);
    return 1;
}

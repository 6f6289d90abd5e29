/* Pooling, reduction and resizing. */
#include <string.h>

#include "kernels/nn_requantize.h"
#include "nn/copy.h"
#include "nn/run.h"

/* The window's part inside the image: kernel indices [first, last). */
static void window_part(int32_t start, int32_t size, int32_t kernel, int32_t *first, int32_t *last)
{
    *first = start < 0 ? -start : 0;
    *last = start + kernel > size ? size - start : kernel;
    if (*last < *first) *last = *first;
}

/* A window over an image: the corner, which may lie outside, and the taps that lie inside. */
struct view {
    const uint8_t *corner;
    int32_t ky, ky_end, kx, kx_end;
};

static struct view view_of(const struct fv_nn_call *call, int32_t row, int32_t x)
{
    const struct fv_op_pool *p = &call->op->u.pool;
    const struct fv_op_image *im = &p->image;
    const struct fv_op_window *w = &p->window;
    const ptrdiff_t image = (ptrdiff_t)(row / im->out_h) * im->in_h;
    const int32_t iy = row % im->out_h * w->stride_y - w->pad_top,
                  ix = x * w->stride_x - w->pad_left;
    struct view v = {.corner = call->in[0] + ((image + iy) * im->in_w + ix) * im->in_stride};
    window_part(iy, im->in_h, w->kh, &v.ky, &v.ky_end);
    window_part(ix, im->in_w, w->kw, &v.kx, &v.kx_end);
    return v;
}

static void max_window(const struct fv_nn_call *call, const struct view *v, uint8_t *out)
{
    const struct fv_op_image *im = &call->op->u.pool.image;
    const ptrdiff_t line = (ptrdiff_t)im->in_w * im->in_stride;
    for (int32_t y = v->ky; y < v->ky_end; y++) {
        for (int32_t x = v->kx; x < v->kx_end; x++) {
            call->kernels->nn_max_u8(out, v->corner + y * line + (ptrdiff_t)x * im->in_stride, out,
                                     im->in_c);
        }
    }
}

static void clamp_pixel(const struct fv_op_pool *p, uint8_t *out)
{
    if (p->act_min == 0 && p->act_max == 255) return;
    for (int32_t c = 0; c < p->image.in_c; c++)
        out[c] = (uint8_t)fv_nn_clamp(out[c], p->act_min, p->act_max);
}

enum { MAX_LANES = 64, MAX_COLUMNS = 16 };

static inline void max_lanes(uint8_t *to, const uint8_t *from)
{
    for (int32_t i = 0; i < MAX_LANES; i++)
        to[i] = to[i] > from[i] ? to[i] : from[i];
}

/* An output row of windows that move pixel by pixel, at most MAX_COLUMNS wide: the largest of every
 * column once, then of the columns. `line` is input row iy, which may lie outside; up to 63 bytes
 * past a pixel are read. */
static void max_row(const struct fv_op_pool *p, const uint8_t *line, int32_t iy, uint8_t *out)
{
    const struct fv_op_image *im = &p->image;
    const ptrdiff_t pitch = (ptrdiff_t)im->in_w * im->in_stride;
    uint8_t columns[MAX_COLUMNS][MAX_LANES], best[MAX_LANES];
    int32_t ky, ky_end;
    window_part(iy, im->in_h, p->window.kh, &ky, &ky_end);
    for (int32_t c = 0; c < im->in_c; c += MAX_LANES) {
        const int32_t lanes = im->in_c - c < MAX_LANES ? im->in_c - c : MAX_LANES;
        for (int32_t x = 0, next = 0; x < im->out_w; x++) {
            const int32_t start = x - p->window.pad_left, past = start + p->window.kw;
            const int32_t first = start > 0 ? start : 0, end = past < im->in_w ? past : im->in_w;
            for (; next < end; next++) {
                uint8_t *column = columns[next % MAX_COLUMNS];
                memset(column, 0, MAX_LANES);
                for (int32_t y = ky; y < ky_end; y++)
                    max_lanes(column, line + y * pitch + (ptrdiff_t)next * im->in_stride + c);
            }
            memset(best, p->act_min, sizeof best);
            for (int32_t i = first; i < end; i++)
                max_lanes(best, columns[i % MAX_COLUMNS]);
            uint8_t *to = out + (ptrdiff_t)x * im->out_stride + c;
            for (int32_t i = 0; i < lanes; i++)
                to[i] = best[i] < p->act_max ? best[i] : (uint8_t)p->act_max;
        }
    }
}

enum { LINE_BYTES = 8192 };

/* Whether an output row goes by a line: the largest of every byte over the window's rows once, then
 * over its columns. */
static int is_by_line(const struct fv_op_pool *p)
{
    const struct fv_op_image *im = &p->image;
    return !p->average && im->in_stride == im->in_c &&
           (int64_t)p->window.kw * im->in_c <= LINE_BYTES;
}

/* The largest of rows [ky, ky_end) below `from`, `pitch` bytes apart. */
static void max_of_rows(const struct fv_kernels *kernels, const uint8_t *from, ptrdiff_t pitch,
                        int32_t ky, int32_t ky_end, uint8_t *to, int32_t bytes)
{
    if (ky == ky_end) {
        memset(to, 0, (size_t)bytes);
        return;
    }
    memcpy(to, from + ky * pitch, (size_t)bytes);
    for (int32_t y = ky + 1; y < ky_end; y++)
        kernels->nn_max_u8(to, from + y * pitch, to, bytes);
}

/* An output pixel from `count` columns. */
static void max_of_columns(const struct fv_nn_call *call, const uint8_t *columns, int32_t count,
                           uint8_t *out)
{
    const struct fv_op_pool *p = &call->op->u.pool;
    const int32_t channels = p->image.in_c;
    if (count == 0)
        memset(out, 0, (size_t)channels);
    else
        memcpy(out, columns, (size_t)channels);
    for (int32_t x = 1; x < count; x++)
        call->kernels->nn_max_u8(out, columns + x * channels, out, channels);
    clamp_pixel(p, out);
}

/* The column of the image at `at`, or its end beyond which `at` lies. */
static int32_t column_of(const struct fv_op_image *im, int32_t at)
{
    return at < 0 ? 0 : at > im->in_w ? im->in_w : at;
}

/* An output row, as many pixels at a time as LINE_BYTES holds the inputs of. */
static void max_row_by_line(const struct fv_nn_call *call, int32_t row, uint8_t *out)
{
    const struct fv_op_pool *p = &call->op->u.pool;
    const struct fv_op_image *im = &p->image;
    const struct fv_op_window *w = &p->window;
    const int32_t most = (LINE_BYTES / im->in_c - w->kw) / w->stride_x + 1;
    uint8_t line[LINE_BYTES];
    for (int32_t x = 0, some; x < im->out_w; x += some) {
        some = im->out_w - x < most ? im->out_w - x : most;
        const struct view v = view_of(call, row, x);
        const int32_t left = x * w->stride_x - w->pad_left, first = column_of(im, left),
                      past = column_of(im, left + (some - 1) * w->stride_x + w->kw);
        if (first < past)
            max_of_rows(call->kernels, v.corner + ((ptrdiff_t)first - left) * im->in_c,
                        (ptrdiff_t)im->in_w * im->in_c, v.ky, v.ky_end, line,
                        (past - first) * im->in_c);
        for (int32_t i = 0; i < some; i++, out += im->out_stride) {
            const int32_t at = left + i * w->stride_x, begin = column_of(im, at),
                          end = column_of(im, at + w->kw);
            max_of_columns(call, line + (begin - first) * im->in_c, end - begin, out);
        }
    }
}

/* int8 averages round halves away from the original zero, uint8 ones half up. */
static int32_t average_of(int32_t sum, int32_t count, int32_t is_signed)
{
    if (count == 0) return 0;
    if (!is_signed) return (sum + count / 2) / count;
    sum -= 128 * count;
    return (sum > 0 ? (sum + count / 2) / count : (sum - count / 2) / count) + 128;
}

/* Sums of `n` channels from c0 on. */
static void add_window(const struct fv_op_image *im, const struct view *v, int32_t c0, int32_t n,
                       int32_t *sum)
{
    const ptrdiff_t line = (ptrdiff_t)im->in_w * im->in_stride;
    for (int32_t y = v->ky; y < v->ky_end; y++) {
        for (int32_t x = v->kx; x < v->kx_end; x++) {
            const uint8_t *in = v->corner + y * line + (ptrdiff_t)x * im->in_stride + c0;
            for (int32_t c = 0; c < n; c++)
                sum[c] += in[c];
        }
    }
}

static void averages_of(const struct fv_op_pool *p, const struct view *v, const int32_t *sum,
                        int32_t n, uint8_t *out)
{
    const int32_t count = (v->ky_end - v->ky) * (v->kx_end - v->kx);
    for (int32_t c = 0; c < n; c++)
        out[c] =
            (uint8_t)fv_nn_clamp(average_of(sum[c], count, p->is_signed), p->act_min, p->act_max);
}

static void pool_pixel(const struct fv_nn_call *call, const struct view *v, uint8_t *out)
{
    const struct fv_op_pool *p = &call->op->u.pool;
    const int32_t channels = p->image.in_c;
    if (!p->average) {
        memset(out, 0, (size_t)channels);
        max_window(call, v, out);
        clamp_pixel(p, out);
        return;
    }
    for (int32_t c0 = 0; c0 < channels; c0 += 64) {
        const int32_t n = channels - c0 < 64 ? channels - c0 : 64;
        int32_t sum[64] = {0};
        add_window(&p->image, v, c0, n, sum);
        averages_of(p, v, sum, n, out + c0);
    }
}

static int32_t larger(int32_t a, int32_t b)
{
    return a > b ? a : b;
}

static int32_t smaller(int32_t a, int32_t b)
{
    return a < b ? a : b;
}

/* Taps [begin, end) of a pixel, row by row of its window, the last of which finish it. */
static void pool_taps(const struct fv_nn_call *call, int32_t row, int32_t x, int32_t begin,
                      int32_t end)
{
    const struct fv_op_pool *p = &call->op->u.pool;
    const struct fv_op_image *im = &p->image;
    const int32_t kw = p->window.kw;
    const struct view v = view_of(call, row, x);
    uint8_t *out = call->out[0] + ((ptrdiff_t)row * im->out_w + x) * im->out_stride;
    int32_t *sums = (int32_t *)(void *)call->scratch;
    if (begin == 0 && p->average) memset(sums, 0, (size_t)im->in_c * sizeof *sums);
    if (begin == 0 && !p->average) memset(out, 0, (size_t)im->in_c);
    int32_t y = begin / kw, first = begin % kw;
    for (int32_t left = end - begin; left > 0; y++, first = 0) {
        const int32_t past = smaller(first + left, kw);
        const struct view part = {v.corner, larger(v.ky, y), smaller(v.ky_end, y + 1),
                                  larger(v.kx, first), smaller(v.kx_end, past)};
        left -= past - first;
        if (p->average)
            add_window(im, &part, 0, im->in_c, sums);
        else
            max_window(call, &part, out);
    }
    if (end < p->window.kh * kw) return;
    if (p->average)
        averages_of(p, &v, sums, im->in_c, out);
    else
        clamp_pixel(p, out);
}

/* Part `part` of a row: its share of the taps of all pixels, which come one after the other. */
static void pool_part(const struct fv_nn_call *call, int32_t row, int32_t part)
{
    const struct fv_op_pool *p = &call->op->u.pool;
    const int32_t taps = p->window.kh * p->window.kw;
    const int64_t all = (int64_t)p->image.out_w * taps,
                  end = fv_nn_part_first(all, part + 1, p->parts);
    for (int64_t at = fv_nn_part_first(all, part, p->parts); at < end;) {
        const int32_t begin = (int32_t)(at % taps);
        const int32_t past = end - at < taps - begin ? begin + (int32_t)(end - at) : taps;
        pool_taps(call, row, (int32_t)(at / taps), begin, past);
        at += past - begin;
    }
}

void fv_nn_op_pool(const struct fv_nn_call *call, int32_t begin, int32_t end)
{
    const struct fv_op_pool *p = &call->op->u.pool;
    const struct fv_op_image *im = &p->image;
    const struct fv_op_window *w = &p->window;
    const int by_column = !p->average && w->stride_x == 1 && w->kw <= MAX_COLUMNS,
              by_line = is_by_line(p);
    for (int32_t row = begin; row < end; row++) {
        uint8_t *out = call->out[0] + (ptrdiff_t)row * im->out_w * im->out_stride;
        if (p->parts > 1) {
            pool_part(call, row / p->parts, row % p->parts);
            continue;
        }
        if (by_column) {
            const ptrdiff_t image = (ptrdiff_t)(row / im->out_h) * im->in_h;
            const int32_t iy = row % im->out_h * w->stride_y - w->pad_top;
            max_row(p, call->in[0] + (image + iy) * im->in_w * im->in_stride, iy, out);
            continue;
        }
        if (by_line) {
            max_row_by_line(call, row, out);
            continue;
        }
        for (int32_t x = 0; x < im->out_w; x++, out += im->out_stride) {
            const struct view v = view_of(call, row, x);
            pool_pixel(call, &v, out);
        }
    }
}

/* Elements [begin, end) of the dropped axes, of `lanes` results whose inputs are neighbours, go
 * into sums or extremes. */
static void reduce_lanes(const struct fv_op_reduce *p, const uint8_t *in, int32_t lanes,
                         int32_t begin, int32_t end, int32_t *result)
{
    for (int32_t at = begin, count; at < end; at += count) {
        const int32_t line = at / p->count[3], first = at % p->count[3];
        const int32_t i2 = line % p->count[2], i1 = line / p->count[2] % p->count[1],
                      i0 = line / p->count[2] / p->count[1];
        const uint8_t *from = in + (ptrdiff_t)i0 * p->inner[0] + (ptrdiff_t)i1 * p->inner[1] +
                              (ptrdiff_t)i2 * p->inner[2] + (ptrdiff_t)first * p->inner[3];
        count = smaller(p->count[3] - first, end - at);
        for (int32_t l = 0; l < count; l++, from += p->inner[3]) {
            if (p->function == FV_REDUCE_MEAN) {
                for (int32_t c = 0; c < lanes; c++)
                    result[c] += from[c];
            } else if (p->function == FV_REDUCE_MAX) {
                for (int32_t c = 0; c < lanes; c++)
                    result[c] = from[c] > result[c] ? from[c] : result[c];
            } else {
                for (int32_t c = 0; c < lanes; c++)
                    result[c] = from[c] < result[c] ? from[c] : result[c];
            }
        }
    }
}

/* The same for results [first, first + lanes) of a row; the elements before `begin` are in
 * `result`, and the last finish it. */
static void reduce_results(const struct fv_nn_call *call, int32_t row, int32_t first, int32_t lanes,
                           int32_t begin, int32_t end, int32_t *result)
{
    const struct fv_op_reduce *p = &call->op->u.reduce;
    const int32_t k = row % p->dims[2], j = row / p->dims[2] % p->dims[1],
                  i = row / p->dims[2] / p->dims[1];
    const uint8_t *in = call->in[0] + (ptrdiff_t)i * p->outer[0] + (ptrdiff_t)j * p->outer[1] +
                        (ptrdiff_t)k * p->outer[2] + (ptrdiff_t)first * p->outer[3];
    uint8_t *out = call->out[0] + (ptrdiff_t)row * p->dims[3] + first;
    for (int32_t c = 0; c < lanes && begin == 0; c++)
        result[c] = p->function == FV_REDUCE_MEAN ? 0 : in[c];
    reduce_lanes(p, in, lanes, begin, end, result);
    for (int32_t c = 0; c < lanes && end == p->elements; c++) {
        int32_t value = result[c];
        if (p->function == FV_REDUCE_MEAN) {
            value = fv_nn_sum(
                fv_nn_requantize(value - p->zero_in * p->elements, p->multiplier, p->shift),
                p->zero_out);
        }
        out[c] = (uint8_t)fv_nn_clamp(value, 0, 255);
    }
}

/* Results that share a walk over the elements, at most. */
static int32_t lanes_of(const struct fv_op_reduce *p)
{
    return p->outer[3] == 1 ? FV_MODEL_REDUCE_LANES : 1;
}

/* Part `part` of a row: its share of the elements of all results, which come one walk after the
 * other. */
static void reduce_part(const struct fv_nn_call *call, int32_t row, int32_t part)
{
    const struct fv_op_reduce *p = &call->op->u.reduce;
    const int32_t most = lanes_of(p);
    const int64_t all = ((int64_t)p->dims[3] + most - 1) / most * p->elements,
                  end = fv_nn_part_first(all, part + 1, p->parts);
    for (int64_t at = fv_nn_part_first(all, part, p->parts); at < end;) {
        const int32_t first = (int32_t)(at / p->elements) * most,
                      begin = (int32_t)(at % p->elements);
        const int32_t past =
            end - at < p->elements - begin ? begin + (int32_t)(end - at) : p->elements;
        reduce_results(call, row, first, smaller(p->dims[3] - first, most), begin, past,
                       (int32_t *)(void *)call->scratch);
        at += past - begin;
    }
}

void fv_nn_op_reduce(const struct fv_nn_call *call, int32_t begin, int32_t end)
{
    const struct fv_op_reduce *p = &call->op->u.reduce;
    const int32_t most = lanes_of(p);
    int32_t result[FV_MODEL_REDUCE_LANES];
    for (int32_t row = begin; row < end; row++) {
        if (p->parts > 1) {
            reduce_part(call, row / p->parts, row % p->parts);
            continue;
        }
        for (int32_t first = 0; first < p->dims[3]; first += most)
            reduce_results(call, row, first, smaller(p->dims[3] - first, most), 0, p->elements,
                           result);
    }
}

struct entry {
    int32_t low, high, weight;
};

static float weight_of(const struct entry *entry)
{
    float weight;
    memcpy(&weight, &entry->weight, sizeof weight);
    return weight;
}

/* uint8: float arithmetic in the reference's order, 0.5 added and cut off. */
static void blend_float(const uint8_t *const corner[4], float dy, float dx, uint8_t *out,
                        int32_t count)
{
    for (int32_t c = 0; c < count; c++) {
        const float top = (float)corner[0][c] * (1.0f - dy) * (1.0f - dx);
        const float bottom = (float)corner[1][c] * dy * (1.0f - dx);
        const float top_right = (float)corner[2][c] * (1.0f - dy) * dx;
        const float bottom_right = (float)corner[3][c] * dy * dx;
        const float value = top + bottom + top_right + bottom_right + 0.5f;
        out[c] = value < 0.0f ? 0 : value < 256.0f ? (uint8_t)value : 255;
    }
}

/* One row of nearest neighbours from `line`. */
static void nearest_row(const struct fv_op_image *im, const struct entry *columns,
                        const uint8_t *line, uint8_t *out)
{
    const ptrdiff_t step_in = im->in_stride, step_out = im->out_stride;
    const size_t bytes = (size_t)im->in_c;
    const int32_t count = im->out_w;
    for (int32_t i = 0; i < count; i++, out += step_out)
        fv_nn_copy(out, line + columns[i].low * step_in, bytes);
}

void fv_nn_op_resize(const struct fv_nn_call *call, int32_t begin, int32_t end)
{
    const struct fv_op_resize *p = &call->op->u.resize;
    const struct fv_op_image *im = &p->image;
    const struct entry *rows = (const struct entry *)(const void *)(call->model->base + p->rows);
    const struct entry *columns =
        (const struct entry *)(const void *)(call->model->base + p->columns);
    const ptrdiff_t line = (ptrdiff_t)im->in_w * im->in_stride;
    const struct fv_nn_blend blend = {.channels = im->in_c,
                                      .in_stride = im->in_stride,
                                      .out_w = im->out_w,
                                      .out_stride = im->out_stride,
                                      .bits = p->bits,
                                      .middle = p->mode == FV_RESIZE_SIGNED ? 128 : 0,
                                      .columns = &columns->low};
    for (int32_t row = begin; row < end; row++) {
        const uint8_t *image = call->in[0] + (ptrdiff_t)(row / im->out_h) * im->in_h * line;
        const struct entry *y = &rows[row % im->out_h];
        uint8_t *out = call->out[0] + (ptrdiff_t)row * im->out_w * im->out_stride;
        if (p->mode == FV_RESIZE_EXACT || p->mode == FV_RESIZE_SIGNED) {
            call->kernels->nn_blend_u8(&blend, image + y->low * line, image + y->high * line,
                                       y->weight, out);
            continue;
        }
        if (p->mode == FV_RESIZE_NEAREST) {
            nearest_row(im, columns, image + y->low * line, out);
            continue;
        }
        for (int32_t i = 0; i < im->out_w; i++, out += im->out_stride) {
            const struct entry *x = &columns[i];
            const uint8_t *left = image + (ptrdiff_t)x->low * im->in_stride,
                          *right = image + (ptrdiff_t)x->high * im->in_stride;
            const uint8_t *const corner[4] = {left + y->low * line, left + y->high * line,
                                              right + y->low * line, right + y->high * line};
            blend_float(corner, weight_of(y), weight_of(x), out, im->in_c);
        }
    }
}

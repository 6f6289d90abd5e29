/* Checks of the operators on images: windows that slide over one, and its resizing. */
#include "nn/model_check_help.h"

static int shifts_fit(const struct fv_check *c, int32_t offset, int32_t count)
{
    const int32_t *shift = fv_check_words_at(c, offset);
    int good = 1;
    for (int32_t i = 0; i < count; i++)
        good &= shift[i] >= -31 && shift[i] <= 30;
    return good;
}

/* An image of bytes inside its tensor, from byte `first` on; `row`: bytes from row to row, 0 where
 * rows follow without gap. */
static const char *half_image(const struct fv_model_tensor *t, int32_t batch, int32_t h, int32_t w,
                              int32_t channels, int32_t stride, int32_t first, int32_t row)
{
    if (!fv_check_between(batch, 1, 4096) || !fv_check_between(h, 1, 1 << 20) ||
        !fv_check_between(w, 1, 1 << 20) || !fv_check_between(channels, 1, 1 << 20)) {
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
static const char *check_images(const struct fv_check *c, const struct fv_op_image *im,
                                int32_t first, int32_t row, int32_t parts)
{
    *c->word = 16;
    const char *fault = fv_check_operands(c, 1, 1);
    if (fault != NULL) return fault;
    *c->word = 16;
    fault = half_image(fv_check_input(c, 0), im->batch, im->in_h, im->in_w, im->in_c, im->in_stride,
                       0, 0);
    if (fault != NULL) return fault;
    *c->word = 21;
    fault = half_image(fv_check_output(c, 0), im->batch, im->out_h, im->out_w, im->out_c,
                       im->out_stride, first, row);
    if (fault != NULL) return fault;
    *c->word = 13;
    return fv_check_rows_are(c, (int64_t)im->batch * im->out_h, parts)
               ? NULL
               : "rows do not match the image";
}

static const char *check_image(const struct fv_check *c, const struct fv_op_image *im)
{
    return check_images(c, im, 0, 0, 1);
}

/* `left`: the least that may lie left of the image; below zero output columns begin inside. */
static const char *check_window(const struct fv_check *c, const struct fv_op_window *w,
                                int32_t left)
{
    const int32_t *v = &w->kh;
    for (int32_t i = 0; i < 8; i++) {
        *c->word = 25 + i;
        if (!fv_check_between(v[i], i < 6 ? 1 : i < 7 ? 0 : left, i < 4 ? 1024 : 4096))
            return "the window is out of range";
    }
    return NULL;
}

static int is_pointwise(const struct fv_op_image *im, const struct fv_op_window *w)
{
    return w->kh == 1 && w->kw == 1 && w->stride_x == 1 && w->stride_y == 1 && w->pad_top == 0 &&
           w->pad_left == 0 && im->in_h == im->out_h && im->in_w == im->out_w;
}

const char *fv_check_conv(const struct fv_check *c)
{
    const struct fv_op_conv *p = &c->op->u.conv;
    const char *fault = check_images(c, &p->image, p->out_first, p->out_row, p->parts);
    if (fault == NULL) fault = check_window(c, &p->window, -p->image.in_w);
    if (fault != NULL) return fault;
    const int64_t k = (int64_t)p->window.kh * p->window.kw * p->image.in_c;
    FV_CHECK_REQUIRE(conv.k, p->k == k && k <= 1 << 22, "not kernel height x width x channels");
    FV_CHECK_REQUIRE(conv.k4, p->k4 == (p->k + 3) / 4, "not k / 4 rounded up");
    FV_CHECK_REQUIRE(conv.zero_in,
                     fv_check_activation_fits(p->zero_in, p->zero_out, p->act_min, p->act_max),
                     "zero points or range are not bytes");
    FV_CHECK_REQUIRE(conv.row_sum_factor, fv_check_between(p->row_sum_factor, -256, 256),
                     "out of range");
    const int32_t n16 = (p->image.out_c + 15) / 16 * 16;
    FV_CHECK_REQUIRE(conv.weights, fv_check_constant(c, p->weights, (int64_t)n16 * p->k4 * 4, 64),
                     "weights lie outside the file");
    FV_CHECK_REQUIRE(conv.bias, fv_check_constant(c, p->bias, (int64_t)n16 * 4, 64),
                     "biases lie outside the file");
    FV_CHECK_REQUIRE(conv.multiplier, fv_check_constant(c, p->multiplier, (int64_t)n16 * 4, 64),
                     "multipliers lie outside the file");
    FV_CHECK_REQUIRE(conv.shift, fv_check_constant(c, p->shift, (int64_t)n16 * 4, 64),
                     "shifts lie outside the file");
    FV_CHECK_REQUIRE(conv.table, fv_check_table_fits(c, p->table),
                     "the table lies outside the file");
    const int pointwise = is_pointwise(&p->image, &p->window);
    const int64_t pitch = ((int64_t)p->k4 * 4 + 15 + 63) / 64 * 64;
    FV_CHECK_REQUIRE(conv.single_rounding, fv_check_between(p->single_rounding, 0, pointwise),
                     "not 0 or 1, or not for this window");
    FV_CHECK_REQUIRE(conv.parts,
                     fv_check_parts_fit(c, p->parts, p->k4) &&
                         (p->parts <= 1 || (p->single_rounding && p->image.out_w == 1)),
                     "not of this version of the format, or not for this layer");
    FV_CHECK_REQUIRE(conv.shift, p->single_rounding || shifts_fit(c, p->shift, n16),
                     "a shift is out of range");
    int64_t scratch = pointwise ? 0 : FV_MODEL_CONV_PIXELS * pitch + FV_MODEL_SLACK_BYTES;
    if (p->single_rounding) scratch += (int64_t)n16 * 4 * FV_MODEL_CONV_PIXELS;
    *c->word = 14;
    return scratch == 0 || fv_check_scratch_bytes(c) >= scratch ? NULL : "scratch is too small";
}

const char *fv_check_depthwise(const struct fv_check *c)
{
    const struct fv_op_depthwise *p = &c->op->u.depthwise;
    const char *fault = check_image(c, &p->image);
    if (fault == NULL) fault = check_window(c, &p->window, 0);
    if (fault != NULL) return fault;
    FV_CHECK_REQUIRE(depthwise.image.out_c, p->image.in_c == p->image.out_c,
                     "not the input's channels");
    FV_CHECK_REQUIRE(depthwise.zero_in,
                     fv_check_activation_fits(p->zero_in, p->zero_out, p->act_min, p->act_max),
                     "zero points or range are not bytes");
    FV_CHECK_REQUIRE(depthwise.planes, fv_check_between(p->planes, 1, 3), "out of range");
    FV_CHECK_REQUIRE(depthwise.c16, p->c16 == (p->image.in_c + 15) / 16 * 16,
                     "not the channels rounded up to 16");
    const int64_t taps = (int64_t)p->window.kh * p->window.kw;
    FV_CHECK_REQUIRE(depthwise.weights,
                     taps <= 1 << 16 &&
                         fv_check_constant(c, p->weights, p->planes * taps * p->c16, 64),
                     "weights lie outside the file");
    FV_CHECK_REQUIRE(depthwise.bias, fv_check_constant(c, p->bias, (int64_t)p->c16 * 4, 64),
                     "biases lie outside the file");
    FV_CHECK_REQUIRE(depthwise.multiplier,
                     fv_check_constant(c, p->multiplier, (int64_t)p->c16 * 4, 64),
                     "multipliers lie outside the file");
    FV_CHECK_REQUIRE(depthwise.shift,
                     fv_check_constant(c, p->shift, (int64_t)p->c16 * 4, 64) &&
                         shifts_fit(c, p->shift, p->c16),
                     "a shift is out of range");
    FV_CHECK_REQUIRE(depthwise.table, fv_check_table_fits(c, p->table),
                     "the table lies outside the file");
    const int64_t span = (int64_t)(p->window.kw - 1) * p->window.dilation_x + 1;
    const int64_t all = (int64_t)(p->image.out_w - 1) * p->window.stride_x + span;
    const int64_t most = span > FV_MODEL_DEPTHWISE_COLUMNS ? span : FV_MODEL_DEPTHWISE_COLUMNS;
    *c->word = 14;
    return fv_check_scratch_bytes(c) >= (all < most ? all : most) * 256 * ((p->window.kh + 3) / 4)
               ? NULL
               : "scratch is too small";
}

const char *fv_check_pool(const struct fv_check *c)
{
    const struct fv_op_pool *p = &c->op->u.pool;
    const char *fault = check_images(c, &p->image, 0, 0, p->parts);
    if (fault == NULL) fault = check_window(c, &p->window, 0);
    if (fault != NULL) return fault;
    FV_CHECK_REQUIRE(pool.image.out_c, p->image.in_c == p->image.out_c, "not the input's channels");
    FV_CHECK_REQUIRE(pool.average, fv_check_between(p->average, 0, 1), "not 0 or 1");
    FV_CHECK_REQUIRE(pool.is_signed, fv_check_between(p->is_signed, 0, 1), "not 0 or 1");
    FV_CHECK_REQUIRE(pool.act_min, fv_check_activation_fits(0, 0, p->act_min, p->act_max),
                     "the range is not bytes");
    const int64_t taps = (int64_t)p->image.out_w * p->window.kh * p->window.kw;
    FV_CHECK_REQUIRE(pool.parts, fv_check_parts_fit(c, p->parts, taps),
                     "not of this version of the format, or more than a row has taps");
    *c->word = 14;
    return p->parts <= 1 || !p->average || fv_check_scratch_bytes(c) >= (int64_t)p->image.in_c * 4
               ? NULL
               : "scratch is too small";
}

static int entries_fit(const struct fv_check *c, int32_t offset, int32_t count, int32_t size)
{
    if (!fv_check_constant(c, offset, (int64_t)count * 12, 4)) return 0;
    const int32_t *entry = fv_check_words_at(c, offset);
    int good = 1;
    for (int32_t i = 0; i < count; i++, entry += 3)
        good &= fv_check_between(entry[0], 0, size - 1) && fv_check_between(entry[1], 0, size - 1);
    return good;
}

static int weights_fit(const struct fv_check *c, int32_t offset, int32_t count, int32_t high)
{
    const int32_t *entry = fv_check_words_at(c, offset);
    int good = 1;
    for (int32_t i = 0; i < count; i++, entry += 3)
        good &= fv_check_between(entry[2], 0, high);
    return good;
}

const char *fv_check_resize(const struct fv_check *c)
{
    const struct fv_op_resize *p = &c->op->u.resize;
    const char *fault = check_image(c, &p->image);
    if (fault != NULL) return fault;
    FV_CHECK_REQUIRE(resize.image.out_c, p->image.in_c == p->image.out_c,
                     "not the input's channels");
    FV_CHECK_REQUIRE(resize.mode, fv_check_between(p->mode, FV_RESIZE_NEAREST, FV_RESIZE_EXACT),
                     "no such mode");
    FV_CHECK_REQUIRE(resize.rows, entries_fit(c, p->rows, p->image.out_h, p->image.in_h),
                     "the table is outside the file or the image");
    FV_CHECK_REQUIRE(resize.columns, entries_fit(c, p->columns, p->image.out_w, p->image.in_w),
                     "the table is outside the file or the image");
    if (p->mode != FV_RESIZE_SIGNED && p->mode != FV_RESIZE_EXACT) return NULL;
    FV_CHECK_REQUIRE(resize.bits, fv_check_between(p->bits, 0, 10), "out of range");
    FV_CHECK_REQUIRE(resize.rows, weights_fit(c, p->rows, p->image.out_h, 1 << p->bits),
                     "a weight is out of range");
    FV_CHECK_REQUIRE(resize.columns, weights_fit(c, p->columns, p->image.out_w, 1 << p->bits),
                     "a weight is out of range");
    return NULL;
}

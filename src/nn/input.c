#include "nn/input.h"

#include <string.h>

#include "base/grey_world.h"
#include "nn/pixel.h"
#include "nn/run.h"

enum { WEIGHT_BITS = 15, WEIGHT_ONE = 1 << WEIGHT_BITS };

enum fovea_status fv_nn_input_fit_of(const struct fv_model *model, const struct fovea_image *image,
                                     struct fv_nn_input_fit *fit)
{
    const struct fv_model_preprocess *p = &model->header->preprocess;
    const struct fv_model_tensor *t = &model->tensors[model->inputs[0]];
    const int colours = p->channels == 1 || p->channels == 3;
    const int fits =
        model->header->input_count == 1 && t->rank == 4 && t->dims[0] == 1 &&
        t->dims[1] == p->height && t->dims[2] == p->width && t->dims[3] == p->channels &&
        (t->type == FV_TYPE_U8 || t->type == FV_TYPE_F32) && (t->flags & FV_TENSOR_CONST) == 0;
    if (!colours || !fits || !fv_pixel_known(image->format) || image->width < 1 ||
        image->height < 1)
        return FOVEA_ERROR_UNSUPPORTED;
    *fit = (struct fv_nn_input_fit){.image_width = image->width,
                                    .image_height = image->height,
                                    .width = p->width,
                                    .height = p->height};
    if (p->fit == FV_FIT_LETTERBOX) {
        if ((int64_t)p->width * image->height < (int64_t)p->height * image->width) {
            fit->height = (int32_t)(((int64_t)image->height * p->width * 2 + image->width) /
                                    (2 * (int64_t)image->width));
        } else {
            fit->width = (int32_t)(((int64_t)image->width * p->height * 2 + image->height) /
                                   (2 * (int64_t)image->height));
        }
        fit->width = fit->width < 1 ? 1 : fit->width;
        fit->height = fit->height < 1 ? 1 : fit->height;
        fit->left = (p->width - fit->width) / 2;
        fit->top = (p->height - fit->height) / 2;
    }
    fit->scale_x = (float)fit->width / (float)image->width;
    fit->scale_y = (float)fit->height / (float)image->height;
    return FOVEA_OK;
}

bool fv_nn_takes_images(const struct fv_model *model)
{
    const struct fovea_image image = {.width = 1, .height = 1, .format = FOVEA_PIXEL_GREY8};
    struct fv_nn_input_fit fit;
    return fv_nn_input_fit_of(model, &image, &fit) == FOVEA_OK;
}

/* Lower neighbour and weight of the upper one for target `at` of `count` over `size` source pixels.
 */
static void source_of(int32_t at, int32_t count, int32_t size, int32_t *low, int32_t *high,
                      int32_t *weight)
{
    /* (at + 0.5) size / count - 0.5 in units of 1 / WEIGHT_ONE, rounded down */
    const int64_t position = ((int64_t)(2 * at + 1) * size * WEIGHT_ONE / count - WEIGHT_ONE) / 2;
    const int64_t clamped = position < 0 ? 0 : position;
    *low = (int32_t)(clamped >> WEIGHT_BITS);
    *weight = (int32_t)(clamped & (WEIGHT_ONE - 1));
    if (*low >= size - 1) {
        *low = size - 1;
        *weight = 0;
    }
    *high = *low + 1 < size ? *low + 1 : *low;
}

/* Red, green and blue of one interpolated pixel. */
static void sample(const struct fovea_image *image, const uint8_t *upper, const uint8_t *lower,
                   int32_t wy, int32_t left, int32_t right, int32_t wx, uint8_t rgb[3])
{
    const int32_t channels = image->format == FOVEA_PIXEL_GREY8 ? 1 : 3;
    for (int32_t c = 0; c < channels; c++) {
        const int32_t a =
            upper[left * channels + c] * (WEIGHT_ONE - wx) + upper[right * channels + c] * wx;
        const int32_t b =
            lower[left * channels + c] * (WEIGHT_ONE - wx) + lower[right * channels + c] * wx;
        const int64_t sum = (int64_t)a * (WEIGHT_ONE - wy) + (int64_t)b * wy;
        rgb[c] = (uint8_t)((sum + (INT64_C(1) << (2 * WEIGHT_BITS - 1))) >> (2 * WEIGHT_BITS));
    }
    if (channels == 1) {
        rgb[1] = rgb[2] = rgb[0];
    } else if (image->format == FOVEA_PIXEL_BGR24) {
        const uint8_t blue = rgb[0];
        rgb[0] = rgb[2];
        rgb[2] = blue;
    }
}

/* Input values by pixel value and channel. */
struct tables {
    uint8_t byte[3][256];
    float real[3][256];
};

/* The level that a channel of the input, as the model orders them, has instead of `level`. */
static uint32_t balanced(const struct fv_model_preprocess *p, const struct fv_nn_balance *balance,
                         int32_t channel, uint32_t level)
{
    if (balance == NULL || p->channels != 3) return level;
    const uint32_t *sums = balance->sums;
    return fv_grey_world(level, sums[p->order == 1 ? 2 - channel : channel],
                         (uint64_t)sums[0] + sums[1] + sums[2]);
}

static void make_tables(const struct fv_model *model, const struct fv_nn_balance *balance,
                        struct tables *t)
{
    const struct fv_model_preprocess *p = &model->header->preprocess;
    const struct fv_model_tensor *in = &model->tensors[model->inputs[0]];
    for (int32_t c = 0; c < p->channels; c++) {
        for (int32_t v = 0; v < 256; v++) {
            const uint32_t level = balanced(p, balance, c, (uint32_t)v);
            const float real = ((float)level - p->mean[c]) * p->scale[c];
            const float quantised = real / in->scale + (float)in->zero + 0.5f;
            t->real[c][v] = real;
            t->byte[c][v] = quantised < 0.0f ? 0 : quantised < 256.0f ? (uint8_t)quantised : 255;
        }
    }
}

/* The same for formats whose pixels must be made first. */
static void sample_made(const struct fovea_image *image, const int32_t rows[2], int32_t wy,
                        const int32_t columns[2], int32_t wx, bool luma, uint8_t rgb[3])
{
    uint8_t p[4][3];
    for (int k = 0; k < 4; k++)
        fv_pixel_fetch(image, columns[k & 1], rows[k >> 1], luma, p[k]);
    for (int c = 0; c < 3; c++) {
        const int32_t a = p[0][c] * (WEIGHT_ONE - wx) + p[1][c] * wx,
                      b = p[2][c] * (WEIGHT_ONE - wx) + p[3][c] * wx;
        const int64_t sum = (int64_t)a * (WEIGHT_ONE - wy) + (int64_t)b * wy;
        rgb[c] = (uint8_t)((sum + (INT64_C(1) << (2 * WEIGHT_BITS - 1))) >> (2 * WEIGHT_BITS));
    }
}

static void put(const struct fv_model *model, const struct tables *t, uint8_t *input, ptrdiff_t at,
                const uint8_t rgb[3])
{
    const struct fv_model_preprocess *p = &model->header->preprocess;
    const int real = model->tensors[model->inputs[0]].type == FV_TYPE_F32;
    uint8_t value[3] = {rgb[0], rgb[1], rgb[2]};
    if (p->channels == 1)
        value[0] = (uint8_t)((9798 * rgb[0] + 19235 * rgb[1] + 3735 * rgb[2] + 16384) >> 15);
    if (p->order == 1) {
        value[0] = rgb[2];
        value[2] = rgb[0];
    }
    for (int32_t c = 0; c < p->channels; c++) {
        if (real)
            memcpy(input + (at * p->channels + c) * 4, &t->real[c][value[c]], 4);
        else
            input[at * p->channels + c] = t->byte[c][value[c]];
    }
}

/* Rows that share the sampled columns: the division for a column costs more than the sample. */
enum { BLOCK_ROWS = 16 };

/* Where rows of a block sample. */
struct block {
    int32_t begin, count;
    int32_t shown[BLOCK_ROWS], up[BLOCK_ROWS], down[BLOCK_ROWS], wy[BLOCK_ROWS];
};

static void block_begin(const struct fovea_image *image, const struct fv_nn_input_fit *fit,
                        int32_t begin, int32_t end, struct block *b)
{
    b->begin = begin;
    b->count = end - begin < BLOCK_ROWS ? end - begin : BLOCK_ROWS;
    for (int32_t i = 0; i < b->count; i++) {
        const int32_t iy = begin + i - fit->top;
        b->shown[i] = iy >= 0 && iy < fit->height;
        if (b->shown[i])
            source_of(iy, fit->height, image->height, &b->up[i], &b->down[i], &b->wy[i]);
    }
}

static void fill_column(const struct fv_model *model, const struct tables *tables,
                        const struct fovea_image *image, const struct fv_nn_input_fit *fit,
                        const struct block *b, int32_t x, uint8_t *input)
{
    const struct fv_model_preprocess *p = &model->header->preprocess;
    const bool plain = image->format == FOVEA_PIXEL_GREY8 || image->format == FOVEA_PIXEL_RGB24 ||
                       image->format == FOVEA_PIXEL_BGR24;
    const int32_t ix = x - fit->left, is_shown = ix >= 0 && ix < fit->width;
    int32_t columns[2] = {0, 0}, wx = 0;
    if (is_shown) source_of(ix, fit->width, image->width, &columns[0], &columns[1], &wx);
    for (int32_t i = 0; i < b->count; i++) {
        uint8_t rgb[3] = {(uint8_t)p->pad, (uint8_t)p->pad, (uint8_t)p->pad};
        const int32_t rows[2] = {b->up[i], b->down[i]};
        if (is_shown && b->shown[i] && plain) {
            sample(image, image->data + (ptrdiff_t)rows[0] * image->stride_bytes,
                   image->data + (ptrdiff_t)rows[1] * image->stride_bytes, b->wy[i], columns[0],
                   columns[1], wx, rgb);
        } else if (is_shown && b->shown[i]) {
            sample_made(image, rows, b->wy[i], columns, wx, p->channels == 1, rgb);
        }
        put(model, tables, input, (ptrdiff_t)(b->begin + i) * p->width + x, rgb);
    }
}

/* Grey to grey, as most cameras and networks are: columns of one strip of a block. The divisions of
 * a column are made once for all rows. */
enum { STRIP_COLUMNS = 64 };

struct strip {
    int32_t begin, count; /* of the input's columns */
    int32_t first, end;   /* those of them that the image shows, counted from `begin` */
    int32_t left[STRIP_COLUMNS], right[STRIP_COLUMNS], wx[STRIP_COLUMNS];
};

static void strip_begin(const struct fovea_image *image, const struct fv_nn_input_fit *fit,
                        int32_t begin, int32_t end, struct strip *s)
{
    s->begin = begin;
    s->count = end - begin < STRIP_COLUMNS ? end - begin : STRIP_COLUMNS;
    const int32_t first = fit->left - begin, last = fit->left + fit->width - begin;
    s->first = first < 0 ? 0 : first < s->count ? first : s->count;
    s->end = last < s->first ? s->first : last < s->count ? last : s->count;
    for (int32_t i = s->first; i < s->end; i++)
        source_of(begin + i - fit->left, fit->width, image->width, &s->left[i], &s->right[i],
                  &s->wx[i]);
}

static void fill_grey_row(const uint8_t table[256], const struct strip *s, const uint8_t *upper,
                          const uint8_t *lower, int32_t wy, uint8_t *to)
{
    for (int32_t i = s->first; i < s->end; i++) {
        const int32_t left = s->left[i], right = s->right[i], wx = s->wx[i];
        const int32_t a = upper[left] * (WEIGHT_ONE - wx) + upper[right] * wx,
                      b = lower[left] * (WEIGHT_ONE - wx) + lower[right] * wx;
        const int64_t sum = (int64_t)a * (WEIGHT_ONE - wy) + (int64_t)b * wy;
        to[i] = table[(sum + (INT64_C(1) << (2 * WEIGHT_BITS - 1))) >> (2 * WEIGHT_BITS)];
    }
}

static void fill_grey(const struct fv_model *model, const uint8_t table[256],
                      const struct fovea_image *image, const struct fv_nn_input_fit *fit,
                      const struct block *b, uint8_t *input)
{
    const struct fv_model_preprocess *p = &model->header->preprocess;
    const uint8_t pad = table[(uint8_t)p->pad];
    struct strip strip;
    for (int32_t x = 0; x < p->width; x += strip.count) {
        strip_begin(image, fit, x, p->width, &strip);
        for (int32_t i = 0; i < b->count; i++) {
            uint8_t *to = input + (ptrdiff_t)(b->begin + i) * p->width + x;
            memset(to, pad, (size_t)strip.count);
            if (b->shown[i])
                fill_grey_row(
                    table, &strip, image->data + (ptrdiff_t)b->up[i] * image->stride_bytes,
                    image->data + (ptrdiff_t)b->down[i] * image->stride_bytes, b->wy[i], to);
        }
    }
}

static bool is_grey(const struct fv_model *model, const struct fovea_image *image)
{
    return image->format == FOVEA_PIXEL_GREY8 && model->header->preprocess.channels == 1 &&
           model->tensors[model->inputs[0]].type == FV_TYPE_U8;
}

/* A grey frame of the network's own size needs no interpolation: most cameras' case, and thirty
 * times faster. */
static bool is_direct(const struct fv_model *model, const struct fovea_image *image,
                      const struct fv_nn_input_fit *fit)
{
    return is_grey(model, image) && fit->width == image->width && fit->height == image->height;
}

int32_t fv_nn_rows_per_unit(const struct fv_model *model, const struct fovea_image *image,
                            const struct fv_nn_input_fit *fit)
{
    enum { PIXELS = 9600, PIXELS_DIRECT = 96000 };
    const int32_t pixels = is_direct(model, image, fit) ? PIXELS_DIRECT : PIXELS,
                  width = model->header->preprocess.width;
    return width >= pixels ? 1 : pixels / (width < 1 ? 1 : width);
}

static void fill_direct(const struct fv_model *model, const uint8_t table[256],
                        const struct fovea_image *image, const struct fv_nn_input_fit *fit,
                        int32_t y, uint8_t *input)
{
    const int32_t width = model->header->preprocess.width, iy = y - fit->top;
    const uint8_t pad = table[(uint8_t)model->header->preprocess.pad];
    uint8_t *to = input + (ptrdiff_t)y * width;
    memset(to, pad, (size_t)width);
    if (iy < 0 || iy >= fit->height) return;
    const uint8_t *from = image->data + (ptrdiff_t)iy * image->stride_bytes;
    for (int32_t x = 0; x < fit->width; x++)
        to[fit->left + x] = table[from[x]];
}

void fv_nn_fill(const struct fv_model *model, const struct fovea_image *image,
                const struct fv_nn_input_fit *fit, const struct fv_nn_balance *balance,
                uint8_t *arena, int32_t begin, int32_t end)
{
    uint8_t *input = fv_nn_tensor(model, arena, model->inputs[0]);
    struct tables tables;
    struct block block = {.count = 0};
    make_tables(model, balance, &tables);
    if (is_direct(model, image, fit)) {
        for (int32_t y = begin; y < end; y++)
            fill_direct(model, tables.byte[0], image, fit, y, input);
        return;
    }
    for (int32_t y = begin; y < end; y += block.count) {
        block_begin(image, fit, y, end, &block);
        if (is_grey(model, image)) {
            fill_grey(model, tables.byte[0], image, fit, &block, input);
            continue;
        }
        for (int32_t x = 0; x < model->header->preprocess.width; x++)
            fill_column(model, &tables, image, fit, &block, x, input);
    }
}

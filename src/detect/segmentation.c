#include "detect/segmentation.h"

#include <string.h>

struct fv_segmentation_place fv_segmentation_place(const struct fv_model *model,
                                                   const struct fv_nn_input_fit *fit, int32_t width,
                                                   int32_t height)
{
    const struct fv_model_preprocess *p = &model->header->preprocess;
    const double sx = (double)p->width / width, sy = (double)p->height / height;
    return (struct fv_segmentation_place){
        .scale = {sx / (double)fit->scale_x, sy / (double)fit->scale_y},
        .offset = {(0.5 * sx - fit->left) / (double)fit->scale_x - 0.5,
                   (0.5 * sy - fit->top) / (double)fit->scale_y - 0.5}};
}

/* Of `mask` pixels along an axis of the input: those whose centre, (2 k + 1) input / (2 mask), lies
 * in the `size` pixels from `first` on; all of them where the input is no picture. */
static void find_part(int32_t first, int32_t size, int32_t input, int32_t mask, int32_t *begin,
                      int32_t *count)
{
    *begin = 0;
    *count = mask;
    if (input < 1) return;
    const int64_t one = (int64_t)2 * input, from = (int64_t)2 * first * mask - input,
                  to = (int64_t)2 * (first + size) * mask - input;
    const int64_t low = from > 0 ? (from + one - 1) / one : 0,
                  high = to > 0 ? (to + one - 1) / one : 0;
    *begin = (int32_t)(high > low ? low : (int64_t)(2 * first + size) * mask / one);
    *count = (int32_t)(high > low ? high - low : 1);
}

struct fovea_segmentation_part fv_segmentation_part(const struct fv_model *model,
                                                    const struct fv_nn_input_fit *fit,
                                                    int32_t width, int32_t height)
{
    const struct fv_model_preprocess *p = &model->header->preprocess;
    struct fovea_segmentation_part part;
    find_part(fit->left, fit->width, p->width, width, &part.left, &part.width);
    find_part(fit->top, fit->height, p->height, height, &part.top, &part.height);
    return part;
}

/* ---- colours --------------------------------------------------------------------------------- */

enum { COLOUR_BITS = 8 };

/* PASCAL VOC's (VOCdevkit, VOClabelcolormap.m): bit 0, 3, 6... of the number to red, from its
 * highest bit down; 1, 4, 7... to green; 2, 5, 8... to blue. */
static void voc_colour(uint32_t number, uint8_t rgb[3])
{
    memset(rgb, 0, 3);
    for (int bit = 0; bit < COLOUR_BITS; bit++, number >>= 3)
        for (int k = 0; k < 3; k++)
            rgb[k] |= (uint8_t)((number >> k & 1) << (COLOUR_BITS - 1 - bit));
}

/* Whether the first class is what is left when all others are taken: by its label, or there are
 * none. */
static bool begins_with_background(const struct fv_model *model)
{
    static const char *const names[] = {"background", "void", "unlabeled", "unlabelled", "none"};
    const char *label = fv_model_label(model, model->header->decode.first_label);
    if (label == NULL) return true;
    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        if (strcmp(label, names[i]) == 0) return true;
    return false;
}

void fv_segmentation_colour(const struct fv_model *model, int32_t class_id, int32_t object,
                            uint8_t rgb[3])
{
    const uint8_t *given = object < 0 ? fv_model_colour(model, class_id) : NULL;
    if (given != NULL)
        memcpy(rgb, given, 3);
    else if (object >= 0)
        voc_colour((uint32_t)object + 1, rgb);
    else
        voc_colour((uint32_t)class_id + !begins_with_background(model), rgb);
}

/* ---- the view -------------------------------------------------------------------------------- */

void fv_segmentation_view(const struct fv_model *model, const struct fv_nn_input_fit *fit,
                          const struct fv_detect_mask *mask, const uint8_t *pixels,
                          const uint8_t *confidence, struct fovea_segmentation *segmentation)
{
    const struct fv_model_preprocess *p = &model->header->preprocess;
    const struct fv_segmentation_place place =
        fv_segmentation_place(model, fit, mask->width, mask->height);
    *segmentation = (struct fovea_segmentation){
        .image_width = fit->image_width,
        .image_height = fit->image_height,
        .width = mask->width,
        .height = mask->height,
        .fit = {p->width, p->height, fit->left, fit->top, fit->width, fit->height},
        .part = fv_segmentation_part(model, fit, mask->width, mask->height),
        .raw_scale = {place.scale[0], place.scale[1]},
        .raw_offset = {place.offset[0], place.offset[1]},
        .count = (uint32_t)mask->count,
        .list = mask->segments,
        .pixels = pixels,
        .index = mask->index,
        .confidence = confidence,
    };
}

/* ---- at the size of the image ---------------------------------------------------------------- */

/* The pixel of the mask, along one axis, in which the centre of pixel x of the image lies, from
 * pixel to pixel: the whole part of (first + (2 x + 1) part / (2 image)) mask / input. */
struct walk {
    int64_t whole, rest, step_whole, step_rest, divisor;
    int64_t low, high; /* of the mask's pixels that show the image */
};

static struct walk walk_of(int32_t first, int32_t part, int32_t image, int32_t mask, int32_t input,
                           int32_t x)
{
    const int64_t divisor = (int64_t)2 * image * input, step = (int64_t)2 * part * mask,
                  begin = ((int64_t)2 * first * image + part) * mask + x * step;
    return (struct walk){
        begin / divisor, begin % divisor, step / divisor, step % divisor, divisor, 0, mask - 1};
}

/* Along the columns of a picture of the mask's view, `width` pixels wide. */
static struct walk columns_of(const struct fovea_segmentation *s, int32_t width)
{
    const struct fovea_segmentation_fit *f = &s->fit;
    struct walk walk = walk_of(f->left, f->width, width, s->width, f->input_width, 0);
    walk.low = s->part.left;
    walk.high = s->part.left + s->part.width - 1;
    return walk;
}

/* Along its rows, from row y on. */
static struct walk rows_of(const struct fovea_segmentation *s, int32_t height, int32_t y)
{
    const struct fovea_segmentation_fit *f = &s->fit;
    struct walk walk = walk_of(f->top, f->height, height, s->height, f->input_height, y);
    walk.low = s->part.top;
    walk.high = s->part.top + s->part.height - 1;
    return walk;
}

/* The nearest pixel of the mask that shows the image. */
static int64_t nearest(const struct walk *walk)
{
    const int64_t most = walk->whole < walk->high ? walk->whole : walk->high;
    return most > walk->low ? most : walk->low;
}

static void next(struct walk *walk)
{
    walk->whole += walk->step_whole;
    walk->rest += walk->step_rest;
    if (walk->rest < walk->divisor) return;
    walk->rest -= walk->divisor;
    walk->whole++;
}

void fovea_segmentation_enlarge(const struct fovea_segmentation *s, const uint8_t *values,
                                uint8_t *pixels)
{
    uint8_t of[256];
    for (int i = 0; i < 256; i++)
        of[i] = values == NULL ? s->index[i] : values[s->index[i]];
    struct walk row = rows_of(s, s->image_height, 0);
    for (int32_t y = 0; y < s->image_height; y++, next(&row)) {
        const uint8_t *from = s->pixels + nearest(&row) * s->width;
        struct walk column = columns_of(s, s->image_width);
        for (int32_t x = 0; x < s->image_width; x++, next(&column))
            *pixels++ = of[from[nearest(&column)]];
    }
}

/* What a pixel of each value of the mask is drawn with: (picture * keep + add) / 256. */
struct tint {
    uint16_t keep, add;
};

/* Of the classes of a network, by their number: 0, 255, 128, 64, 192, 32, 160 and so on. Colours
 * that differ may have one brightness, as most of VOC's have. */
static uint8_t brightness_of(int32_t number)
{
    if (number < 2) return number == 1 ? 255 : 0;
    uint32_t reversed = 0;
    for (int bit = 0; bit < 8; bit++)
        reversed |= ((uint32_t)(number - 1) >> bit & 1) << (7 - bit);
    return (uint8_t)reversed;
}

static void find_tints(const struct fovea_segmentation *s, struct tint tints[256])
{
    enum { PART = 102 }; /* of 256: two fifths */
    for (int i = 0; i < 256; i++) {
        tints[i] = (struct tint){256, 0};
        if (s->index[i] >= s->count) continue;
        const struct fovea_segmentation_class *c = &s->list[s->index[i]];
        const uint8_t brightness = brightness_of(c->object < 0 ? c->class_id : c->object);
        tints[i] = (struct tint){256 - PART, (uint16_t)(brightness * PART)};
    }
}

void fv_segmentation_overlay(const struct fovea_segmentation *s, uint8_t *pixels, int32_t width,
                             int32_t height, int32_t begin, int32_t end)
{
    const int32_t before = begin > 0 ? begin - 1 : 0;
    struct walk row = rows_of(s, height, before);
    const uint8_t *above = s->pixels + nearest(&row) * s->width;
    struct tint tints[256];
    find_tints(s, tints);
    for (int32_t y = before; y < end; y++, next(&row)) {
        const uint8_t *from = s->pixels + nearest(&row) * s->width;
        struct walk column = columns_of(s, width);
        uint8_t *to = pixels + (ptrdiff_t)y * width, left = s->index[from[nearest(&column)]];
        for (int32_t x = 0; x < width && y >= begin; x++, next(&column)) {
            const int64_t at = nearest(&column);
            const uint8_t value = from[at], here = s->index[value];
            to[x] = (uint8_t)((to[x] * tints[value].keep + tints[value].add) >> 8);
            if (here != left || here != s->index[above[at]]) to[x] = to[x] < 128 ? 255 : 0;
            left = here;
        }
        above = from;
    }
}

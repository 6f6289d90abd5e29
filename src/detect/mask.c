#include "detect/mask.h"

#include <string.h>

#include "detect/heads.h"
#include "detect/segmentation.h"

enum { PRODUCTS_PER_UNIT = 1 << 17, LABELS_PER_UNIT = 1 << 14 };

/* ---- the grid -------------------------------------------------------------------------------- */

static const struct fv_model_tensor *output_of(const struct fv_model *model, int32_t role)
{
    const int32_t given = model->header->decode.roles[role], place = given > 0 ? given - 1 : role;
    if ((uint32_t)place >= model->header->output_count) return NULL;
    return &model->tensors[model->outputs[place]];
}

/* Of a network that labels pixels: [h][w], [1][h][w] or [1][h][w][channels]. */
static int32_t channels_of(const struct fv_model_tensor *t)
{
    return t->rank == 4 ? t->dims[3] : 1;
}

void fv_detect_mask_size(const struct fv_model *model, int32_t *width, int32_t *height)
{
    const struct fv_model_decode *d = &model->header->decode;
    const bool labelled = d->kind == FV_DECODER_SEGMENT;
    *width = *height = 0;
    if (!labelled && d->kind != FV_DECODER_YOLOV8_SEG) return;
    const struct fv_model_tensor *t =
        output_of(model, labelled ? FV_ROLE_BOXES : FV_ROLE_PROTOTYPES);
    if (t == NULL || t->rank < 2 || t->rank > 4) return;
    if (labelled ? channels_of(t) > FOVEA_SEGMENTATION_CLASSES_MAX
                 : t->rank != 4 || d->coefficients < 1 || t->dims[3] != d->coefficients)
        return;
    const int32_t first = t->rank == 2 ? 0 : 1, h = t->dims[first], w = t->dims[first + 1];
    if ((t->rank > 2 && t->dims[0] != 1) || w > FV_DETECT_MASK_SIDE_MAX ||
        (int64_t)h * w > FV_DETECT_MASK_PIXELS_MAX)
        return;
    *width = w;
    *height = h;
}

bool fv_detect_mask_confident(const struct fv_model *model)
{
    const struct fv_model_decode *d = &model->header->decode;
    return d->kind == FV_DECODER_SEGMENT && d->probabilities != 0;
}

/* The pixels of one axis whose centres lie in [low, high) of the image. */
struct span {
    int32_t first, last; /* last exclusive */
};

/* Of `part`, the columns (axis 0) or the rows that lie in `s`. */
static struct span inside(const struct fovea_segmentation_part *part, int axis, struct span s)
{
    const int32_t first = axis == 0 ? part->left : part->top,
                  last = first + (axis == 0 ? part->width : part->height);
    return (struct span){s.first > first ? s.first : first, s.last < last ? s.last : last};
}

static struct span span_of(const struct fv_segmentation_place *place, int axis, double low,
                           double high, int32_t size)
{
    struct span s = {0, size};
    while (s.first < size && place->scale[axis] * s.first + place->offset[axis] < low)
        s.first++;
    while (s.last > s.first && place->scale[axis] * (s.last - 1) + place->offset[axis] >= high)
        s.last--;
    return s;
}

void fv_detect_mask_clear(const struct fv_model *model, struct fv_detect_mask *mask,
                          uint8_t *pixels, uint8_t *confidence)
{
    memset(mask, 0, sizeof *mask);
    memset(mask->index, FOVEA_SEGMENTATION_NONE, sizeof mask->index);
    fv_detect_mask_size(model, &mask->width, &mask->height);
    const size_t bytes = (size_t)mask->width * (size_t)mask->height;
    memset(pixels, FOVEA_SEGMENTATION_NONE, bytes);
    if (confidence != NULL) memset(confidence, 0, bytes);
}

static struct fovea_segmentation_class segment_of(const struct fv_model *model, int32_t class_id,
                                                  int32_t object, float score, uint32_t pixels)
{
    uint8_t rgb[3];
    fv_segmentation_colour(model, class_id, object, rgb);
    return (struct fovea_segmentation_class){.class_id = class_id,
                                             .object = object,
                                             .score = score,
                                             .pixels = pixels,
                                             .red = rgb[0],
                                             .green = rgb[1],
                                             .blue = rgb[2]};
}

/* ---- objects by prototypes ------------------------------------------------------------------- */

/* Coefficients of an object: whole numbers beside a scale above 0, or real ones. */
struct coefficients {
    bool whole;
    int32_t count, zero; /* zero: of the prototypes */
    int16_t whole_value[FV_MODEL_COEFFICIENTS_MAX];
    float value[FV_MODEL_COEFFICIENTS_MAX];
};

static void read_coefficients(const struct fv_head_job *j, const struct fv_head_output *prototypes,
                              int32_t item, struct coefficients *c)
{
    const struct fv_head_output *o = fv_head_role(j, FV_ROLE_BOXES);
    const int64_t n = fv_head_last_dim(o), rows = n > 0 ? fv_head_count(o) / n : 0;
    c->count = j->d->coefficients;
    c->whole = o->t->type == FV_TYPE_U8 && prototypes->t->type == FV_TYPE_U8;
    c->zero = prototypes->t->zero;
    for (int32_t i = 0; i < c->count; i++) {
        const int64_t at = (rows - c->count + i) * n + item;
        c->value[i] = fv_head_value(o, at);
        c->whole_value[i] = c->whole ? (int16_t)(o->data[at] - o->t->zero) : 0;
    }
}

static bool is_inside(const struct coefficients *c, const struct fv_head_output *prototypes,
                      int64_t pixel)
{
    const int64_t at = pixel * c->count;
    if (c->whole) {
        const uint8_t *from = prototypes->data + at;
        int32_t sum = 0;
        for (int32_t i = 0; i < c->count; i++)
            sum += c->whole_value[i] * (from[i] - c->zero);
        return sum > 0;
    }
    double sum = 0;
    for (int32_t i = 0; i < c->count; i++)
        sum += (double)c->value[i] * (double)fv_head_value(prototypes, at + i);
    return sum > 0;
}

bool fv_detect_mask_objects(const struct fv_head_job *j, const struct fovea_detection *objects,
                            const int32_t *items, int32_t count, struct fv_detect_mask *mask,
                            uint8_t *pixels, int64_t *object, int32_t *row)
{
    const struct fv_head_output *prototypes = fv_head_role(j, FV_ROLE_PROTOTYPES);
    const struct fv_segmentation_place place =
        fv_segmentation_place(j->model, j->fit, mask->width, mask->height);
    if (count > FOVEA_SEGMENTATION_OBJECTS_MAX) count = FOVEA_SEGMENTATION_OBJECTS_MAX;
    if (*object >= count) return true;
    const int32_t i = (int32_t)*object;
    const struct fovea_detection *d = &objects[i];
    const struct fovea_segmentation_part part =
        fv_segmentation_part(j->model, j->fit, mask->width, mask->height);
    const struct span x = inside(&part, 0,
                                 span_of(&place, 0, (double)d->x_min_px, (double)d->x_max_px,
                                         mask->width)),
                      y = inside(&part, 1,
                                 span_of(&place, 1, (double)d->y_min_px, (double)d->y_max_px,
                                         mask->height));
    struct coefficients c;
    read_coefficients(j, prototypes, items[i], &c);
    uint32_t taken = 0;
    int32_t left = PRODUCTS_PER_UNIT;
    if (*row < y.first) *row = y.first;
    for (; *row < y.last && left > 0; ++*row, left -= (x.last - x.first) * c.count) {
        for (int32_t k = x.first; k < x.last; k++) {
            const int64_t at = (int64_t)*row * mask->width + k;
            if (pixels[at] != FOVEA_SEGMENTATION_NONE || !is_inside(&c, prototypes, at)) continue;
            pixels[at] = (uint8_t)i;
            taken++;
        }
    }
    mask->pixels[i] += taken;
    if (*row < y.last) return false;
    mask->segments[i] = segment_of(j->model, d->class_id, i, d->score, mask->pixels[i]);
    mask->index[i] = (uint8_t)i;
    mask->count = i + 1;
    *row = 0;
    return ++*object == count;
}

/* ---- a class for each pixel ------------------------------------------------------------------ */

/* The place of the largest of a pixel's scores, the first of equal ones. */
static int32_t best_of(const struct fv_head_output *o, int32_t channels, int64_t at)
{
    int32_t best = 0;
    if (o->t->type == FV_TYPE_U8) { /* the scale is above 0 */
        const uint8_t *from = o->data + at;
        for (int32_t c = 1; c < channels; c++)
            if (from[c] > from[best]) best = c;
        return best;
    }
    for (int32_t c = 1; c < channels; c++)
        if (fv_head_value(o, at + c) > fv_head_value(o, at + best)) best = c;
    return best;
}

/* The class of a pixel: its number, or the place of its largest score; of one score whether it
 * reaches the threshold. `score` takes that of the class, or of there being none. */
static int32_t class_of(const struct fv_head_job *j, const struct fv_head_output *o,
                        int32_t channels, int64_t pixel, float *score)
{
    const int64_t at = pixel * channels;
    if (channels > 1) {
        const int32_t best = best_of(o, channels, at);
        *score = fv_head_value(o, at + best);
        return best;
    }
    const float value = fv_head_value(o, at);
    if (j->d->classes == 1) {
        const bool is_it = value >= fv_head_least(j, 0);
        *score = is_it ? value : 1.0f - value;
        return is_it ? 0 : -1;
    }
    *score = 0;
    return value > -0.5f && value < (float)FOVEA_SEGMENTATION_NONE ? (int32_t)(value + 0.5f) : -1;
}

/* The classes that pixels have, by their number. */
static void list_classes(const struct fv_model *model, struct fv_detect_mask *mask)
{
    for (int c = 0; c < FOVEA_SEGMENTATION_CLASSES_MAX; c++) {
        if (mask->pixels[c] == 0) continue;
        mask->segments[mask->count] = segment_of(model, c, -1, __builtin_nanf(""), mask->pixels[c]);
        mask->index[c] = (uint8_t)mask->count++;
    }
}

bool fv_detect_mask_classes(const struct fv_head_job *j, struct fv_detect_mask *mask,
                            uint8_t *pixels, uint8_t *confidence, int64_t *at)
{
    const struct fv_head_output *o = fv_head_role(j, FV_ROLE_BOXES);
    const struct fovea_segmentation_part part =
        fv_segmentation_part(j->model, j->fit, mask->width, mask->height);
    const int32_t channels = channels_of(o->t);
    const struct span x = inside(&part, 0, (struct span){0, mask->width}),
                      y = inside(&part, 1, (struct span){0, mask->height});
    int32_t left = LABELS_PER_UNIT / channels + 1;
    const int64_t end = (int64_t)y.last * mask->width;
    if (*at < (int64_t)y.first * mask->width) *at = (int64_t)y.first * mask->width;
    int32_t next = *at < end ? (int32_t)(*at % mask->width) : 0;
    for (; *at < end && left > 0; ++*at, --left) {
        const int32_t column = next;
        next = next + 1 < mask->width ? next + 1 : 0;
        if (column < x.first || column >= x.last) continue;
        float score;
        const int32_t class_id = class_of(j, o, channels, *at, &score);
        if (confidence != NULL)
            confidence[*at] = (uint8_t)(fv_head_clamp(score, 1.0f) * 255.0f + 0.5f);
        if (class_id < 0 || class_id >= FOVEA_SEGMENTATION_NONE) continue;
        pixels[*at] = (uint8_t)class_id;
        mask->pixels[class_id]++;
    }
    if (*at < end) return false;
    list_classes(j->model, mask);
    return true;
}

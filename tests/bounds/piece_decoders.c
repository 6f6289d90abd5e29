/* Of networks' outputs: candidates, keypoints and masks of objects, by decoders on the shapes that
 * give most of them. */
#include <stdlib.h>
#include <string.h>

#include "bounds/counter.h"
#include "bounds/limits.h"
#include "bounds/pieces.h"
#include "detect/decode.h"
#include "detect/mask.c"

LIMIT(PRODUCTS_PER_UNIT, MASK_PRODUCTS);

enum { IMAGE = 640, ROWS = 14000, ANCHORS = ROWS, OUTPUTS = 3, MASK_ROWS = 64 };

/* A file's head with a table of anchors behind it. */
struct file {
    struct fv_model_header header;
    float anchors[ANCHORS][4];
};

struct decoding {
    struct file *file;
    struct fv_model_tensor tensors[1 + OUTPUTS];
    struct fv_model model;
    struct fv_nn_input_fit fit;
    struct fv_detect_limits limits;
    struct fv_detect_scratch *scratch;
    struct fv_detect_mask mask;
    struct fv_detect_room room;
    uint8_t *arena;
    size_t used;
    enum fovea_status status;
};

/* A decoder's outputs: as many rows as fill more than a unit; 0: no second one. */
struct shape {
    int32_t kind;
    int32_t rank, dims[4], second[2];
    int32_t points; /* of each object */
    int32_t values; /* of each point, its score the last of three */
    int32_t normalised;
};

static const int32_t inputs[1] = {0}, outputs[OUTPUTS] = {1, 2, 3};

static void add_output(struct decoding *w, int32_t rank, const int32_t *dims, int32_t type)
{
    const uint32_t number = 1 + w->file->header.output_count++;
    struct fv_model_tensor *t = &w->tensors[number];
    size_t count = 1;
    *t = (struct fv_model_tensor){.type = type,
                                  .rank = rank,
                                  .storage = (int32_t)number,
                                  .offset = (int32_t)w->used,
                                  .scale = 1.0f / 128,
                                  .zero = 0};
    for (int32_t i = 0; i < rank; i++) {
        t->dims[i] = dims[i];
        count *= (size_t)dims[i];
    }
    const size_t bytes = count * (type == FV_TYPE_F32 ? 4 : 1);
    t->bytes = (int32_t)bytes;
    w->arena = realloc(w->arena, w->used + bytes);
    MUST(w->arena != NULL);
    float *values = (float *)(void *)(w->arena + w->used);
    /* Each is larger than those before it, so that the best candidates are all replaced. */
    for (size_t i = 0; i < count && type == FV_TYPE_F32; i++)
        values[i] = 0.3f + 0.6f * (float)i / (float)count;
    if (type != FV_TYPE_F32) memset(w->arena + w->used, 100, bytes);
    w->used += (bytes + 63) / 64 * 64;
}

static void begin_model(struct decoding *w, int32_t kind)
{
    memset(&w->file->header, 0, sizeof w->file->header);
    w->file->header.input_count = 1;
    w->file->header.file_bytes = sizeof *w->file;
    w->file->header.preprocess =
        (struct fv_model_preprocess){.width = IMAGE, .height = IMAGE, .channels = 3};
    w->file->header.decode = (struct fv_model_decode){.kind = kind,
                                                      .iou_threshold = 1,
                                                      .anchor_count = 1,
                                                      .anchors = {1, 1},
                                                      .box_scales = {1, 1, 1, 1},
                                                      .anchor_data = sizeof w->file->header};
    for (int i = 0; i < ANCHORS; i++)
        for (int k = 0; k < 4; k++)
            w->file->anchors[i][k] = k < 2 ? 0.5f : 1;
    w->tensors[0] = (struct fv_model_tensor){.rank = 4, .dims = {1, IMAGE, IMAGE, 3}};
    w->used = 0;
    w->model = (struct fv_model){.base = (const uint8_t *)w->file,
                                 .header = &w->file->header,
                                 .tensors = w->tensors,
                                 .inputs = inputs,
                                 .outputs = outputs};
    w->limits = (struct fv_detect_limits){.iou = 1};
}

static void unit(void *context)
{
    struct decoding *w = context;
    w->status =
        fv_detect_decode_unit(&w->model, w->arena, &w->fit, &w->limits, w->scratch, &w->room);
}

/* ---- candidates and keypoints ---------------------------------------------------------------- */

static void decode(struct decoding *w)
{
    fv_detect_decode_start(w->scratch);
    do {
        const int32_t phase = w->scratch->progress.phase;
        const double took = (double)counter_of(unit, w);
        piece_note(phase == FV_DECODE_SCAN       ? PIECE_candidates_read
                   : phase == FV_DECODE_SORT     ? PIECE_candidates_sorted
                   : phase == FV_DECODE_SUPPRESS ? PIECE_candidates_removed
                                                 : PIECE_keypoints_read,
                   took);
    } while (w->status == FOVEA_AGAIN);
}

/* The decoders that give keypoints or turned boxes, or whose candidates are dear. */
static void of_shapes(struct decoding *w)
{
    static const struct shape shapes[] = {
        {FV_DECODER_YOLOV5, 3, {1, ROWS, 6}, {0}, 0, 0, 1},
        {FV_DECODER_YOLOV8, 3, {1, 5, ROWS}, {0}, 0, 0, 1},
        {FV_DECODER_YOLOV8_OBB, 3, {1, 6, ROWS}, {0}, 0, 0, 1},
        {FV_DECODER_YOLOV8_POSE, 3, {1, 5 + 3, ROWS}, {0}, 1, 3, 1},
        {FV_DECODER_YOLOV8_POSE, 3, {1, 5 + 90, ROWS / 16}, {0}, 30, 3, 1},
        {FV_DECODER_END2END, 3, {1, ROWS, 6}, {0}, 0, 0, 1},
        {FV_DECODER_END2END, 3, {1, ROWS / 16, 6 + 90}, {0}, 30, 3, 1},
        {FV_DECODER_MOVENET, 3, {1, ROWS, 3 + 5}, {0}, 1, 3, 1},
        {FV_DECODER_MOVENET, 3, {1, ROWS / 16, 90 + 5}, {0}, 30, 3, 1},
        {FV_DECODER_BLAZE, 3, {1, ROWS / 2, 4 + 60}, {1, ROWS / 2}, 30, 2, 0},
        {FV_DECODER_LANDMARKS, 2, {1, 3000}, {1, 1}, 1000, 3, 0},
        {FV_DECODER_YOLOX, 3, {1, 6400, 6}, {0}, 0, 0, 0},
        {FV_DECODER_SSD_RAW, 3, {1, ROWS, 4}, {1, 2 * ROWS}, 0, 0, 0},
        {FV_DECODER_CLASSIFIER, 2, {1, FV_MODEL_LABELS_MAX}, {0}, 0, 0, 0},
    };
    for (size_t i = 0; i < sizeof shapes / sizeof *shapes; i++) {
        const struct shape *s = &shapes[i];
        struct fv_model_decode *d = &w->file->header.decode;
        begin_model(w, s->kind);
        d->point_count = s->points;
        d->point_values = s->values;
        d->point_score = s->values == 3 ? 2 : 0;
        d->normalised = s->normalised;
        d->logits = FV_LOGITS_SCORES | FV_LOGITS_POINTS;
        add_output(w, s->rank, s->dims, FV_TYPE_F32);
        if (s->second[0] > 0) add_output(w, 2, s->second, FV_TYPE_F32);
        decode(w);
        MUST(w->status == FOVEA_OK && w->scratch->count > 0);
    }
}

/* ---- masks of objects ------------------------------------------------------------------------ */

static void clear(void *context)
{
    struct decoding *w = context;
    fv_detect_mask_clear(&w->model, &w->mask, w->room.pixels, NULL);
}

/* One object over all of a mask, no pixel of which another has. */
static double mask_unit(struct decoding *w, int32_t coefficients, int32_t type)
{
    const int32_t prototypes[4] = {1, MASK_ROWS, MASK_SIDE, coefficients},
                  boxes[3] = {1, 5 + coefficients, 8};
    begin_model(w, FV_DECODER_YOLOV8_SEG);
    struct fv_model_decode *d = &w->file->header.decode;
    d->coefficients = coefficients;
    d->normalised = 1;
    d->roles[FV_ROLE_PROTOTYPES] = 2;
    add_output(w, 3, boxes, type);
    add_output(w, 4, prototypes, type);
    fv_detect_mask_clear(&w->model, &w->mask, w->room.pixels, NULL);
    MUST(w->mask.width == MASK_SIDE);
    w->scratch->progress = (struct fv_detect_progress){.phase = FV_DECODE_MASK};
    w->scratch->count = w->scratch->sure = 2;
    w->scratch->items[0] = w->scratch->items[1] = 7;
    w->scratch->candidates[0] = w->scratch->candidates[1] =
        (struct fovea_detection){.x_max_px = IMAGE, .y_max_px = IMAGE, .score = 1};
    const double took = (double)counter_of(unit, w);
    MUST(w->mask.pixels[0] > 0);
    return took;
}

/* Of a pixel with one coefficient, and what each one more adds. */
static void of_masks(struct decoding *w)
{
    static const int32_t types[] = {FV_TYPE_U8, FV_TYPE_F32};
    for (size_t i = 0; i < sizeof types / sizeof *types; i++) {
        const double one = mask_unit(w, 1, types[i]);
        piece_note(PIECE_mask_pixel, one / w->mask.pixels[0]);
        const double all = mask_unit(w, MASK_COEFFICIENTS, types[i]);
        piece_note(PIECE_mask_product, all / ((double)w->mask.pixels[0] * MASK_COEFFICIENTS));
    }
    NOTE(mask_cleared, clear, w, MASK_ROWS * MASK_SIDE);
}

void pieces_of_decoders(void)
{
    static struct decoding w;
    const uint8_t pixel = 0;
    const struct fovea_image image = {.data = &pixel,
                                      .width = IMAGE,
                                      .height = IMAGE,
                                      .stride_bytes = IMAGE,
                                      .format = FOVEA_PIXEL_GREY8};
    w.file = calloc(1, sizeof *w.file);
    w.scratch = calloc(1, sizeof *w.scratch);
    w.room.points = calloc(FOVEA_KEYPOINTS_MAX, sizeof *w.room.points);
    w.room.pixels = calloc(MASK_ROWS, MASK_SIDE);
    MUST(w.file != NULL && w.scratch != NULL && w.room.points != NULL && w.room.pixels != NULL);
    w.room.mask = &w.mask;
    begin_model(&w, FV_DECODER_YOLOV8);
    MUST(fv_nn_input_fit_of(&w.model, &image, &w.fit) == FOVEA_OK);
    of_shapes(&w);
    of_masks(&w);
    free(w.file);
    free(w.scratch);
    free(w.room.points);
    free(w.room.pixels);
    free(w.arena);
}

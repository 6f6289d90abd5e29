#include "detect/heads.h"

#include <string.h>

#include "nn/run.h"

/* ---- candidates ------------------------------------------------------------------------------ */

const struct fv_head_output *fv_head_role(const struct fv_head_job *j, int32_t role)
{
    const int32_t place = j->d->roles[role] > 0 ? j->d->roles[role] - 1 : role;
    return place < j->out_count ? &j->out[place] : NULL;
}

static float threshold_of(const struct fv_head_job *j, int32_t class_id)
{
    const float own = j->thresholds != NULL && class_id < j->d->classes ? j->thresholds[class_id]
                                                                        : j->d->score_threshold;
    return own > j->score_threshold ? own : j->score_threshold;
}

float fv_head_least(const struct fv_head_job *j, int32_t class_id)
{
    const float threshold = threshold_of(j, class_id);
    return j->floor > 0.0f && j->floor < threshold ? j->floor : threshold;
}

/* A score above 1, which the rounding of a quantised sigmoid or product may give, is 1: whatever a
 * model's outputs hold, no other score leaves a decoder. */
static void keep(struct fv_head_job *j, int64_t item, struct fovea_detection *found, float score,
                 int32_t class_id)
{
    found->score = fv_head_clamp(score, 1.0f);
    found->class_id = class_id;
    fv_detect_keep(j->s, found, item, found->score < threshold_of(j, class_id));
}

void fv_head_add_box(struct fv_head_job *j, int64_t item, float x0, float y0, float x1, float y1,
                     float score, int32_t class_id)
{
    const struct fv_nn_input_fit *v = j->fit;
    const float width = (float)v->image_width, height = (float)v->image_height;
    struct fovea_detection found = {
        .x_min_px = fv_head_clamp((x0 - (float)v->left) / v->scale_x, width) - 0.5f,
        .y_min_px = fv_head_clamp((y0 - (float)v->top) / v->scale_y, height) - 0.5f,
        .x_max_px = fv_head_clamp((x1 - (float)v->left) / v->scale_x, width) - 0.5f,
        .y_max_px = fv_head_clamp((y1 - (float)v->top) / v->scale_y, height) - 0.5f,
    };
    if (found.x_max_px > found.x_min_px && found.y_max_px > found.y_min_px)
        keep(j, item, &found, score, class_id);
}

void fv_head_add_centred(struct fv_head_job *j, int64_t item, float x, float y, float w, float h,
                         float score, int32_t class_id)
{
    const struct fv_model_preprocess *p = &j->model->header->preprocess;
    const float sx = j->d->normalised ? (float)p->width : 1.0f,
                sy = j->d->normalised ? (float)p->height : 1.0f;
    fv_head_add_box(j, item, (x - w * 0.5f) * sx, (y - h * 0.5f) * sy, (x + w * 0.5f) * sx,
                    (y + h * 0.5f) * sy, score, class_id);
}

/* A side of the box, from the input to the image: a vector. */
static float side_of(const struct fv_nn_input_fit *v, float length, double cosine, double sine,
                     double vector[2])
{
    vector[0] = (double)length * cosine / (double)v->scale_x;
    vector[1] = (double)length * sine / (double)v->scale_y;
    return (float)__builtin_sqrt(vector[0] * vector[0] + vector[1] * vector[1]);
}

void fv_head_add_turned(struct fv_head_job *j, int64_t item, const float box[4], float angle,
                        float score, int32_t class_id)
{
    const bool plausible = angle > -100.0f && angle < 100.0f;
    const double turn = plausible ? (double)angle : 0.0, cosine = fv_cos(turn), sine = fv_sin(turn);
    const struct fovea_keypoint centre = fv_head_keypoint(j, box[0], box[1], 0);
    double along[2], across[2];
    const float w = side_of(j->fit, box[2], cosine, sine, along),
                h = side_of(j->fit, box[3], -sine, cosine, across);
    struct fovea_detection found = {.x_min_px = centre.x_px - 0.5f * w,
                                    .y_min_px = centre.y_px - 0.5f * h,
                                    .x_max_px = centre.x_px + 0.5f * w,
                                    .y_max_px = centre.y_px + 0.5f * h,
                                    .angle = (float)fv_atan2(along[1], along[0])};
    if (w > 0 && h > 0 && w < 1e6f && h < 1e6f) keep(j, item, &found, score, class_id);
}

void fv_head_add_plain(struct fv_head_job *j, int64_t item, float score, int32_t class_id)
{
    struct fovea_detection found = {0};
    keep(j, item, &found, score, class_id);
}

/* A number whatever a network's real outputs hold. */
static float plain(float value)
{
    const float far = 1e6f;
    return value > -far ? (value < far ? value : far) : -far;
}

struct fovea_keypoint fv_head_keypoint(const struct fv_head_job *j, float x, float y, float score)
{
    const struct fv_nn_input_fit *v = j->fit;
    return (struct fovea_keypoint){.x_px = plain((x - (float)v->left) / v->scale_x - 0.5f),
                                   .y_px = plain((y - (float)v->top) / v->scale_y - 0.5f),
                                   .score = score == score ? fv_head_clamp(score, 1.0f) : score};
}

/* ---- classifiers ----------------------------------------------------------------------------- */

static int64_t classifier_items(const struct fv_head_job *j, int64_t *cost)
{
    *cost = 1;
    return fv_head_count(&j->out[0]);
}

static void classifier_scan(struct fv_head_job *j, int64_t begin, int64_t end)
{
    const struct fv_model_preprocess *p = &j->model->header->preprocess;
    const int32_t background = j->d->background ? 1 : 0;
    for (int64_t i = begin > background ? begin : background; i < end; i++) {
        const float score = fv_head_value(&j->out[0], i);
        const int32_t class_id = (int32_t)i - background;
        if (score >= fv_head_least(j, class_id))
            fv_head_add_box(j, i, 0, 0, (float)p->width, (float)p->height, score, class_id);
    }
}

/* ---- SSD: the outputs of TFLite_Detection_PostProcess ---------------------------------------- */

static int64_t ssd_items(const struct fv_head_job *j, int64_t *cost)
{
    *cost = 6;
    if (j->out_count < 4) return 0;
    const int64_t slots = fv_head_count(&j->out[2]);
    if (fv_head_count(&j->out[0]) < slots * 4 || fv_head_count(&j->out[1]) < slots) return 0;
    const float given = fv_head_value(&j->out[3], 0);
    return given > 0.0f && given < (float)slots ? (int64_t)given : (given > 0.0f ? slots : 0);
}

static void ssd_scan(struct fv_head_job *j, int64_t begin, int64_t end)
{
    const struct fv_model_preprocess *p = &j->model->header->preprocess;
    const struct fv_head_output *b = &j->out[0];
    const float w = (float)p->width, h = (float)p->height;
    for (int64_t i = begin; i < end; i++) {
        const float score = fv_head_value(&j->out[2], i),
                    class_value = fv_head_value(&j->out[1], i);
        const int32_t class_id =
            class_value >= 0.0f && class_value < 4096.0f ? (int32_t)class_value : 0;
        if (!(score >= fv_head_least(j, class_id))) continue;
        fv_head_add_box(j, i, fv_head_value(b, 4 * i + 1) * w, fv_head_value(b, 4 * i) * h,
                        fv_head_value(b, 4 * i + 3) * w, fv_head_value(b, 4 * i + 2) * h, score,
                        class_id);
    }
}

/* ---- SSD before its post-processing ---------------------------------------------------------- */

/* Box encodings [n][4] and scores [n][1 + classes], in either order, with the anchors of the file;
 * class 0 is background. */

static const struct fv_head_output *ssd_raw_boxes(const struct fv_head_job *j)
{
    return &j->out[fv_head_last_dim(&j->out[0]) != 4 && fv_head_last_dim(&j->out[1]) == 4];
}

static const struct fv_head_output *ssd_raw_scores(const struct fv_head_job *j)
{
    return ssd_raw_boxes(j) == &j->out[0] ? &j->out[1] : &j->out[0];
}

static int64_t ssd_raw_columns(const struct fv_head_job *j)
{
    const int64_t n = fv_head_count(ssd_raw_boxes(j)) / 4;
    return n > 0 ? fv_head_count(ssd_raw_scores(j)) / n : 0;
}

static int64_t ssd_raw_items(const struct fv_head_job *j, int64_t *cost)
{
    const struct fv_model_header *h = j->model->header;
    if (j->out_count < 2 || j->d->anchor_data < FV_MODEL_HEADER_BYTES || j->d->anchor_data % 4 != 0)
        return 0;
    const int64_t n = fv_head_count(ssd_raw_boxes(j)) / 4, columns = ssd_raw_columns(j);
    *cost = columns;
    return columns < 2 || j->d->anchor_data + n * 16 > (int64_t)h->file_bytes ? 0 : n;
}

static void ssd_raw_box(struct fv_head_job *j, int64_t i, float score, int32_t class_id)
{
    const struct fv_model_preprocess *p = &j->model->header->preprocess;
    const float *anchor = (const float *)(const void *)(j->model->base + j->d->anchor_data) + 4 * i,
                *scale = j->d->box_scales;
    const struct fv_head_output *b = ssd_raw_boxes(j);
    const float cy = fv_head_value(b, 4 * i) / scale[0] * anchor[2] + anchor[0];
    const float cx = fv_head_value(b, 4 * i + 1) / scale[1] * anchor[3] + anchor[1];
    const float bh =
        (float)fv_exp((double)fv_head_value(b, 4 * i + 2) / (double)scale[2]) * anchor[2];
    const float bw =
        (float)fv_exp((double)fv_head_value(b, 4 * i + 3) / (double)scale[3]) * anchor[3];
    fv_head_add_box(j, i, (cx - bw * 0.5f) * (float)p->width, (cy - bh * 0.5f) * (float)p->height,
                    (cx + bw * 0.5f) * (float)p->width, (cy + bh * 0.5f) * (float)p->height, score,
                    class_id);
}

static void ssd_raw_scan(struct fv_head_job *j, int64_t begin, int64_t end)
{
    const struct fv_head_output *scores = ssd_raw_scores(j);
    const int64_t columns = ssd_raw_columns(j);
    for (int64_t i = begin; i < end; i++) {
        for (int64_t c = 1; c < columns; c++) {
            const float score = fv_head_value(scores, i * columns + c);
            if (score >= fv_head_least(j, (int32_t)c - 1)) ssd_raw_box(j, i, score, (int32_t)c - 1);
        }
    }
}

/* ---- FOMO: cells of a class that touch are one object; its box is theirs, its score the best - */

/* A grid of cells by classes, of which the first is background. */
struct grid {
    const struct fv_head_output *o;
    int32_t w, h, classes, class_id;
    float threshold;
};

struct cells {
    int32_t x0, x1, y0, y1;
    float score;
};

static int is_object(const struct grid *g, int32_t cell)
{
    return fv_head_value(g->o, (int64_t)cell * g->classes + g->class_id + 1) >= g->threshold;
}

/* All cells that touch `start` (8 neighbours) over other cells of the object; each enters the stack
 * once. */
static struct cells grow(const struct grid *g, int32_t start, uint8_t *seen, int32_t *stack)
{
    struct cells c = {.x0 = g->w, .x1 = -1, .y0 = g->h, .y1 = -1, .score = 0};
    int32_t top = 1;
    stack[0] = start;
    seen[start] = 1;
    while (top > 0) {
        const int32_t cell = stack[--top], x = cell % g->w, y = cell / g->w;
        const float value = fv_head_value(g->o, (int64_t)cell * g->classes + g->class_id + 1);
        c.score = value > c.score ? value : c.score;
        c.x0 = x < c.x0 ? x : c.x0;
        c.x1 = x > c.x1 ? x : c.x1;
        c.y0 = y < c.y0 ? y : c.y0;
        c.y1 = y > c.y1 ? y : c.y1;
        for (int32_t k = 0; k < 9; k++) {
            const int32_t nx = x + k % 3 - 1, ny = y + k / 3 - 1, next = ny * g->w + nx;
            if (nx < 0 || nx >= g->w || ny < 0 || ny >= g->h || seen[next] || !is_object(g, next))
                continue;
            seen[next] = 1;
            stack[top++] = next;
        }
    }
    return c;
}

static int64_t fomo_items(const struct fv_head_job *j, int64_t *cost)
{
    const struct fv_model_tensor *t = j->out[0].t;
    if (t->rank != 4 || (int64_t)t->dims[1] * t->dims[2] > FV_DETECT_CELLS_MAX) return 0;
    *cost = 8 * (int64_t)t->dims[1] * t->dims[2];
    return t->dims[3] - 1;
}

static void fomo_scan(struct fv_head_job *j, int64_t begin, int64_t end)
{
    const struct fv_head_output *o = &j->out[0];
    const struct fv_model_preprocess *p = &j->model->header->preprocess;
    struct grid g = {.o = o, .h = o->t->dims[1], .w = o->t->dims[2], .classes = o->t->dims[3]};
    const int32_t cells = g.h * g.w;
    const float cell_w = (float)p->width / (float)g.w, cell_h = (float)p->height / (float)g.h;
    for (g.class_id = (int32_t)begin; g.class_id < (int32_t)end; g.class_id++) {
        g.threshold = threshold_of(j, g.class_id);
        memset(j->s->seen, 0, (size_t)cells);
        for (int32_t start = 0; start < cells; start++) {
            if (j->s->seen[start] || !is_object(&g, start)) continue;
            const struct cells c = grow(&g, start, j->s->seen, j->s->stack);
            fv_head_add_box(j, start, (float)c.x0 * cell_w, (float)c.y0 * cell_h,
                            (float)(c.x1 + 1) * cell_w, (float)(c.y1 + 1) * cell_h, c.score,
                            g.class_id);
        }
    }
}

/* ---- a class for each pixel: mask.c reads it ------------------------------------------------- */

static int64_t segment_items(const struct fv_head_job *j, int64_t *cost)
{
    (void)j;
    *cost = 1;
    return 0;
}

const struct fv_head *fv_head_of(int32_t decoder)
{
    static const struct fv_head classifier = {classifier_items, classifier_scan, 0,
                                              FV_DETECT_CLASSES, NULL},
                                ssd = {ssd_items, ssd_scan, 0, FV_DETECT_BOXES, NULL},
                                ssd_raw = {ssd_raw_items, ssd_raw_scan, 1, FV_DETECT_BOXES, NULL},
                                fomo = {fomo_items, fomo_scan, 0, FV_DETECT_BOXES, NULL},
                                segment = {segment_items, NULL, 0, FV_DETECT_MASK, NULL};
    static const struct fv_head *const heads[FV_DECODER_COUNT] = {
        [FV_DECODER_CLASSIFIER] = &classifier,
        [FV_DECODER_SSD] = &ssd,
        [FV_DECODER_SSD_RAW] = &ssd_raw,
        [FV_DECODER_YOLOV5] = &fv_head_yolov5,
        [FV_DECODER_YOLOV8] = &fv_head_yolov8,
        [FV_DECODER_YOLOV2] = &fv_head_yolov2,
        [FV_DECODER_FOMO] = &fomo,
        [FV_DECODER_SEGMENT] = &segment,
        [FV_DECODER_YOLOV8_SEG] = &fv_head_yolov8_seg,
        [FV_DECODER_YOLOV8_POSE] = &fv_head_yolov8_pose,
        [FV_DECODER_YOLOV8_OBB] = &fv_head_yolov8_obb,
        [FV_DECODER_YOLOX] = &fv_head_yolox,
        [FV_DECODER_YOLOV3] = &fv_head_yolov3,
        [FV_DECODER_END2END] = &fv_head_end2end,
        [FV_DECODER_MOVENET] = &fv_head_movenet,
        [FV_DECODER_BLAZE] = &fv_head_blaze,
        [FV_DECODER_LANDMARKS] = &fv_head_landmarks};
    return decoder >= 0 && decoder < FV_DECODER_COUNT ? heads[decoder] : NULL;
}

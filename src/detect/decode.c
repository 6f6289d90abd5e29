#include "detect/decode.h"

#include <string.h>

#include "fovea/elementary.h"
#include "nn/run.h"

/* One output tensor, read element by element as real numbers. */
struct output {
    const struct fv_model_tensor *t;
    const uint8_t *data;
};

struct job {
    const struct fv_model *model;
    const struct fv_model_decode *d;
    const struct fv_detect_view *view;
    struct fv_detect_scratch *s;
    const float *thresholds; /* by class, or NULL */
    struct output out[FV_MODEL_IO_MAX];
};

static int64_t count_of(const struct output *o)
{
    int64_t count = 1;
    for (int32_t i = 0; i < o->t->rank; ++i) count *= o->t->dims[i];
    return count;
}

static float value_at(const struct output *o, int64_t i)
{
    if (o->t->type == FV_TYPE_F32) return ((const float *)(const void *)o->data)[i];
    if (o->t->type == FV_TYPE_U8) return o->t->scale * (float)(o->data[i] - o->t->zero);
    if (o->t->type == FV_TYPE_I32) return (float)((const int32_t *)(const void *)o->data)[i];
    return (float)((const int64_t *)(const void *)o->data)[i];
}

static float threshold_of(const struct job *j, int32_t class_id)
{
    return j->thresholds != NULL && class_id < j->d->classes ? j->thresholds[class_id] : j->d->score_threshold;
}

/* Keep a candidate; when the list is full the one of the lowest score goes. */
static void keep(struct job *j, const struct fovea_detection *found)
{
    struct fv_detect_scratch *s = j->s;
    if (s->count < FV_DETECT_CANDIDATES_MAX) {
        if (s->count == 0 || found->score < s->candidates[s->smallest].score) s->smallest = s->count;
        s->candidates[s->count++] = *found;
        return;
    }
    if (!(found->score > s->candidates[s->smallest].score)) return;
    s->candidates[s->smallest] = *found;
    for (int32_t i = 0; i < s->count; ++i) {
        if (s->candidates[i].score < s->candidates[s->smallest].score) s->smallest = i;
    }
}

static float clamped(float value, float high)
{
    return value > 0.0f ? (value < high ? value : high) : 0.0f;
}

/* A box in input pixels (corner coordinates) to image pixels, cut at the image. */
static void add_box(struct job *j, float x0, float y0, float x1, float y1, float score, int32_t class_id)
{
    const struct fv_detect_view *v = j->view;
    const float width = (float)v->image_width, height = (float)v->image_height;
    const struct fovea_detection found = {
        .x_min_px = clamped((x0 - (float)v->left) / v->scale_x, width) - 0.5f,
        .y_min_px = clamped((y0 - (float)v->top) / v->scale_y, height) - 0.5f,
        .x_max_px = clamped((x1 - (float)v->left) / v->scale_x, width) - 0.5f,
        .y_max_px = clamped((y1 - (float)v->top) / v->scale_y, height) - 0.5f,
        .score = score,
        .class_id = class_id,
    };
    if (found.x_max_px > found.x_min_px && found.y_max_px > found.y_min_px) keep(j, &found);
}

static void add_centred(struct job *j, float x, float y, float w, float h, float score, int32_t class_id)
{
    const struct fv_model_preprocess *p = &j->model->header->preprocess;
    const float sx = j->d->normalised ? (float)p->width : 1.0f, sy = j->d->normalised ? (float)p->height : 1.0f;
    add_box(j, (x - w * 0.5f) * sx, (y - h * 0.5f) * sy, (x + w * 0.5f) * sx, (y + h * 0.5f) * sy, score, class_id);
}

static float sigmoid(float x)
{
    return (float)(1.0 / (1.0 + fovea_exp(-(double)x)));
}

static void decode_classifier(struct job *j)
{
    const int64_t count = count_of(&j->out[0]);
    const struct fv_model_preprocess *p = &j->model->header->preprocess;
    for (int64_t i = j->d->background ? 1 : 0; i < count; ++i) {
        const float score = value_at(&j->out[0], i);
        const int32_t class_id = (int32_t)i - (j->d->background ? 1 : 0);
        if (score >= threshold_of(j, class_id)) add_box(j, 0, 0, (float)p->width, (float)p->height, score, class_id);
    }
}

static void decode_ssd(struct job *j)
{
    const struct fv_model_preprocess *p = &j->model->header->preprocess;
    const float w = (float)p->width, h = (float)p->height;
    if (j->model->header->output_count < 4) return;
    const int64_t slots = count_of(&j->out[2]);
    if (count_of(&j->out[0]) < slots * 4 || count_of(&j->out[1]) < slots) return;
    const float given = value_at(&j->out[3], 0);
    const int64_t count = given > 0.0f && given < (float)slots ? (int64_t)given : (given > 0.0f ? slots : 0);
    for (int64_t i = 0; i < count; ++i) {
        const float score = value_at(&j->out[2], i), class_value = value_at(&j->out[1], i);
        const int32_t class_id = class_value >= 0.0f && class_value < 4096.0f ? (int32_t)class_value : 0;
        if (!(score >= threshold_of(j, class_id))) continue;
        const struct output *b = &j->out[0];
        add_box(j, value_at(b, 4 * i + 1) * w, value_at(b, 4 * i) * h, value_at(b, 4 * i + 3) * w, value_at(b, 4 * i + 2) * h, score, class_id);
    }
}

/* Box encodings [n][4] and scores [n][1 + classes] with the anchors of the file; class 0 is background. */
static void decode_ssd_raw(struct job *j)
{
    const struct fv_model_preprocess *p = &j->model->header->preprocess;
    const struct fv_model_header *h = j->model->header;
    if (h->output_count < 2 || j->d->anchor_data < FV_MODEL_HEADER_BYTES || j->d->anchor_data % 4 != 0) return;
    const int64_t n = count_of(&j->out[0]) / 4, columns = n > 0 ? count_of(&j->out[1]) / n : 0;
    if (columns < 2 || j->d->anchor_data + n * 16 > (int64_t)h->file_bytes) return;
    const float *anchor = (const float *)(const void *)(j->model->base + j->d->anchor_data), *scale = j->d->box_scales;
    for (int64_t i = 0; i < n; ++i, anchor += 4) {
        for (int64_t c = 1; c < columns; ++c) {
            const float score = value_at(&j->out[1], i * columns + c);
            if (!(score >= threshold_of(j, (int32_t)c - 1))) continue;
            const float cy = value_at(&j->out[0], 4 * i) / scale[0] * anchor[2] + anchor[0];
            const float cx = value_at(&j->out[0], 4 * i + 1) / scale[1] * anchor[3] + anchor[1];
            const float bh = (float)fovea_exp((double)value_at(&j->out[0], 4 * i + 2) / (double)scale[2]) * anchor[2];
            const float bw = (float)fovea_exp((double)value_at(&j->out[0], 4 * i + 3) / (double)scale[3]) * anchor[3];
            add_box(j, (cx - bw * 0.5f) * (float)p->width, (cy - bh * 0.5f) * (float)p->height, (cx + bw * 0.5f) * (float)p->width,
                    (cy + bh * 0.5f) * (float)p->height, score, (int32_t)c - 1);
        }
    }
}

/* YOLOv5: rows of centre, size, objectness, classes. */
static void decode_yolov5(struct job *j)
{
    const struct output *o = &j->out[0];
    const int32_t columns = o->t->rank > 0 ? o->t->dims[o->t->rank - 1] : 0;
    if (columns < 6) return;
    const int64_t rows = count_of(o) / columns;
    for (int64_t r = 0; r < rows; ++r) {
        const int64_t at = r * columns;
        const float object = value_at(o, at + 4);
        for (int32_t c = 0; c < columns - 5; ++c) {
            const float score = object * value_at(o, at + 5 + c);
            if (score >= threshold_of(j, c)) add_centred(j, value_at(o, at), value_at(o, at + 1), value_at(o, at + 2), value_at(o, at + 3), score, c);
        }
    }
}

/* YOLOv8 and YOLO11: columns of centre, size, classes; the best class of each counts. */
static void decode_yolov8(struct job *j)
{
    const struct output *o = &j->out[0];
    if (o->t->rank < 2) return;
    const int64_t n = o->t->dims[o->t->rank - 1], rows = count_of(o) / n;
    for (int64_t i = 0; i < n && rows > 4; ++i) {
        int32_t best = 0;
        float score = value_at(o, 4 * n + i);
        for (int32_t c = 1; c < rows - 4; ++c) {
            const float other = value_at(o, (4 + c) * n + i);
            if (other > score) {
                score = other;
                best = c;
            }
        }
        if (score >= threshold_of(j, best)) add_centred(j, value_at(o, i), value_at(o, n + i), value_at(o, 2 * n + i), value_at(o, 3 * n + i), score, best);
    }
}

/* YOLOv2 and its tiny kin: a grid of cells with several anchors each, everything before its activation. */
static void decode_yolov2(struct job *j)
{
    const struct output *o = &j->out[0];
    const struct fv_model_preprocess *p = &j->model->header->preprocess;
    const int32_t anchors = j->d->anchor_count;
    if (o->t->rank != 4 || anchors < 1 || o->t->dims[3] % anchors != 0 || o->t->dims[3] / anchors < 6) return;
    const int32_t h = o->t->dims[1], w = o->t->dims[2], columns = o->t->dims[3] / anchors;
    for (int64_t i = 0; i < (int64_t)h * w * anchors; ++i) {
        const int64_t at = i * columns;
        const int32_t a = (int32_t)(i % anchors), x = (int32_t)(i / anchors % w), y = (int32_t)(i / anchors / w);
        double sum = 0, largest = (double)value_at(o, at + 5);
        for (int32_t c = 1; c < columns - 5; ++c) largest = (double)value_at(o, at + 5 + c) > largest ? (double)value_at(o, at + 5 + c) : largest;
        for (int32_t c = 0; c < columns - 5; ++c) sum += fovea_exp((double)value_at(o, at + 5 + c) - largest);
        const float object = sigmoid(value_at(o, at + 4));
        const float cx = ((float)x + sigmoid(value_at(o, at))) / (float)w * (float)p->width;
        const float cy = ((float)y + sigmoid(value_at(o, at + 1))) / (float)h * (float)p->height;
        const float bw = j->d->anchors[2 * a] * (float)fovea_exp((double)value_at(o, at + 2)) / (float)w * (float)p->width;
        const float bh = j->d->anchors[2 * a + 1] * (float)fovea_exp((double)value_at(o, at + 3)) / (float)h * (float)p->height;
        for (int32_t c = 0; c < columns - 5; ++c) {
            const float score = object * (float)(fovea_exp((double)value_at(o, at + 5 + c) - largest) / sum);
            if (score >= threshold_of(j, c)) add_box(j, cx - bw * 0.5f, cy - bh * 0.5f, cx + bw * 0.5f, cy + bh * 0.5f, score, c);
        }
    }
}

/* A grid of cells by classes, of which the first is background. */
struct grid {
    const struct output *o;
    int32_t w, h, classes, class_id;
    float threshold;
};

struct cells {
    int32_t x0, x1, y0, y1;
    float score;
};

static int is_object(const struct grid *g, int32_t cell)
{
    return value_at(g->o, (int64_t)cell * g->classes + g->class_id + 1) >= g->threshold;
}

/* All cells that touch `start` (8 neighbours) over other cells of the object; each enters the stack once. */
static struct cells grow(const struct grid *g, int32_t start, uint8_t *seen, int32_t *stack)
{
    struct cells c = {.x0 = g->w, .x1 = -1, .y0 = g->h, .y1 = -1, .score = 0};
    int32_t top = 1;
    stack[0] = start;
    seen[start] = 1;
    while (top > 0) {
        const int32_t cell = stack[--top], x = cell % g->w, y = cell / g->w;
        const float value = value_at(g->o, (int64_t)cell * g->classes + g->class_id + 1);
        c.score = value > c.score ? value : c.score;
        c.x0 = x < c.x0 ? x : c.x0;
        c.x1 = x > c.x1 ? x : c.x1;
        c.y0 = y < c.y0 ? y : c.y0;
        c.y1 = y > c.y1 ? y : c.y1;
        for (int32_t k = 0; k < 9; ++k) {
            const int32_t nx = x + k % 3 - 1, ny = y + k / 3 - 1, next = ny * g->w + nx;
            if (nx < 0 || nx >= g->w || ny < 0 || ny >= g->h || seen[next] || !is_object(g, next)) continue;
            seen[next] = 1;
            stack[top++] = next;
        }
    }
    return c;
}

/* FOMO: cells of a class that touch are one object; its box is theirs, its score the best. */
static void decode_fomo(struct job *j)
{
    const struct output *o = &j->out[0];
    const struct fv_model_preprocess *p = &j->model->header->preprocess;
    if (o->t->rank != 4) return;
    struct grid g = {.o = o, .h = o->t->dims[1], .w = o->t->dims[2], .classes = o->t->dims[3]};
    const int64_t cells = (int64_t)g.h * g.w;
    const float cell_w = (float)p->width / (float)g.w, cell_h = (float)p->height / (float)g.h;
    if (cells > FV_DETECT_CELLS_MAX) return;
    for (g.class_id = 0; g.class_id < g.classes - 1; ++g.class_id) {
        g.threshold = threshold_of(j, g.class_id);
        memset(j->s->seen, 0, (size_t)cells);
        for (int32_t start = 0; start < cells; ++start) {
            if (j->s->seen[start] || !is_object(&g, start)) continue;
            const struct cells c = grow(&g, start, j->s->seen, j->s->stack);
            add_box(j, (float)c.x0 * cell_w, (float)c.y0 * cell_h, (float)(c.x1 + 1) * cell_w, (float)(c.y1 + 1) * cell_h, c.score, g.class_id);
        }
    }
}

/* Insertion by falling score; stable. */
static void sort(struct fovea_detection *list, int32_t count)
{
    for (int32_t i = 1; i < count; ++i) {
        const struct fovea_detection item = list[i];
        int32_t at = i;
        for (; at > 0 && list[at - 1].score < item.score; --at) list[at] = list[at - 1];
        list[at] = item;
    }
}

static float overlap(const struct fovea_detection *a, const struct fovea_detection *b)
{
    const float x0 = a->x_min_px > b->x_min_px ? a->x_min_px : b->x_min_px, x1 = a->x_max_px < b->x_max_px ? a->x_max_px : b->x_max_px;
    const float y0 = a->y_min_px > b->y_min_px ? a->y_min_px : b->y_min_px, y1 = a->y_max_px < b->y_max_px ? a->y_max_px : b->y_max_px;
    if (x1 <= x0 || y1 <= y0) return 0.0f;
    const float both = (x1 - x0) * (y1 - y0);
    const float area_a = (a->x_max_px - a->x_min_px) * (a->y_max_px - a->y_min_px);
    const float area_b = (b->x_max_px - b->x_min_px) * (b->y_max_px - b->y_min_px);
    return both / (area_a + area_b - both);
}

int32_t fv_detect_suppress(struct fovea_detection *list, int32_t count, float iou, int class_agnostic, uint8_t *dropped)
{
    int32_t left = 0;
    memset(dropped, 0, (size_t)count);
    for (int32_t i = 0; i < count; ++i) {
        if (dropped[i]) continue;
        const struct fovea_detection best = list[i];
        for (int32_t k = i + 1; k < count; ++k) {
            if (dropped[k] || (!class_agnostic && list[k].class_id != best.class_id)) continue;
            if (overlap(&best, &list[k]) > iou) dropped[k] = 1;
        }
        list[left++] = best;
    }
    return left;
}

int32_t fv_detect_decode(const struct fv_model *model, uint8_t *arena, const struct fv_detect_view *view,
                         struct fv_detect_scratch *scratch, struct fovea_detection *detections, int32_t capacity)
{
    static void (*const decoders[FV_DECODER_COUNT])(struct job *) = {
        [FV_DECODER_CLASSIFIER] = decode_classifier, [FV_DECODER_SSD] = decode_ssd, [FV_DECODER_SSD_RAW] = decode_ssd_raw,
        [FV_DECODER_YOLOV5] = decode_yolov5, [FV_DECODER_YOLOV8] = decode_yolov8, [FV_DECODER_YOLOV2] = decode_yolov2,
        [FV_DECODER_FOMO] = decode_fomo};
    const struct fv_model_decode *d = &model->header->decode;
    if (decoders[d->kind] == NULL) return 0;
    struct job j = {.model = model, .d = d, .view = view, .s = scratch};
    if (d->thresholds != 0) j.thresholds = (const float *)(const void *)(model->base + d->thresholds);
    for (uint32_t i = 0; i < model->header->output_count; ++i) {
        j.out[i] = (struct output){.t = &model->tensors[model->outputs[i]], .data = fv_nn_tensor(model, arena, model->outputs[i])};
    }
    scratch->count = scratch->smallest = 0;
    decoders[d->kind](&j);
    sort(scratch->candidates, scratch->count);
    int32_t count = scratch->count;
    const int boxes = d->kind == FV_DECODER_SSD_RAW || d->kind == FV_DECODER_YOLOV5 || d->kind == FV_DECODER_YOLOV8 || d->kind == FV_DECODER_YOLOV2;
    if (boxes || (d->kind == FV_DECODER_SSD && d->class_agnostic)) {
        count = fv_detect_suppress(scratch->candidates, count, d->iou_threshold, d->class_agnostic, scratch->dropped);
    }
    if (d->max_detections > 0 && count > d->max_detections) count = d->max_detections;
    if (count > capacity) count = capacity;
    memcpy(detections, scratch->candidates, (size_t)count * sizeof *detections);
    return count;
}

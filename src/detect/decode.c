#include "detect/decode.h"

#include <string.h>

#include "detect/heads.h"
#include "detect/turned.h"
#include "nn/run.h"

enum {
    VALUES_PER_UNIT = 1 << 16, /* read by a unit of the scan: some 0.1 ms here */
    PAIRS_PER_UNIT = 1 << 15   /* compared by a unit of the suppression: likewise */
};

const char *fv_detect_label(const struct fv_model *model, int32_t class_id)
{
    const char *label = fv_model_label(model, class_id + model->header->decode.first_label);
    return label != NULL ? label : "";
}

uint32_t fv_detect_gives(const struct fv_model *model)
{
    const struct fv_head *head = fv_head_of(model->header->decode.kind);
    int32_t width, height;
    if (head == NULL) return 0;
    uint32_t gives = head->gives;
    fv_detect_mask_size(model, &width, &height);
    if (fv_detect_point_count(model) == 0) gives &= ~(uint32_t)FV_DETECT_POINTS;
    if (width == 0) gives &= ~(uint32_t)FV_DETECT_MASK;
    return gives;
}

const char *fv_detect_decoder_name(const struct fv_model *model)
{
    static const char *const names[FV_DECODER_COUNT] = {
        "none",    "classifier", "ssd",       "ssd_raw",     "yolov5",     "yolov8",     "yolov2",
        "fomo",    "segment",    "embedding", "yolov8_pose", "yolov8_seg", "yolov8_obb", "end2end",
        "movenet", "blaze",      "landmarks", "yolox",       "yolov3"};
    return names[model->header->decode.kind];
}

int32_t fv_detect_point_count(const struct fv_model *model)
{
    const struct fv_head *head = fv_head_of(model->header->decode.kind);
    return head != NULL && head->points != NULL ? model->header->decode.point_count : 0;
}

int32_t fv_detect_sets_max(const struct fv_model *model)
{
    const int32_t each = fv_detect_point_count(model);
    if (each == 0) return 0;
    const int32_t most = FOVEA_KEYPOINTS_MAX / each;
    return most < FOVEA_KEYPOINT_SETS_MAX ? most : FOVEA_KEYPOINT_SETS_MAX;
}

/* ---- the best candidates: a heap with the worst on top --------------------------------------- */

/* Whether `a` comes before `b` in the result: not uncertain, higher score, or earlier in the
 * outputs. */
static int better(const struct fv_detect_candidate *a, const struct fv_detect_candidate *b)
{
    if (a->uncertain != b->uncertain) return b->uncertain;
    return a->found.score > b->found.score ||
           (a->found.score == b->found.score && a->order < b->order);
}

static void sink(struct fv_detect_candidate *heap, int32_t at, int32_t count)
{
    const struct fv_detect_candidate item = heap[at];
    for (int32_t child = 2 * at + 1; child < count; child = 2 * at + 1) {
        if (child + 1 < count && better(&heap[child], &heap[child + 1])) ++child;
        if (!better(&item, &heap[child])) break;
        heap[at] = heap[child];
        at = child;
    }
    heap[at] = item;
}

static void rise(struct fv_detect_candidate *heap, int32_t at)
{
    const struct fv_detect_candidate item = heap[at];
    for (; at > 0 && better(&heap[(at - 1) / 2], &item); at = (at - 1) / 2)
        heap[at] = heap[(at - 1) / 2];
    heap[at] = item;
}

void fv_detect_keep(struct fv_detect_scratch *s, const struct fovea_detection *found, int64_t item,
                    int uncertain)
{
    const struct fv_detect_candidate offered = {
        .found = *found, .order = s->offered++, .item = (int32_t)item, .uncertain = uncertain};
    if (s->count < FV_DETECT_CANDIDATES_MAX) {
        s->heap[s->count] = offered;
        rise(s->heap, s->count++);
    } else if (better(&offered, &s->heap[0])) {
        s->heap[0] = offered;
        sink(s->heap, 0, s->count);
    }
}

/* The heap into a list by falling score: the worst left goes to the end. */
static void sort(struct fv_detect_scratch *s)
{
    s->sure = 0;
    for (int32_t left = s->count; left > 0; --left) {
        s->sure += !s->heap[0].uncertain;
        s->candidates[left - 1] = s->heap[0].found;
        s->items[left - 1] = s->heap[0].item;
        s->heap[0] = s->heap[left - 1];
        sink(s->heap, 0, left - 1);
    }
}

/* ---- non-maximum suppression ----------------------------------------------------------------- */

static float overlap(const struct fovea_detection *a, const struct fovea_detection *b)
{
    const float x0 = a->x_min_px > b->x_min_px ? a->x_min_px : b->x_min_px,
                x1 = a->x_max_px < b->x_max_px ? a->x_max_px : b->x_max_px;
    const float y0 = a->y_min_px > b->y_min_px ? a->y_min_px : b->y_min_px,
                y1 = a->y_max_px < b->y_max_px ? a->y_max_px : b->y_max_px;
    if (x1 <= x0 || y1 <= y0) return 0.0f;
    const float both = (x1 - x0) * (y1 - y0);
    const float area_a = (a->x_max_px - a->x_min_px) * (a->y_max_px - a->y_min_px);
    const float area_b = (b->x_max_px - b->x_min_px) * (b->y_max_px - b->y_min_px);
    return both / (area_a + area_b - both);
}

/* One row of the suppression: what `best` removes of those behind place i. Returns its cost. */
static int32_t remove_upright(struct fv_detect_scratch *s, int32_t i,
                              const struct fovea_detection *best, float iou, int class_agnostic)
{
    const struct fovea_detection *list = s->candidates;
    for (int32_t k = i + 1; k < s->count; k++) {
        if (s->dropped[k] || (!class_agnostic && list[k].class_id != best->class_id)) continue;
        if (overlap(best, &list[k]) > iou) s->dropped[k] = 1;
    }
    return s->count - i;
}

static int32_t remove_turned(struct fv_detect_scratch *s, int32_t i,
                             const struct fovea_detection *best, float iou, int class_agnostic)
{
    const struct fovea_detection *list = s->candidates;
    const struct fv_turned one = fv_turned_of(best);
    int32_t total = 1;
    for (int32_t k = i + 1; k < s->count; k++, total++) {
        int cost = 0;
        if (s->dropped[k] || (!class_agnostic && list[k].class_id != best->class_id)) continue;
        if (fv_turned_overlaps(&one, &list[k], (double)iou, &cost)) s->dropped[k] = 1;
        total += cost;
    }
    return total;
}

/* Go on from progress.at until about PAIRS_PER_UNIT pairs were compared; true when all were. */
static int suppress_some(struct fv_detect_scratch *s, float iou, int class_agnostic, int turned)
{
    struct fv_detect_progress *progress = &s->progress;
    for (int32_t pairs = PAIRS_PER_UNIT; progress->at < s->count && pairs > 0; progress->at++) {
        const int32_t i = (int32_t)progress->at;
        if (s->dropped[i]) continue;
        const struct fovea_detection best = s->candidates[i];
        pairs -= turned ? remove_turned(s, i, &best, iou, class_agnostic)
                        : remove_upright(s, i, &best, iou, class_agnostic);
        s->items[progress->left] = s->items[i];
        s->candidates[progress->left++] = best;
    }
    return progress->at == s->count;
}

/* ---- all of it, in units --------------------------------------------------------------------- */

void fv_detect_decode_start(struct fv_detect_scratch *scratch)
{
    scratch->count = 0;
    scratch->sure = 0;
    scratch->offered = 0;
    scratch->progress = (struct fv_detect_progress){.phase = FV_DECODE_SCAN};
}

/* How many of the candidates that are not uncertain the suppression left. */
static int32_t sure_left(const struct fv_detect_scratch *s)
{
    int32_t left = 0;
    for (int32_t i = 0; i < s->sure; i++)
        left += !s->dropped[i];
    return left;
}

/* What the decoder reads: the model's outputs, for SSD those of the detection at its end, which
 * models list in any order. */
static const int32_t *sources(const struct fv_model *model, int32_t *count)
{
    const struct fv_model_header *h = model->header;
    const struct fv_model_op *last = h->op_count > 0 ? &model->ops[h->op_count - 1] : NULL;
    const int ssd =
        h->decode.kind == FV_DECODER_SSD && last != NULL && last->kind == FV_OP_DETECTION;
    *count = ssd ? last->output_count : (int32_t)h->output_count;
    return ssd ? last->outputs : model->outputs;
}

static void open_outputs(const struct fv_model *model, uint8_t *arena, struct fv_head_job *j)
{
    if (j->d->thresholds != 0)
        j->thresholds = (const float *)(const void *)(model->base + j->d->thresholds);
    const int32_t *from = sources(model, &j->out_count);
    for (int32_t i = 0; i < j->out_count; i++) {
        j->out[i] = (struct fv_head_output){.t = &model->tensors[from[i]],
                                            .data = fv_nn_tensor(model, arena, from[i])};
    }
}

static void scan_some(struct fv_head_job *j, const struct fv_head *head,
                      struct fv_detect_progress *progress)
{
    int64_t cost = 1;
    const int64_t items = head->items(j, &cost), most = VALUES_PER_UNIT / (cost < 1 ? 1 : cost),
                  step = most < 1 ? 1 : most;
    const int64_t end = items - progress->at > step ? progress->at + step : items;
    if (progress->at < end) head->scan(j, progress->at, end);
    progress->at = end;
    if (end == items) progress->phase = FV_DECODE_SORT;
}

/* Of those held, the detections that the limits leave. */
static int32_t sure_count(const struct fv_model *model, const struct fv_detect_limits *limits,
                          const struct fv_detect_scratch *s)
{
    const int32_t most = model->header->decode.max_detections;
    int32_t count = s->sure;
    if (most > 0 && count > most) count = most;
    if (limits->count > 0 && count > limits->count) count = limits->count;
    return count;
}

static void read_points(const struct fv_head_job *j, const struct fv_head *head,
                        const struct fv_detect_limits *limits, struct fovea_keypoint *points)
{
    const int32_t sets = fv_detect_sets_max(j->model), each = j->d->point_count;
    const int32_t sure = sure_count(j->model, limits, j->s), count = sure < sets ? sure : sets;
    for (int32_t i = 0; i < count; i++)
        head->points(j, j->s->items[i], points + (ptrdiff_t)i * each);
}

/* After the list: keypoints or a mask, where they are wanted, or the end. */
static enum fovea_status after_list(const struct fv_model *model, struct fv_detect_scratch *s,
                                    const struct fv_detect_room *room)
{
    const uint32_t gives = room == NULL ? 0 : fv_detect_gives(model);
    if ((gives & FV_DETECT_POINTS) != 0 && room->points != NULL)
        s->progress.phase = FV_DECODE_POINTS;
    else if ((gives & FV_DETECT_MASK) != 0 && room->pixels != NULL)
        s->progress.phase = FV_DECODE_CLEAR;
    else
        return FOVEA_OK;
    return FOVEA_AGAIN;
}

static enum fovea_status mask_some(const struct fv_head_job *j,
                                   const struct fv_detect_limits *limits,
                                   const struct fv_detect_room *room)
{
    struct fv_detect_scratch *s = j->s;
    struct fv_detect_progress *progress = &s->progress;
    const bool whole =
        j->d->kind == FV_DECODER_SEGMENT
            ? fv_detect_mask_classes(j, room->mask, room->pixels, room->confidence, &progress->at)
            : fv_detect_mask_objects(j, s->candidates, s->items, sure_count(j->model, limits, s),
                                     room->mask, room->pixels, &progress->at, &progress->left);
    return whole ? FOVEA_OK : FOVEA_AGAIN;
}

enum fovea_status fv_detect_decode_unit(const struct fv_model *model, uint8_t *arena,
                                        const struct fv_nn_input_fit *fit,
                                        const struct fv_detect_limits *limits,
                                        struct fv_detect_scratch *s,
                                        const struct fv_detect_room *room)
{
    const struct fv_model_decode *d = &model->header->decode;
    const struct fv_head *head = fv_head_of(d->kind);
    struct fv_detect_progress *progress = &s->progress;
    struct fv_head_job j = {.model = model,
                            .d = d,
                            .fit = fit,
                            .s = s,
                            .score_threshold = limits->score,
                            .floor = limits->floor};
    if (head == NULL) return FOVEA_OK;
    const int due = head->boxes_overlap || (d->kind == FV_DECODER_SSD && d->class_agnostic);
    open_outputs(model, arena, &j);
    switch (progress->phase) {
    case FV_DECODE_SCAN:
        scan_some(&j, head, progress);
        return FOVEA_AGAIN;
    case FV_DECODE_SORT:
        sort(s);
        *progress = (struct fv_detect_progress){.phase = FV_DECODE_SUPPRESS};
        memset(s->dropped, 0, sizeof s->dropped);
        return due ? FOVEA_AGAIN : after_list(model, s, room);
    case FV_DECODE_SUPPRESS:
        if (!suppress_some(s, limits->iou > 0.0f ? limits->iou : d->iou_threshold,
                           d->class_agnostic, d->kind == FV_DECODER_YOLOV8_OBB))
            return FOVEA_AGAIN;
        s->count = progress->left;
        s->sure = sure_left(s);
        return after_list(model, s, room);
    case FV_DECODE_POINTS:
        read_points(&j, head, limits, room->points);
        return FOVEA_OK;
    case FV_DECODE_CLEAR:
        fv_detect_mask_clear(model, room->mask, room->pixels, room->confidence);
        *progress = (struct fv_detect_progress){.phase = FV_DECODE_MASK};
        return FOVEA_AGAIN;
    default:
        return mask_some(&j, limits, room);
    }
}

int32_t fv_detect_decode_take(const struct fv_model *model, const struct fv_detect_limits *limits,
                              const struct fv_detect_scratch *s, struct fovea_detection *detections,
                              int32_t capacity, int32_t *uncertain)
{
    int32_t count = sure_count(model, limits, s);
    if (count > capacity) count = capacity;
    memcpy(detections, s->candidates, (size_t)count * sizeof *detections);
    if (uncertain == NULL) return count;
    *uncertain = s->count - s->sure < capacity - count ? s->count - s->sure : capacity - count;
    memcpy(detections + count, s->candidates + s->sure, (size_t)*uncertain * sizeof *detections);
    return count;
}

int32_t fv_detect_decode(const struct fv_model *model, uint8_t *arena,
                         const struct fv_nn_input_fit *fit, struct fv_detect_scratch *scratch,
                         const struct fv_detect_room *room, struct fovea_detection *detections,
                         int32_t capacity)
{
    const struct fv_detect_limits none = {.count = 0};
    fv_detect_decode_start(scratch);
    while (fv_detect_decode_unit(model, arena, fit, &none, scratch, room) == FOVEA_AGAIN)
        continue;
    return fv_detect_decode_take(model, &none, scratch, detections, capacity, NULL);
}

/* Matching by optimal assignment, certain detections first. */
#include "objects/objects.h"

/* Gates: 99.7 % of a four-dimensional normal distribution for centre and size; overlap that lets
 * pairs pass which are farther, as boxes are that something cuts off. Sizes deviate by a tenth
 * besides what the filter knows. */
static const double distance_gate = 16.0, overlap_gate = 0.3, overlap_gate_low = 0.4,
                    far_gate = 40.0, size_fraction = 0.1;

/* What the cost needs of a prediction and of a detection, worked out once for all their pairs. */
static void row_of(const struct fv_object_slot *slot, struct fv_object_side *side)
{
    const struct fv_filter *b = slot->box;
    *side = (struct fv_object_side){.x = b[FV_OBJECT_X].x,
                                    .y = b[FV_OBJECT_Y].x,
                                    .half_w = 0.5 * b[FV_OBJECT_W].x,
                                    .half_h = 0.5 * b[FV_OBJECT_H].x,
                                    .x_variance = b[FV_OBJECT_X].xx,
                                    .y_variance = b[FV_OBJECT_Y].xx,
                                    .x_reach = __builtin_sqrt(distance_gate * b[FV_OBJECT_X].xx),
                                    .y_reach = __builtin_sqrt(distance_gate * b[FV_OBJECT_Y].xx),
                                    .w_variance = b[FV_OBJECT_W].xx,
                                    .h_variance = b[FV_OBJECT_H].xx,
                                    .class_id = slot->object.class_id};
}

static void column_of(const struct fovea_detection *d, struct fv_object_side *side)
{
    const double x0 = (double)d->x_min_px, y0 = (double)d->y_min_px, x1 = (double)d->x_max_px,
                 y1 = (double)d->y_max_px;
    const double sigma = 0.025 * (x1 - x0 + y1 - y0) + 0.5,
                 reach = __builtin_sqrt(distance_gate) * sigma;
    *side = (struct fv_object_side){
        .x = 0.5 * (x0 + x1),
        .y = 0.5 * (y0 + y1),
        .half_w = 0.5 * (x1 - x0),
        .half_h = 0.5 * (y1 - y0),
        .x_variance = sigma * sigma,
        .y_variance = sigma * sigma,
        .x_reach = reach,
        .y_reach = reach,
        .w_variance = size_fraction * size_fraction * (x1 - x0) * (x1 - x0) + sigma * sigma,
        .h_variance = size_fraction * size_fraction * (y1 - y0) * (y1 - y0) + sigma * sigma,
        .class_id = d->class_id};
}

static double least(double a, double b)
{
    return a < b ? a : b;
}

static double overlap(const struct fv_object_side *a, const struct fv_object_side *b)
{
    const double w =
        least(a->x + a->half_w, b->x + b->half_w) + least(a->half_w - a->x, b->half_w - b->x);
    const double h =
        least(a->y + a->half_h, b->y + b->half_h) + least(a->half_h - a->y, b->half_h - b->y);
    if (w <= 0 || h <= 0) return 0;
    return w * h / (4 * (a->half_w * a->half_h + b->half_w * b->half_h) - w * h);
}

/* Neither overlap nor the gate can hold: most pairs end here. */
static bool is_far(double off, double half, double reach)
{
    off = off < 0 ? -off : off;
    return off > half && off > reach;
}

/* In [0, 1); 1: not the same object. Overlap and squared Mahalanobis distance of centre and size
 * share the cost. */
static float cost_of(const struct fv_object_side *a, const struct fv_object_side *b,
                     bool only_overlap)
{
    const double dx = b->x - a->x, dy = b->y - a->y;
    if (is_far(dx, a->half_w + b->half_w, a->x_reach + b->x_reach) ||
        is_far(dy, a->half_h + b->half_h, a->y_reach + b->y_reach))
        return 1.0f;
    if (a->class_id != b->class_id) return 1.0f;
    const double iou = overlap(a, b);
    if (only_overlap) return iou >= overlap_gate_low ? (float)(1.0 - iou) : 1.0f;
    const double dw = 2 * (b->half_w - a->half_w), dh = 2 * (b->half_h - a->half_h);
    const double far =
        dx * dx / (a->x_variance + b->x_variance) + dy * dy / (a->y_variance + b->y_variance) +
        dw * dw / (a->w_variance + b->w_variance) + dh * dh / (a->h_variance + b->h_variance);
    if (far > far_gate || (far > distance_gate && iou < overlap_gate)) return 1.0f;
    return (float)(1.0 - 0.5 * iou - 0.5 / (1.0 + 0.25 * far));
}

/* One assignment of the slots in objects->rows to the detections in objects->columns. */
static void assign(struct fv_objects *objects, const struct fv_objects_inference *inference,
                   int32_t rows, int32_t columns, bool only_overlap)
{
    if (rows == 0 || columns == 0) return;
    struct fv_object_side *columns_of = objects->sides, row;
    for (int32_t c = 0; c < columns; c++)
        column_of(&inference->detections[objects->columns[c]], &columns_of[c]);
    for (int32_t r = 0; r < rows; r++) {
        row_of(&objects->slots[objects->rows[r]], &row);
        for (int32_t c = 0; c < columns; c++)
            objects->cost[r * columns + c] = cost_of(&row, &columns_of[c], only_overlap);
    }
    fv_assign(objects->cost, columns, rows, columns, objects->assign, objects->column_of);
    for (int32_t r = 0; r < rows; r++) {
        if (objects->column_of[r] < 0) continue;
        fv_objects_take(objects, &objects->slots[objects->rows[r]], inference,
                        (uint32_t)objects->columns[objects->column_of[r]]);
    }
}

/* Detections of the first stage, or those of the second. */
static int32_t gather_detections(const struct fv_objects *objects,
                                 const struct fv_objects_inference *inference, bool first)
{
    const struct fovea_objects_config *config = objects->config;
    int32_t count = 0;
    for (uint32_t d = 0; d < inference->count + inference->uncertain; d++) {
        const double score = (double)inference->detections[d].score;
        const bool high = d < inference->count && score >= config->score_high;
        if (!objects->taken[d] && high == first && score >= config->score_low)
            objects->columns[count++] = (int32_t)d;
    }
    return count;
}

/* Slots that were not matched yet; `fresh`: only those that were seen in the inference before. */
static int32_t gather_slots(const struct fv_objects *objects, bool fresh)
{
    int32_t count = 0;
    for (uint32_t i = 0; i < objects->config->count_max; i++) {
        const struct fv_object_slot *slot = &objects->slots[i];
        const bool fits = !fresh || slot->object.unseen == 0;
        if (slot->used && !slot->matched && fits) objects->rows[count++] = (int32_t)i;
    }
    return count;
}

/* Tentative objects take part in the first stage: else an object that has just gone behind
 * something would take the detections of the one that comes out there. */
void fv_objects_match_sort(struct fv_objects *objects, const struct fv_objects_inference *inference)
{
    assign(objects, inference, gather_slots(objects, false),
           gather_detections(objects, inference, true), false);
    assign(objects, inference, gather_slots(objects, true),
           gather_detections(objects, inference, false), true);
}

/* Heads of the YOLO family. */
#include "detect/heads.h"

/* ---- YOLOv5: rows of centre, size, objectness, classes --------------------------------------- */

static int64_t yolov5_items(const struct fv_head_job *j, int64_t *cost)
{
    const int32_t columns = fv_head_last_dim(&j->out[0]);
    *cost = columns;
    return columns < 6 ? 0 : fv_head_count(&j->out[0]) / columns;
}

static void yolov5_scan(struct fv_head_job *j, int64_t begin, int64_t end)
{
    const struct fv_head_output *o = &j->out[0];
    const int32_t columns = fv_head_last_dim(&j->out[0]);
    for (int64_t r = begin; r < end; r++) {
        const int64_t at = r * columns;
        const float object = fv_head_value(o, at + 4);
        for (int32_t c = 0; c < columns - 5; c++) {
            const float score = object * fv_head_value(o, at + 5 + c);
            if (score >= fv_head_least(j, c))
                fv_head_add_centred(j, r, fv_head_value(o, at), fv_head_value(o, at + 1),
                                    fv_head_value(o, at + 2), fv_head_value(o, at + 3), score, c);
        }
    }
}

/* ---- YOLOv8 and YOLO11 ----------------------------------------------------------------------- */

/* Columns of centre, size and classes; the best class of each counts. Keypoints, or the
 * coefficients of a mask, follow the classes. */

static int64_t yolov8_rows(const struct fv_head_output *o)
{
    return o->t->rank < 2 ? 0 : fv_head_count(o) / o->t->dims[o->t->rank - 1];
}

static int64_t yolov8_items(const struct fv_head_job *j, int64_t *cost)
{
    const struct fv_head_output *o = fv_head_role(j, FV_ROLE_BOXES);
    if (o == NULL) return 0;
    *cost = yolov8_rows(o);
    return *cost > 4 ? o->t->dims[o->t->rank - 1] : 0;
}

/* Only classes stand after the box, or `classes` of the file and what else it says. */
static int64_t yolov8_classes(const struct fv_head_job *j)
{
    const int64_t rows = yolov8_rows(fv_head_role(j, FV_ROLE_BOXES));
    const int64_t others = (int64_t)j->d->point_count * j->d->point_values + j->d->coefficients;
    return rows - 4 - others;
}

static int64_t yolov8_more_items(const struct fv_head_job *j, int64_t *cost)
{
    const int64_t n = yolov8_items(j, cost);
    return n > 0 && yolov8_classes(j) > 0 ? n : 0;
}

static int64_t yolov8_seg_items(const struct fv_head_job *j, int64_t *cost)
{
    int32_t width, height;
    fv_detect_mask_size(j->model, &width, &height);
    return width > 0 ? yolov8_more_items(j, cost) : 0;
}

static int64_t yolov8_pose_items(const struct fv_head_job *j, int64_t *cost)
{
    return j->d->point_count > 0 ? yolov8_more_items(j, cost) : 0;
}

static void yolov8_scan(struct fv_head_job *j, int64_t begin, int64_t end)
{
    const struct fv_head_output *o = fv_head_role(j, FV_ROLE_BOXES);
    const int64_t n = o->t->dims[o->t->rank - 1], classes = yolov8_classes(j);
    for (int64_t i = begin; i < end; i++) {
        int32_t best = 0;
        float score = fv_head_value(o, 4 * n + i);
        for (int32_t c = 1; c < classes; c++) {
            const float other = fv_head_value(o, (4 + c) * n + i);
            if (other > score) {
                score = other;
                best = c;
            }
        }
        if (score >= fv_head_least(j, best))
            fv_head_add_centred(j, i, fv_head_value(o, i), fv_head_value(o, n + i),
                                fv_head_value(o, 2 * n + i), fv_head_value(o, 3 * n + i), score,
                                best);
    }
}

/* Boxes that are turned by the last row, in rad. */
static int64_t yolov8_obb_items(const struct fv_head_job *j, int64_t *cost)
{
    const int64_t n = yolov8_items(j, cost);
    return n > 0 && *cost > 4 + 1 ? n : 0;
}

static void yolov8_obb_scan(struct fv_head_job *j, int64_t begin, int64_t end)
{
    const struct fv_head_output *o = fv_head_role(j, FV_ROLE_BOXES);
    const struct fv_model_preprocess *p = &j->model->header->preprocess;
    const int64_t n = fv_head_last_dim(o), rows = yolov8_rows(o);
    const float sx = j->d->normalised ? (float)p->width : 1.0f,
                sy = j->d->normalised ? (float)p->height : 1.0f;
    for (int64_t i = begin; i < end; i++) {
        int32_t best = 0;
        float score = fv_head_value(o, 4 * n + i);
        for (int32_t c = 1; c < rows - 5; c++) {
            const float other = fv_head_value(o, (4 + c) * n + i);
            if (other > score) {
                score = other;
                best = c;
            }
        }
        if (!(score >= fv_head_least(j, best))) continue;
        const float box[4] = {fv_head_value(o, i) * sx, fv_head_value(o, n + i) * sy,
                              fv_head_value(o, 2 * n + i) * sx, fv_head_value(o, 3 * n + i) * sy};
        fv_head_add_turned(j, i, box, fv_head_value(o, (rows - 1) * n + i), score, best);
    }
}

static void yolov8_points(const struct fv_head_job *j, int64_t item, struct fovea_keypoint *points)
{
    const struct fv_head_output *o = fv_head_role(j, FV_ROLE_BOXES);
    const struct fv_model_preprocess *p = &j->model->header->preprocess;
    const int64_t n = o->t->dims[o->t->rank - 1], values = j->d->point_values;
    const float sx = j->d->normalised ? (float)p->width : 1.0f,
                sy = j->d->normalised ? (float)p->height : 1.0f;
    int64_t row = 4 + yolov8_classes(j);
    for (int32_t k = 0; k < j->d->point_count; k++, row += values) {
        const float score = j->d->point_score > 0
                                ? fv_head_value(o, (row + j->d->point_score) * n + item)
                                : __builtin_nanf("");
        points[k] = fv_head_keypoint(j, fv_head_value(o, row * n + item) * sx,
                                     fv_head_value(o, (row + 1) * n + item) * sy, score);
    }
}

/* ---- YOLOv2 and tiny YOLOv2 ------------------------------------------------------------------ */

/* A grid of cells with several anchors each; all values come before their activation. */

static int64_t yolov2_items(const struct fv_head_job *j, int64_t *cost)
{
    const struct fv_model_tensor *t = j->out[0].t;
    const int32_t anchors = j->d->anchor_count;
    if (t->rank != 4 || anchors < 1 || t->dims[3] % anchors != 0 || t->dims[3] / anchors < 6)
        return 0;
    *cost = (int64_t)t->dims[3] / anchors * FV_HEAD_EXP_COST;
    return (int64_t)t->dims[1] * t->dims[2] * anchors;
}

static void yolov2_box(struct fv_head_job *j, int64_t item, int64_t at, float score,
                       int32_t class_id)
{
    const struct fv_head_output *o = &j->out[0];
    const struct fv_model_preprocess *p = &j->model->header->preprocess;
    const int32_t h = o->t->dims[1], w = o->t->dims[2], anchors = j->d->anchor_count;
    const int32_t a = (int32_t)(item % anchors), x = (int32_t)(item / anchors % w),
                  y = (int32_t)(item / anchors / w);
    const float cx =
        ((float)x + fv_head_sigmoid(fv_head_value(o, at))) / (float)w * (float)p->width;
    const float cy =
        ((float)y + fv_head_sigmoid(fv_head_value(o, at + 1))) / (float)h * (float)p->height;
    const float bw = j->d->anchors[2 * a] * (float)fv_exp((double)fv_head_value(o, at + 2)) /
                     (float)w * (float)p->width;
    const float bh = j->d->anchors[2 * a + 1] * (float)fv_exp((double)fv_head_value(o, at + 3)) /
                     (float)h * (float)p->height;
    fv_head_add_box(j, item, cx - bw * 0.5f, cy - bh * 0.5f, cx + bw * 0.5f, cy + bh * 0.5f, score,
                    class_id);
}

static void yolov2_scan(struct fv_head_job *j, int64_t begin, int64_t end)
{
    const struct fv_head_output *o = &j->out[0];
    const int32_t columns = o->t->dims[3] / j->d->anchor_count, classes = columns - 5;
    for (int64_t i = begin; i < end; i++) {
        const int64_t at = i * columns;
        const float object = fv_head_sigmoid(fv_head_value(o, at + 4));
        double sum = 0, largest = (double)fv_head_value(o, at + 5);
        for (int32_t c = 1; c < classes; c++)
            largest = (double)fv_head_value(o, at + 5 + c) > largest
                          ? (double)fv_head_value(o, at + 5 + c)
                          : largest;
        for (int32_t c = 0; c < classes; c++)
            sum += fv_exp((double)fv_head_value(o, at + 5 + c) - largest);
        for (int32_t c = 0; c < classes; c++) {
            const float score =
                object * (float)(fv_exp((double)fv_head_value(o, at + 5 + c) - largest) / sum);
            if (score >= fv_head_least(j, c)) yolov2_box(j, i, at, score, c);
        }
    }
}

/* ---- YOLOX: rows of offset, logarithm of size, objectness, classes, in the cells of its grids.
 * ---
 */

enum { YOLOX_STRIDE_FIRST = 8, YOLOX_STRIDE_LAST = 64 };

/* The cell that row `at` belongs to; false: the rows are more than the cells. */
static bool yolox_cell(const struct fv_model_preprocess *p, int64_t at, int32_t *stride, int32_t *x,
                       int32_t *y)
{
    for (*stride = YOLOX_STRIDE_FIRST; *stride <= YOLOX_STRIDE_LAST; *stride *= 2) {
        const int64_t w = p->width / *stride, cells = w * (p->height / *stride);
        if (at < cells) {
            *x = (int32_t)(at % w);
            *y = (int32_t)(at / w);
            return true;
        }
        at -= cells;
    }
    return false;
}

static int64_t yolox_items(const struct fv_head_job *j, int64_t *cost)
{
    const struct fv_head_output *o = fv_head_role(j, FV_ROLE_BOXES);
    int32_t stride, x, y;
    if (o == NULL || o->t->rank < 2 || fv_head_last_dim(o) < 6) return 0;
    const int64_t n = fv_head_count(o) / fv_head_last_dim(o);
    *cost = fv_head_last_dim(o) + 2 * FV_HEAD_EXP_COST;
    return yolox_cell(&j->model->header->preprocess, n - 1, &stride, &x, &y) ? n : 0;
}

static void yolox_scan(struct fv_head_job *j, int64_t begin, int64_t end)
{
    const struct fv_head_output *o = fv_head_role(j, FV_ROLE_BOXES);
    const int32_t columns = fv_head_last_dim(o);
    for (int64_t r = begin; r < end; r++) {
        const int64_t at = r * columns;
        const float object = fv_head_value(o, at + 4);
        int32_t stride, x, y, best = 0;
        float score = object * fv_head_value(o, at + 5);
        for (int32_t c = 1; c < columns - 5; c++) {
            const float other = object * fv_head_value(o, at + 5 + c);
            if (other > score) {
                score = other;
                best = c;
            }
        }
        if (!(score >= fv_head_least(j, best)) ||
            !yolox_cell(&j->model->header->preprocess, r, &stride, &x, &y))
            continue;
        const float s = (float)stride, cx = (fv_head_value(o, at) + (float)x) * s,
                    cy = (fv_head_value(o, at + 1) + (float)y) * s,
                    w = (float)fv_exp((double)fv_head_value(o, at + 2)) * s,
                    h = (float)fv_exp((double)fv_head_value(o, at + 3)) * s;
        fv_head_add_box(j, r, cx - w * 0.5f, cy - h * 0.5f, cx + w * 0.5f, cy + h * 0.5f, score,
                        best);
    }
}

/* ---- YOLOv3 and YOLOv4: a grid of cells for each output with anchors of its own, in input pixels,
 * all before their activation; each class has a score of its own. -------------------------------
 */

static int64_t yolov3_cells(const struct fv_head_output *o)
{
    return (int64_t)o->t->dims[1] * o->t->dims[2];
}

static int64_t yolov3_items(const struct fv_head_job *j, int64_t *cost)
{
    const struct fv_model_decode *d = j->d;
    const int64_t anchors = (int64_t)j->out_count * d->anchor_count;
    int64_t items = 0;
    if (d->anchor_count < 1 || d->anchor_data < FV_MODEL_HEADER_BYTES || d->anchor_data % 4 != 0 ||
        d->anchor_data + anchors * 8 > (int64_t)j->model->header->file_bytes)
        return 0;
    for (int32_t i = 0; i < j->out_count; i++) {
        const struct fv_model_tensor *t = j->out[i].t;
        if (t->rank != 4 || t->dims[0] != 1 || t->dims[3] != d->anchor_count * (5 + d->classes))
            return 0;
        items += yolov3_cells(&j->out[i]) * d->anchor_count;
    }
    *cost = (int64_t)(5 + d->classes) * FV_HEAD_EXP_COST;
    return d->classes > 0 ? items : 0;
}

static void yolov3_box(struct fv_head_job *j, int32_t output, int64_t place, int64_t item,
                       float score, int32_t class_id)
{
    const struct fv_head_output *o = &j->out[output];
    const struct fv_model_preprocess *p = &j->model->header->preprocess;
    const int32_t count = j->d->anchor_count, h = o->t->dims[1], w = o->t->dims[2];
    if (w < 1 || h < 1 || count < 1) return; /* the loader lets none through */
    const float *anchor = (const float *)(const void *)(j->model->base + j->d->anchor_data) +
                          2 * (output * count + (int32_t)(place % count));
    const int64_t at = place * (5 + j->d->classes), cell = place / count, x = cell % w,
                  y = cell / w;
    const float cx =
                    ((float)x + fv_head_sigmoid(fv_head_value(o, at))) / (float)w * (float)p->width,
                cy = ((float)y + fv_head_sigmoid(fv_head_value(o, at + 1))) / (float)h *
                     (float)p->height,
                bw = anchor[0] * (float)fv_exp((double)fv_head_value(o, at + 2)),
                bh = anchor[1] * (float)fv_exp((double)fv_head_value(o, at + 3));
    fv_head_add_box(j, item, cx - bw * 0.5f, cy - bh * 0.5f, cx + bw * 0.5f, cy + bh * 0.5f, score,
                    class_id);
}

static void yolov3_scan(struct fv_head_job *j, int64_t begin, int64_t end)
{
    for (int64_t i = begin; i < end; i++) {
        int32_t output = 0;
        int64_t place = i;
        while (place >= yolov3_cells(&j->out[output]) * j->d->anchor_count)
            place -= yolov3_cells(&j->out[output++]) * j->d->anchor_count;
        const struct fv_head_output *o = &j->out[output];
        const int64_t at = place * (5 + j->d->classes);
        const float object = fv_head_sigmoid(fv_head_value(o, at + 4));
        for (int32_t c = 0; c < j->d->classes; c++) {
            const float least = fv_head_least(j, c);
            if (object < least) continue; /* a product with a score is no larger */
            const float score = object * fv_head_sigmoid(fv_head_value(o, at + 5 + c));
            if (score >= least) yolov3_box(j, output, place, i, score, c);
        }
    }
}

const struct fv_head fv_head_yolov2 = {yolov2_items, yolov2_scan, 1, FV_DETECT_BOXES, NULL};
const struct fv_head fv_head_yolov5 = {yolov5_items, yolov5_scan, 1, FV_DETECT_BOXES, NULL};
const struct fv_head fv_head_yolov8 = {yolov8_items, yolov8_scan, 1, FV_DETECT_BOXES, NULL};
const struct fv_head fv_head_yolov8_seg = {yolov8_seg_items, yolov8_scan, 1,
                                           FV_DETECT_BOXES | FV_DETECT_MASK, NULL};
const struct fv_head fv_head_yolov8_obb = {yolov8_obb_items, yolov8_obb_scan, 1, FV_DETECT_BOXES,
                                           NULL};
const struct fv_head fv_head_yolox = {yolox_items, yolox_scan, 1, FV_DETECT_BOXES, NULL};
const struct fv_head fv_head_yolov3 = {yolov3_items, yolov3_scan, 1, FV_DETECT_BOXES, NULL};
const struct fv_head fv_head_yolov8_pose = {yolov8_pose_items, yolov8_scan, 1,
                                            FV_DETECT_BOXES | FV_DETECT_POINTS, yolov8_points};

/* Heads whose objects have keypoints: detectors of faces, palms and people against anchors, poses,
 * landmarks; and boxes that need no suppression. Forms: the networks of MediaPipe (BlazeFace,
 * Bazarevsky et al., arXiv:1907.05047; BlazePalm and hand landmarks, Zhang et al.,
 * arXiv:2006.10214), MoveNet as TensorFlow Hub gives it, end-to-end exports of YOLO. */
#include "detect/heads.h"

static float sx_of(const struct fv_head_job *j)
{
    return j->d->normalised ? (float)j->model->header->preprocess.width : 1.0f;
}

static float sy_of(const struct fv_head_job *j)
{
    return j->d->normalised ? (float)j->model->header->preprocess.height : 1.0f;
}

static float score_of(const struct fv_head_job *j, float value)
{
    return (j->d->logits & FV_LOGITS_SCORES) != 0 ? fv_head_sigmoid(value) : value;
}

/* The keypoints from element `at` of an output on, x before y. */
static void read_points(const struct fv_head_job *j, const struct fv_head_output *o, int64_t at,
                        struct fovea_keypoint *points)
{
    const struct fv_model_decode *d = j->d;
    for (int32_t k = 0; k < d->point_count; k++, at += d->point_values) {
        float score = __builtin_nanf("");
        if (d->point_score > 0) score = fv_head_value(o, at + d->point_score);
        if (d->point_score > 0 && (d->logits & FV_LOGITS_POINTS) != 0)
            score = fv_head_sigmoid(score);
        points[k] = fv_head_keypoint(j, fv_head_value(o, at) * sx_of(j),
                                     fv_head_value(o, at + 1) * sy_of(j), score);
    }
}

/* ---- rows of corners, score and class, best first, without overlaps -------------------------- */

enum { END2END_FIRST = 6 };

static int64_t end2end_items(const struct fv_head_job *j, int64_t *cost)
{
    const struct fv_head_output *o = fv_head_role(j, FV_ROLE_BOXES);
    const int64_t points = (int64_t)j->d->point_count * j->d->point_values;
    if (o == NULL || o->t->rank < 2 || fv_head_last_dim(o) != END2END_FIRST + points) return 0;
    *cost = fv_head_last_dim(o);
    return fv_head_count(o) / fv_head_last_dim(o);
}

static void end2end_scan(struct fv_head_job *j, int64_t begin, int64_t end)
{
    const struct fv_head_output *o = fv_head_role(j, FV_ROLE_BOXES);
    const float sx = sx_of(j), sy = sy_of(j);
    for (int64_t i = begin; i < end; i++) {
        const int64_t at = i * fv_head_last_dim(o);
        const float score = fv_head_value(o, at + 4), number = fv_head_value(o, at + 5) + 0.5f;
        if (!(number >= 0.0f && number < (float)FV_MODEL_LABELS_MAX)) continue;
        const int32_t class_id = (int32_t)number;
        if (score >= fv_head_least(j, class_id))
            fv_head_add_box(j, i, fv_head_value(o, at) * sx, fv_head_value(o, at + 1) * sy,
                            fv_head_value(o, at + 2) * sx, fv_head_value(o, at + 3) * sy, score,
                            class_id);
    }
}

static void end2end_points(const struct fv_head_job *j, int64_t item, struct fovea_keypoint *points)
{
    const struct fv_head_output *o = fv_head_role(j, FV_ROLE_BOXES);
    read_points(j, o, item * fv_head_last_dim(o) + END2END_FIRST, points);
}

/* ---- MoveNet: y, x, score of each keypoint; with several people corners and score of each ---- */

enum { MOVENET_VALUES = 3, MOVENET_BOX = 5 };

static int64_t movenet_items(const struct fv_head_job *j, int64_t *cost)
{
    const struct fv_head_output *o = fv_head_role(j, FV_ROLE_BOXES);
    const int64_t points = (int64_t)j->d->point_count * MOVENET_VALUES;
    if (o == NULL || points == 0 || o->t->rank < 2) return 0;
    *cost = points;
    if (fv_head_last_dim(o) == points + MOVENET_BOX) return fv_head_count(o) / fv_head_last_dim(o);
    return fv_head_last_dim(o) == MOVENET_VALUES && fv_head_count(o) == points ? 1 : 0;
}

static void movenet_scan(struct fv_head_job *j, int64_t begin, int64_t end)
{
    const struct fv_head_output *o = fv_head_role(j, FV_ROLE_BOXES);
    const float sx = sx_of(j), sy = sy_of(j);
    if (fv_head_last_dim(o) == MOVENET_VALUES) { /* one person: the mean of the keypoints' scores */
        float sum = 0;
        for (int32_t k = 0; k < j->d->point_count; k++)
            sum += fv_head_clamp(fv_head_value(o, k * MOVENET_VALUES + 2), 1.0f);
        const float score = sum / (float)j->d->point_count;
        if (score >= fv_head_least(j, 0)) fv_head_add_plain(j, 0, score, 0);
        return;
    }
    for (int64_t i = begin; i < end; i++) {
        const int64_t at = (i + 1) * fv_head_last_dim(o) - MOVENET_BOX;
        const float score = fv_head_value(o, at + 4);
        if (score >= fv_head_least(j, 0))
            fv_head_add_box(j, i, fv_head_value(o, at + 1) * sx, fv_head_value(o, at) * sy,
                            fv_head_value(o, at + 3) * sx, fv_head_value(o, at + 2) * sy, score, 0);
    }
}

static void movenet_points(const struct fv_head_job *j, int64_t item, struct fovea_keypoint *points)
{
    const struct fv_head_output *o = fv_head_role(j, FV_ROLE_BOXES);
    int64_t at = fv_head_last_dim(o) == MOVENET_VALUES ? 0 : item * fv_head_last_dim(o);
    for (int32_t k = 0; k < j->d->point_count; k++, at += MOVENET_VALUES)
        points[k] = fv_head_keypoint(j, fv_head_value(o, at + 1) * sx_of(j),
                                     fv_head_value(o, at) * sy_of(j), fv_head_value(o, at + 2));
}

/* ---- Blaze detectors: box and keypoints against an anchor, in input pixels ------------------- */

enum { BLAZE_FIRST = 4 };

static const float *blaze_anchor(const struct fv_head_job *j, int64_t item)
{
    return (const float *)(const void *)(j->model->base + j->d->anchor_data) + 4 * item;
}

static int64_t blaze_items(const struct fv_head_job *j, int64_t *cost)
{
    const struct fv_head_output *boxes = fv_head_role(j, FV_ROLE_BOXES),
                                *scores = fv_head_role(j, FV_ROLE_SCORES);
    const int64_t columns = BLAZE_FIRST + (int64_t)j->d->point_count * 2;
    if (boxes == NULL || scores == NULL || boxes->t->rank < 2 || fv_head_last_dim(boxes) != columns)
        return 0;
    const int64_t n = fv_head_count(boxes) / columns;
    if (fv_head_count(scores) != n || j->d->anchor_data < FV_MODEL_HEADER_BYTES ||
        j->d->anchor_data % 4 != 0 ||
        j->d->anchor_data + n * 16 > (int64_t)j->model->header->file_bytes)
        return 0;
    *cost = FV_HEAD_EXP_COST;
    return n;
}

static void blaze_scan(struct fv_head_job *j, int64_t begin, int64_t end)
{
    const struct fv_head_output *boxes = fv_head_role(j, FV_ROLE_BOXES),
                                *scores = fv_head_role(j, FV_ROLE_SCORES);
    const struct fv_model_preprocess *p = &j->model->header->preprocess;
    const float width = (float)p->width, height = (float)p->height;
    for (int64_t i = begin; i < end; i++) {
        const float score = score_of(j, fv_head_value(scores, i));
        if (!(score >= fv_head_least(j, 0))) continue;
        const float *anchor = blaze_anchor(j, i);
        const int64_t at = i * fv_head_last_dim(boxes);
        const float x = fv_head_value(boxes, at) * anchor[3] + anchor[1] * width,
                    y = fv_head_value(boxes, at + 1) * anchor[2] + anchor[0] * height,
                    w = fv_head_value(boxes, at + 2) * anchor[3],
                    h = fv_head_value(boxes, at + 3) * anchor[2];
        fv_head_add_box(j, i, x - w * 0.5f, y - h * 0.5f, x + w * 0.5f, y + h * 0.5f, score, 0);
    }
}

static void blaze_points(const struct fv_head_job *j, int64_t item, struct fovea_keypoint *points)
{
    const struct fv_head_output *boxes = fv_head_role(j, FV_ROLE_BOXES);
    const struct fv_model_preprocess *p = &j->model->header->preprocess;
    const float *anchor = blaze_anchor(j, item);
    int64_t at = item * fv_head_last_dim(boxes) + BLAZE_FIRST;
    for (int32_t k = 0; k < j->d->point_count; k++, at += 2) {
        const float x = fv_head_value(boxes, at) * anchor[3] + anchor[1] * (float)p->width,
                    y = fv_head_value(boxes, at + 1) * anchor[2] + anchor[0] * (float)p->height;
        points[k] = fv_head_keypoint(j, x, y, __builtin_nanf(""));
    }
}

/* ---- landmarks of the one object that the picture shows -------------------------------------- */

static int64_t landmarks_items(const struct fv_head_job *j, int64_t *cost)
{
    const struct fv_head_output *o = fv_head_role(j, FV_ROLE_BOXES),
                                *score = fv_head_role(j, FV_ROLE_SCORES);
    const int64_t values = (int64_t)j->d->point_count * j->d->point_values;
    *cost = FV_HEAD_EXP_COST;
    return o != NULL && values > 0 && fv_head_count(o) == values &&
                   (score == NULL || fv_head_count(score) == 1)
               ? 1
               : 0;
}

/* Without an output for the score it is 1. */
static void landmarks_scan(struct fv_head_job *j, int64_t begin, int64_t end)
{
    const struct fv_head_output *o = fv_head_role(j, FV_ROLE_SCORES);
    const float score = o == NULL ? 1.0f : score_of(j, fv_head_value(o, 0));
    if (begin < end && score >= fv_head_least(j, 0)) fv_head_add_plain(j, begin, score, 0);
}

static void landmarks_points(const struct fv_head_job *j, int64_t item,
                             struct fovea_keypoint *points)
{
    (void)item;
    read_points(j, fv_head_role(j, FV_ROLE_BOXES), 0, points);
}

const struct fv_head fv_head_end2end = {end2end_items, end2end_scan, 0,
                                        FV_DETECT_BOXES | FV_DETECT_POINTS, end2end_points};
const struct fv_head fv_head_movenet = {movenet_items, movenet_scan, 0, FV_DETECT_POINTS,
                                        movenet_points};
const struct fv_head fv_head_blaze = {blaze_items, blaze_scan, 1,
                                      FV_DETECT_BOXES | FV_DETECT_POINTS, blaze_points};
const struct fv_head fv_head_landmarks = {landmarks_items, landmarks_scan, 0, FV_DETECT_POINTS,
                                          landmarks_points};

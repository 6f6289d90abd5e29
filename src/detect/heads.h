/* The heads of networks: how each kind writes what it found into the network's outputs. One scan
 * function per kind reads a range of the outputs' items (anchors, cells, rows, classes) and hands
 * in candidates; the rest is decode.c's. */
#ifndef FOVEA_DETECT_HEADS_H
#define FOVEA_DETECT_HEADS_H

#include "detect/decode.h"
#include "detect/output.h"

enum { FV_HEAD_EXP_COST = 16 }; /* an exponential beside a value read */

struct fv_head_job {
    const struct fv_model *model;
    const struct fv_model_decode *d;
    const struct fv_nn_input_fit *fit;
    struct fv_detect_scratch *s;
    const float *thresholds; /* by class, or NULL */
    float score_threshold;   /* for every class, beside its own */
    float floor; /* below the threshold down to here a box is uncertain; 0: such are left out */
    int32_t out_count;
    struct fv_head_output out[FV_MODEL_IO_MAX];
};

struct fv_head {
    /* Items that the outputs hold, 0 where their shape does not fit; `cost` takes values read per
     * item. */
    int64_t (*items)(const struct fv_head_job *job, int64_t *cost);
    void (*scan)(struct fv_head_job *job, int64_t begin, int64_t end);
    int boxes_overlap; /* several items may give the same object: suppression is due */
    uint32_t gives;    /* bits FV_DETECT_*: what a candidate is */
    /* The job's d->point_count keypoints of an item that was a candidate; NULL: it has none. */
    void (*points)(const struct fv_head_job *job, int64_t item, struct fovea_keypoint *points);
};

/* heads_yolo.c */
extern const struct fv_head fv_head_yolov2, fv_head_yolov3, fv_head_yolov5, fv_head_yolov8,
    fv_head_yolov8_obb, fv_head_yolov8_pose, fv_head_yolov8_seg, fv_head_yolox;
/* heads_points.c */
extern const struct fv_head fv_head_end2end, fv_head_movenet, fv_head_blaze, fv_head_landmarks;

/* The head of a decoder, NULL for one without candidates. */
const struct fv_head *fv_head_of(int32_t decoder);

/* The output of a role, NULL where the network has none. */
const struct fv_head_output *fv_head_role(const struct fv_head_job *job, int32_t role);

/* What a score must be at least to be taken at all. */
float fv_head_least(const struct fv_head_job *job, int32_t class_id);

/* A candidate with a box in input pixels (corner coordinates), which is cut at the image; of no
 * area: none. `item` is where its keypoints are found again. */
void fv_head_add_box(struct fv_head_job *job, int64_t item, float x0, float y0, float x1, float y1,
                     float score, int32_t class_id);
/* The same by centre and size, which are fractions of the input where the model says so. */
void fv_head_add_centred(struct fv_head_job *job, int64_t item, float x, float y, float w, float h,
                         float score, int32_t class_id);
/* A candidate with a turned box by centre and size in input pixels; it is not cut. */
void fv_head_add_turned(struct fv_head_job *job, int64_t item, const float box[4], float angle,
                        float score, int32_t class_id);
/* A candidate without a box. */
void fv_head_add_plain(struct fv_head_job *job, int64_t item, float score, int32_t class_id);

/* A keypoint in input pixels. */
struct fovea_keypoint fv_head_keypoint(const struct fv_head_job *job, float x, float y,
                                       float score);

/* Take a candidate; of more than FV_DETECT_CANDIDATES_MAX the best are kept, an uncertain one never
 * before one that is not. */
void fv_detect_keep(struct fv_detect_scratch *scratch, const struct fovea_detection *found,
                    int64_t item, int uncertain);

#endif

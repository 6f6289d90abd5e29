/* The heads of detectors: how each kind writes its boxes into the network's outputs. One scan
 * function per kind reads a range of the outputs' items (anchors, cells, rows, classes) and hands
 * in candidates; the rest is decode.c's. */
#ifndef FOVEA_DETECT_HEADS_H
#define FOVEA_DETECT_HEADS_H

#include "detect/decode.h"

/* One output tensor, read element by element as real numbers. */
struct fv_head_output {
    const struct fv_model_tensor *t;
    const uint8_t *data;
};

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
};

/* The head of a decoder, NULL for one that gives no boxes. */
const struct fv_head *fv_head_of(int32_t decoder);

/* Take a candidate; of more than FV_DETECT_CANDIDATES_MAX the best are kept, an uncertain one never
 * before one that is not. */
void fv_detect_keep(struct fv_detect_scratch *scratch, const struct fovea_detection *found,
                    int uncertain);

#endif

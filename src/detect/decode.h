/* From a network's outputs to detections in pixels of the image it looked at. */
#ifndef FOVEA_DETECT_DECODE_H
#define FOVEA_DETECT_DECODE_H

#include "detect/preprocess.h"
#include "fovea/detect.h"
#include "nn/model.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { FV_DETECT_CANDIDATES_MAX = 1000 };

/* Cells of the largest grid that the FOMO decoder takes. */
enum { FV_DETECT_CELLS_MAX = 128 * 128 };

/* Scratch of the decoders, in job memory. */
struct fv_detect_scratch {
    struct fovea_detection candidates[FV_DETECT_CANDIDATES_MAX];
    int32_t count, smallest; /* the candidate of the lowest score once the list is full */
    uint8_t dropped[FV_DETECT_CANDIDATES_MAX];
    uint8_t seen[FV_DETECT_CELLS_MAX]; /* cells already part of an object */
    int32_t stack[FV_DETECT_CELLS_MAX];
};

/* Decode the outputs of a finished run into at most `capacity` detections by falling score (ties: order of the outputs).
 * Returns how many. Outputs whose shape does not fit the decoder give none. Real-time safe; at most a pass over the outputs
 * plus FV_DETECT_CANDIDATES_MAX^2 / 2 box comparisons. */
int32_t fv_detect_decode(const struct fv_model *model, uint8_t *arena, const struct fv_detect_view *view,
                         struct fv_detect_scratch *scratch, struct fovea_detection *detections, int32_t capacity);

/* Greedy suppression of candidates already sorted by falling score; keeps those that overlap no better one (of their class,
 * or of any) by more than `iou`. Returns how many are left, at the front. */
int32_t fv_detect_suppress(struct fovea_detection *list, int32_t count, float iou, int class_agnostic, uint8_t *dropped);

#ifdef __cplusplus
}
#endif
#endif

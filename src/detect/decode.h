/* From a network's outputs to what it found, in pixels of the image that it was given. */
#ifndef FOVEA_DETECT_DECODE_H
#define FOVEA_DETECT_DECODE_H

#include "detect/mask.h"
#include "nn/input.h"
#include "fovea/detect.h"
#include "nn/model.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { FV_DETECT_CANDIDATES_MAX = 1000 };

/* Cells of the largest grid that the FOMO decoder takes. */
enum { FV_DETECT_CELLS_MAX = 128 * 128 };

/* Stricter limits than the model's own; 0 leaves one as it is. */
struct fv_detect_limits {
    float score, iou;
    int32_t count;
    /* boxes below the threshold are kept as uncertain ones down to this score, but for FOMO, whose
     * boxes grow with it */
    float floor;
};

struct fv_detect_candidate {
    struct fovea_detection found;
    int32_t order;     /* in the outputs */
    int32_t item;      /* of the outputs, where its keypoints or coefficients are */
    int32_t uncertain; /* below the threshold */
};

enum fv_decode_phase {
    FV_DECODE_SCAN = 0,
    FV_DECODE_SORT,
    FV_DECODE_SUPPRESS,
    FV_DECODE_POINTS,
    FV_DECODE_CLEAR,
    FV_DECODE_MASK
};
struct fv_detect_progress {
    int64_t at; /* item of the scan, or candidate of the suppression, that comes next */
    int32_t phase;
    int32_t left; /* candidates that the suppression has left so far; then the row of a mask */
};

/* Scratch of the decoders, in job memory. */
struct fv_detect_scratch {
    struct fv_detect_progress progress;
    int32_t count, offered; /* candidates held; ever */
    int32_t sure; /* once sorted: of those held, how many are not uncertain; they are the first */
    struct fv_detect_candidate heap[FV_DETECT_CANDIDATES_MAX];
    struct fovea_detection candidates[FV_DETECT_CANDIDATES_MAX]; /* by falling score, once sorted */
    int32_t items[FV_DETECT_CANDIDATES_MAX];                     /* of these */
    uint8_t dropped[FV_DETECT_CANDIDATES_MAX];
    uint8_t seen[FV_DETECT_CELLS_MAX]; /* cells already part of an object */
    int32_t stack[FV_DETECT_CELLS_MAX];
};

/* What a decoder gives. */
enum {
    FV_DETECT_BOXES = 1,
    FV_DETECT_POINTS = 2,
    FV_DETECT_CLASSES = 4, /* of the whole image */
    FV_DETECT_MASK = 8
};

/* Room for what is not in the list of detections; NULL: it is left out. */
struct fv_detect_room {
    struct fovea_keypoint *points; /* of fv_detect_sets_max detections */
    struct fv_detect_mask *mask;   /* with pixels, of fv_detect_mask_size */
    uint8_t *pixels, *confidence;  /* confidence: of fv_detect_mask_confident, else NULL */
};

/* Bits of the above for the model's decoder; 0: none, its outputs leave as they are. */
uint32_t fv_detect_gives(const struct fv_model *model);
/* Its name, as tools/import knows it. */
const char *fv_detect_decoder_name(const struct fv_model *model);
/* Keypoints of each detection, 0 without. */
int32_t fv_detect_point_count(const struct fv_model *model);
/* Detections that have keypoints, at most: FOVEA_KEYPOINTS_MAX in all. */
int32_t fv_detect_sets_max(const struct fv_model *model);
/* Name of a class, "" where the model has none. */
const char *fv_detect_label(const struct fv_model *model, int32_t class_id);

/* Decode the outputs of a finished run in units of bounded cost: start, then unit until FOVEA_OK,
 * then take. Outputs whose shape does not fit the decoder give nothing. Real-time safe. The last
 * unit writes the keypoints. */
void fv_detect_decode_start(struct fv_detect_scratch *scratch);
enum fovea_status fv_detect_decode_unit(const struct fv_model *model, uint8_t *arena,
                                        const struct fv_nn_input_fit *fit,
                                        const struct fv_detect_limits *limits,
                                        struct fv_detect_scratch *scratch,
                                        const struct fv_detect_room *room);
/* At most `capacity` detections by falling score (ties: order of the outputs). Returns how many.
 * Behind them go the uncertain ones, which suppress no others, as far as there is room; `uncertain`
 * takes how many, NULL: none are wanted. */
int32_t fv_detect_decode_take(const struct fv_model *model, const struct fv_detect_limits *limits,
                              const struct fv_detect_scratch *scratch,
                              struct fovea_detection *detections, int32_t capacity,
                              int32_t *uncertain);

/* All units at once, with the model's own limits. */
int32_t fv_detect_decode(const struct fv_model *model, uint8_t *arena,
                         const struct fv_nn_input_fit *fit, struct fv_detect_scratch *scratch,
                         const struct fv_detect_room *room, struct fovea_detection *detections,
                         int32_t capacity);

#ifdef __cplusplus
}
#endif
#endif

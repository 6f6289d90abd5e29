/* A network within the runtime: it takes a frame when it is free, runs on it (an inference) and
 * encodes what its decoder gives, a message for each kind of result, with the stamp of that frame;
 * boxes are in the raw and the rectified image. */
#ifndef FOVEA_RUNTIME_DETECTION_H
#define FOVEA_RUNTIME_DETECTION_H

#include <stdbool.h>

#include "detect/job.h"
#include "fovea/fovea.h"
#include "image/seen.h"
#include "image/rectify.h"
#include "message/message.h"
#include "runtime/frame_id.h"

/* After the decoder: boxes are mapped to the rectified image, then a mask is sent piece by piece.
 */
enum fv_detection_mapping { FV_DETECTION_IDLE = 0, FV_DETECTION_MAPPING, FV_DETECTION_SENDING };

/* No addresses and no padding: copied and hashed as bytes. */
struct fv_detection_state {
    struct fv_frame_id frame, found_frame; /* under way; of the last completed inference */
    uint64_t inferences;                   /* completed */
    uint32_t mapping;                      /* enum fv_detection_mapping */
    uint32_t mapped; /* how many are; of a raw network, bytes of outputs that were sent */
    int32_t mask_row, reserved;     /* rows of the mask that were sent */
    struct fv_detect_limits limits; /* of the inference under way */
    float rectified[FOVEA_DETECTIONS_MAX][4];
};

struct fv_detection {
    bool enabled;
    uint32_t gives;                      /* bits FV_DETECT_*; 0: its outputs are sent as they are */
    struct fovea_detect_config settings; /* of this detector */
    float
        floor; /* detections down to this score are kept behind the others, for objects; 0: none */
    struct fv_model model; /* in the caller's bytes */
    struct fv_detect_memory memory;
    struct fv_detection_state *state;
    void *message_scratch;
    bool has_rectified;
    struct fv_rectified rectified; /* the rectified image */
};

/* Check the model of `settings`, which must take images; choose the rectified
 * image. Init-only. FOVEA_ERROR_*: `error` begins with `key`, that of the model. Nothing is
 * enabled without a model. */
enum fovea_status fv_detection_prepare(struct fv_detection *detection, const char *key,
                                       const struct fovea_detect_config *settings,
                                       const struct fovea_camera *camera,
                                       struct fovea_error *error);

/* With the settings of fv_detection_set. */
void fv_detection_carve(struct fv_detection *detection, const struct fovea_camera *camera,
                        struct fv_arena *persistent, struct fv_arena *job, struct fv_arena *frame);
/* Prepare the network for these kernels. Init-only. */
void fv_detection_init(const struct fv_detection *detection, const struct fv_kernels *kernels);
/* Take the limits of `settings` for inferences that begin from now on; their count is at most that
 * of the settings at carving. Real-time safe. */
void fv_detection_set(struct fv_detection *detection, const struct fovea_detect_config *settings,
                      float floor);
/* The floor that objects with this configuration need. */
float fv_detection_floor(const struct fovea_objects_config *objects);

/* The kinds of message that a network sends, in the order in which they leave. */
enum fv_detection_message {
    FV_DETECTION_BOXES = 0,
    FV_DETECTION_KEYPOINTS,
    FV_DETECTION_CLASSES,
    FV_DETECTION_SEGMENTATION, /* in as many messages as the mask needs, one per work call */
    FV_DETECTION_TENSORS,
    FV_DETECTION_MESSAGE_COUNT
};
bool fv_detection_sends(const struct fv_detection *detection, enum fv_detection_message message);
/* Whether it is due now: of a mask that takes several messages, the others left with the first. */
bool fv_detection_due(const struct fv_detection *detection, enum fv_detection_message message);
/* Its kind for the first network (0) or the second (1). */
enum fv_message_kind fv_detection_kind(enum fv_detection_message message, int network);

/* Bytes that a message takes at most. */
size_t fv_detection_label_bytes(const struct fv_detection *detection); /* of the longest label */
size_t fv_detection_message_bytes(const struct fv_detection *detection,
                                  enum fv_detection_message message);

/* Give up the inference under way. Real-time safe, as all that follows. */
void fv_detection_reset(struct fv_detection *detection);

/* Take this frame, unless an inference is under way: its pixels are copied. Where networks see the
 * result of the preprocessing chain, the copy gets its luma; `white_balance`: its colours are
 * balanced. True: the inference begins. */
bool fv_detection_offer(struct fv_detection *detection, const struct fovea_frame *frame,
                        const struct fv_frame_id *id, const struct fv_seen *seen,
                        bool white_balance);

bool fv_detection_waiting(const struct fv_detection *detection);

/* Do at most `units` units, `*done` of them. True: an inference is complete, or outputs are ready
 * to be sent; fv_detection_encode then encodes each message that is due. */
bool fv_detection_advance(struct fv_detection *detection, const struct fovea_config *config,
                          const struct fv_kernels *kernels, uint32_t units, uint32_t *done);

/* Encode a message about the last inference, or the next part of a raw network's outputs. Returns
 * the bytes. */
uint32_t fv_detection_encode(struct fv_detection *detection, enum fv_detection_message message,
                             const struct fovea_config *config, uint32_t reset_counter,
                             uint8_t *buffer, size_t capacity);

void fv_detection_get(const struct fv_detection *detection, struct fovea_detections *detections);
/* Its mask; inferences is 0 where there is none. While the next one is decoded it is incomplete. */
void fv_detection_get_segmentation(const struct fv_detection *detection,
                                   struct fovea_segmentation *segmentation);
/* The same, but of a whole mask only; false: there is none now. */
bool fv_detection_has_mask(const struct fv_detection *detection,
                           struct fovea_segmentation *segmentation);
/* "" where there is none. */
const char *fv_detection_label(const struct fv_detection *detection, int32_t class_id);

#endif

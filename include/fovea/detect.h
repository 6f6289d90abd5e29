/* Detections: what an int8 network finds in an image: objects with boxes, keypoints, masks, or the
 * classes of the whole image. The decoder named in the model file decides which.
 *
 * A network reads an image resized to its input (stretched, or letterboxed with its shape kept);
 * boxes and points are given in pixels of that image, (0, 0) the centre of the top left pixel, max
 * exclusive.
 *
 * In the runtime detection is a job: an image is copied when the job is free, the network runs in
 * units of bounded work over as many frames as it takes, and its boxes are published with the
 * stamp of the image that they belong to. */
#ifndef FOVEA_DETECT_H
#define FOVEA_DETECT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum {
    FOVEA_DETECTIONS_MAX = 300,
    FOVEA_KEYPOINT_SETS_MAX = 100, /* detections with keypoints, of one image */
    FOVEA_KEYPOINTS_MAX = 3000     /* of all of them */
};

struct fovea_detection {
    float x_min_px, y_min_px, x_max_px, y_max_px;
    float score;      /* 0 to 1 */
    int32_t class_id; /* index into the model's classes, background not counted */
    float angle;      /* rad: the box is turned by it about its centre, from x to y; mostly 0 */
};

/* A point in pixels of the image; it may lie outside of it. */
struct fovea_keypoint {
    float x_px, y_px;
    float score; /* 0 to 1; NaN: the model gives none */
};

struct fovea_detect_config {
    /* A model file (.fvm, made by tools/import) of `model_bytes` bytes in memory, at a multiple of
     * 64, which stays the caller's and must stay as it is while the runtime is in use: it is read
     * in place and shared by copies of the runtime. Checked from end to end by fovea_size and
     * fovea_init. Its decoder says which messages leave: detections_t, keypoints_t, classes_t,
     * segmentation_t; without one no detections are made, and its raw outputs leave (tensors_t).
     * NULL: no network. */
    const void *model;
    size_t model_bytes;

    bool enabled; /* default true; false: the network is loaded and does not run */
    /* [1, 1000000], default 1: run on every n-th frame, if the network is free then */
    uint32_t period_frames;
    uint32_t count_max; /* [1, 300], default 100: detections of one image, best first; affects the
                           size of the message */
    double score_threshold; /* [0, 1], default 0: the model's own; above: at least this for every
                               class */
    double iou_threshold;   /* [0, 1], default 0: the model's own overlap above which the box of
                               lower score is removed */
};

/* Detections of the last completed inference, in memory of the runtime's block. */
struct fovea_detections {
    uint64_t inferences; /* completed since fovea_init; nothing below is valid while 0 */
    int64_t stamp_ns;    /* of the image */
    uint64_t sequence;   /* its frame's number */
    uint32_t count;
    /* detections after the first `count` of the list: below the threshold, for the objects
     * (objects.score_low) */
    uint32_t uncertain;
    /* By falling score. Of a classifier the boxes are the whole image, of keypoints without a box
     * they are 0. */
    const struct fovea_detection *list;
    uint32_t set_count, point_count; /* the first set_count of the list have this many keypoints */
    const struct fovea_keypoint *points; /* set after set; NULL: the model gives none */
};

#ifdef __cplusplus
}
#endif
#endif

/* One frame of a run for its picture: the image with its features, boxes and objects. The frame
 * with most confirmed objects is kept, of equal ones the one whose pose has most landmarks.
 *
 * Detections come some frames late, for an image that has gone: so now and then a frame is noted,
 * and completed when the detections of its stamp come. Of a camera its pixels are copied, into two
 * frames taken at open; of a recording the pixels are read again at the end, when its source is
 * closed and has given its memory back. */
#ifndef FOVEA_APP_RUN_SNAPSHOT_H
#define FOVEA_APP_RUN_SNAPSHOT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "fovea/fovea.h"

enum { FV_SNAPSHOT_BOXES_MAX = 64 };

struct fv_snapshot_box {
    float x_min_px, y_min_px, x_max_px, y_max_px, score;
    int32_t class_id;
    uint32_t id;   /* of the object; 0: only detected */
    bool coasting; /* predicted, not seen in this image */
};

struct fv_snapshot_frame {
    bool whole;
    uint32_t score;
    int64_t stamp_ns;
    uint64_t sequence, index;
    struct fovea_image image; /* in the snapshot's memory; data NULL until fv_snapshot_fetch */
    uint32_t feature_count, box_count;
    struct fovea_feature features[FOVEA_FEATURES_MAX];
    struct fv_snapshot_box boxes[FV_SNAPSHOT_BOXES_MAX];
};

struct fv_snapshot {
    bool detecting;
    size_t frame_bytes;
    uint8_t *memory;                  /* two frames; NULL where frame_bytes is 0 */
    uint32_t best;                    /* frame that is kept; the other is being filled */
    bool pending;                     /* the other waits for its detections */
    uint64_t steps, copied;           /* frames so far; with which one the last copy was made */
    struct fv_snapshot_frame *frames; /* two; NULL: no snapshot is wanted */
};

/* Bytes that an open snapshot takes. */
size_t fv_snapshot_bytes(size_t frame_bytes);

/* False: no memory, and there will be no snapshot. `frame_bytes`: of the largest frame, 0 where
 * frames can be read again. Init-only. */
bool fv_snapshot_open(struct fv_snapshot *snapshot, size_t frame_bytes, bool detecting);
void fv_snapshot_close(struct fv_snapshot *snapshot);

/* After a processed step and after each work, with what they gave. Loop thread, real-time safe. */
void fv_snapshot_step(struct fv_snapshot *snapshot, const struct fovea *rt,
                      const struct fovea_frame *frame, const struct fovea_pose *pose);
void fv_snapshot_work(struct fv_snapshot *snapshot, const struct fovea_detections *detections,
                      const struct fovea_objects *objects);

/* The frame that was kept; NULL: none. After the loop's last call. */
const struct fv_snapshot_frame *fv_snapshot_best(const struct fv_snapshot *snapshot);

/* Read the pixels of the frame that was kept again, from a source that is opened for it. False: it
 * has none, or they cannot be read any more; the snapshot then is empty. */
bool fv_snapshot_fetch(struct fv_snapshot *snapshot, const char *uri, bool colour);

#endif

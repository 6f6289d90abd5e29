/* The preview job: a JPEG of one pyramid level, for people, whose message is one packet. Copies its
 * level when it starts, encodes a few blocks per unit, and yields one message, which carries the
 * stamp of the image that it shows. */
#ifndef FOVEA_RUNTIME_PREVIEW_H
#define FOVEA_RUNTIME_PREVIEW_H

#include <stdbool.h>
#include <stdint.h>

#include "base/arena.h"
#include "fovea/fovea.h"
#include "image/jpeg.h"
#include "image/plane.h"
#include "runtime/frame_id.h"

struct fv_preview_state {
    struct fv_frame_id frame;
    struct fv_jpeg jpeg;
    uint32_t due;    /* a frame asked for a preview */
    uint32_t active; /* pixels are copied and being encoded */
    /* of this one: less than configured where the picture did not fit the packet */
    uint32_t quality;
    int32_t drawn; /* rows into which a mask was drawn, or none is to be */
};

struct fv_preview {
    struct fv_preview_state *state;
    struct fv_plane picture; /* the level that is encoded, no padding */
    uint8_t *jpeg;
    size_t jpeg_capacity;
};

/* Persistent state and job memory for a level of width x height pixels. */
void fv_preview_carve(struct fv_preview *preview, int32_t width, int32_t height,
                      struct fv_arena *persistent, struct fv_arena *job);

/* Ask for a preview of the frame that was just processed; an unfinished one goes on first. One that
 * was asked for but not begun must be asked for again with each new frame, since it will look at
 * that. */
void fv_preview_ask(struct fv_preview *preview, const struct fv_frame_id *frame);

bool fv_preview_waiting(const struct fv_preview *preview);

/* Do one unit. `level` is that of the last processed frame: the job looks at it in its first
 * unit only. `mask`: whose borders are drawn into it, after that unit; NULL: of none. Returns true
 * when the picture is complete in preview->jpeg, state->jpeg.used bytes. */
bool fv_preview_unit(struct fv_preview *preview, const struct fv_plane *level,
                     const struct fovea_segmentation *mask, uint32_t quality);

#endif

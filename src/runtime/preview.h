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
#include "image/pyramid.h"
#include "runtime/frame_id.h"

struct fv_preview_state {
    struct fv_frame_id frame;
    struct fv_jpeg jpeg;
    uint32_t due;    /* a frame asked for a preview */
    uint32_t camera; /* of this one */
    uint32_t turn;   /* the camera of the next */
    uint32_t active; /* pixels are copied and being encoded */
    /* of this one: less than configured where the picture did not fit the packet */
    uint32_t quality;
    int32_t drawn; /* rows into which a mask was drawn, or none is to be */
};

struct fv_preview {
    struct fv_preview_state *state;
    uint32_t cameras;                                /* shown in turn */
    struct fv_pyramid others[FOVEA_CAMERAS_MAX - 1]; /* of all but the first */
    uint8_t *picture;                                /* the level that is encoded, no padding */
    uint8_t *jpeg;
    size_t jpeg_capacity;
};

/* Persistent state and job memory for pictures of these sizes, of which only width and height are
 * looked at. */
void fv_preview_carve(struct fv_preview *preview, const struct fv_plane *const *levels,
                      uint32_t cameras, struct fv_arena *persistent, struct fv_arena *job);

/* Ask for a preview of a camera of the frame that was just processed; an unfinished one goes on
 * first. One that was asked for but not begun must be asked for again with each new frame, since it
 * will look at that. */
void fv_preview_ask(struct fv_preview *preview, const struct fv_frame_id *frame, uint32_t camera);

bool fv_preview_waiting(const struct fv_preview *preview);

/* Do one unit. `level` is that of the camera in the last processed frame: the job looks at its
 * pixels in its first unit only. `mask`: whose borders are drawn into it, after that unit; NULL: of
 * none. Returns true when the picture is complete in preview->jpeg, state->jpeg.used bytes. */
bool fv_preview_unit(struct fv_preview *preview, const struct fv_plane *level,
                     const struct fovea_segmentation *mask, uint32_t quality);

#endif

/* Boxes around what moves on its own (people, vehicles), and the mask that keeps features out of
 * them.
 *
 * Boxes belong to an image, which may be some frames old when they come. Until newer ones come they
 * grow with their age, by the way that such a thing goes: its own height per second to each side.
 * Boxes older than FV_BOXES_AGE_MAX_NS no longer count. State holds no addresses. Real-time safe.
 */
#ifndef FOVEA_RUNTIME_BOXES_H
#define FOVEA_RUNTIME_BOXES_H

#include "base/arena.h"
#include "fovea/fovea.h"
#include "image/plane.h"

enum { FV_BOXES_AGE_MAX_NS = 1000000000 };

struct fv_boxes_state {
    int64_t stamp_ns;
    uint32_t count;
    struct fovea_box boxes[FOVEA_INPUT_BOXES_MAX];
};

struct fv_boxes {
    struct fv_boxes_state *state;
    struct fv_plane mask; /* of this frame */
};

void fv_boxes_carve(struct fv_boxes *boxes, int32_t width, int32_t height,
                    struct fv_arena *persistent, struct fv_arena *frame);
/* Replace the boxes by those of the image with this stamp. */
void fv_boxes_take(struct fv_boxes *boxes, int64_t stamp_ns, const struct fovea_box *list,
                   uint32_t count);
/* The mask of a frame with this stamp: `fixed` (which may be NULL) itself where no box counts. */
const struct fv_plane *fv_boxes_mask(struct fv_boxes *boxes, const struct fv_plane *fixed,
                                     int64_t stamp_ns);

#endif

/* The images of one camera as each viewer sees them: grey levels with or without the operations of
 * a preprocessing chain.
 *
 * Features have the main pyramid. Where somebody sees the image otherwise than features do, a
 * second pyramid holds it, with only the levels that are looked at. Without operations nothing of
 * this takes memory or time. Carving fills sizes and addresses only. */
#ifndef FOVEA_IMAGE_SEEN_H
#define FOVEA_IMAGE_SEEN_H

#include <stdbool.h>

#include "image/preprocess.h"
#include "image/pyramid.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Who looks at images, and how deep. The first is the one of the main pyramid. */
enum fv_viewer { FV_VIEWER_FEATURES = 0, FV_VIEWER_NETWORKS, FV_VIEWER_PREVIEW, FV_VIEWER_EDGES };
enum { FV_VIEWER_COUNT = 4 };

struct fv_seen {
    struct fv_pyramid main, other; /* the second has 0 levels where nobody needs it */
    struct fv_preprocess chain;
    uint32_t seen_by; /* bit of each viewer that sees the result of the chain */
    bool changes;     /* somebody does */
};

/* Of `chain` only what is done to grey levels counts here: white_balance is the networks' own.
 * Take memory for images of width x height: the main pyramid of `levels`, and what the chain and
 * the other viewers need. `looked_at`: levels that each viewer looks at, 0 for one that is not
 * there; networks that see the result take the image before it too, for its colours. Init-only. */
void fv_seen_carve(struct fv_seen *seen, const struct fovea_preprocess_config *chain,
                   uint32_t seen_by, const uint32_t looked_at[FV_VIEWER_COUNT], int32_t width,
                   int32_t height, uint32_t levels, struct fv_arena *frame);

/* Set the chain, as fv_preprocess_set does, once after carving on memory and for every change after
 * that; nothing where the images were carved without one. Real-time safe. */
void fv_seen_set(struct fv_seen *seen, const struct fovea_preprocess_config *chain);

/* Take an image of the carved size, in any uncompressed format, checked with fovea_image_check.
 * Real-time safe; cost proportional to the pixels. */
void fv_seen_build(struct fv_seen *seen, const struct fv_kernels *kernels,
                   const struct fovea_image *image);

/* The image as `viewer` sees it, of the levels that were carved for it; the main pyramid for one
 * that is not there. */
const struct fv_pyramid *fv_seen_pyramid(const struct fv_seen *seen, enum fv_viewer viewer);

/* Whether a viewer of colours has its luma changed: `before` and `after` are then grey images of
 * the image taken. Real-time safe. */
bool fv_seen_luma(const struct fv_seen *seen, enum fv_viewer viewer, struct fovea_image *before,
                  struct fovea_image *after);

#ifdef __cplusplus
}
#endif
#endif

/* Masks: where features are not looked for. A fixed mask (the robot's own parts) is joined with
 * boxes of this frame (people, vehicles: what moves on its own and would mislead odometry). */
#ifndef FOVEA_FEATURES_MASK_H
#define FOVEA_FEATURES_MASK_H

#include <stdint.h>

#include "image/plane.h"

#ifdef __cplusplus
extern "C" {
#endif

/* In raw pixels, min inclusive, max exclusive; may reach beyond the image. A box whose max is not
 * above its min, or that is not a number, covers nothing. */
struct fv_mask_box {
    float x_min, y_min, x_max, y_max;
};

/* Write `mask`: the pixels of `fixed`, which has the same size (NULL: 255 everywhere), and 0 in
 * every pixel that a box touches. `mask` may be `fixed` itself. Real-time safe: cost proportional
 * to the pixels of the image and of the boxes. */
void fv_mask_compose(const struct fv_plane *mask, const struct fv_plane *fixed,
                     const struct fv_mask_box *boxes, uint32_t count);

#ifdef __cplusplus
}
#endif
#endif

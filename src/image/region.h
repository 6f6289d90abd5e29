/* Regions of the line segment detector: pixels of about the same direction, and the rectangle
 * around them. */
#ifndef FOVEA_IMAGE_REGION_H
#define FOVEA_IMAGE_REGION_H

#include "image/segments.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { FV_REGION_MAX = 2048 };

struct fv_rectangle {
    double x, y;       /* centre, in pixels of the reduced image's gradients */
    double dx, dy;     /* direction, of length 1 */
    double begin, end; /* along it */
    double width;
};

/* The segment that begins at pixel `seed`, which no region has: its region grows, is fitted, and
 * where it is too loose grown again within a smaller angle, or cut. False: there is none. `visits`
 * counts down pixels looked at. Real-time safe; time is bounded by FV_REGION_MAX. */
bool fv_region_find(const struct fv_segments *segments, uint32_t seed, int64_t *visits,
                    struct fv_rectangle *rectangle);

#ifdef __cplusplus
}
#endif
#endif

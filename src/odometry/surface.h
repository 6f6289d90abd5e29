/* Points of surfaces that the current frame shows, for free space: its landmarks, which
 * localisation took as inliers, and in a metric map the distances that two cameras measured of its
 * other features; each with what is left open of its place.
 *
 * How far a landmark is follows from the parallax of the keyframes that see it, from the distance
 * that two cameras measure of it now, and where one keyframe sees it, from the distance that it was
 * made of. A landmark that the measured distance contradicts is left out, and so is what is known
 * to less than one part in 20, and what lies under boxes of movable objects, which have no features
 * (runtime/boxes.h). Real-time safe; bounded by the frame's features. */
#ifndef FOVEA_ODOMETRY_SURFACE_H
#define FOVEA_ODOMETRY_SURFACE_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

struct fv_odometry;

/* In the camera's frame and the unit of the map. */
struct fv_surface_point {
    float position[3];
    float along, across; /* one standard deviation, along the line of sight and across it */
};

/* Fill at most `capacity` points from feature `*next` of the frame on, and put into it where to go
 * on; returns their number, 0 at the end and while the frame is not tracked. */
uint32_t fv_odometry_surface(const struct fv_odometry *odometry, uint32_t *next,
                             struct fv_surface_point *points, uint32_t capacity);

#ifdef __cplusplus
}
#endif
#endif

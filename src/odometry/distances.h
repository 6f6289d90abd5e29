/* What measured distances add to odometry: inverse distances of features along their bearings, as a
 * second camera gives them (geometry/inverse_distance.h). Odometry does not know the second camera.
 *
 * The first frame with enough known distances is the first keyframe of a metric map: each feature
 * whose distance is known to one part in FV_MAP_KNOWN_PARTS becomes a landmark. Later keyframes add
 * landmarks likewise, before features that are farther are triangulated from motion as ever. In a
 * metric map every measured distance, however uncertain, is one more error of its feature: in the
 * pose of a frame (geometry/pose.h) and in the window (map/window.h). Frames without distances go
 * on in the same map. A map that was begun without them keeps its own unit; they are then not used.
 *
 * A frame whose distances contradict the map (the second camera shows another instant, or something
 * hangs before it) is localised without them. Real-time safe; bounded by the features. */
#ifndef FOVEA_ODOMETRY_DISTANCES_H
#define FOVEA_ODOMETRY_DISTANCES_H

#include <stdbool.h>
#include <stdint.h>

#include "base/arena.h"
#include "map/map.h"

#ifdef __cplusplus
extern "C" {
#endif

/* One standard deviation of the unit of a map that measured distances began, relative: baselines
 * are calibrated to a few parts in a thousand. */
#define FV_DISTANCES_SCALE_SIGMA 0.005

struct fv_odometry;
struct fv_odometry_input;

struct fv_distances {
    uint16_t *from; /* frame part: number of the input's feature, by that of the frame; NULL: no
                       distances */
};

void fv_distances_carve(struct fv_distances *distances, bool wanted, uint32_t features_max,
                        struct fv_arena *frame);

/* Take the input's distances for the features of the current frame. */
void fv_odometry_take_distances(struct fv_odometry *odometry,
                                const struct fv_odometry_input *input);
/* Begin a metric map with the current frame; false when too few distances are known. *continues:
 * its world is that of the map before, since the inertial sensor has carried the pose over. */
bool fv_odometry_begin_metric(struct fv_odometry *odometry, bool *continues);
/* The frame was matched with the map at this pose: forget its distances where they contradict it.
 * Whether there are any that count. */
bool fv_odometry_judge_distances(struct fv_odometry *odometry, const struct fv_se3 *T_cam_world);
/* New landmarks of a keyframe from its known distances: at most `count` features from `first` on.
 * Returns the feature to go on with. */
uint32_t fv_odometry_create_measured(struct fv_odometry *odometry, uint32_t keyframe,
                                     uint32_t first, uint32_t count);

#ifdef __cplusplus
}
#endif
#endif

/* Motion between a frame and an earlier one, with its covariance: what a fusion of its own asks
 * for, since a pose's covariance is relative to its reference keyframe and holds nothing of the
 * drift before that.
 *
 * Every frame that becomes a keyframe has, as its covariance, that of its pose relative to the
 * keyframe before. These are links of a chain. The covariance of a motion is the sum of those of
 * the later frame against its keyframe, of the keyframes made in between, and of the earlier frame
 * against its own, each carried to the later frame by the adjoint, as if they were independent.
 * What they have in common is added for the whole way, along it: in metres the scale's error, else
 * .5 %, by which the unit of length of a stretch differs from that of the path. Held against the
 * truth by tools/evaluate (nees6_apart).
 *
 * The last FOVEA_RELATIVE_FRAMES_MAX frames are held in a ring. State holds no addresses. Noting a
 * frame is real-time safe; asking is bounded by the frames held. */
#ifndef FOVEA_RUNTIME_RELATIVE_H
#define FOVEA_RUNTIME_RELATIVE_H

#include "base/arena.h"
#include "fovea/odometry.h"
#include "geometry/se3.h"

struct fv_relative_frame {
    int64_t stamp_ns;
    uint32_t stretch; /* poses of one stretch relate; 0: no pose */
    uint32_t is_keyframe;
    struct fv_se3 T_world_cam;
    double covariance[21]; /* but for the scale's share */
    double common_sigma;   /* along the way: what links have in common, relative */
};

struct fv_relative_state {
    uint64_t frames; /* noted; the last one is at (frames - 1) modulo the size of the ring */
    /* Of the last posed frame: what makes poses relate. */
    uint32_t map_id, reset_counter, changes, metric;
    uint32_t stretch, reserved;
    struct fv_relative_frame ring[FOVEA_RELATIVE_FRAMES_MAX + 1];
};

struct fv_relative {
    struct fv_relative_state *state;
};

void fv_relative_carve(struct fv_relative *relative, struct fv_arena *persistent);
/* After each frame: its pose as published, and how often the unit has changed in its map. A frame
 * that was noted and is then lost without another one (same stamp) has no pose any more. */
void fv_relative_note(const struct fv_relative *relative, const struct fovea_pose *pose,
                      uint32_t changes, int64_t stamp_ns);
/* The motion since `frames` frames before the last one. False: that frame is not held, one of both
 * has no pose, or their poses do not relate. */
bool fv_relative_get(const struct fv_relative *relative, uint32_t frames,
                     struct fovea_relative_pose *out);

#endif

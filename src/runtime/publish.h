/* What goes out about a frame's pose: of the camera in `world` and of the robot's body (`base` in
 * messages) in `odom`, with velocity, covariance and the transform to the map, in metres as soon as
 * the scale is known. Odometry gives the pose in a unit of its own and does not know of this.
 *
 * The published position moves by `scale` times what odometry's moves, so that a better estimate of
 * the scale bends the path but does not tear it. Only when the scale becomes known the unit
 * changes, and all that was published before is to be multiplied (the message shows it by its
 * scale_source). State holds no addresses. Real-time safe: no heap, all bounded. */
#ifndef FOVEA_RUNTIME_PUBLISH_H
#define FOVEA_RUNTIME_PUBLISH_H

#include "base/arena.h"
#include "fovea/odometry.h"
#include "geometry/se3.h"
#include "geometry/sim3.h"
#include "odometry/odometry.h"
#include "scale/scale.h"

struct fv_publish_state {
    struct fovea_pose pose; /* of the last frame */
    /* Camera position as odometry has it and as published, when the frame was last posed. */
    double inner[3], outer[3];
    int64_t stamp_ns; /* of the last frame */
    uint32_t metric;  /* inner and outer are in metres */
    uint32_t reserved;
};

/* Of the robot's body: metres per second in odom, rad/s in the body's frame. 0 where the last two
 * frames are not both posed, in one world and unit. */
struct fv_rates {
    double velocity[3], rotation_rate[3];
};

struct fv_publish {
    struct fv_se3 T_body_cam;
    struct fv_publish_state *state;
    struct fv_rates rates; /* of the last frame: follows from the state before and after */
};

/* Take memory and the configured transform. Init-only. */
void fv_publish_carve(struct fv_publish *publish, const double T_body_cam[12],
                      struct fv_arena *persistent);

/* After each frame, and when the pose was lost without one; stamp_ns is the last frame's. */
void fv_publish_step(struct fv_publish *publish, const struct fv_odometry *odometry,
                     const struct fv_scale *scale, int64_t stamp_ns);

const struct fovea_pose *fv_publish_pose(const struct fv_publish *publish);
struct fv_se3 fv_publish_body_pose(const struct fv_publish *publish); /* T_odom_body */
const struct fv_rates *fv_publish_body_rates(const struct fv_publish *publish);
/* Covariance of the body's pose, as that of struct fovea_pose, in the body's frame. */
void fv_publish_body_covariance(const struct fv_publish *publish, double covariance[21]);
/* S_map_odom in the published unit: between the camera's frames at the start, or the body's. */
void fv_publish_map(const struct fv_publish *publish, bool of_body, struct fv_sim3 *S_map_odom);

#endif

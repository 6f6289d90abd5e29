/* What goes out about a frame's pose: of the robot's body and of the camera, both in `odom`, with
 * velocity, covariance and the transforms to keyframe and map, in metres as soon as the scale is
 * known. Odometry gives the pose in a unit of its own and does not know of this.
 *
 * Frames: `world` is the camera's frame at the start of the map, `odom` the body's at the same
 * instant, p_odom = T_body_cam p_world, until gravity is known, by an inertial sensor or by the map
 * that was entered: from then on it is turned so that gravity points along -z, p_odom = upright
 * T_body_cam p_world. The C interface gives the camera in `world` (struct fovea_pose), messages
 * give both in `odom`.
 *
 * The published position moves by `scale` times what odometry's moves, so that a better estimate of
 * the scale bends the path but does not tear it. Only when the scale or gravity becomes known
 * `odom` changes; struct fv_publish_change says how. Better estimates of gravity leave it. Another
 * map goes on in the same `odom` where odometry has counted no reset. State holds no addresses.
 * Real-time safe: no heap, all bounded. */
#ifndef FOVEA_RUNTIME_PUBLISH_H
#define FOVEA_RUNTIME_PUBLISH_H

#include "base/arena.h"
#include "fovea/odometry.h"
#include "geometry/se3.h"
#include "geometry/sim3.h"
#include "odometry/odometry.h"
#include "scale/inertial.h"
#include "scale/scale.h"

struct fv_publish_state {
    struct fovea_pose pose; /* of the last frame */
    struct fovea_pose seen; /* of the last one posed by its picture, in metres; else not posed */
    /* Camera position as odometry has it and as published, when the frame was last posed. */
    double inner[3], outer[3];
    int64_t stamp_ns;      /* of the last frame */
    uint32_t metric;       /* inner and outer are in metres */
    uint32_t is_upright;   /* by `upright`, as gravity has it */
    uint32_t sent;         /* a pose of this map went out */
    uint32_t changes;      /* of odom, since it began */
    struct fv_sim3 change; /* the last */
    double upright[9];
};

/* The child whose pose in `odom` is meant. */
enum fv_publish_child { FV_PUBLISH_BODY = 0, FV_PUBLISH_CAMERA, FV_PUBLISH_CHILDREN };

/* Of a child: unit of length per second in odom, rad/s in the child's frame. By the inertial sensor
 * where it is claimed, which also gives sigmas; else not known, and 0, unless the last two frames
 * are both posed, in one map and unit. */
struct fv_rates {
    bool known;
    double velocity[3], rotation_rate[3];
    double velocity_sigma, rotation_rate_sigma; /* of each axis; 0: not known */
};

/* The last change of the unit and axes: takes points of `odom` as it was to `odom` as it is. */
struct fv_publish_change {
    uint32_t count; /* since odom began; 0: none, and S_new_old is the identity */
    struct fv_sim3 S_new_old;
};

struct fv_publish {
    struct fv_se3 T_body_cam;
    struct fv_publish_state *state;
    /* of the last frame: follow from the state before and after */
    struct fv_rates rates[FV_PUBLISH_CHILDREN];
};

/* Take memory and the configured transform. Init-only. */
void fv_publish_carve(struct fv_publish *publish, const double T_body_cam[12],
                      struct fv_arena *persistent);

/* After each frame, and when the pose was lost without one; stamp_ns is the last frame's.
 * `inertial`: what an inertial sensor claims; NULL: nothing. */
void fv_publish_step(struct fv_publish *publish, const struct fv_odometry *odometry,
                     const struct fv_scale *scale, const struct fv_inertial_known *inertial,
                     int64_t stamp_ns);

const struct fovea_pose *fv_publish_pose(const struct fv_publish *publish);
struct fv_se3 fv_publish_child_pose(const struct fv_publish *publish,
                                    enum fv_publish_child child); /* T_odom_child */
/* out = v of `world`'s axes in those of odom. */
void fv_publish_turn(const struct fv_publish *publish, const double v[3], double out[3]);
const struct fv_rates *fv_publish_rates(const struct fv_publish *publish,
                                        enum fv_publish_child child);
/* Covariance as that of struct fovea_pose, in the child's frame. */
void fv_publish_covariance(const struct fv_publish *publish, enum fv_publish_child child,
                           double covariance[21]);
/* T_keyframe_child in the published unit: from the child now to the child at the keyframe. */
struct fv_se3 fv_publish_keyframe_pose(const struct fv_publish *publish,
                                       enum fv_publish_child child);
struct fv_publish_change fv_publish_last_change(const struct fv_publish *publish);
/* S_map_odom in the published unit. */
struct fv_sim3 fv_publish_map(const struct fv_publish *publish);
/* S_map_own: from the own frame and unit of the current map to `map`. */
struct fv_sim3 fv_publish_own_map(const struct fv_publish *publish);

#endif

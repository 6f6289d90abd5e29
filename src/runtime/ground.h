/* The floor under the robot in the loop (geometry/ground.h): begun from T_body_cam, carried on with
 * each pose in metres, measured by landmarks that the mask calls floor and by gravity. The grid of
 * free space takes it with each mask.
 *
 * Landmarks are looked at with a mask, once they are half a metre of way later than those before:
 * they are projected into the mask, and a plane is fitted to those that lie on a floor's pixel
 * (scale/floor.c). Their plane measures tilt and height; where the unit of length was made from the
 * camera's height (scale.source: camera_height) tilt alone. While the map's lengths are not metres
 * nothing is known of the floor. */
#ifndef FOVEA_RUNTIME_GROUND_H
#define FOVEA_RUNTIME_GROUND_H

#include "fovea/fovea.h"
#include "geometry/ground.h"
#include "runtime/free_space.h"
#include "runtime/publish.h"
#include "scale/inertial.h"
#include "scale/scale.h"

/* Landmarks being looked at: points are gathered, in pieces, then the first fit, then the second.
 */
enum fv_ground_phase {
    FV_GROUND_IDLE = 0,
    FV_GROUND_GATHERING,
    FV_GROUND_GATHERED,
    FV_GROUND_SHARPENED
};

/* No addresses and no padding: copied and hashed as bytes. */
struct fv_ground_stage_state {
    struct fv_ground ground;
    struct fv_random random;
    struct fv_free_space_world world; /* that the floor is in */
    double looked_m;                  /* of the way, when a plane was last looked for */
    int64_t seen_ns;                  /* mask that landmarks were last looked at with */
    struct fv_se3 T_odom_cam;         /* that they are seen from, metres */
    double metres, height_sigma;      /* of their unit, and relative */
    double down[3];                   /* where the floor is expected from there */
    struct fv_floor_gather gather;
    uint32_t phase, reserved; /* enum fv_ground_phase; zero */
    uint32_t looked, begun;   /* a plane was looked for in this world; the mount is known */
};

struct fv_ground_stage {
    bool enabled;
    struct fovea_grid_job_config config;
    struct fv_ground_stage_state *state;
    struct fv_floor_point *points; /* of the landmarks being looked at */
};

/* Nothing where there is no grid. Init-only. */
void fv_ground_stage_carve(struct fv_ground_stage *stage,
                           const struct fovea_grid_job_config *config, struct fv_arena *persistent,
                           struct fv_arena *job);

/* All that follows is real-time safe, and does nothing where it is off. */

/* What was learnt of the mount is forgotten. */
void fv_ground_stage_reset(struct fv_ground_stage *stage);
/* After a pose is published. `inertial`: what an inertial sensor claims; NULL: nothing. */
void fv_ground_stage_follow(struct fv_ground_stage *stage, const struct fv_publish *publish,
                            const struct fv_inertial_known *inertial);
/* One unit that looks at the landmarks, where they are due; false: they are not, nothing is done.
 * `view`: a mask and where it was seen from; its floor is not read. */
bool fv_ground_stage_look(struct fv_ground_stage *stage, const struct fovea_grid_view *view,
                          const struct fv_odometry *odometry, const struct fv_scale *scale,
                          const struct fv_publish *publish);

/* The floor with its height over a position of odom; false: not known. */
bool fv_ground_stage_at(const struct fv_ground_stage *stage, const double position[2],
                        struct fv_ground_plane *plane);
/* Fill what is of the mount, and the counts. */
void fv_ground_stage_mount(const struct fv_ground_stage *stage, struct fovea_ground *ground);

#endif

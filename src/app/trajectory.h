/* The path of a run as a TUM trajectory file: "stamp_s x y z qx qy qz qw", T_world_cam of every posed frame as it was
 * published at that frame. The loop's thread puts poses into a ring; the watching thread writes them. */
#ifndef FOVEA_APP_TRAJECTORY_H
#define FOVEA_APP_TRAJECTORY_H

#include "fovea/odometry.h"
#include "fovea/status.h"

struct fv_trajectory;

/* Create the file. FOVEA_ERROR_INPUT: it cannot be written. */
enum fovea_status fv_trajectory_open(const char *path, struct fv_trajectory **trajectory, struct fovea_error *error);

/* Loop's thread: wait-free, no heap. A frame without a pose is passed over. NULL trajectory: nothing happens. */
void fv_trajectory_add(struct fv_trajectory *trajectory, int64_t stamp_ns, const struct fovea_pose *pose);

/* Watching thread: write what has come. */
void fv_trajectory_drain(struct fv_trajectory *trajectory);

/* Write the rest and close. FOVEA_ERROR_SYSTEM: something was not written (disk full, or the ring overran). */
enum fovea_status fv_trajectory_close(struct fv_trajectory *trajectory, struct fovea_error *error);

#endif

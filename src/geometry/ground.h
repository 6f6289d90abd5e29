/* The floor under a robot as a plane with a covariance, kept up while the robot drives.
 *
 * Two things are estimated together, each a slope along two axes (dz/dx, dz/dy) and a height, by
 * a Kalman filter of these six numbers:
 *
 * - the *floor* in `odom`, z = height + slope . (p - position), with the body's origin over
 *   `position`;
 * - the *mount*: the same plane in the axes of the body (x forward, y left) as the robot stands
 *   on average. It would be 0 if T_body_cam were exact, and stays with the robot: another `odom`,
 *   another map or a loss of the pose leaves it known.
 *
 * What each measurement observes:
 *
 * - Calibration: the mount, once, 0 with the sigmas of its prior.
 * - Standing (fv_ground_drive): the robot stands on the floor, so floor = body's pose and mount,
 *   but for what it nods. Each 0.25 m, since it nods the same way for as long. This follows a ramp
 *   where no landmark shows it, and carries what landmarks say to the mount. Since the floor stays
 *   where it is, the way shows its slope along the way, and a turn the tilt of the mount.
 * - Landmarks (fv_ground_see): a plane that was fitted in the camera's frame (geometry/floor.h)
 *   is the floor in `odom`, tilt and height, with the fit's covariance and, beside it, what floors
 *   are not flat by; what all fits share (a map that is bent) bounds both sigmas from below, at
 *   0.005 (0.3 degrees) and 6 mm. Beyond 99.9 % of what is expected it is another plane (a table,
 *   a wall) and is refused.
 * - Gravity (fv_ground_level), where it is known in `odom`: floors are level but for a slope of
 *   0.03 (1.7 degrees) that is another one each 2 m. It bounds the tilt of the floor, and through
 *   it that of the mount; it says nothing of the height, and a ramp is no contradiction.
 *
 * Process noise is in proportion to the way, so what stands still stays known. Angles of the floor
 * and of the body are taken to be small (tangents for angles): upright within 0.5 rad.
 *
 * No addresses and no padding. Real-time safe: constant time, no heap; the same bits on every
 * machine. */
#ifndef FOVEA_GEOMETRY_GROUND_H
#define FOVEA_GEOMETRY_GROUND_H

#include <stdbool.h>
#include <stdint.h>

#include "geometry/floor.h"
#include "geometry/se3.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { FV_GROUND_FLOOR = 3, FV_GROUND_SIZE = 6 };

struct fv_ground {
    /* floor: slope x, slope y, height (m); mount: the same in the body's axes */
    double x[FV_GROUND_SIZE];
    double P[FV_GROUND_SIZE * FV_GROUND_SIZE];
    double position[2];         /* that the floor's height is of, in odom */
    double driven_m;            /* so far */
    double stood_m, levelled_m; /* of which at the last measurement of its kind */
    uint32_t placed;            /* the floor is known in this odom */
    uint32_t levelled;          /* gravity was taken in this odom */
    uint32_t taken, refused;    /* planes of landmarks */
};

/* A plane of `odom`: z = height_m + slope . (p - position). */
struct fv_ground_plane {
    double slope[2], height_m;
    double covariance[6]; /* of slope x, slope y, height: upper triangle by rows */
};

/* One standard deviation of what T_body_cam leaves open: of each axis's tilt, and of the height. */
void fv_ground_init(struct fv_ground *ground, double tilt_sigma_rad, double height_sigma_m);

/* `odom` is another one, or has other axes: the floor is where the mount says it is. */
void fv_ground_place(struct fv_ground *ground);

/* After each pose in metres; the first after fv_ground_place places the floor. */
void fv_ground_drive(struct fv_ground *ground, const struct fv_se3 *T_odom_body);

/* A plane from landmarks, of which the camera saw them from T_odom_cam. `height_sigma`: what its
 * lengths are uncertain by, relative, beside the fit (the scale); infinite: its height says
 * nothing, since the unit of length was made from it. False: refused. */
bool fv_ground_see(struct fv_ground *ground, const struct fv_se3 *T_odom_cam,
                   const struct fv_floor *floor, double height_sigma);

/* The slopes of a level plane by gravity, with the standard deviation of each. Used each 2 m. */
void fv_ground_level(struct fv_ground *ground, const double slope[2], double sigma_rad);

/* The floor with its height over another position; false: it is not placed. */
bool fv_ground_at(const struct fv_ground *ground, const double position[2],
                  struct fv_ground_plane *plane);

/* Where the floor is expected in the camera's frame, for the next fit: a unit vector down. */
void fv_ground_down(const struct fv_ground *ground, const struct fv_se3 *T_odom_cam,
                    double down[3]);

#ifdef __cplusplus
}
#endif
#endif

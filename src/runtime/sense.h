/* The pose at the rate of the inertial sensor: the last published pose, carried on by its samples
 * until the next frame. For controllers; nothing depends on it, so it is not hashed, and runs with
 * and without it are equal.
 *
 * A frame is processed after its instant, so its samples have been seen by then: those of the last
 * while are kept, and applied again from the new pose on. Between two samples the sensor's motion
 * is that of their mean; the force counts in the attitude half-way (inertial/preintegration.h has
 * the equations; its sums carry a covariance, too dear for all samples kept in one step). It ends
 * when samples lack for 60 ms, or 2 s after the last pose.
 *
 * No addresses. Real-time safe: a sample costs about a hundred multiplications, a new pose that
 * times the samples kept. */
#ifndef FOVEA_RUNTIME_SENSE_H
#define FOVEA_RUNTIME_SENSE_H

#include "base/arena.h"
#include "fovea/rig.h"
#include "fovea/sensor.h"
#include "geometry/se3.h"
#include "inertial/preintegration.h"
#include "inertial/reading.h"

enum { FV_SENSE_KEPT = 256 };

/* What a frame ends with, in odom and metres. */
struct fv_sense_anchor {
    int64_t stamp_ns;
    struct fv_se3 T_odom_body;
    double velocity[3];     /* of the body's origin */
    double angular_rate[3]; /* in the body's axes */
    double gravity[3];      /* m/s^2 */
    struct fv_imu_biases biases;
};

struct fv_sense {
    struct fv_sense_anchor anchor;
    struct fv_se3 T_odom_imu; /* at reached_ns */
    double velocity[3];       /* of the sensor */
    int64_t reached_ns;
    struct fv_imu_reading kept[FV_SENSE_KEPT]; /* the last ones, a ring */
    uint32_t first, count;
    bool begun;
};

struct fv_sense_pose {
    int64_t stamp_ns, since_ns;
    struct fv_se3 T_odom_body;
    double velocity[3], angular_rate[3];
};

/* After a frame; NULL: it has no pose to go on from. */
void fv_sense_begin(struct fv_sense *sense, const struct fovea_rig_imu *rig,
                    const struct fv_sense_anchor *anchor);

/* The next sample as it came. False: it is not taken (not finite, not after the last), or there is
 * no pose. */
bool fv_sense_take(struct fv_sense *sense, const struct fovea_rig_imu *rig,
                   const struct fovea_imu_sample *sample, struct fv_sense_pose *pose);

#endif

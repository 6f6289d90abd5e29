/* The pose at the rate of the inertial sensor: the last published pose, carried on by its samples
 * until the next frame. For controllers; nothing depends on it, so it is not hashed, and runs with
 * and without it are equal.
 *
 * A frame is processed after its instant, so its samples have been seen by then: those of the last
 * while are kept, and applied again from the new pose on. Between two samples the sensor's motion
 * is that of their mean; the force counts in the attitude half-way (inertial/preintegration.h has
 * the equations; its sums carry a covariance, too dear for all samples kept at once). It ends
 * when samples lack for 60 ms, or 2 s after the last pose. A sample more than 2 s before the last
 * one is of a clock that was set back, and what was kept is dropped.
 *
 * Two threads: the loop's offers poses, and that of the samples takes the newest one with the next
 * sample. Neither waits: there are three places, of which one lies between them. The loop's writes
 * its own and exchanges it for the one between; the other exchanges likewise when that is newer.
 *
 * No addresses. Real-time safe: an offer is a copy, a sample costs about a hundred multiplications,
 * the first one after an offer that times the samples kept since the pose. */
#ifndef FOVEA_RUNTIME_SENSE_H
#define FOVEA_RUNTIME_SENSE_H

#ifdef __cplusplus
#error "poses are handed over by C11 atomics: C only"
#endif

#include <stdatomic.h>

#include "base/arena.h"
#include "fovea/rig.h"
#include "fovea/sensor.h"
#include "geometry/se3.h"
#include "inertial/preintegration.h"
#include "inertial/reading.h"
#include "runtime/frame_id.h"

enum { FV_SENSE_KEPT = 256, FV_SENSE_NEWER = 4 };

/* What a frame ends with, in odom and metres. */
struct fv_sense_anchor {
    bool posed; /* false: no pose that samples can carry on; the rest is undefined */
    struct fv_frame_id frame;
    uint32_t reset_counter, map_id, change_count;
    struct fv_se3 T_odom_body;
    double velocity[3];     /* of the body's origin */
    double angular_rate[3]; /* in the body's axes */
    double gravity[3];      /* m/s^2 */
    struct fv_imu_biases biases;
    int64_t moved_ns; /* added to samples' stamps besides what the rig states */
};

struct fv_sense {
    /* Between the threads: a place of `offers`, and FV_SENSE_NEWER where the loop's put it there.
     */
    struct fv_sense_anchor offers[3];
    atomic_uint between;
    uint32_t loops; /* the loop's place */
    /* The rest is of the samples' thread. */
    uint32_t own; /* its place */
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

/* Zeroed memory. */
void fv_sense_init(struct fv_sense *sense);

/* After a frame. Loop thread. */
void fv_sense_offer(struct fv_sense *sense, const struct fv_sense_anchor *anchor);

/* The next sample as it came. False: it is not taken (not finite, not after the last one), or there
 * is no pose. Thread of the samples. */
bool fv_sense_take(struct fv_sense *sense, const struct fovea_rig_imu *rig,
                   const struct fovea_imu_sample *sample, struct fv_sense_pose *pose);

#endif

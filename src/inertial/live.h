/* From frame to frame: where the sensor is by its samples since the last frame with a pose, and how
 * fast it moves.
 *
 * The velocity is filtered (Kalman, one variance for all axes): it follows the samples, each pose
 * measures it anew by the way since the one before, and each estimate of the stations
 * (estimator.h) takes its place. Lengths in metres, in the axes of `world`. State holds no
 * addresses. Real-time safe, any thread; constant time per call. */
#ifndef FOVEA_INERTIAL_LIVE_H
#define FOVEA_INERTIAL_LIVE_H

#include <stdbool.h>
#include <stdint.h>

#include "geometry/se3.h"
#include "inertial/preintegration.h"
#include "inertial/reading.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { FV_INERTIAL_AHEAD_MAX = 128 }; /* samples that are later than the last frame */

struct fv_inertial_live {
    /* samples that wait for a frame as late as they are, a ring, oldest first */
    uint64_t ahead_first, ahead_count;
    struct fv_imu_reading ahead[FV_INERTIAL_AHEAD_MAX];
    bool any_sample, begun, broken; /* broken: samples lack since the last pose */
    int64_t sample_ns;              /* the last sample */
    double gyro[3], acceleration[3];
    int64_t pose_ns, reached_ns;  /* the last pose; as far as `sum` reaches */
    struct fv_preintegration sum; /* since the last pose */
    struct fv_se3 T_world_imu;    /* the last pose, metres */
    bool moving;                  /* the velocity is known */
    double velocity[3], variance; /* at the last pose */
};

/* A sample. It waits until a frame is as late; of too many that wait the oldest is used at once. */
void fv_inertial_live_take(struct fv_inertial_live *live, const struct fv_imu_noise *noise,
                           const struct fv_imu_reading *sample);

/* Use the samples up to an instant, that of a frame. */
void fv_inertial_live_advance(struct fv_inertial_live *live, const struct fv_imu_noise *noise,
                              int64_t stamp_ns);

/* What the samples say of the time from the last pose to an instant; the last sample holds until
 * then. False: no pose, samples lack, or later ones were used. */
bool fv_inertial_live_reach(const struct fv_inertial_live *live, const struct fv_imu_noise *noise,
                            int64_t stamp_ns, struct fv_preintegration *sum);

/* Pose (and velocity) that `sum` leads to; gravity in m/s^2. */
void fv_inertial_live_predict(const struct fv_inertial_live *live,
                              const struct fv_preintegration *sum, const double gravity[3],
                              struct fv_se3 *T_world_imu, double velocity[3]);

/* A pose at an instant, with the sigma of its position in metres. `sum`: what leads to it from the
 * one before, NULL where nothing does; `gravity` NULL: lengths are not metres, and there is no
 * velocity. Samples from now on are rid of these biases. */
void fv_inertial_live_pose(struct fv_inertial_live *live, int64_t stamp_ns,
                           const struct fv_se3 *T_world_imu, double position_sigma,
                           const struct fv_preintegration *sum, const double gravity[3],
                           const struct fv_imu_biases *biases);

#ifdef __cplusplus
}
#endif
#endif

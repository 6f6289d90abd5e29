/* Samples of sensors beside the cameras: events of their own, each with its own stamp.
 *
 * Samples come in the order of their stamps. A stamp is nanoseconds on the clock of the frames;
 * those of an inertial sensor are off by fovea_rig_imu.time_offset_ns. */
#ifndef FOVEA_SENSOR_H
#define FOVEA_SENSOR_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* An inertial sensor, in its own frame (fovea_rig_imu.T_body_imu). */
struct fovea_imu_sample {
    int64_t stamp_ns;
    double gyro[3];         /* angular rate, rad/s */
    double acceleration[3]; /* specific force, m/s^2: at rest it points up, against gravity */
};

/* Where the robot is by its wheels or legs: T_wheel_odom_body, in the frame wheel_odom, where this
 * odometry began. It is not the frame odom of poses. */
struct fovea_wheel_odometry_sample {
    int64_t stamp_ns;
    double position_m[3];
    double orientation[4]; /* unit quaternion w x y z */
};

enum { FOVEA_INPUT_SAMPLES_MAX = 256 }; /* that one step takes */

enum fovea_sample_kind {
    FOVEA_SAMPLE_IMU = 0,
    FOVEA_SAMPLE_WHEEL_ODOMETRY = 1,
    FOVEA_SAMPLE_KIND_COUNT
};

struct fovea_sample {
    enum fovea_sample_kind kind; /* which member holds it */
    union {
        struct fovea_imu_sample imu;
        struct fovea_wheel_odometry_sample wheel_odometry;
    };
};

/* Any thread. */
static inline int64_t fovea_sample_stamp(const struct fovea_sample *sample)
{
    return sample->kind == FOVEA_SAMPLE_IMU ? sample->imu.stamp_ns
                                            : sample->wheel_odometry.stamp_ns;
}

#ifdef __cplusplus
}
#endif
#endif

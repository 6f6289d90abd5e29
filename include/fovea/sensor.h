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

/* Every kind of sample, a row each: its constant's end, and the name of its member, of its struct
 * (fovea_NAME_sample) and of its LCM type (fovea.NAME_t). The constant's end is also the last part
 * of the kind's channel in recordings. Recording, replay and `lcmlog:` follow from these rows.
 *
 * Such a struct holds stamp_ns and then doubles alone, as many and in the order of the fields that
 * follow the stamp in the LCM type. */
#define FOVEA_SAMPLE_KINDS(ROW)                                                                    \
    ROW(IMU, imu)                                                                                  \
    ROW(WHEEL_ODOMETRY, wheel_odometry)

/* An inertial sensor, in its own frame (fovea_rig_imu.T_body_imu). */
struct fovea_imu_sample {
    int64_t stamp_ns;
    double gyro[3];         /* angular rate, rad/s */
    double acceleration[3]; /* specific force, m/s^2: at rest it points up, against gravity */
};

/* Pose of the robot's body by its wheels or legs: T_wheel_odom_body, in the frame wheel_odom, which
 * is where this odometry began. It is not the frame odom of poses. */
struct fovea_wheel_odometry_sample {
    int64_t stamp_ns;
    double position_m[3];
    double orientation[4]; /* unit quaternion w x y z */
};

enum { FOVEA_INPUT_SAMPLES_MAX = 256 }; /* that one step takes */

enum fovea_sample_kind {
#define FOVEA_SAMPLE_CONSTANT(KIND, name) FOVEA_SAMPLE_##KIND,
    FOVEA_SAMPLE_KINDS(FOVEA_SAMPLE_CONSTANT)
#undef FOVEA_SAMPLE_CONSTANT
        FOVEA_SAMPLE_KIND_COUNT
};

enum { FOVEA_SAMPLE_VALUES_MAX = 7 }; /* doubles of the longest kind */

/* What all kinds have in common. */
struct fovea_any_sample {
    int64_t stamp_ns;
    double values[FOVEA_SAMPLE_VALUES_MAX];
};

struct fovea_sample {
    enum fovea_sample_kind kind; /* which member holds it */
    union {
        struct fovea_any_sample any;
#define FOVEA_SAMPLE_MEMBER(KIND, name) struct fovea_##name##_sample name;
        FOVEA_SAMPLE_KINDS(FOVEA_SAMPLE_MEMBER)
#undef FOVEA_SAMPLE_MEMBER
    };
};

/* Any thread. */
static inline int64_t fovea_sample_stamp(const struct fovea_sample *sample)
{
    return sample->any.stamp_ns;
}

/* Doubles of a kind. Any thread. */
static inline uint32_t fovea_sample_value_count(enum fovea_sample_kind kind)
{
#define FOVEA_SAMPLE_COUNT(KIND, name)                                                             \
    (sizeof(struct fovea_##name##_sample) - sizeof(int64_t)) / sizeof(double),
    static const uint32_t counts[] = {FOVEA_SAMPLE_KINDS(FOVEA_SAMPLE_COUNT)};
#undef FOVEA_SAMPLE_COUNT
    return counts[kind];
}

/* The last part of a kind's channel in recordings, "WHEEL_ODOMETRY". Any thread. */
static inline const char *fovea_sample_channel(enum fovea_sample_kind kind)
{
#define FOVEA_SAMPLE_CHANNEL(KIND, name) #KIND,
    static const char *const channels[] = {FOVEA_SAMPLE_KINDS(FOVEA_SAMPLE_CHANNEL)};
#undef FOVEA_SAMPLE_CHANNEL
    return channels[kind];
}

#ifdef __cplusplus
}
#endif
#endif

/* Samples of sensors beside the cameras: events of their own, each with its own stamp.
 *
 * Samples come in the order of their stamps. A stamp is nanoseconds on the clock of the frames;
 * those of an inertial sensor are off by fovea_rig_imu.time_offset_ns. */
#ifndef FOVEA_SENSOR_H
#define FOVEA_SENSOR_H

#include <stdbool.h>
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
    ROW(WHEEL_ODOMETRY, wheel_odometry)                                                            \
    ROW(VELOCITY, velocity)

/* An inertial sensor, in its own frame (fovea_rig_imu.T_body_imu). A step judges each of its
 * samples (fovea_imu_status); those that are late, lost or not plausible stop nothing. */
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

/* A motion that a driven source was asked for and took (fovea_source_ops.drive): an input of the
 * run, for the record. In the body frame; the stamp is of the frame that it followed. */
struct fovea_velocity_sample {
    int64_t stamp_ns;
    double velocity_m_s[3];
    double angular_rate[3]; /* rad/s */
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

/* ---- what became of an inertial sensor's samples ------------------------------------------------
 */

/* By the last sample, or the lack of one. */
enum fovea_imu_state {
    FOVEA_IMU_NONE = 0, /* the rig has no inertial sensor */
    FOVEA_IMU_OK = 1,
    FOVEA_IMU_SILENT = 2,     /* none has come for long, or at all */
    FOVEA_IMU_NOT_FINITE = 3, /* or beyond 1,000 rad/s or 100,000 m/s^2 */
    FOVEA_IMU_SATURATED = 4,  /* an axis is at the end of its range */
    FOVEA_IMU_FROZEN = 5,     /* the same values for a tenth of a second, though it has noise */
    FOVEA_IMU_OFF_CLOCK = 6,  /* stamps that are not of the frames' clock */
    FOVEA_IMU_STATE_COUNT
};
/* "frozen"; "none" for FOVEA_IMU_NONE, "unknown" for what is no state. Any thread. */
const char *fovea_imu_state_name(enum fovea_imu_state state);

/* Samples since the start; a reset does not clear them. Each that came is one of the first seven.
 */
struct fovea_imu_counts {
    uint64_t taken;
    uint64_t repeated;   /* the last one again: refused, as are all below */
    uint64_t late;       /* stamp not after that of the last one */
    uint64_t not_finite; /* or absurdly large */
    uint64_t saturated;
    uint64_t frozen;
    uint64_t off_clock; /* more than 1 s from the frames', or a stamp that leaps ahead */
    uint64_t missing;   /* that should have come between two, by the rate */
    uint64_t gaps;      /* stretches without a sample that was taken */
    uint64_t jumps;     /* of the sensor's clock, that were followed */
};

struct fovea_imu_status {
    enum fovea_imu_state state;
    int64_t stamp_ns; /* of the last sample that was taken; of the sensor's clock */
    double rate_hz;   /* as observed; 0: not yet */
    struct fovea_imu_counts counts;
    /* How late the camera's stamps are against the sensor's beyond the rig's time_offset_ns, as
     * odometry finds it, one standard deviation of that (30 ms while nothing shows it; 0: odometry
     * does not use the sensor), and by how much samples are moved: 0 while the rig's offset fits.
     */
    double time_offset_s, time_offset_sigma_s, time_offset_used_s;
    /* By which rotation the sensor is off the rig's T_body_imu = (R, t), as odometry finds it: its
     * true attitude is R exp(mount_error); rad, axis times angle, in the sensor's axes. One
     * standard deviation per axis (0.1 while nothing shows it; 0: odometry does not use the
     * sensor); the angle, and one standard deviation of it. The sensor's place is used as stated
     * all the same.
     * `mount_wrong`: the angle was beyond 2 degrees and 5 sigmas for 1 s; it stays so. */
    double mount_error[3], mount_sigma[3], mount_angle, mount_angle_sigma;
    bool mount_wrong;
};

#ifdef __cplusplus
}
#endif
#endif

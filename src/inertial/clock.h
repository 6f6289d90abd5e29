/* How far the clocks of camera and inertial sensor are apart, beyond the offset that the rig
 * states, and by which rotation the sensor is off its stated place: found online from turns.
 *
 * While the sensor turns at a changing rate, the camera's attitudes follow those that the gyro
 * sums up only where the stamps of both are of one clock: an offset of dt shows as the rate times
 * dt. A Kalman filter on the error holds the sensor's attitude by its own samples, the gyro's bias
 * and the offset (7 numbers); each posed frame measures the attitude at the frame's stamp less the
 * offset so far. This is the temporal calibration of M. Li, A. Mourikis, "Online temporal
 * calibration for camera-IMU systems" (IJRR 2014), with attitudes alone: positions would need
 * metres and gravity. The camera's world may turn slowly against a fixed one (the map is
 * optimised), as a random walk. A frame whose innovation is too large is left out; after five in
 * succession the attitude begins anew, and bias and offset stay with larger sigmas. A turn at a
 * constant rate looks as another attitude does, and standing as nothing: the sigma stays large.
 *
 * A clock with a `mount_sigma` also estimates the mount error: the rotation R_stated_true between
 * the sensor's frame as the rig states it and the true one, three more states, in rad, in the
 * sensor's axes (R_cam_true = R_cam_stated R_stated_true; to first order the axes of both frames
 * are the same). A frame's attitude is that of the stated frame; the gyro turns the true one. With
 * errors e of the attitude and d of the mount, both on the right, a frame shows e - d, and a turn E
 * between two frames shows (E^T - I) d: nothing of d along the axis of E. So the sigma about an
 * axis stays large until the sensor turns about another one (hand-eye calibration: R. Tsai, R.
 * Lenz, 1989). A scale error of gyro or lens adds errors in proportion to the turn, and so does
 * the noise of this filter.
 *
 * A `mount_sigma` of 0 states that the mount is right; the offset then has the same bits as that of
 * a filter without the three states.
 *
 * Units: seconds, rad, rad/s; the sign is that of fovea_rig_imu.time_offset_ns: `offset_s` is to
 * be added to a sample's stamp besides. Attitudes are of the sensor's true frame in `world`,
 * errors on the right. Frames wait until the samples have reached them. State holds no addresses.
 * Real-time safe: fixed memory, some 4,000 multiplications a frame and 200 a sample; same bits on
 * every machine. */
#ifndef FOVEA_INERTIAL_CLOCK_H
#define FOVEA_INERTIAL_CLOCK_H

#include <stdbool.h>
#include <stdint.h>

#include "inertial/reading.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    FV_IMU_CLOCK_SAMPLES_MAX = 256, /* that wait for a frame; the oldest is used at once then */
    FV_IMU_CLOCK_FRAMES_MAX = 8,    /* that wait for samples; the oldest is left out then */
    FV_IMU_CLOCK_SIZE = 10          /* errors of the attitude and of the bias; offset; mount */
};

struct fv_imu_clock_sample {
    int64_t stamp_ns;
    double gyro[3];
};

/* Where the camera is turned to, as the sensor would be. */
struct fv_imu_clock_frame {
    int64_t stamp_ns;
    double R[9];          /* R_world_imu, by the stated mount */
    double covariance[9]; /* of a small turn on its right, in the sensor's frame, rad^2 */
};

struct fv_imu_clock {
    uint64_t begun;     /* the attitude is known */
    uint64_t frames;    /* that counted */
    uint64_t refused;   /* in succession */
    int64_t reached_ns; /* samples are summed up to here, on the stated clock */
    double attitude[9]; /* R_world_imu at the last frame */
    double bias[3], offset_s;
    double mount_sigma; /* at the beginning, rad, per axis; 0: the mount is right */
    double mount[9];    /* R_stated_true */
    double P[FV_IMU_CLOCK_SIZE * FV_IMU_CLOCK_SIZE];
    /* since the last frame */
    double time_s, turn[9], turn_bias[9]; /* the derivative of its error on the right */
    double rate[3];                       /* of the last piece, as measured */
    uint64_t first_sample, sample_count, first_frame, frame_count; /* rings, oldest first */
    struct fv_imu_clock_sample samples[FV_IMU_CLOCK_SAMPLES_MAX];
    struct fv_imu_clock_frame waiting[FV_IMU_CLOCK_FRAMES_MAX];
};

/* Squared densities of the gyro's noise, and of its bias's walk. */
struct fv_imu_clock_noise {
    double gyro, gyro_walk;
};

void fv_imu_clock_init(struct fv_imu_clock *clock, double mount_sigma);
/* The camera's world became another: its attitudes begin anew. */
void fv_imu_clock_restart(struct fv_imu_clock *clock);
/* The sensor's clock leapt: what is known of the offset is void, unlike the bias. */
void fv_imu_clock_jump(struct fv_imu_clock *clock);
/* A sample, corrected, on the frames' clock by the stated offset. */
void fv_imu_clock_take(struct fv_imu_clock *clock, const struct fv_imu_reading *reading);
/* A posed frame; then use all frames that the samples reach. */
void fv_imu_clock_frame(struct fv_imu_clock *clock, const struct fv_imu_clock_noise *noise,
                        const struct fv_imu_clock_frame *frame);
/* One standard deviation of offset_s. */
double fv_imu_clock_sigma(const struct fv_imu_clock *clock);

struct fv_imu_clock_mount {
    double error[3], sigma[3]; /* log(R_stated_true), rad, and one standard deviation per axis */
    double angle, angle_sigma; /* of `error`, and one standard deviation along it */
};
void fv_imu_clock_mount(const struct fv_imu_clock *clock, struct fv_imu_clock_mount *mount);

#ifdef __cplusplus
}
#endif
#endif

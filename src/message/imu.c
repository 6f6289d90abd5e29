/* What became of an inertial sensor's samples, and the pose at their rate, as LCM bytes. */
#include <assert.h>
#include <string.h>

#include "message/message.h"
#include "message/wire.h"

#include "fovea_fast_pose_t.h"
#include "fovea_imu_status_t.h"

static_assert((int)FOVEA_IMU_OK == (int)FOVEA_IMU_STATUS_T_STATE_OK &&
                  (int)FOVEA_IMU_SILENT == (int)FOVEA_IMU_STATUS_T_STATE_SILENT &&
                  (int)FOVEA_IMU_NOT_FINITE == (int)FOVEA_IMU_STATUS_T_STATE_NOT_FINITE &&
                  (int)FOVEA_IMU_SATURATED == (int)FOVEA_IMU_STATUS_T_STATE_SATURATED &&
                  (int)FOVEA_IMU_FROZEN == (int)FOVEA_IMU_STATUS_T_STATE_FROZEN &&
                  (int)FOVEA_IMU_OFF_CLOCK == (int)FOVEA_IMU_STATUS_T_STATE_OFF_CLOCK,
              "the states of imu_status_t");

size_t fv_message_imu_status_size_max(void)
{
    fovea_imu_status_t empty;
    memset(&empty, 0, sizeof empty);
    return (size_t)fovea_imu_status_t_encoded_size(&empty);
}

uint32_t fv_message_imu_status_encode(const struct fovea_imu_status *status, fovea_stamp_t stamp,
                                      int64_t now_ns, uint8_t *buffer, size_t capacity)
{
    const struct fovea_imu_counts *counts = &status->counts;
    fovea_imu_status_t message = {
        .stamp = stamp,
        .now_ns = now_ns,
        .state = (int8_t)status->state,
        .sample_stamp_ns = status->stamp_ns,
        .rate_hz = status->rate_hz,
        .taken = (int64_t)counts->taken,
        .repeated = (int64_t)counts->repeated,
        .late = (int64_t)counts->late,
        .not_finite = (int64_t)counts->not_finite,
        .saturated = (int64_t)counts->saturated,
        .frozen = (int64_t)counts->frozen,
        .off_clock = (int64_t)counts->off_clock,
        .missing = (int64_t)counts->missing,
        .gaps = (int64_t)counts->gaps,
        .jumps = (int64_t)counts->jumps,
        .time_offset_s = status->time_offset_s,
        .time_offset_sigma_s = status->time_offset_sigma_s,
        .time_offset_used_s = status->time_offset_used_s,
        .mount_angle = status->mount_angle,
        .mount_angle_sigma = status->mount_angle_sigma,
        .mount_wrong = status->mount_wrong,
    };
    memcpy(message.mount_error, status->mount_error, sizeof message.mount_error);
    memcpy(message.mount_sigma, status->mount_sigma, sizeof message.mount_sigma);
    return fv_wire_encoded(
        fovea_imu_status_t_encode(buffer, 0, fv_wire_capacity(capacity), &message));
}

size_t fv_message_fast_pose_size_max(void)
{
    fovea_fast_pose_t empty;
    memset(&empty, 0, sizeof empty);
    return (size_t)fovea_fast_pose_t_encoded_size(&empty);
}

uint32_t fv_message_fast_pose_encode(const struct fv_message_fast_pose *in, uint8_t *buffer,
                                     size_t capacity)
{
    fovea_fast_pose_t message = {
        .stamp = in->stamp,
        .since_ns = in->since_ns,
        .reset_counter = (int32_t)in->reset_counter,
        .map_id = (int32_t)in->map_id,
        .change_count = (int32_t)in->change_count,
    };
    memcpy(message.position, in->T_odom_body.position, sizeof message.position);
    memcpy(message.orientation, in->T_odom_body.orientation, sizeof message.orientation);
    memcpy(message.velocity, in->velocity, sizeof message.velocity);
    memcpy(message.angular_rate, in->angular_rate, sizeof message.angular_rate);
    return fv_wire_encoded(
        fovea_fast_pose_t_encode(buffer, 0, fv_wire_capacity(capacity), &message));
}

#include "app/network/heard_imu.h"

#include <string.h>

#include "fovea/source.h"

#include "fovea_imu_t.h"

bool fv_heard_imu_decode(const struct fv_received *received, struct fv_heard_imu *heard)
{
    fovea_imu_t message;
    if (fovea_imu_t_decode(received->data, 0, (int)received->bytes, &message) < 0) return false;
    *heard = (struct fv_heard_imu){.sample.stamp_ns = message.stamp.time_ns,
                                   .utc_offset_ns = message.stamp.utc_offset_ns,
                                   .clock = message.stamp.clock,
                                   .from_host = received->from_host};
    memcpy(heard->sample.gyro, message.gyro, sizeof heard->sample.gyro);
    memcpy(heard->sample.acceleration, message.acceleration, sizeof heard->sample.acceleration);
    return true;
}

bool fv_heard_imu_stamp(const struct fv_heard_imu *heard, int clock, int64_t utc_offset_ns,
                        int64_t *stamp_ns)
{
    const bool own =
        heard->clock == clock && (heard->from_host || heard->clock == FOVEA_CLOCK_REALTIME);
    *stamp_ns = heard->sample.stamp_ns;
    if (own) return true;
    if (heard->utc_offset_ns == 0 && heard->clock != FOVEA_CLOCK_REALTIME) return false;
    return !__builtin_add_overflow(*stamp_ns, heard->utc_offset_ns, stamp_ns) &&
           !__builtin_sub_overflow(*stamp_ns, utc_offset_ns, stamp_ns);
}

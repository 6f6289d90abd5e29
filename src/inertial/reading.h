/* A sample of an inertial sensor as it is used: on the frames' clock, and as the calibration of the
 * sensor corrects it. Real-time safe, any thread. */
#ifndef FOVEA_INERTIAL_READING_H
#define FOVEA_INERTIAL_READING_H

#include <stdbool.h>
#include <stdint.h>

#include "fovea/rig.h"
#include "fovea/sensor.h"

#ifdef __cplusplus
extern "C" {
#endif

struct fv_imu_reading {
    int64_t stamp_ns;
    double gyro[3], acceleration[3];
};

/* Whether all values are numbers that a sensor can give: at most 1,000 rad/s and 100,000 m/s^2. */
bool fv_imu_possible(const struct fovea_imu_sample *sample);

/* False: its stamp on the frames' clock cannot be stated. */
bool fv_imu_read(const struct fovea_rig_imu *rig, const struct fovea_imu_sample *sample,
                 struct fv_imu_reading *reading);

#ifdef __cplusplus
}
#endif
#endif

/* Samples of an inertial sensor from a file or a source. */
#ifndef FOVEA_CALIBRATE_IMU_SAMPLES_H
#define FOVEA_CALIBRATE_IMU_SAMPLES_H

#include <string>
#include <vector>

#include "fovea/sensor.h"
#include "fovea/status.h"

namespace calibrate
{

/* `source` is a file in EuRoC's layout (stamp_ns, angular rates, accelerations) or the URI of a
 * source that has an inertial sensor: a recording, `euroc:DIR?imu=1`. FOVEA_ERROR_INPUT: it has
 * none. */
fovea_status read_imu(const std::string &source, std::vector<fovea_imu_sample> &samples,
                      fovea_error *error);

} // namespace calibrate
#endif

/* The inertial sensor of EuRoC data sets in ASL layout: imu0/{sensor.yaml,data.csv}. */
#ifndef FOVEA_RECORDED_EUROC_IMU_H
#define FOVEA_RECORDED_EUROC_IMU_H

#include "fovea/rig.h"
#include "fovea/status.h"
#include "samples.h"

/* Place (T_BS), rate and noise densities; the time offset where `time_offset_ns` states it, scale
 * and misalignment where `gyro_correction` and `acceleration_correction` do. Init-only. */
enum fovea_status fv_euroc_imu_sensor(const char *path, struct fovea_rig_imu *imu,
                                      struct fovea_error *error);
/* The samples as they stand in the file, also those that repeat a stamp, are out of order or not
 * finite: the runtime judges them (inertial/gate.h). What is no sample is refused with its line.
 * Init-only. */
enum fovea_status fv_euroc_imu_samples(const char *path, struct fv_samples *samples,
                                       struct fovea_error *error);

#endif

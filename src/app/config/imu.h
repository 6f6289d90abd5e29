/* The inertial sensor that the key `imu` names, beside what the source has. */
#ifndef FOVEA_APP_CONFIG_IMU_H
#define FOVEA_APP_CONFIG_IMU_H

#include "app/config/settings.h"
#include "drivers/iio/iio.h"
#include "fovea/source.h"

/* What follows "lcm:" or "iio:" in the key; NULL: it begins otherwise. */
const char *fv_imu_lcm_channel(const struct fv_settings *settings);
const char *fv_imu_iio_name(const struct fv_settings *settings);

/* Put the sensor into the rig of the settings, whose cameras are there already, from imu_file; a
 * device of IIO is opened and tried, and states its ranges. Nothing where the key is empty.
 * FOVEA_ERROR_INPUT: `error` names the key, what was found and what was expected. Init-only. */
enum fovea_status fv_imu_join(struct fv_settings *settings, const struct fovea_source_info *info,
                              struct fv_iio **iio, struct fovea_error *error);

#endif

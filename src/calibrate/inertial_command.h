/* The part of `fovea-calibrate rig` that places an inertial sensor. */
#ifndef FOVEA_CALIBRATE_INERTIAL_COMMAND_H
#define FOVEA_CALIBRATE_INERTIAL_COMMAND_H

#include "calibrate/moving.h"
#include "calibrate/rig_report.h"

namespace calibrate
{

struct InertialGiven {
    std::string sensor, file, out, seconds, lcm_url, listen; /* as the options state them */
    bool wanted() const
    {
        return !sensor.empty();
    }
};

/* What can be said before anything is opened. FV_EXIT_OK, or a line is printed. */
int check_inertial(const InertialGiven &given, const std::vector<std::string> &sources);

/* Pictures and samples; the densities are those of the file, or of the source. `collections` gets
 * the pictures of which lenses are solved. FV_EXIT_OK, or a line is printed. */
int collect_inertial(const InertialGiven &given, const std::string &source, const Board &board,
                     int views_max, Moving &moving, std::vector<Collection> &collections,
                     Inertial &inertial);

/* Samples as the sensor's file corrects them (gyro_correction, acceleration_correction). Those at
 * the end of a range stay as they came, so that they still show as that. */
std::vector<fovea_imu_sample> corrected_samples(const std::vector<fovea_imu_sample> &samples,
                                                const fovea_rig_imu &imu);

/* Place the sensor before the cameras that the report has found, and judge it. */
void place_inertial(const Moving &moving, RigReport &report);

} // namespace calibrate
#endif

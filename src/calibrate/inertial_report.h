/* What `fovea-calibrate rig --imu` leaves of the inertial sensor: JSON, HTML, text, files. */
#ifndef FOVEA_CALIBRATE_INERTIAL_REPORT_H
#define FOVEA_CALIBRATE_INERTIAL_REPORT_H

#include "calibrate/inertial.h"

namespace calibrate
{

/* An inertial sensor that is placed, or was to be. */
struct Inertial {
    std::string sensor;     /* where its samples come from */
    fovea_rig_imu imu = {}; /* its densities and rate */
    bool solved = false;
    InertialSolution solution;
};

std::string inertial_json(const Inertial &inertial); /* one object */
std::string inertial_section(const Inertial &inertial);
void inertial_print(const Inertial &inertial); /* on stdout */

/* Six standard deviations of the place on the sensor of another camera, whose place before the
 * first one is known to `T_first_cam_stdev` (both as RigCamera::stdev). */
std::array<double, 6> place_stdev(const InertialSolution &solution, const Rigid &T_first_cam,
                                  const std::array<double, 6> &T_first_cam_stdev);

/* The sensor's file in EuRoC's layout, where the body is the first camera. */
std::string inertial_file(const Inertial &inertial, Grade grade, const std::string &date);

} // namespace calibrate
#endif

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

/* The sensor's file in EuRoC's layout, where the body is the first camera. */
std::string inertial_file(const Inertial &inertial, Grade grade, const std::string &date);

} // namespace calibrate
#endif

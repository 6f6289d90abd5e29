/* The Allan deviation of an inertial sensor as a picture. */
#ifndef FOVEA_CALIBRATE_ALLAN_PLOT_H
#define FOVEA_CALIBRATE_ALLAN_PLOT_H

#include "calibrate/allan.h"
#include "fovea/status.h"

namespace calibrate
{

/* A PNG: gyroscope left, accelerometer right; points by axis with the fit's line, both axes
 * logarithmic. */
fovea_status plot_allan(const ImuNoise &noise, const char *path, fovea_error *error);

} // namespace calibrate
#endif

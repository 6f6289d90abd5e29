/* Pictures of a board and the samples of an inertial sensor, while a hand moves both cameras and
 * sensor. */
#ifndef FOVEA_CALIBRATE_MOVING_H
#define FOVEA_CALIBRATE_MOVING_H

#include "calibrate/live_imu.h"
#include "calibrate/pictures.h"
#include "fovea/rig.h"

namespace calibrate
{

struct Moving {
    std::vector<Collection> cameras; /* all pictures: views of one index belong together */
    std::vector<fovea_imu_sample> samples;
    fovea_rig rig = {};       /* what the source states */
    double imu_range[2] = {}; /* as the sensor beside the source states them; 0: not known */
};

/* All frames of a recording, or of `seconds` of another source; SIGINT ends it before. `imu` is the
 * sensor beside the source, or none: the source's own. FOVEA_ERROR_INPUT: there is none, or the
 * source cannot be read. */
fovea_status collect_moving(const std::string &source, const LiveImuSetup &imu, const Board &board,
                            double seconds, Moving &moving, fovea_error *error);

/* Of these, the first ones whose boards are new, for the solve of lenses and of the cameras' places
 * to each other. */
std::vector<Collection> still_views(const Moving &moving, int views_max);

} // namespace calibrate
#endif

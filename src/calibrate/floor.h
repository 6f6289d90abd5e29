/* The camera over the floor, from a board that lies on it. */
#ifndef FOVEA_CALIBRATE_FLOOR_H
#define FOVEA_CALIBRATE_FLOOR_H

#include "calibrate/verdict.h"

namespace calibrate
{

struct FloorSolution {
    double height_m = 0; /* of the optical centre */
    /* How far the optical axis points below the horizon, and by how much the camera is turned about
     * it, to the right: 0, 0 is level. */
    double tilt_rad = 0, roll_rad = 0;
    /* Camera to a body on the floor right below: x where the camera looks (of one that looks
     * straight down: where the top of its image is), y left, z up. Row-major 3x4. */
    std::array<double, 12> T_body_cam = {};
    double height_stdev_m = 0;
    double tilt_stdev_rad = 0, roll_stdev_rad = 0;
    double lean_stdev_rad =
        0; /* about the body's x axis; roll is that over the cosine of the tilt */
    double rms_px = 0, noise_px = 0; /* all boards on one plane; as of Solution */
    double alone_rms_px = 0;         /* each board by itself */
    int views_used = 0, corners_used = 0;
    std::vector<std::string> left_out; /* per view: why, or empty */
};

/* `camera` is prepared, and stands still over the floor, or moves over a flat one. The board's
 * points are `thickness_m` above the floor. False, with a line: no view can be used. */
bool solve_floor(const Board &board, const std::vector<View> &views, const fovea_camera &camera,
                 double thickness_m, FloorSolution &solution, std::string &error);

Verdict judge_floor(const std::vector<View> &views, const FloorSolution &solution);

} // namespace calibrate
#endif

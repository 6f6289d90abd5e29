/* The camera on the body of a robot (or on its hand), from poses of the body and pictures of a
 * board that stands still.
 *
 * The start is the rotation first, then the translation (F. Park, B. Martin, Robot sensor
 * calibration: solving AX = XB on the Euclidean group, IEEE Transactions on Robotics and Automation
 * 10(5), 1994). The refinement weighs each view by what its corners know of the board's pose and by
 * the noise of the body's poses, which is estimated with it. */
#ifndef FOVEA_CALIBRATE_HAND_EYE_H
#define FOVEA_CALIBRATE_HAND_EYE_H

#include "calibrate/rigid.h"
#include "calibrate/verdict.h"

namespace calibrate
{

struct BodyPose {
    bool known = false;
    Rigid T_world_body;
};

struct HandEyeSolution {
    Rigid T_body_cam, T_world_board;
    /* Of T_body_cam: a small rotation about the body's axes (radians), the translation (metres). */
    std::array<double, 6> stdev = {};
    double pose_noise_rad = 0, pose_noise_m = 0; /* of the body's poses, per axis */
    double noise_px = 0;                         /* of one coordinate of the corners */
    double turn_rad = 0;                         /* largest rotation between two poses */
    double second_turn_rad = 0; /* rms of rotations about the second of their axes */
    double angle_off_rad = 0;   /* rms difference of the angles that body and camera turned */
    int views_used = 0;
    std::vector<std::string> left_out; /* per view: why, or empty */
};

/* `camera` is prepared; `poses` is as long as `views`. False, with a line: too few views, or
 * motions that do not determine the camera, by name. */
bool solve_hand_eye(const Board &board, const std::vector<View> &views,
                    const std::vector<BodyPose> &poses, const fovea_camera &camera,
                    HandEyeSolution &solution, std::string &error);

Verdict judge_hand_eye(const HandEyeSolution &solution);

} // namespace calibrate
#endif

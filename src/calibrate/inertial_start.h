/* Where a camera is on an inertial sensor, from the rotation of pictures posed one by one: the
 * start of the joint solve. */
#ifndef FOVEA_CALIBRATE_INERTIAL_START_H
#define FOVEA_CALIBRATE_INERTIAL_START_H

#include "calibrate/inertial.h"

namespace calibrate
{

constexpr double GRAVITY_M_S2 = 9.80665;

/* A picture with a board that takes part. */
struct PosedPicture {
    size_t camera, view;
    double time_s;       /* of its stamp, since the first picture */
    bool turned = false; /* its corners count from the board's other end */
    std::vector<char> used;
    Rigid T_board_first; /* of the first camera */
    double rms_px = 0;
};

struct InertialStart {
    int64_t begin_ns = 0; /* what times count from */
    std::vector<PosedPicture> pictures;
    Eigen::Matrix3d R_imu_cam; /* of the first camera */
    double shift_s = 0;
    Eigen::Vector3d gyro_bias = Eigen::Vector3d::Zero();
    Eigen::Vector3d gravity_m_s2; /* in the board's frame, down */
};

/* Corner `c` of a picture, counted from the board's other end where that is `turned`. */
Pixel inertial_corner(const InertialInput &input, const PosedPicture &picture, size_t c);

/* Fills left_out, fits, rate_ratio, and the counts of views with a board. False, with a line: see
 * solve_inertial. */
bool start_inertial(const InertialInput &input, InertialStart &start, InertialSolution &solution,
                    std::string &error);

} // namespace calibrate
#endif

/* Rigid motions between frames, and the pose of a board before a camera that is known. */
#ifndef FOVEA_CALIBRATE_RIGID_H
#define FOVEA_CALIBRATE_RIGID_H

#include <Eigen/Dense>

#include "calibrate/calibrate.h"

namespace calibrate
{

/* T_a_b: takes points of b to a. */
struct Rigid {
    Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
    Eigen::Vector3d t = Eigen::Vector3d::Zero();

    Rigid inverse() const;
    Rigid operator*(const Rigid &other) const;
    Eigen::Vector3d operator*(const Eigen::Vector3d &point) const;
    bool finite() const;
};

Rigid rigid_of(const Pose &pose);
Pose pose_of(const Rigid &motion);
std::array<double, 12> rows_of(const Rigid &motion); /* three rows of [R t] */

/* The axis of a rotation times its angle, of [0, pi]. */
Eigen::Vector3d angle_axis(const Eigen::Matrix3d &R);

/* How T_b_a moves with the six numbers of T_a_b = [R t]: a small turn about a's axes, and the place
 * of a in b. */
Eigen::Matrix<double, 6, 6> change_of_place(const Pose &T_a_b);

/* T_cam_board of a view by a camera that is prepared: the least squares over the corners that the
 * view has, with less weight on those far off. Its error is the RMS over all its corners. False:
 * fewer than six of its corners are seen where the camera has rays, or nothing fits. */
bool pose_view(const Board &board, const fovea_camera &camera, const View &view, Pose &pose,
               double &rms_px);

} // namespace calibrate
#endif

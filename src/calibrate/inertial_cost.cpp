#include "calibrate/inertial_cost.h"

#include <cmath>

#include "calibrate/corner_cost.h"
#include "calibrate/least_squares.h"

namespace calibrate
{
namespace
{

using Row6 = Eigen::Matrix<double, 2, 6>;
template <int COLUMNS>
using Rows = Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, COLUMNS, Eigen::RowMajor>>;

Eigen::Matrix<double, 6, 1> sum(const double *const *control,
                                const std::array<double, SPLINE_ORDER> &weights)
{
    Eigen::Matrix<double, 6, 1> all = Eigen::Matrix<double, 6, 1>::Zero();
    for (size_t j = 0; j < SPLINE_ORDER; j++)
        all += weights[j] * Eigen::Map<const Eigen::Matrix<double, 6, 1>>(control[j]);
    return all;
}

/* How the angular rate J(turn) turn_rate moves with `turn`. */
Eigen::Matrix3d rate_by_turn(const Motion &motion)
{
    using Jet = ceres::Jet<double, 3>;
    Eigen::Matrix<Jet, 3, 1> turn, rate;
    for (int i = 0; i < 3; i++) {
        turn[i] = Jet(motion.turn[i], i);
        rate[i] = Jet(motion.turn_rate[i]);
    }
    const Jet angle2 = turn.squaredNorm();
    Jet first(.5), second(1. / 6); /* of the vector, of its square */
    if (angle2.a > 1e-8) {
        const Jet angle = sqrt(angle2);
        first = (1. - cos(angle)) / angle2;
        second = (angle - sin(angle)) / (angle2 * angle);
    }
    const Eigen::Matrix<Jet, 3, 1> crossed = turn.cross(rate), twice = turn.cross(crossed);
    Eigen::Matrix3d by_turn;
    for (int i = 0; i < 3; i++) {
        const Jet component = rate[i] - first * crossed[i] + second * twice[i];
        by_turn.row(i) = component.v.transpose();
    }
    return by_turn;
}

} // namespace

Motion motion_of(const double *const *control, const SplineWeights &weights)
{
    const Eigen::Matrix<double, 6, 1> value = sum(control, weights.value),
                                      first = sum(control, weights.first),
                                      second = sum(control, weights.second);
    Motion motion;
    motion.turn = value.head<3>();
    motion.turn_rate = first.head<3>();
    motion.place = value.tail<3>();
    motion.speed = first.tail<3>();
    motion.acceleration = second.tail<3>();
    motion.J = left_jacobian(motion.turn).transpose();
    const double angle = motion.turn.norm();
    motion.R = angle < 1e-12
                   ? Eigen::Matrix3d(Eigen::Matrix3d::Identity() + cross_matrix(motion.turn))
                   : Eigen::AngleAxisd(angle, motion.turn / angle).toRotationMatrix();
    return motion;
}

/* ---- a picture ------------------------------------------------------------------------------- */

PictureCost::PictureCost(const Spline &spline, const Camera &camera, std::vector<Corner> corners,
                         double time_s, double middle_s, double shift_s, double sigma_px)
    : begin_s_(spline.begin_s), step_s_(spline.step_s), camera_(camera),
      corners_(std::move(corners)), time_s_(time_s), middle_s_(middle_s), weight_(1 / sigma_px)
{
    const int last = (int)spline.control.size() - CONTROLS;
    first_ = std::clamp(spline.segment(time_s + shift_s) - 1, 0, last);
    set_num_residuals(2 * (int)corners_.size());
    for (int j = 0; j < CONTROLS; j++)
        mutable_parameter_block_sizes()->push_back(6);
    mutable_parameter_block_sizes()->push_back(6);
    mutable_parameter_block_sizes()->push_back(2);
}

bool PictureCost::evaluate_corner(const double *const *blocks, const Corner &corner,
                                  double *residuals, double **jacobians, size_t row) const
{
    const double *pose = blocks[CONTROLS], *clock = blocks[CONTROLS + 1];
    const double since_s = time_s_ - middle_s_;
    const double time_s = time_s_ + (corner.found[1] / camera_.height - .5) * camera_.readout_s +
                          clock[0] + clock[1] * since_s;
    const double place = (time_s - begin_s_) / step_s_ - first_;
    const int at = (int)std::floor(place);
    if (!(place >= 0) || at + SPLINE_ORDER > CONTROLS) return false; /* a step that is too far */
    const SplineWeights weights = spline_weights(place - at, step_s_);
    const Motion motion = motion_of(blocks + at, weights);
    const Rigid T_cam_imu = rigid_of({pose[0], pose[1], pose[2], pose[3], pose[4], pose[5]});
    const Eigen::Vector3d in_imu = motion.R.transpose() * (corner.point - motion.place),
                          turned = T_cam_imu.R * in_imu, in_first = turned + T_cam_imu.t,
                          in_camera = camera_.T_cam_first * in_first;
    double *residual = residuals + 2 * row;
    ProjectionDerivatives derivatives;
    if (!project_derivatives(camera_.model, camera_.parameters.data(), in_camera.data(), residual,
                             derivatives))
        return false;
    for (size_t i = 0; i < 2; i++)
        residual[i] = weight_ * (residual[i] - corner.found[i]);
    if (jacobians == nullptr) return true;
    const Eigen::Matrix<double, 2, 3> by_first =
                                          weight_ * derivatives.by_point * camera_.T_cam_first.R,
                                      by_imu = by_first * T_cam_imu.R;
    Row6 by_motion; /* by the six numbers of the spline */
    by_motion.leftCols<3>() = by_imu * cross_matrix(in_imu) * motion.J;
    by_motion.rightCols<3>() = -by_imu * motion.R.transpose();
    const auto top = (Eigen::Index)(2 * row);
    for (int j = 0; j < CONTROLS; j++) {
        if (jacobians[j] == nullptr) continue;
        Rows<6> all(jacobians[j], num_residuals(), 6);
        const double weight =
            j >= at && j < at + SPLINE_ORDER ? weights.value[(size_t)(j - at)] : 0;
        all.middleRows<2>(top) = weight * by_motion;
    }
    if (jacobians[CONTROLS] != nullptr) {
        Row6 by_pose;
        by_pose.leftCols<3>() =
            -by_first * cross_matrix(turned) * left_jacobian({pose[0], pose[1], pose[2]});
        by_pose.rightCols<3>() = by_first;
        Rows<6>(jacobians[CONTROLS], num_residuals(), 6).middleRows<2>(top) = by_pose;
    }
    if (jacobians[CONTROLS + 1] != nullptr) {
        const Eigen::Vector3d rate = motion.J * motion.turn_rate,
                              moves = in_imu.cross(rate) - motion.R.transpose() * motion.speed;
        const Eigen::Vector2d by_time = by_imu * moves;
        Rows<2> all(jacobians[CONTROLS + 1], num_residuals(), 2);
        all.middleRows<2>(top).col(0) = by_time;
        all.middleRows<2>(top).col(1) = since_s * by_time;
    }
    return true;
}

bool PictureCost::Evaluate(const double *const *blocks, double *residuals, double **jacobians) const
{
    for (size_t c = 0; c < corners_.size(); c++)
        if (!evaluate_corner(blocks, corners_[c], residuals, jacobians, c)) return false;
    return true;
}

/* ---- samples --------------------------------------------------------------------------------- */

ReadingsCost::ReadingsCost(const Spline &spline, int segment, double bias_begin_s,
                           double bias_step_s, std::vector<Reading> readings)
    : step_s_(spline.step_s), bias_begin_s_(bias_begin_s), bias_step_s_(bias_step_s),
      segment_(segment), readings_(std::move(readings))
{
    for (const Reading &reading : readings_)
        weights_.push_back(spline_weights(spline.within(reading.time_s, segment), step_s_));
    set_num_residuals(6 * (int)readings_.size());
    for (int j = 0; j < SPLINE_ORDER + 2; j++)
        mutable_parameter_block_sizes()->push_back(6);
    mutable_parameter_block_sizes()->push_back(3);
}

bool ReadingsCost::Evaluate(const double *const *blocks, double *residuals,
                            double **jacobians) const
{
    enum { BEGIN = SPLINE_ORDER, END, GRAVITY };
    const Eigen::Map<const Eigen::Matrix<double, 6, 1>> begin(blocks[BEGIN]), end(blocks[END]);
    const Eigen::Map<const Eigen::Vector3d> gravity(blocks[GRAVITY]);
    for (size_t i = 0; i < readings_.size(); i++) {
        const Reading &reading = readings_[i];
        const SplineWeights &weights = weights_[i];
        const Motion motion = motion_of(blocks, weights);
        const double late = (reading.time_s - bias_begin_s_) / bias_step_s_;
        const Eigen::Matrix<double, 6, 1> bias = (1 - late) * begin + late * end;
        const Eigen::Vector3d rate = motion.J * motion.turn_rate,
                              force = motion.R.transpose() * (motion.acceleration - gravity);
        const double gyro = reading.weights[0], accelerometer = reading.weights[1];
        const auto top = (Eigen::Index)(6 * i);
        Eigen::Map<Eigen::Matrix<double, 6, 1>> residual(residuals + top);
        residual.head<3>() = gyro * (rate + bias.head<3>() - reading.gyro);
        residual.tail<3>() = accelerometer * (force + bias.tail<3>() - reading.acceleration);
        if (jacobians == nullptr) continue;
        const Eigen::Matrix3d by_turn = gyro * rate_by_turn(motion), by_turn_rate = gyro * motion.J,
                              force_by_turn = accelerometer * cross_matrix(force) * motion.J,
                              by_acceleration = accelerometer * motion.R.transpose();
        for (size_t j = 0; j < SPLINE_ORDER; j++) {
            if (jacobians[j] == nullptr) continue;
            Rows<6> all(jacobians[j], num_residuals(), 6);
            auto here = all.middleRows<6>(top);
            here.topLeftCorner<3, 3>() =
                weights.value[j] * by_turn + weights.first[j] * by_turn_rate;
            here.topRightCorner<3, 3>().setZero();
            here.bottomLeftCorner<3, 3>() = weights.value[j] * force_by_turn;
            here.bottomRightCorner<3, 3>() = weights.second[j] * by_acceleration;
        }
        for (int side = BEGIN; side <= END; side++) {
            if (jacobians[side] == nullptr) continue;
            Rows<6> all(jacobians[side], num_residuals(), 6);
            const double share = side == BEGIN ? 1 - late : late;
            Eigen::Matrix<double, 6, 1> diagonal;
            diagonal << share * gyro, share * gyro, share * gyro, share * accelerometer,
                share * accelerometer, share * accelerometer;
            all.middleRows<6>(top) = diagonal.asDiagonal().toDenseMatrix();
        }
        if (jacobians[GRAVITY] != nullptr) {
            Rows<3> all(jacobians[GRAVITY], num_residuals(), 3);
            all.middleRows<3>(top).setZero();
            all.middleRows<3>(top + 3) = -by_acceleration;
        }
    }
    return true;
}

} // namespace calibrate

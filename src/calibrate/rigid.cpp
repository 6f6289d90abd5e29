#include "calibrate/rigid.h"

#include "calibrate/compare.h"
#include "calibrate/least_squares.h"
#include "calibrate/projection.h"

#include <ceres/rotation.h>

#include <cmath>

namespace calibrate
{
namespace
{

/* The pose alone, the camera being known. */
struct Posed {
    Model model;
    const Parameters *camera;
    Point point;
    Pixel found;
    template <typename T> bool operator()(const T *pose, T *residual) const
    {
        const T on_board[3] = {T(point[0]), T(point[1]), T(point[2])};
        T seen[3], pixel[2], parameters[PARAMETERS_MAX];
        for (size_t i = 0; i < PARAMETERS_MAX; i++)
            parameters[i] = T((*camera)[i]);
        ceres::AngleAxisRotatePoint(pose, on_board, seen);
        for (int i = 0; i < 3; i++)
            seen[i] += pose[3 + i];
        if (!project(model, parameters, seen, pixel)) return false;
        residual[0] = pixel[0] - found[0];
        residual[1] = pixel[1] - found[1];
        return true;
    }
};

} // namespace

Rigid Rigid::inverse() const
{
    return {R.transpose(), -(R.transpose() * t)};
}

Rigid Rigid::operator*(const Rigid &other) const
{
    return {R * other.R, R * other.t + t};
}

Eigen::Vector3d Rigid::operator*(const Eigen::Vector3d &point) const
{
    return R * point + t;
}

bool Rigid::finite() const
{
    return R.allFinite() && t.allFinite();
}

Rigid rigid_of(const Pose &pose)
{
    Rigid motion;
    ceres::AngleAxisToRotationMatrix(pose.data(), motion.R.data()); /* column by column, both */
    motion.t = {pose[3], pose[4], pose[5]};
    return motion;
}

Pose pose_of(const Rigid &motion)
{
    const Eigen::Vector3d axis = angle_axis(motion.R);
    return {axis[0], axis[1], axis[2], motion.t[0], motion.t[1], motion.t[2]};
}

std::array<double, 12> rows_of(const Rigid &motion)
{
    std::array<double, 12> rows;
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++)
            rows[(size_t)(4 * i + j)] = motion.R(i, j);
        rows[(size_t)(4 * i + 3)] = motion.t[i];
    }
    return rows;
}

Eigen::Vector3d angle_axis(const Eigen::Matrix3d &R)
{
    Eigen::Vector3d axis;
    ceres::RotationMatrixToAngleAxis(R.data(), axis.data());
    return axis;
}

/* The turn about a's axes d by the left Jacobian, the place -R'(t + dt - d x t). */
Eigen::Matrix<double, 6, 6> change_of_place(const Pose &T_a_b)
{
    const Rigid T = rigid_of(T_a_b);
    const Eigen::Matrix3d turn = left_jacobian({T_a_b[0], T_a_b[1], T_a_b[2]});
    Eigen::Matrix<double, 6, 6> change = Eigen::Matrix<double, 6, 6>::Zero();
    change.block<3, 3>(0, 0) = turn;
    change.block<3, 3>(3, 0) = -T.R.transpose() * cross_matrix(T.t) * turn;
    change.block<3, 3>(3, 3) = -T.R.transpose();
    return change;
}

bool pose_view(const Board &board, const fovea_camera &camera, const View &view, Pose &pose,
               double &rms_px)
{
    constexpr double loss_px = 2;
    const std::vector<Point> points = board.points();
    if (view.corners.size() != points.size() || !initial_pose(board, camera, view, pose))
        return false;
    const Parameters parameters = parameters_of(camera);
    const Model model = model_of(camera);
    ceres::Problem problem;
    std::vector<Posed> corners;
    for (size_t c = 0; c < points.size(); c++)
        if (seen(view.corners[c]))
            corners.push_back({model, &parameters, points[c], view.corners[c]});
    for (const Posed &corner : corners)
        problem.AddResidualBlock(new ceres::AutoDiffCostFunction<Posed, 2, 6>(new Posed(corner)),
                                 new ceres::CauchyLoss(loss_px), pose.data());
    if (!solve_least_squares(problem, {pose.data()}, {pose.data()})) return false;
    double squares = 0;
    for (const Posed &corner : corners) {
        double residual[2];
        if (!corner(pose.data(), residual)) return false;
        squares += residual[0] * residual[0] + residual[1] * residual[1];
    }
    rms_px = std::sqrt(squares / (double)corners.size());
    return std::isfinite(rms_px);
}

} // namespace calibrate

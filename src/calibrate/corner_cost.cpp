#include "calibrate/corner_cost.h"

#include <ceres/rotation.h>

#include <cmath>

#include "calibrate/least_squares.h"

namespace calibrate
{
namespace
{

using ByCoefficients = Eigen::Matrix<double, 2, FOVEA_LENS_COEFFICIENTS>;
using ByPoint = Eigen::Matrix<double, 2, 3>;
using ByPose = Eigen::Matrix<double, 2, 6, Eigen::RowMajor>;

/* Where the image plane at distance 1 is met, and its derivatives. */
struct Distorted {
    Eigen::Vector2d at;
    ByCoefficients by_k = ByCoefficients::Zero();
    ByPoint by_point;
};

bool distort_radtan(const double *k, const double *point, Distorted &out)
{
    if (!(point[2] > 1e-9)) return false;
    const double inverse = 1 / point[2], a = point[0] * inverse, b = point[1] * inverse;
    const double r2 = a * a + b * b, r4 = r2 * r2, r6 = r4 * r2;
    const double below = 1 / (1 + r2 * k[5] + r4 * k[6] + r6 * k[7]);
    const double scale = (1 + r2 * k[0] + r4 * k[1] + r6 * k[4]) * below;
    /* of the scale, by r2 */
    const double slope =
        ((k[0] + 2 * r2 * k[1] + 3 * r4 * k[4]) - scale * (k[5] + 2 * r2 * k[6] + 3 * r4 * k[7])) *
        below;
    const Eigen::Vector2d ray(a, b);
    out.at = scale * ray + Eigen::Vector2d(2 * k[2] * a * b + k[3] * (r2 + 2 * a * a),
                                           k[2] * (r2 + 2 * b * b) + 2 * k[3] * a * b);
    const double powers[3] = {r2 * below, r4 * below, r6 * below};
    static const int numerator[3] = {0, 1, 4}, denominator[3] = {5, 6, 7};
    for (int i = 0; i < 3; i++) {
        out.by_k.col(numerator[i]) = powers[i] * ray;
        out.by_k.col(denominator[i]) = -scale * powers[i] * ray;
    }
    out.by_k.col(2) << 2 * a * b, r2 + 2 * b * b;
    out.by_k.col(3) << r2 + 2 * a * a, 2 * a * b;
    Eigen::Matrix2d by_ray =
        scale * Eigen::Matrix2d::Identity() + 2 * slope * ray * ray.transpose();
    const double mixed = 2 * (k[2] * a + k[3] * b);
    by_ray(0, 0) += 2 * k[2] * b + 6 * k[3] * a;
    by_ray(0, 1) += mixed;
    by_ray(1, 0) += mixed;
    by_ray(1, 1) += 6 * k[2] * b + 2 * k[3] * a;
    out.by_point.leftCols<2>() = inverse * by_ray;
    out.by_point.col(2) = -inverse * by_ray * ray;
    return true;
}

bool distort_equidistant(const double *k, const double *point, Distorted &out)
{
    const Eigen::Vector2d across(point[0], point[1]);
    const double radius2 = across.squaredNorm(), z = point[2];
    if (radius2 <= 1e-18) {
        const double inverse = 1 / z;
        out.at = inverse * across;
        out.by_point.leftCols<2>() = inverse * Eigen::Matrix2d::Identity();
        out.by_point.col(2) = -inverse * inverse * across;
        return true;
    }
    const double radius = std::sqrt(radius2), theta = std::atan2(radius, z), t2 = theta * theta;
    double value = theta, slope = 1, power = theta; /* of the polynomial, by theta */
    for (int i = 0; i < 4; i++) {
        power *= t2;
        value += k[i] * power;
        slope += (2 * i + 3) * k[i] * power / theta;
        out.by_k.col(i) = power / radius * across;
    }
    const double scale = value / radius, distance2 = radius2 + z * z;
    const double by_radius = (slope * z / distance2 - scale) / radius;
    out.at = scale * across;
    out.by_point.leftCols<2>() =
        scale * Eigen::Matrix2d::Identity() + by_radius / radius * across * across.transpose();
    out.by_point.col(2) = -slope / distance2 * across;
    return true;
}

/* A point moved by a pose: where it comes to, and how far it has been turned. */
struct Moved {
    Eigen::Vector3d turned, at;
};

Moved move(const double *pose, const double *point)
{
    Moved moved;
    ceres::AngleAxisRotatePoint(pose, point, moved.turned.data());
    moved.at = moved.turned + Eigen::Map<const Eigen::Vector3d>(pose + 3);
    return moved;
}

/* A change d of the angle axis turns the point on by left_jacobian d. */
ByPose by_pose(const ByPoint &by_point, const double *pose, const Moved &moved)
{
    ByPose all;
    all.leftCols<3>() = -by_point * cross_matrix(moved.turned) *
                        left_jacobian(Eigen::Map<const Eigen::Vector3d>(pose));
    all.rightCols<3>() = by_point;
    return all;
}

Eigen::Matrix3d rotation(const double *pose)
{
    Eigen::Matrix3d R;
    ceres::AngleAxisToRotationMatrix(pose, R.data()); /* by columns */
    return R;
}

/* Of a board that is bent. */
Eigen::Vector3d on_board(const Corner &corner, const double *bend)
{
    return {corner.point[0], corner.point[1],
            bend[0] * (1 - corner.x * corner.x) + bend[1] * (1 - corner.y * corner.y)};
}

void less(const Pixel &found, double *residual)
{
    for (size_t i = 0; i < 2; i++)
        residual[i] -= found[i];
}

bool predicted_less_found(Model model, const double *camera, const Eigen::Vector3d &point,
                          const Pixel &found, double *residual)
{
    if (!project(model, camera, point.data(), residual)) return false;
    less(found, residual);
    return true;
}

/* Residual and derivatives by camera and point. */
bool evaluate(Model model, const double *camera, const Eigen::Vector3d &point, const Pixel &found,
              double *residual, ProjectionDerivatives &derivatives)
{
    if (!project_derivatives(model, camera, point.data(), residual, derivatives)) return false;
    less(found, residual);
    return true;
}

template <typename Matrix> void put(double *at, const Matrix &jacobian)
{
    if (at == nullptr) return;
    Eigen::Map<Matrix> values(at);
    values = jacobian;
}

} // namespace

bool project_derivatives(Model model, const double *camera, const double *point, double *pixel,
                         ProjectionDerivatives &derivatives)
{
    Distorted distorted;
    const bool ahead = model == Model::equidistant
                           ? distort_equidistant(camera + 4, point, distorted)
                           : distort_radtan(camera + 4, point, distorted);
    if (!ahead) return false;
    const Eigen::Vector2d focal(camera[0], camera[0] * camera[1]);
    for (int i = 0; i < 2; i++)
        pixel[i] = focal[i] * distorted.at[i] + camera[2 + i];
    derivatives.by_camera.leftCols<4>() << distorted.at[0], 0, 1, 0, camera[1] * distorted.at[1],
        camera[0] * distorted.at[1], 0, 1;
    derivatives.by_camera.rightCols<FOVEA_LENS_COEFFICIENTS>() =
        focal.asDiagonal() * distorted.by_k;
    derivatives.by_point = focal.asDiagonal() * distorted.by_point;
    return true;
}

bool Corner::residual(const double *camera, const double *pose, const double *bend,
                      double *out) const
{
    const Eigen::Vector3d board = on_board(*this, bend);
    return predicted_less_found(model, camera, move(pose, board.data()).at, found, out);
}

bool CornerCost::Evaluate(const double *const *blocks, double *residuals, double **jacobians) const
{
    const double *camera = blocks[0], *pose = blocks[1], *bend = blocks[2];
    if (jacobians == nullptr) return corner.residual(camera, pose, bend, residuals);
    const Eigen::Vector3d board = on_board(corner, bend);
    const Moved moved = move(pose, board.data());
    ProjectionDerivatives derivatives;
    if (!evaluate(corner.model, camera, moved.at, corner.found, residuals, derivatives))
        return false;
    put(jacobians[0], derivatives.by_camera);
    put(jacobians[1], by_pose(derivatives.by_point, pose, moved));
    if (jacobians[2] == nullptr) return true;
    const Eigen::Vector2d by_height = derivatives.by_point * rotation(pose).col(2);
    const Eigen::RowVector2d heights(1 - corner.x * corner.x, 1 - corner.y * corner.y);
    put(jacobians[2], Eigen::Matrix<double, 2, 2, Eigen::RowMajor>(by_height * heights));
    return true;
}

bool RigCorner::residual(const double *camera, const double *T_cam_first,
                         const double *T_first_board, double *out) const
{
    const Moved in_first = move(T_first_board, point.data());
    return predicted_less_found(model, camera, move(T_cam_first, in_first.at.data()).at, found,
                                out);
}

bool RigCornerCost::Evaluate(const double *const *blocks, double *residuals,
                             double **jacobians) const
{
    const double *camera = blocks[0], *T_cam_first = blocks[1], *T_first_board = blocks[2];
    if (jacobians == nullptr) return corner.residual(camera, T_cam_first, T_first_board, residuals);
    const Moved in_first = move(T_first_board, corner.point.data());
    const Moved moved = move(T_cam_first, in_first.at.data());
    ProjectionDerivatives derivatives;
    if (!evaluate(corner.model, camera, moved.at, corner.found, residuals, derivatives))
        return false;
    put(jacobians[0], derivatives.by_camera);
    put(jacobians[1], by_pose(derivatives.by_point, T_cam_first, moved));
    if (jacobians[2] != nullptr)
        put(jacobians[2],
            by_pose(derivatives.by_point * rotation(T_cam_first), T_first_board, in_first));
    return true;
}

} // namespace calibrate

/* What all solves by Ceres share: how it is run, and the covariance of what it finds. */
#ifndef FOVEA_CALIBRATE_LEAST_SQUARES_H
#define FOVEA_CALIBRATE_LEAST_SQUARES_H

#include <Eigen/Dense>
#include <ceres/ceres.h>

#include <vector>

namespace calibrate
{

/* Minimise to the last digits. Blocks of `first` (poses of boards) are eliminated first: no
 * residual may hold two of them. All other blocks are in `rest`; none: sparse elimination in any
 * order. */
bool solve_least_squares(ceres::Problem &problem, const std::vector<double *> &first,
                         const std::vector<double *> &rest);

struct SolveError {
    size_t residuals = 0; /* without the last ones, which are none of measurements */
    double rms = 0;       /* of one residual */
    double noise = 0;     /* residuals over degrees of freedom */
};

/* Covariance of `blocks`, in their tangent spaces and in their order, all others held: the inverse
 * of the normal matrix times the noise found. The last `extra` residuals are left out of the noise.
 * False: the measurements do not determine the blocks. */
bool covariance(ceres::Problem &problem, const std::vector<double *> &blocks, int extra,
                Eigen::MatrixXd &result, SolveError &found);

/* [v]x: the matrix of the cross product v x . */
Eigen::Matrix3d cross_matrix(const Eigen::Vector3d &v);

/* Left Jacobian of the rotation: how the rotation moves, as a vector in the frame that it leads to,
 * with the angle-axis. */
Eigen::Matrix3d left_jacobian(const Eigen::Vector3d &axis);

} // namespace calibrate
#endif

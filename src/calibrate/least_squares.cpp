#include "calibrate/least_squares.h"

#include <glog/logging.h>

#include <cmath>

namespace calibrate
{
namespace
{

/* Inverse of the normal matrix, times the noise. The matrix is scaled to a unit diagonal first: its
 * parameters have sizes from 1e-9 to 1e3. Combinations of parameters that the pictures say nothing
 * of, as of the rational model's coefficients, get a large finite deviation by the ridge. */
bool invert(const Eigen::MatrixXd &normal, double noise, Eigen::MatrixXd &covariance)
{
    const Eigen::VectorXd scale = normal.diagonal().cwiseSqrt().cwiseInverse();
    if (!scale.allFinite()) return false;
    const Eigen::MatrixXd scaled = scale.asDiagonal() * normal * scale.asDiagonal();
    const Eigen::MatrixXd one = Eigen::MatrixXd::Identity(scaled.rows(), scaled.cols());
    for (const double ridge : {0., 1e-14, 1e-13, 1e-12, 1e-11}) {
        const Eigen::LLT<Eigen::MatrixXd> factor(scaled + ridge * one);
        if (factor.info() != Eigen::Success) continue;
        covariance = noise * noise * (scale.asDiagonal() * factor.solve(one) * scale.asDiagonal());
        return covariance.allFinite() && covariance.diagonal().minCoeff() >= 0;
    }
    return false;
}

} // namespace

Eigen::Matrix3d cross_matrix(const Eigen::Vector3d &v)
{
    Eigen::Matrix3d cross;
    cross << 0, -v[2], v[1], v[2], 0, -v[0], -v[1], v[0], 0;
    return cross;
}

Eigen::Matrix3d left_jacobian(const Eigen::Vector3d &axis)
{
    const double angle = axis.norm();
    const Eigen::Matrix3d cross = cross_matrix(axis);
    if (angle < 1e-6) return Eigen::Matrix3d::Identity() + .5 * cross;
    return Eigen::Matrix3d::Identity() + (1 - std::cos(angle)) / (angle * angle) * cross +
           (angle - std::sin(angle)) / (angle * angle * angle) * cross * cross;
}

bool solve_least_squares(ceres::Problem &problem, const std::vector<double *> &first,
                         const std::vector<double *> &rest)
{
    ceres::Solver::Options how;
    how.linear_solver_type = rest.empty() ? ceres::SPARSE_NORMAL_CHOLESKY : ceres::DENSE_SCHUR;
    if (!rest.empty()) {
        how.linear_solver_ordering = std::make_shared<ceres::ParameterBlockOrdering>();
        for (double *block : first)
            if (problem.HasParameterBlock(block))
                how.linear_solver_ordering->AddElementToGroup(block, 0);
        for (double *block : rest)
            if (problem.HasParameterBlock(block))
                how.linear_solver_ordering->AddElementToGroup(block, 1);
    }
    how.max_num_iterations = 200;
    how.function_tolerance = 1e-12;
    how.parameter_tolerance = 1e-12;
    how.gradient_tolerance = 1e-14;
    how.logging_type = ceres::SILENT;
    FLAGS_minloglevel = google::GLOG_FATAL; /* a step that fails is tried again, smaller */
    ceres::Solver::Summary summary;
    ceres::Solve(how, &problem, &summary);
    return summary.IsSolutionUsable();
}

bool covariance(ceres::Problem &problem, const std::vector<double *> &blocks, int extra,
                Eigen::MatrixXd &result, SolveError &found)
{
    ceres::Problem::EvaluateOptions what;
    what.parameter_blocks = blocks;
    std::vector<double> residuals;
    ceres::CRSMatrix jacobian;
    if (!problem.Evaluate(what, nullptr, &residuals, nullptr, &jacobian)) return false;
    Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(jacobian.num_cols, jacobian.num_cols);
    for (int row = 0; row < jacobian.num_rows; row++)
        for (int a = jacobian.rows[(size_t)row]; a < jacobian.rows[(size_t)row + 1]; a++)
            for (int b = jacobian.rows[(size_t)row]; b < jacobian.rows[(size_t)row + 1]; b++)
                matrix(jacobian.cols[(size_t)a], jacobian.cols[(size_t)b]) +=
                    jacobian.values[(size_t)a] * jacobian.values[(size_t)b];
    double squares = 0;
    residuals.resize(residuals.size() - (size_t)extra);
    for (const double residual : residuals)
        squares += residual * residual;
    const int freedom = (int)residuals.size() - jacobian.num_cols;
    if (freedom <= 0) return false;
    found.residuals = residuals.size();
    found.rms = std::sqrt(squares / (double)residuals.size());
    found.noise = std::sqrt(squares / freedom);
    return invert(matrix, found.noise, result);
}

} // namespace calibrate

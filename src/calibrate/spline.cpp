#include "calibrate/spline.h"

#include <Eigen/SparseCholesky>

#include <algorithm>
#include <cmath>

namespace calibrate
{
namespace
{

constexpr int DEGREE = SPLINE_ORDER - 1;
constexpr double EVENNESS = 1e-4; /* weight of second differences beside one value */

} // namespace

SplineWeights spline_weights(double u, double step_s)
{
    /* by the recurrence of Cox and de Boor: basis[d] holds the d + 1 weights of degree d */
    double basis[SPLINE_ORDER][SPLINE_ORDER] = {{1}};
    for (int d = 1; d <= DEGREE; d++)
        for (int j = 0; j <= d; j++)
            basis[d][j] = ((j > 0 ? (u + d - j) * basis[d - 1][j - 1] : 0) +
                           (j < d ? (1 + j - u) * basis[d - 1][j] : 0)) /
                          d;
    const auto below = [&](int degree, int j) {
        return j >= 0 && j <= degree ? basis[degree][j] : 0.;
    };
    SplineWeights weights;
    for (int j = 0; j < SPLINE_ORDER; j++) {
        weights.value[(size_t)j] = basis[DEGREE][j];
        weights.first[(size_t)j] = (below(DEGREE - 1, j - 1) - below(DEGREE - 1, j)) / step_s;
        weights.second[(size_t)j] =
            (below(DEGREE - 2, j - 2) - 2 * below(DEGREE - 2, j - 1) + below(DEGREE - 2, j)) /
            (step_s * step_s);
    }
    return weights;
}

Spline::Spline(double begin, double end, double step) : begin_s(begin), step_s(step)
{
    const int count = std::max(1, (int)std::ceil((end - begin) / step));
    control.assign((size_t)(count + DEGREE), {});
}

int Spline::segment(double time_s) const
{
    return std::clamp((int)std::floor((time_s - begin_s) / step_s), 0, segments() - 1);
}

double Spline::within(double time_s, int segment) const
{
    return (time_s - begin_s) / step_s - segment;
}

Eigen::Matrix<double, 6, 1> Spline::sum(int segment,
                                        const std::array<double, SPLINE_ORDER> &weights) const
{
    Eigen::Matrix<double, 6, 1> all = Eigen::Matrix<double, 6, 1>::Zero();
    for (size_t j = 0; j < SPLINE_ORDER; j++)
        all += weights[j] *
               Eigen::Map<const Eigen::Matrix<double, 6, 1>>(control[(size_t)segment + j].data());
    return all;
}

void fit_spline(const std::vector<double> &times_s,
                const std::vector<Eigen::Matrix<double, 6, 1>> &values, Spline &spline)
{
    const auto size = (Eigen::Index)spline.control.size();
    std::vector<Eigen::Triplet<double>> entries;
    Eigen::MatrixXd right = Eigen::MatrixXd::Zero(size, 6);
    for (size_t k = 0; k < times_s.size(); k++) {
        const int at = spline.segment(times_s[k]);
        const auto weights = spline_weights(spline.within(times_s[k], at), spline.step_s).value;
        for (int i = 0; i < SPLINE_ORDER; i++) {
            right.row(at + i) += weights[(size_t)i] * values[k].transpose();
            for (int j = 0; j < SPLINE_ORDER; j++)
                entries.emplace_back(at + i, at + j, weights[(size_t)i] * weights[(size_t)j]);
        }
    }
    static const double difference[3] = {1, -2, 1};
    for (int at = 0; at + 2 < size; at++)
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++)
                entries.emplace_back(at + i, at + j, EVENNESS * difference[i] * difference[j]);
    Eigen::SparseMatrix<double> normal(size, size);
    normal.setFromTriplets(entries.begin(), entries.end());
    const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factor(normal);
    const Eigen::MatrixXd found = factor.solve(right);
    for (Eigen::Index at = 0; at < size; at++)
        for (Eigen::Index i = 0; i < 6; i++)
            spline.control[(size_t)at][(size_t)i] = found(at, i);
}

} // namespace calibrate

/* A motion as a uniform B-spline of degree five: six numbers over time, each a polynomial between
 * knots whose first four derivatives have no steps. C. de Boor, A Practical Guide to Splines, 1978.
 *
 * As the motion of a body the numbers are the angle-axis vector and the translation of T_world_body
 * (P. Furgale, J. Rehder, R. Siegwart, Unified temporal and spatial calibration for multi-sensor
 * systems, IROS 2013). The vector is continuous where it passes a half turn; the caller chooses the
 * world so that it stays below a whole one. */
#ifndef FOVEA_CALIBRATE_SPLINE_H
#define FOVEA_CALIBRATE_SPLINE_H

#include <Eigen/Dense>

#include <array>
#include <vector>

namespace calibrate
{

constexpr int SPLINE_ORDER = 6; /* control points that a value depends on */

/* Weights of these control points: of the value, and of its derivatives by time. */
struct SplineWeights {
    std::array<double, SPLINE_ORDER> value, first, second;
};

/* At `u` of [0, 1] between two knots `step_s` apart. */
SplineWeights spline_weights(double u, double step_s);

struct Spline {
    double begin_s = 0, step_s = 0;
    std::vector<std::array<double, SPLINE_ORDER>> control; /* six numbers each */

    Spline() = default;
    /* Over [begin, end], all zero. */
    Spline(double begin_s, double end_s, double step_s);
    int segments() const
    {
        return (int)control.size() - SPLINE_ORDER + 1;
    }
    double end_s() const
    {
        return begin_s + step_s * segments();
    }
    /* Between which knots; the first or last ones beyond both ends. */
    int segment(double time_s) const;
    double within(double time_s, int segment) const; /* `u` of spline_weights */

    /* What the control points make of such weights, from the first one of a segment on. */
    Eigen::Matrix<double, 6, 1> sum(int segment,
                                    const std::array<double, SPLINE_ORDER> &weights) const;
};

/* The spline that is nearest to six numbers at each of these times, in the least squares, its
 * control points as even as they allow where there are none. */
void fit_spline(const std::vector<double> &times_s,
                const std::vector<Eigen::Matrix<double, 6, 1>> &values, Spline &spline);

} // namespace calibrate
#endif

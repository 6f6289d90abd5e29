/* The joint solve of cameras and an inertial sensor as Ceres takes it: what is solved for, its
 * start and its residuals. Needs Ceres. */
#ifndef FOVEA_CALIBRATE_INERTIAL_PROBLEM_H
#define FOVEA_CALIBRATE_INERTIAL_PROBLEM_H

#include "calibrate/inertial_cost.h"
#include "calibrate/inertial_start.h"

namespace calibrate
{

/* A residual with the blocks that it depends on. */
struct InertialTerm {
    const ceres::CostFunction *cost;
    std::vector<double *> blocks;
};

struct InertialState {
    const InertialInput &input;
    InertialStart start;
    InertialSolution &solution;
    Rigid T_world_board; /* turned so that the sensor is upright in the world in the mean */
    double period_s = 0; /* of samples */
    double sigma_px = 0, excess[INERTIAL_PARTS] = {1, 1};
    /* what is solved for */
    Spline spline;
    std::vector<std::array<double, 6>> biases;
    Pose T_cam_imu = {};
    std::array<double, 2> clock = {}; /* shift, drift */
    std::array<double, 3> gravity = {};
    /* the problem, while there is one */
    std::vector<PictureCost *> pictures;
    std::vector<size_t> picture_of; /* of start.pictures */
    std::vector<ReadingsCost *> readings;
    std::vector<InertialTerm> terms;

    InertialState(const InertialInput &of, const InertialStart &from, InertialSolution &to)
        : input(of), start(from), solution(to)
    {
    }
    int stretch_segments() const; /* between two of whose ends a bias walks evenly */
    double middle_s() const
    {
        return .5 * start.pictures.back().time_s;
    }
};

/* The start, but for the spline; and the spline through the pictures' poses with `knots_hz` knots
 * a second, by the present place of the camera. */
void begin_inertial(InertialState &state);
void lay_spline(InertialState &state, double knots_hz);

/* Fill `terms`: pictures first, then samples, in the order of `pictures` and `readings`. */
void build_inertial(InertialState &state, ceres::Problem &problem);

bool minimise_inertial(InertialState &state, ceres::Problem &problem);

/* Residuals of a term, with derivatives by block where they are asked for. False: not possible. */
bool evaluate_term(const InertialTerm &term, Eigen::VectorXd &residuals,
                   std::vector<Eigen::MatrixXd> *by_block);

/* Whether an axis is at the end of its range; 0: it has none. */
bool is_saturated(const double *values, double range);

} // namespace calibrate
#endif

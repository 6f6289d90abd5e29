/* The joint solve of cameras and an inertial sensor. */
#include "calibrate/inertial.h"

#include <Eigen/SparseCholesky>

#include <algorithm>
#include <cmath>

#include "calibrate/inertial_problem.h"
#include "calibrate/least_squares.h"

namespace calibrate
{
namespace
{

constexpr double KNOTS_HZ = 20, KNOTS_HZ_MAX = 100;
constexpr double CORNER_SIGMAS = 5, VIEW_RATIO = 3.5, RAYLEIGH_MEDIAN = 1.17741;
constexpr int ROUNDS_MAX = 5;
constexpr double EXCESS_PASS = 1.1; /* above it the knots are doubled, and the noise is raised */

/* ---- what fits ------------------------------------------------------------------------------- */

/* Leave out corners and pictures that do not fit, and weigh all by the noise that they show.
 * Returns whether anything changed by much. */
bool judge_residuals(InertialState &state)
{
    bool changed = false;
    double squares = 0;
    size_t count = 0;
    std::vector<double> medians;
    std::vector<std::vector<double>> errors(state.pictures.size());
    for (size_t i = 0; i < state.pictures.size(); i++) {
        Eigen::VectorXd residuals;
        if (!evaluate_term(state.terms[i], residuals, nullptr)) continue; /* pictures come first */
        for (Eigen::Index c = 0; c < residuals.size(); c += 2)
            errors[i].push_back(state.sigma_px * residuals.segment<2>(c).norm());
        medians.push_back(median(errors[i]));
    }
    const double usual = median(medians), limit = CORNER_SIGMAS * usual / RAYLEIGH_MEDIAN;
    for (size_t i = 0; i < errors.size(); i++) {
        PosedPicture &picture = state.start.pictures[state.picture_of[i]];
        if (errors[i].empty() || median(errors[i]) > VIEW_RATIO * usual) {
            char text[120];
            snprintf(text, sizeof text,
                     "its corners are %.2f px off the motion where the others' are %.2f px",
                     errors[i].empty() ? INFINITY : median(errors[i]), usual);
            state.solution.left_out[picture.camera][picture.view] = text;
            changed = true;
            continue;
        }
        size_t next = 0;
        for (char &used : picture.used) {
            if (!used) continue;
            const double error = errors[i][next++];
            used = error <= limit;
            changed |= !used;
            if (!used) continue;
            squares += error * error;
            count += 2;
        }
    }
    const double noise_px = std::sqrt(squares / (double)std::max<size_t>(1, count));
    changed |= std::fabs(noise_px / state.sigma_px - 1) > .02;
    state.sigma_px = noise_px;
    return changed;
}

/* Residuals of the samples over what their densities state. */
void measure_excess(InertialState &state, double excess[INERTIAL_PARTS])
{
    double squares[INERTIAL_PARTS] = {};
    size_t counts[INERTIAL_PARTS] = {};
    for (size_t i = 0; i < state.readings.size(); i++) {
        const InertialTerm &term = state.terms[state.pictures.size() + i];
        Eigen::VectorXd residuals;
        if (!evaluate_term(term, residuals, nullptr)) continue;
        const std::vector<Reading> &readings = state.readings[i]->readings();
        for (size_t s = 0; s < readings.size(); s++)
            for (int part = 0; part < INERTIAL_PARTS; part++) {
                if (readings[s].weights[part] == 0) continue;
                squares[part] +=
                    residuals.segment<3>((Eigen::Index)(6 * s) + 3 * part).squaredNorm();
                counts[part] += 3;
            }
    }
    /* The spline bends after a part of the noise. */
    const double left = 1 - std::min(.9, state.period_s / state.spline.step_s);
    for (int part = 0; part < INERTIAL_PARTS; part++)
        excess[part] =
            counts[part] > 0
                ? state.excess[part] * std::sqrt(squares[part] / ((double)counts[part] * left))
                : 0;
}

/* Solve with `knots_hz` knots a second until nothing changes any more; `excess` is what the samples
 * show. */
bool settle(InertialState &state, double knots_hz, double excess[INERTIAL_PARTS])
{
    bool changed = true;
    for (int part = 0; part < INERTIAL_PARTS; part++)
        state.excess[part] = 1;
    lay_spline(state, knots_hz);
    for (int round = 0; changed && round < ROUNDS_MAX; round++) {
        ceres::Problem problem;
        build_inertial(state, problem);
        if (state.pictures.empty() || !minimise_inertial(state, problem)) return false;
        changed = judge_residuals(state);
        measure_excess(state, excess);
        for (int part = 0; part < INERTIAL_PARTS; part++) {
            const double raised = excess[part] > EXCESS_PASS ? excess[part] : 1;
            changed |= std::fabs(raised / state.excess[part] - 1) > .05;
            state.excess[part] = raised;
        }
    }
    return true;
}

/* More knots while these follow the samples much better. */
bool refine(InertialState &state)
{
    double excess[INERTIAL_PARTS];
    double knots_hz = std::min(KNOTS_HZ, .5 / state.period_s);
    if (!settle(state, knots_hz, excess)) return false;
    while (2 * knots_hz <= std::min(KNOTS_HZ_MAX, .5 / state.period_s) &&
           std::max(excess[0], excess[1]) > EXCESS_PASS) {
        constexpr double better = .95;
        const double before[INERTIAL_PARTS] = {excess[0], excess[1]};
        if (!settle(state, 2 * knots_hz, excess)) return false;
        knots_hz *= 2;
        if (excess[0] > better * before[0] && excess[1] > better * before[1]) break;
    }
    std::copy(excess, excess + INERTIAL_PARTS, state.solution.excess);
    return true;
}

/* ---- what is found --------------------------------------------------------------------------- */

/* Where each block begins in the normal equations. */
struct Columns {
    std::vector<std::pair<const double *, int>> begins; /* by address */
    int size = 0;
    int clock = 0, pose = 0, gravity = 0, bias = 0;

    explicit Columns(const InertialState &state)
    {
        for (const auto &control : state.spline.control)
            add(control.data(), 6);
        for (const std::array<double, 6> &one : state.biases)
            add(one.data(), 6);
        pose = add(state.T_cam_imu.data(), 6);
        clock = add(state.clock.data(), 2);
        gravity = add(state.gravity.data(), 3);
        std::sort(begins.begin(), begins.end());
        bias = of(state.biases[state.biases.size() / 2].data());
    }
    int of(const double *block) const
    {
        return std::lower_bound(begins.begin(), begins.end(), std::pair(block, 0))->second;
    }

  private:
    int add(const double *block, int width)
    {
        begins.emplace_back(block, size);
        size += width;
        return size - width;
    }
};

using Sparse = Eigen::SparseMatrix<double>;

bool normal_equations(const InertialState &state, const Columns &columns, Sparse &normal,
                      Eigen::VectorXd &gradient)
{
    std::vector<Eigen::Triplet<double>> entries;
    gradient = Eigen::VectorXd::Zero(columns.size);
    for (const InertialTerm &term : state.terms) {
        Eigen::VectorXd residuals;
        std::vector<Eigen::MatrixXd> by_block;
        if (!evaluate_term(term, residuals, &by_block)) return false;
        for (size_t a = 0; a < by_block.size(); a++) {
            const int row = columns.of(term.blocks[a]);
            gradient.segment(row, by_block[a].cols()) += by_block[a].transpose() * residuals;
            for (size_t b = 0; b < by_block.size(); b++) {
                const int column = columns.of(term.blocks[b]);
                if (column > row) continue; /* the lower triangle alone */
                const Eigen::MatrixXd product = by_block[a].transpose() * by_block[b];
                for (int i = 0; i < product.rows(); i++)
                    for (int j = 0; j < product.cols(); j++)
                        if (row + i >= column + j && product(i, j) != 0)
                            entries.emplace_back(row + i, column + j, product(i, j));
            }
        }
    }
    normal.resize(columns.size, columns.size);
    normal.setFromTriplets(entries.begin(), entries.end());
    return true;
}

/* Rows of the inverse that are read: pose, shift, gravity, biases half-way; drift. */
enum { POSE = 0, SHIFT = 6, GRAVITY = 7, BIAS = 10, DRIFT = 16, READ = 17 };

/* Their covariance with the drift held, and the drift by itself. */
bool read_inverse(const InertialState &state, Eigen::MatrixXd &covariance, double drift[2])
{
    const Columns columns(state);
    Sparse normal;
    Eigen::VectorXd gradient;
    if (!normal_equations(state, columns, normal, gradient)) return false;
    Eigen::VectorXd scale = normal.diagonal().cwiseSqrt().cwiseInverse();
    if (!scale.allFinite()) return false;
    normal = scale.asDiagonal() * normal * scale.asDiagonal();
    const Eigen::SimplicialLDLT<Sparse, Eigen::Lower> factor(normal);
    if (factor.info() != Eigen::Success || !(factor.vectorD().minCoeff() > 0)) return false;
    std::vector<int> read;
    for (int i = 0; i < 6; i++)
        read.push_back(columns.pose + i);
    read.push_back(columns.clock);
    for (int i = 0; i < 3; i++)
        read.push_back(columns.gravity + i);
    for (int i = 0; i < 6; i++)
        read.push_back(columns.bias + i);
    read.push_back(columns.clock + 1);
    covariance.resize(READ, READ);
    for (int c = 0; c < READ; c++) {
        Eigen::VectorXd unit = Eigen::VectorXd::Zero(columns.size);
        unit[read[(size_t)c]] = scale[read[(size_t)c]];
        const Eigen::VectorXd column = factor.solve(unit);
        for (int r = 0; r < READ; r++)
            covariance(r, c) = scale[read[(size_t)r]] * column[read[(size_t)r]];
        if (c == DRIFT) drift[0] = -column.dot(scale.cwiseProduct(gradient));
    }
    const double variance = covariance(DRIFT, DRIFT);
    drift[1] = std::sqrt(variance);
    const Eigen::VectorXd with_drift = covariance.col(DRIFT);
    covariance -= with_drift * with_drift.transpose() / variance;
    return covariance.allFinite() && variance > 0;
}

bool deviations(InertialState &state)
{
    Eigen::MatrixXd covariance;
    double drift[2];
    ceres::Problem problem;
    build_inertial(state, problem);
    if (!read_inverse(state, covariance, drift)) return false;
    InertialSolution &solution = state.solution;
    const Eigen::Matrix<double, 6, 6> change = change_of_place(state.T_cam_imu);
    solution.covariance = change * covariance.block<6, 6>(POSE, POSE) * change.transpose();
    for (int i = 0; i < 6; i++)
        solution.stdev[(size_t)i] = std::sqrt(solution.covariance(i, i));
    solution.time_shift_stdev_s = std::sqrt(covariance(SHIFT, SHIFT));
    solution.clock_drift = drift[0];
    solution.clock_drift_stdev = drift[1];
    const Eigen::Vector3d down =
        Eigen::Map<const Eigen::Vector3d>(state.gravity.data()).normalized();
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - down * down.transpose();
    solution.gravity_stdev_rad =
        std::sqrt((across * covariance.block<3, 3>(GRAVITY, GRAVITY) * across).trace() / 2) /
        GRAVITY_M_S2;
    for (int i = 0; i < 6; i++)
        solution.bias_stdev[i / 3][i % 3] = std::sqrt(covariance(BIAS + i, BIAS + i));
    return true;
}

/* How the sensor turned and moved. */
void measure_motion(const InertialState &state)
{
    InertialSolution &solution = state.solution;
    Eigen::Matrix3d rates = Eigen::Matrix3d::Zero();
    double squares = 0;
    int count = 0;
    for (const PosedPicture &picture : state.start.pictures) {
        const double time_s = picture.time_s + state.clock[0];
        const int at = state.spline.segment(time_s);
        const double *control[SPLINE_ORDER];
        for (int j = 0; j < SPLINE_ORDER; j++)
            control[j] = state.spline.control[(size_t)(at + j)].data();
        const Motion motion = motion_of(
            control, spline_weights(state.spline.within(time_s, at), state.spline.step_s));
        const Eigen::Vector3d rate = motion.J * motion.turn_rate;
        rates += rate * rate.transpose();
        squares += motion.acceleration.squaredNorm();
        count++;
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(rates / count);
    for (int i = 0; i < 2; i++)
        solution.turn_rad_s[i] = std::sqrt(std::max(0., solver.eigenvalues()[2 - i]));
    solution.acceleration_m_s2 = std::sqrt(squares / count);
}

void measure_samples(const InertialState &state)
{
    InertialSolution &solution = state.solution;
    const fovea_rig_imu &imu = state.input.imu;
    int64_t before_ns = 0;
    for (const fovea_imu_sample &sample : state.input.samples) {
        const double time_s = 1e-9 * (double)(sample.stamp_ns - state.start.begin_ns);
        if (time_s < state.spline.begin_s || time_s >= state.spline.end_s()) continue;
        if (solution.samples_used > 0)
            solution.missing += std::max(
                0, (int)std::lround(1e-9 * (double)(sample.stamp_ns - before_ns) / state.period_s) -
                       1);
        before_ns = sample.stamp_ns;
        solution.samples_used++;
        solution.saturated[0] += is_saturated(sample.gyro, imu.gyro_range);
        solution.saturated[1] += is_saturated(sample.acceleration, imu.acceleration_range);
    }
}

void keep(const InertialState &state)
{
    InertialSolution &solution = state.solution;
    double squares = 0, corners = 0;
    solution.T_cam_imu = rigid_of(state.T_cam_imu);
    solution.time_shift_s = state.clock[0];
    solution.gravity_m_s2 =
        state.T_world_board.R.transpose() * Eigen::Map<const Eigen::Vector3d>(state.gravity.data());
    const std::array<double, 6> &bias = state.biases[state.biases.size() / 2];
    for (size_t i = 0; i < 6; i++)
        solution.bias[i / 3][i % 3] = bias[i];
    solution.noise_px = state.sigma_px;
    solution.knots_hz = 1 / state.spline.step_s;
    solution.duration_s = state.start.pictures.back().time_s;
    for (size_t i = 0; i < state.pictures.size(); i++) {
        const PosedPicture &picture = state.start.pictures[state.picture_of[i]];
        const auto count = (double)state.pictures[i]->corner_count();
        squares += count * picture.rms_px * picture.rms_px;
        corners += count;
    }
    solution.views_used = (int)state.pictures.size();
    solution.corners_used = (int)corners;
    solution.alone_px = std::sqrt(.5 * squares / std::max(1., corners));
    measure_motion(state);
    measure_samples(state);
}

} // namespace

bool solve_inertial(const InertialInput &input, InertialSolution &solution, std::string &error)
{
    InertialStart start;
    solution = InertialSolution();
    if (!start_inertial(input, start, solution, error)) return false;
    InertialState state(input, start, solution);
    begin_inertial(state);
    if (!refine(state)) {
        error = "the solve does not converge: the pictures and samples do not determine the place "
                "of the sensor";
        return false;
    }
    if (!deviations(state)) {
        error = "the pictures and samples do not determine the place of the sensor: turn the "
                "camera quickly about all its axes before the board";
        return false;
    }
    keep(state);
    return true;
}

std::array<double, 6> place_stdev(const InertialSolution &solution, const Rigid &T_first_cam,
                                  const std::array<double, 6> &T_first_cam_stdev)
{
    /* The turn of the first camera by its own axes, seen by the other's; its centre moves by the
     * turn across the distance between both, in the sensor's frame. */
    const Eigen::Matrix3d R_imu_first = solution.T_cam_imu.R.transpose();
    Eigen::Matrix<double, 6, 6> change = Eigen::Matrix<double, 6, 6>::Zero();
    change.block<3, 3>(0, 0) = T_first_cam.R.transpose();
    change.block<3, 3>(3, 0) = R_imu_first * cross_matrix(T_first_cam.t);
    change.block<3, 3>(3, 3).setIdentity();
    const Eigen::Matrix<double, 6, 6> of_first = change * solution.covariance * change.transpose();
    const Eigen::Vector3d own(T_first_cam_stdev[3], T_first_cam_stdev[4], T_first_cam_stdev[5]);
    const Eigen::Matrix3d place =
        R_imu_first * own.cwiseAbs2().asDiagonal() * R_imu_first.transpose();
    std::array<double, 6> stdev;
    for (int i = 0; i < 3; i++) {
        const double turn = T_first_cam_stdev[(size_t)i];
        stdev[(size_t)i] = std::sqrt(of_first(i, i) + turn * turn);
        stdev[(size_t)(3 + i)] = std::sqrt(of_first(3 + i, 3 + i) + place(i, i));
    }
    return stdev;
}

} // namespace calibrate

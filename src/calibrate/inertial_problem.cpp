#include "calibrate/inertial_problem.h"

#include <glog/logging.h>

#include <algorithm>
#include <cmath>

#include "calibrate/compare.h"

namespace calibrate
{
namespace
{

constexpr double BIAS_STRETCH_S = .25;
constexpr double GRAVITY_SPREAD_M_S2 = .02; /* over the earth */
/* What a bias may be, and the accelerations of a hand: they hold what nothing measures. */
constexpr double BIAS_SPREAD[INERTIAL_PARTS] = {1, 2}, SECOND_SPREAD = 1e3;
constexpr double NOISE_LEAST[INERTIAL_PARTS] = {1e-6, 1e-5},
                 WALK_LEAST[INERTIAL_PARTS] = {1e-7, 1e-6};

/* The biases of a stretch and of the next one: their walk. Blocks: both. */
struct Walk {
    double weights[INERTIAL_PARTS];
    template <typename T> bool operator()(const T *a, const T *b, T *residual) const
    {
        for (int i = 0; i < 6; i++)
            residual[i] = weights[i / 3] * (b[i] - a[i]);
        return true;
    }
};

struct FirstBias {
    template <typename T> bool operator()(const T *bias, T *residual) const
    {
        for (int i = 0; i < 6; i++)
            residual[i] = bias[i] / BIAS_SPREAD[i / 3];
        return true;
    }
};

struct SizeOfGravity {
    template <typename T> bool operator()(const T *g, T *residual) const
    {
        residual[0] =
            (sqrt(g[0] * g[0] + g[1] * g[1] + g[2] * g[2]) - GRAVITY_M_S2) / GRAVITY_SPREAD_M_S2;
        return true;
    }
};

/* Three control points in a row. */
struct Even {
    double weight;
    template <typename T> bool operator()(const T *a, const T *b, const T *c, T *residual) const
    {
        for (int i = 0; i < 6; i++)
            residual[i] = weight * (a[i] - 2.0 * b[i] + c[i]);
        return true;
    }
};

double density(const InertialState &state, int part)
{
    const fovea_rig_imu &imu = state.input.imu;
    return std::max(part == 0 ? imu.gyro_noise : imu.acceleration_noise, NOISE_LEAST[part]);
}

double walk_density(const InertialState &state, int part)
{
    const fovea_rig_imu &imu = state.input.imu;
    return std::max(part == 0 ? imu.gyro_walk : imu.acceleration_walk, WALK_LEAST[part]);
}

/* ---- the start ------------------------------------------------------------------------------- */

Eigen::Matrix3d mean_rotation(const Eigen::Matrix3d &sum)
{
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
    const Eigen::Vector3d sign(1, 1, (svd.matrixU() * svd.matrixV().transpose()).determinant());
    return svd.matrixU() * sign.asDiagonal() * svd.matrixV().transpose();
}

double period_of(const std::vector<fovea_imu_sample> &samples)
{
    std::vector<double> steps;
    for (size_t i = 1; i < samples.size(); i++)
        steps.push_back(1e-9 * (double)(samples[i].stamp_ns - samples[i - 1].stamp_ns));
    return median(steps);
}

/* ---- the problem ----------------------------------------------------------------------------- */

void add(InertialState &state, ceres::Problem &problem, ceres::CostFunction *cost,
         const std::vector<double *> &blocks)
{
    problem.AddResidualBlock(cost, nullptr, blocks);
    state.terms.push_back({cost, blocks});
}

void add_pictures(InertialState &state, ceres::Problem &problem)
{
    const std::vector<Point> points = state.input.board.points();
    for (size_t i = 0; i < state.start.pictures.size(); i++) {
        const PosedPicture &picture = state.start.pictures[i];
        const InertialCamera &camera = state.input.cameras[picture.camera];
        std::vector<PictureCost::Corner> corners;
        if (!state.solution.left_out[picture.camera][picture.view].empty()) continue;
        for (size_t c = 0; c < points.size(); c++)
            if (picture.used[c])
                corners.push_back(
                    {state.T_world_board * Eigen::Vector3d(points[c][0], points[c][1], 0),
                     inertial_corner(state.input, picture, c)});
        if (corners.empty()) continue;
        auto *cost = new PictureCost(
            state.spline,
            {model_of(camera.camera), parameters_of(camera.camera), camera.T_cam_first,
             camera.readout_s, (double)camera.camera.height},
            std::move(corners), picture.time_s, state.middle_s(), state.clock[0], state.sigma_px);
        std::vector<double *> blocks;
        for (int j = 0; j < PictureCost::CONTROLS; j++)
            blocks.push_back(state.spline.control[(size_t)(cost->first() + j)].data());
        blocks.push_back(state.T_cam_imu.data());
        blocks.push_back(state.clock.data());
        add(state, problem, cost, blocks);
        state.pictures.push_back(cost);
        state.picture_of.push_back(i);
    }
}

void add_readings(InertialState &state, ceres::Problem &problem)
{
    const Spline &spline = state.spline;
    const fovea_rig_imu &imu = state.input.imu;
    const int per_stretch = state.stretch_segments();
    std::vector<std::vector<Reading>> by_segment((size_t)spline.segments());
    double weights[INERTIAL_PARTS];
    for (int part = 0; part < INERTIAL_PARTS; part++)
        weights[part] = std::sqrt(state.period_s) / (density(state, part) * state.excess[part]);
    for (const fovea_imu_sample &sample : state.input.samples) {
        const double time_s = 1e-9 * (double)(sample.stamp_ns - state.start.begin_ns);
        if (time_s < spline.begin_s || time_s >= spline.end_s()) continue;
        Reading reading = {time_s,
                           Eigen::Map<const Eigen::Vector3d>(sample.gyro),
                           Eigen::Map<const Eigen::Vector3d>(sample.acceleration),
                           {weights[0], weights[1]}};
        if (is_saturated(sample.gyro, imu.gyro_range)) reading.weights[0] = 0;
        if (is_saturated(sample.acceleration, imu.acceleration_range)) reading.weights[1] = 0;
        by_segment[(size_t)spline.segment(time_s)].push_back(reading);
    }
    for (int segment = 0; segment < spline.segments(); segment++) {
        std::vector<Reading> &readings = by_segment[(size_t)segment];
        if (readings.empty()) continue;
        const int stretch = segment / per_stretch;
        const double stretch_s = spline.step_s * per_stretch;
        auto *cost = new ReadingsCost(spline, segment, spline.begin_s + stretch * stretch_s,
                                      stretch_s, std::move(readings));
        std::vector<double *> blocks;
        for (int j = 0; j < SPLINE_ORDER; j++)
            blocks.push_back(state.spline.control[(size_t)(segment + j)].data());
        blocks.push_back(state.biases[(size_t)stretch].data());
        blocks.push_back(state.biases[(size_t)stretch + 1].data());
        blocks.push_back(state.gravity.data());
        add(state, problem, cost, blocks);
        state.readings.push_back(cost);
    }
}

void add_priors(InertialState &state, ceres::Problem &problem)
{
    const double stretch_s = state.spline.step_s * state.stretch_segments();
    Walk walk;
    for (int part = 0; part < INERTIAL_PARTS; part++)
        walk.weights[part] = 1 / (walk_density(state, part) * std::sqrt(stretch_s));
    add(state, problem, new ceres::AutoDiffCostFunction<FirstBias, 6, 6>(new FirstBias),
        {state.biases[0].data()});
    for (size_t i = 0; i + 1 < state.biases.size(); i++)
        add(state, problem, new ceres::AutoDiffCostFunction<Walk, 6, 6, 6>(new Walk(walk)),
            {state.biases[i].data(), state.biases[i + 1].data()});
    add(state, problem, new ceres::AutoDiffCostFunction<SizeOfGravity, 1, 3>(new SizeOfGravity),
        {state.gravity.data()});
    const Even even = {1 / (SECOND_SPREAD * state.spline.step_s * state.spline.step_s)};
    for (size_t i = 0; i + 2 < state.spline.control.size(); i++)
        add(state, problem, new ceres::AutoDiffCostFunction<Even, 6, 6, 6, 6>(new Even(even)),
            {state.spline.control[i].data(), state.spline.control[i + 1].data(),
             state.spline.control[i + 2].data()});
}

} // namespace

int InertialState::stretch_segments() const
{
    return std::max(1, (int)std::lround(BIAS_STRETCH_S / spline.step_s));
}

void begin_inertial(InertialState &state)
{
    const InertialStart &start = state.start;
    Rigid T_cam_imu;
    T_cam_imu.R = start.R_imu_cam.transpose();
    Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
    double squares = 0, freedom = 0; /* a pose takes six numbers of it */
    for (const PosedPicture &picture : start.pictures) {
        const auto corners = (double)std::count(picture.used.begin(), picture.used.end(), 1);
        sum += picture.T_board_first.R * T_cam_imu.R;
        squares += corners * picture.rms_px * picture.rms_px;
        freedom += 2 * corners - 6;
    }
    state.T_world_board.R = mean_rotation(sum).transpose();
    state.T_cam_imu = pose_of(T_cam_imu);
    state.clock = {start.shift_s, 0};
    state.sigma_px = std::sqrt(squares / std::max(1., freedom));
    state.period_s = period_of(state.input.samples);
    const Eigen::Vector3d gravity = state.T_world_board.R * start.gravity_m_s2;
    std::copy(gravity.data(), gravity.data() + 3, state.gravity.begin());
}

void lay_spline(InertialState &state, double knots_hz)
{
    const double step_s = 1 / knots_hz, shift_s = state.clock[0];
    const Rigid T_cam_imu = rigid_of(state.T_cam_imu);
    std::vector<double> times_s;
    std::vector<Eigen::Matrix<double, 6, 1>> values;
    Eigen::Vector3d last = Eigen::Vector3d::Zero();
    for (const PosedPicture &picture : state.start.pictures) {
        const Rigid T = state.T_world_board * picture.T_board_first * T_cam_imu;
        Eigen::Vector3d turn = angle_axis(T.R);
        const double angle = turn.norm();
        if (angle > 1e-6) { /* the same rotation by a whole turn less */
            const Eigen::Vector3d other = turn * (1 - 2 * EIGEN_PI / angle);
            if ((other - last).norm() < (turn - last).norm()) turn = other;
        }
        last = turn;
        times_s.push_back(picture.time_s + shift_s);
        values.emplace_back();
        values.back() << turn, T.t;
    }
    state.spline = Spline(times_s.front() - 2 * step_s, times_s.back() + 2 * step_s, step_s);
    fit_spline(times_s, values, state.spline);
    const int stretches =
        (state.spline.segments() + state.stretch_segments() - 1) / state.stretch_segments();
    const Eigen::Vector3d &bias = state.start.gyro_bias;
    state.biases.assign((size_t)stretches + 1, {bias[0], bias[1], bias[2], 0, 0, 0});
}

bool is_saturated(const double *values, double range)
{
    bool at_end = false;
    for (int i = 0; i < 3; i++)
        at_end |= range > 0 && std::fabs(values[i]) >= .999 * range;
    return at_end;
}

void build_inertial(InertialState &state, ceres::Problem &problem)
{
    state.terms.clear();
    state.pictures.clear();
    state.picture_of.clear();
    state.readings.clear();
    add_pictures(state, problem);
    add_readings(state, problem);
    add_priors(state, problem);
}

bool minimise_inertial(InertialState &state, ceres::Problem &problem)
{
    ceres::Solver::Options how;
    how.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
    how.max_num_iterations = 50;
    how.function_tolerance = 1e-9; /* of a cost of some ten thousand: far below one deviation */
    how.parameter_tolerance = 1e-12;
    how.logging_type = ceres::SILENT;
    FLAGS_minloglevel = google::GLOG_FATAL; /* a step that fails is tried again, smaller */
    problem.SetManifold(state.clock.data(), new ceres::SubsetManifold(2, {1}));
    ceres::Solver::Summary summary;
    ceres::Solve(how, &problem, &summary);
    return summary.IsSolutionUsable();
}

bool evaluate_term(const InertialTerm &term, Eigen::VectorXd &residuals,
                   std::vector<Eigen::MatrixXd> *by_block)
{
    const std::vector<int32_t> &sizes = term.cost->parameter_block_sizes();
    const int rows = term.cost->num_residuals();
    residuals.resize(rows);
    std::vector<std::vector<double>> memory;
    std::vector<double *> jacobians;
    for (const int32_t size : sizes)
        memory.emplace_back(by_block != nullptr ? (size_t)(size * rows) : 0);
    for (std::vector<double> &one : memory)
        jacobians.push_back(one.data());
    if (!term.cost->Evaluate(term.blocks.data(), residuals.data(),
                             by_block != nullptr ? jacobians.data() : nullptr))
        return false;
    if (by_block == nullptr) return true;
    by_block->clear();
    for (size_t b = 0; b < sizes.size(); b++)
        by_block->push_back(
            Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(
                memory[b].data(), rows, sizes[b]));
    return true;
}

} // namespace calibrate

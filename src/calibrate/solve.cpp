/* The solve: camera and poses of all views by Ceres, rejection, covariance. */
#include <Eigen/Dense>
#include <ceres/ceres.h>
#include <ceres/rotation.h>
#include <glog/logging.h>

#include "calibrate/calibrate.h"

#include <algorithm>
#include <cmath>
#include <map>

namespace calibrate
{
namespace
{

/* The camera as it is solved for: fx, fy / fx, cx, cy, coefficients. */
using Parameters = std::array<double, PARAMETERS_MAX>;

/* As fovea_camera_project; templated, for derivatives. False: behind a camera that sees forward. */
template <typename T> bool project(Model model, const T *camera, const T *point, T *pixel)
{
    const T *k = camera + 4;
    T x, y;
    if (model == Model::equidistant) {
        const T radius2 = point[0] * point[0] + point[1] * point[1];
        T scale;
        if (radius2 > 1e-18) {
            const T radius = sqrt(radius2), theta = atan2(radius, point[2]), t2 = theta * theta;
            scale = theta * (1.0 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3])))) / radius;
        } else {
            scale = 1.0 / point[2];
        }
        x = point[0] * scale;
        y = point[1] * scale;
    } else {
        if (!(point[2] > 1e-9)) return false;
        const T a = point[0] / point[2], b = point[1] / point[2], r2 = a * a + b * b;
        const T scale = (1.0 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]))) /
                        (1.0 + r2 * (k[5] + r2 * (k[6] + r2 * k[7])));
        x = a * scale + 2.0 * k[2] * a * b + k[3] * (r2 + 2.0 * a * a);
        y = b * scale + k[2] * (r2 + 2.0 * b * b) + 2.0 * k[3] * a * b;
    }
    pixel[0] = camera[0] * x + camera[2];
    pixel[1] = camera[0] * camera[1] * y + camera[3];
    return true;
}

/* One corner: predicted less found. The board's height at (x, y) of [-1, 1] is bend[0] (1 - x^2) +
 * bend[1] (1 - y^2). */
struct Corner {
    Model model;
    Point point;
    double x, y;
    Pixel found;
    template <typename T>
    bool operator()(const T *camera, const T *pose, const T *bend, T *residual) const
    {
        const T on_board[3] = {T(point[0]), T(point[1]),
                               bend[0] * (1.0 - x * x) + bend[1] * (1.0 - y * y)};
        T seen[3], pixel[2];
        ceres::AngleAxisRotatePoint(pose, on_board, seen);
        for (int i = 0; i < 3; i++)
            seen[i] += pose[3 + i];
        if (!project(model, camera, seen, pixel)) return false;
        residual[0] = pixel[0] - found[0];
        residual[1] = pixel[1] - found[1];
        return true;
    }
};
using CornerCost = ceres::AutoDiffCostFunction<Corner, 2, PARAMETERS_MAX, 6, 2>;

/* Coefficients of the rational model can replace each other, up to a pole inside the image that a
 * zero all but cancels. They are held near zero as if that had been measured: a coefficient of 1
 * counts as much as an error of 0.05 px in one corner. */
struct SmallCoefficients {
    enum { COUNT = 6 };
    static constexpr double WEIGHT_PX = .05;
    template <typename T> bool operator()(const T *camera, T *residual) const
    {
        static const int which[COUNT] = {0, 1, 4, 5, 6, 7};
        for (int i = 0; i < COUNT; i++)
            residual[i] = WEIGHT_PX * camera[4 + which[i]];
        return true;
    }
};
using SmallCost =
    ceres::AutoDiffCostFunction<SmallCoefficients, SmallCoefficients::COUNT, PARAMETERS_MAX>;

int extra_residuals(Model model)
{
    return model == Model::rational ? (int)SmallCoefficients::COUNT : 0;
}

struct State {
    const Board &board;
    const std::vector<View> &views;
    const SolveOptions &options;
    std::vector<Point> points;
    std::array<double, 2> extent = {0, 0}; /* of the points, from 0 */
    Parameters camera;
    std::array<double, 2> bend = {0, 0};
    std::vector<Pose> poses;
    std::vector<std::string> left_out;   /* per view */
    std::vector<std::vector<char>> used; /* per view and corner */

    State(const Board &of_board, const std::vector<View> &of_views, const SolveOptions &of_options)
        : board(of_board), views(of_views), options(of_options), points(of_board.points())
    {
        for (const Point &point : points)
            extent = {std::max(extent[0], point[0]), std::max(extent[1], point[1])};
        for (const View &view : views) {
            left_out.push_back(view.left_out);
            used.emplace_back();
            for (const Pixel &corner : view.corners)
                used.back().push_back(seen(corner));
            if (view.corners.size() != points.size() && view.left_out.empty())
                left_out.back() = "no board was found";
        }
    }
    bool takes(size_t view) const
    {
        return left_out[view].empty();
    }
    Corner corner(size_t view, size_t c) const
    {
        return {options.model, points[c], 2 * points[c][0] / extent[0] - 1,
                2 * points[c][1] / extent[1] - 1, views[view].corners[c]};
    }
};

enum Stage { FOCAL_ONLY, WHOLE_CAMERA, POSES_ONLY };

/* Parameters that stay as they are. */
std::vector<int> held_parameters(const SolveOptions &options, Stage stage)
{
    std::vector<int> held;
    for (int i = 1; i < PARAMETERS_MAX; i++) {
        const bool by_model = i >= 4 + coefficient_count(options.model);
        if (by_model || (i == 1 && options.equal_focal) || stage == FOCAL_ONLY) held.push_back(i);
    }
    return held;
}

void build(State &state, Stage stage, double loss_px, ceres::Problem &problem)
{
    for (size_t v = 0; v < state.views.size(); v++) {
        if (!state.takes(v)) continue;
        for (size_t c = 0; c < state.points.size(); c++) {
            if (!state.used[v][c]) continue;
            problem.AddResidualBlock(new CornerCost(new Corner(state.corner(v, c))),
                                     loss_px > 0 ? new ceres::CauchyLoss(loss_px) : nullptr,
                                     state.camera.data(), state.poses[v].data(), state.bend.data());
        }
    }
    if (extra_residuals(state.options.model) > 0) /* the last residuals */
        problem.AddResidualBlock(new SmallCost(new SmallCoefficients()), nullptr,
                                 state.camera.data());
    if (stage == POSES_ONLY)
        problem.SetParameterBlockConstant(state.camera.data());
    else if (const std::vector<int> held = held_parameters(state.options, stage); !held.empty())
        problem.SetManifold(state.camera.data(), new ceres::SubsetManifold(PARAMETERS_MAX, held));
    if (!state.options.bend || stage != WHOLE_CAMERA)
        problem.SetParameterBlockConstant(state.bend.data());
}

bool minimise(State &state, Stage stage, double loss_px)
{
    ceres::Problem problem;
    build(state, stage, loss_px, problem);
    if (problem.NumParameterBlocks() < 3) return false;
    ceres::Solver::Options how;
    how.linear_solver_type = ceres::DENSE_SCHUR;
    how.linear_solver_ordering = std::make_shared<ceres::ParameterBlockOrdering>();
    for (size_t v = 0; v < state.views.size(); v++)
        if (problem.HasParameterBlock(state.poses[v].data()))
            how.linear_solver_ordering->AddElementToGroup(state.poses[v].data(), 0);
    how.linear_solver_ordering->AddElementToGroup(state.camera.data(), 1);
    how.linear_solver_ordering->AddElementToGroup(state.bend.data(), 1);
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

/* Distance of each corner of a view from where the camera sees it; infinite behind the camera, NaN
 * where the corner was not seen. */
std::vector<double> errors_of(const State &state, size_t v)
{
    std::vector<double> errors;
    if (state.views[v].corners.size() != state.points.size()) return errors;
    for (size_t c = 0; c < state.points.size(); c++) {
        double residual[2];
        const bool ahead = state.corner(v, c)(state.camera.data(), state.poses[v].data(),
                                              state.bend.data(), residual);
        errors.push_back(!seen(state.views[v].corners[c]) ? NAN
                         : ahead                          ? std::hypot(residual[0], residual[1])
                                                          : INFINITY);
    }
    return errors;
}

/* Predicted less found, of corners that are used; NaN of the others. */
std::vector<Pixel> residuals_of(const State &state, size_t v)
{
    std::vector<Pixel> residuals(state.used[v].size(), Pixel{NAN, NAN});
    for (size_t c = 0; state.takes(v) && c < residuals.size(); c++)
        if (state.used[v][c])
            (void)state.corner(v, c)(state.camera.data(), state.poses[v].data(), state.bend.data(),
                                     residuals[c].data());
    return residuals;
}

/* Of the values that are known. */
double median(std::vector<double> values)
{
    values.erase(std::remove_if(values.begin(), values.end(),
                                [](double value) { return std::isnan(value); }),
                 values.end());
    if (values.empty()) return 0;
    std::nth_element(values.begin(), values.begin() + values.size() / 2, values.end());
    return values[values.size() / 2];
}

/* Corners further off than five standard deviations (of Gaussian noise, four in a million are), and
 * views whose middle corner is far worse than that of the others. True: the choice has changed. */
constexpr double CORNER_SIGMAS = 5, VIEW_RATIO = 3.5, VIEW_CORNERS_SHARE = .6;
/* Median of the length of a vector of two Gaussian coordinates. */
constexpr double RAYLEIGH_MEDIAN = 1.17741;

bool reject(State &state)
{
    std::vector<std::vector<double>> errors;
    std::vector<double> of_used, medians;
    for (size_t v = 0; v < state.views.size(); v++) {
        errors.push_back(errors_of(state, v));
        if (!state.takes(v)) continue;
        medians.push_back(median(errors[v]));
        of_used.insert(of_used.end(), errors[v].begin(), errors[v].end());
    }
    const double noise = median(of_used) / RAYLEIGH_MEDIAN, usual = median(medians);
    bool changed = false;
    for (size_t v = 0; v < state.views.size(); v++) {
        if (!state.takes(v)) continue;
        size_t kept = 0, there = 0;
        for (size_t c = 0; c < errors[v].size(); c++) {
            if (!seen(state.views[v].corners[c])) continue;
            there++;
            const char use = errors[v][c] <= CORNER_SIGMAS * noise + 1e-9;
            changed |= use != state.used[v][c];
            state.used[v][c] = use;
            kept += use;
        }
        const double worst = median(errors[v]);
        const bool few = (double)kept < VIEW_CORNERS_SHARE * (double)there;
        if (worst <= VIEW_RATIO * usual + 1e-9 && !few) continue;
        char text[160];
        snprintf(text, sizeof text,
                 "its corners are %.2f px off where the others' are %.2f px: another board, a bent "
                 "one, or a blurred picture",
                 worst, usual);
        state.left_out[v] = text;
        changed = true;
    }
    return changed;
}

size_t views_used(const State &state)
{
    size_t count = 0;
    for (size_t v = 0; v < state.views.size(); v++)
        count += state.takes(v);
    return count;
}

/* ---- covariance ------------------------------------------------------------------------------ */

/* Left Jacobian of the rotation: how the rotation moves, as a vector in the camera, with the
 * angle-axis. */
Eigen::Matrix3d left_jacobian(const Eigen::Vector3d &axis)
{
    const double angle = axis.norm();
    Eigen::Matrix3d cross;
    cross << 0, -axis[2], axis[1], axis[2], 0, -axis[0], -axis[1], axis[0], 0;
    if (angle < 1e-6) return Eigen::Matrix3d::Identity() + .5 * cross;
    return Eigen::Matrix3d::Identity() + (1 - std::cos(angle)) / (angle * angle) * cross +
           (angle - std::sin(angle)) / (angle * angle * angle) * cross * cross;
}

struct Normal {
    Eigen::MatrixXd covariance; /* of the tangent space: free camera parameters, bend, poses */
    std::vector<int> free_parameters;
    std::vector<size_t> views;
    int poses_at = 0; /* column of the first pose */
};

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

bool covariance_of(State &state, Solution &solution, Normal &normal)
{
    ceres::Problem problem;
    build(state, WHOLE_CAMERA, 0, problem);
    ceres::Problem::EvaluateOptions what;
    what.parameter_blocks.push_back(state.camera.data());
    const std::vector<int> held = held_parameters(state.options, WHOLE_CAMERA);
    for (int i = 0; i < PARAMETERS_MAX; i++)
        if (std::find(held.begin(), held.end(), i) == held.end())
            normal.free_parameters.push_back(i);
    normal.poses_at = (int)normal.free_parameters.size();
    if (state.options.bend) {
        what.parameter_blocks.push_back(state.bend.data());
        normal.poses_at += 2;
    }
    for (size_t v = 0; v < state.views.size(); v++) {
        if (!problem.HasParameterBlock(state.poses[v].data())) continue;
        what.parameter_blocks.push_back(state.poses[v].data());
        normal.views.push_back(v);
    }
    std::vector<double> residuals;
    ceres::CRSMatrix jacobian;
    if (!problem.Evaluate(what, nullptr, &residuals, nullptr, &jacobian)) return false;
    Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(jacobian.num_cols, jacobian.num_cols);
    for (int row = 0; row < jacobian.num_rows; row++)
        for (int a = jacobian.rows[row]; a < jacobian.rows[row + 1]; a++)
            for (int b = jacobian.rows[row]; b < jacobian.rows[row + 1]; b++)
                matrix(jacobian.cols[a], jacobian.cols[b]) +=
                    jacobian.values[a] * jacobian.values[b];
    double squares = 0;
    residuals.resize(residuals.size() - (size_t)extra_residuals(state.options.model));
    for (const double residual : residuals)
        squares += residual * residual;
    const int freedom = (int)residuals.size() - jacobian.num_cols;
    if (freedom <= 0) return false;
    solution.corners_used = (int)residuals.size() / 2;
    solution.rms_px = std::sqrt(squares / solution.corners_used);
    solution.noise_px = std::sqrt(squares / freedom);
    return invert(matrix, solution.noise_px, normal.covariance);
}

/* From (fx, fy / fx) to (fx, fy). */
void parameter_covariance(const State &state, const Normal &normal, Solution &solution)
{
    const int count = (int)normal.free_parameters.size();
    Eigen::MatrixXd change = Eigen::MatrixXd::Zero(PARAMETERS_MAX, count);
    for (int i = 0; i < count; i++) {
        const int parameter = normal.free_parameters[(size_t)i];
        if (parameter == 0) change(1, i) = state.camera[1];
        change(parameter, i) = parameter == 1 ? state.camera[0] : 1;
    }
    const Eigen::MatrixXd covariance =
        change * normal.covariance.topLeftCorner(count, count) * change.transpose();
    solution.covariance.resize(PARAMETERS_MAX * PARAMETERS_MAX);
    for (int i = 0; i < PARAMETERS_MAX; i++) {
        solution.stdev[(size_t)i] = std::sqrt(covariance(i, i));
        for (int j = 0; j < PARAMETERS_MAX; j++)
            solution.covariance[(size_t)(i * PARAMETERS_MAX + j)] = covariance(i, j);
    }
}

/* Projection of a direction fixed in the scene, which the boards define: when the camera's
 * parameters change, so do the boards' rotations, and their mean change moves the direction. As
 * mrcal's "mean-pcam" at infinity (https://mrcal.secretsauce.net/uncertainty.html). */
double projection_stdev(const State &state, const Normal &normal, const fovea_camera &camera,
                        const Pixel &pixel)
{
    using Jet = ceres::Jet<double, PARAMETERS_MAX + 3>;
    double bearing[3];
    if (fovea_camera_unproject(&camera, pixel.data(), bearing, nullptr) != FOVEA_OK) return NAN;
    std::array<Jet, PARAMETERS_MAX> parameters;
    Jet point[3], seen[2];
    for (int i = 0; i < PARAMETERS_MAX; i++)
        parameters[(size_t)i] = Jet(state.camera[(size_t)i], i);
    for (int i = 0; i < 3; i++)
        point[i] = Jet(bearing[i], PARAMETERS_MAX + i);
    if (!project(state.options.model, parameters.data(), point, seen)) return NAN;
    Eigen::Matrix<double, 2, Eigen::Dynamic> change =
        Eigen::Matrix<double, 2, Eigen::Dynamic>::Zero(2, normal.covariance.cols());
    Eigen::Matrix3d cross; /* a rotation by r moves the bearing b by r x b = -[b]x r */
    cross << 0, bearing[2], -bearing[1], -bearing[2], 0, bearing[0], bearing[1], -bearing[0], 0;
    for (int axis = 0; axis < 2; axis++) {
        for (size_t i = 0; i < normal.free_parameters.size(); i++)
            change(axis, (int)i) = seen[axis].v[normal.free_parameters[i]];
        const Eigen::RowVector3d by_point = seen[axis].v.tail<3>().transpose();
        for (size_t i = 0; i < normal.views.size(); i++) {
            const Pose &pose = state.poses[normal.views[i]];
            change.block<1, 3>(axis, normal.poses_at + 6 * (int)i) =
                by_point * cross * left_jacobian({pose[0], pose[1], pose[2]}) /
                (double)normal.views.size();
        }
    }
    const Eigen::Matrix2d spread = change * normal.covariance * change.transpose();
    return std::sqrt(Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(spread).eigenvalues()[1]);
}

void uncertainty_of(const State &state, const Normal &normal, fovea_camera camera, int columns,
                    int rows, Uncertainty &map)
{
    map.columns = columns;
    map.rows = rows;
    map.stdev_px.assign((size_t)(map.columns * map.rows), NAN);
    if (fovea_camera_prepare(&camera, nullptr) != FOVEA_OK) return;
    for (int j = 0; j < map.rows; j++)
        for (int i = 0; i < map.columns; i++)
            map.stdev_px[(size_t)(j * map.columns + i)] =
                projection_stdev(state, normal, camera,
                                 {(i + .5) * camera.width / map.columns - .5,
                                  (j + .5) * camera.height / map.rows - .5});
}

fovea_camera camera_of(const State &state, int width, int height)
{
    fovea_camera camera = {};
    camera.width = width;
    camera.height = height;
    camera.lens =
        state.options.model == Model::equidistant ? FOVEA_LENS_EQUIDISTANT : FOVEA_LENS_RADTAN;
    camera.fx = state.camera[0];
    camera.fy = state.camera[0] * state.camera[1];
    camera.cx = state.camera[2];
    camera.cy = state.camera[3];
    for (int i = 0; i < FOVEA_LENS_COEFFICIENTS; i++)
        camera.k[i] = state.camera[(size_t)(4 + i)];
    return camera;
}

Parameters parameters_of(const fovea_camera &camera)
{
    Parameters parameters = {camera.fx, camera.fy / camera.fx, camera.cx, camera.cy};
    std::copy(camera.k, camera.k + FOVEA_LENS_COEFFICIENTS, parameters.begin() + 4);
    return parameters;
}

/* From a rough camera to the last one, leaving out on the way what does not fit. */
bool refine(State &state, std::string &error)
{
    constexpr double robust_px = 1;
    constexpr int rounds_max = 10;
    bool solved =
        minimise(state, FOCAL_ONLY, 4 * robust_px) && minimise(state, WHOLE_CAMERA, robust_px);
    for (int round = 0; solved && state.options.reject && round < rounds_max; round++) {
        const bool changed = reject(state);
        if (views_used(state) < 2) break;
        if (round > 0 && !changed) break;
        solved = minimise(state, WHOLE_CAMERA, 0);
    }
    if (solved && !state.options.reject) solved = minimise(state, WHOLE_CAMERA, 0);
    if (!solved) {
        error = "the solve does not converge: the pictures do not determine this model";
        return false;
    }
    if (views_used(state) >= 2) return true;
    error = "found fewer than 2 pictures that agree with each other, expected 2 or more";
    return false;
}

} // namespace

bool solve(const Board &board, const std::vector<View> &views, int width, int height,
           const SolveOptions &options, Solution &solution, std::string &error)
{
    State state(board, views, options);
    fovea_camera guess;
    if (!initial_guess(board, views, width, height, options.model == Model::equidistant, guess,
                       state.poses, error))
        return false;
    state.camera = parameters_of(guess);
    if (!refine(state, error)) return false;
    Normal normal;
    solution = Solution();
    solution.model = options.model;
    solution.camera = camera_of(state, width, height);
    if (!covariance_of(state, solution, normal)) {
        error = "the pictures do not determine the camera: more views, more tilted, are needed";
        return false;
    }
    parameter_covariance(state, normal, solution);
    uncertainty_of(state, normal, solution.camera, 10, 10, solution.uncertainty);
    uncertainty_of(state, normal, solution.camera, 32, 24, solution.uncertainty_fine);
    solution.poses = state.poses;
    solution.bend_m = state.bend;
    solution.left_out = state.left_out;
    for (size_t v = 0; v < views.size(); v++) {
        solution.errors_px.push_back(errors_of(state, v));
        solution.residuals_px.push_back(residuals_of(state, v));
        for (size_t c = 0; state.takes(v) && c < state.used[v].size(); c++)
            if (!state.used[v][c] && seen(views[v].corners[c]))
                solution.corners_left_out.push_back({(int)v, (int)c, solution.errors_px[v][c]});
    }
    return true;
}

double held_out_rms_px(const Board &board, const std::vector<View> &views, const Solution &solution,
                       int folds, const SolveOptions &options)
{
    State all(board, views, options);
    all.left_out = solution.left_out;
    for (const LeftOut &corner : solution.corners_left_out)
        all.used[(size_t)corner.view][(size_t)corner.corner] = 0;
    std::vector<size_t> used;
    for (size_t v = 0; v < views.size(); v++)
        if (all.takes(v)) used.push_back(v);
    double squares = 0;
    size_t corners = 0;
    for (int fold = 0; fold < folds; fold++) {
        State others = all, held = all;
        for (size_t i = 0; i < used.size(); i++)
            ((int)i % folds == fold ? others : held).left_out[used[i]] = "of the other part";
        if (views_used(others) < 2 || views_used(held) == 0) continue;
        others.poses = solution.poses;
        others.camera = parameters_of(solution.camera);
        others.bend = solution.bend_m;
        if (!minimise(others, WHOLE_CAMERA, 0)) return -1;
        held.poses = solution.poses;
        held.camera = others.camera;
        held.bend = others.bend;
        if (!minimise(held, POSES_ONLY, 0)) return -1;
        for (const size_t v : used) {
            if (!held.takes(v)) continue;
            const std::vector<double> errors = errors_of(held, v);
            for (size_t c = 0; c < errors.size(); c++) {
                if (!held.used[v][c]) continue;
                squares += errors[c] * errors[c];
                corners++;
            }
        }
    }
    return corners > 0 ? std::sqrt(squares / (double)corners) : -1;
}

double held_camera_rms_px(const Board &board, const std::vector<View> &views,
                          const Solution &solution, const fovea_camera &camera)
{
    SolveOptions options;
    options.model = solution.model;
    State state(board, views, options);
    state.left_out = solution.left_out;
    for (const LeftOut &corner : solution.corners_left_out)
        state.used[(size_t)corner.view][(size_t)corner.corner] = 0;
    state.camera = parameters_of(camera);
    state.bend = solution.bend_m;
    state.poses = solution.poses;
    for (Pose &pose : state.poses) /* as large in the picture as before */
        pose[5] *= camera.fx / solution.camera.fx;
    if (!minimise(state, POSES_ONLY, 0)) return -1;
    double squares = 0;
    size_t corners = 0;
    for (size_t v = 0; v < views.size(); v++) {
        if (!state.takes(v)) continue;
        const std::vector<double> errors = errors_of(state, v);
        for (size_t c = 0; c < errors.size(); c++) {
            if (!state.used[v][c]) continue;
            squares += errors[c] * errors[c];
            corners++;
        }
    }
    return corners > 0 ? std::sqrt(squares / (double)corners) : -1;
}

} // namespace calibrate

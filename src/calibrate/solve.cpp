/* The solve: camera and poses of all views by Ceres, rejection, covariance. */
#include "calibrate/corner_cost.h"
#include "calibrate/least_squares.h"

#include <algorithm>
#include <cmath>
#include <map>

namespace calibrate
{
namespace
{

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
        const bool without_k3 = options.four_coefficients && options.model == Model::radtan;
        const bool by_model = i >= 4 + coefficient_count(options.model) || (i == 8 && without_k3);
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
            problem.AddResidualBlock(new CornerCost(state.corner(v, c)),
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
    std::vector<double *> poses;
    for (Pose &pose : state.poses)
        poses.push_back(pose.data());
    return solve_least_squares(problem, poses, {state.camera.data(), state.bend.data()});
}

/* Distance of each corner of a view from where the camera sees it; infinite behind the camera, NaN
 * where the corner was not seen. */
std::vector<double> errors_of(const State &state, size_t v)
{
    std::vector<double> errors;
    if (state.views[v].corners.size() != state.points.size()) return errors;
    for (size_t c = 0; c < state.points.size(); c++) {
        double residual[2];
        const bool ahead = state.corner(v, c).residual(state.camera.data(), state.poses[v].data(),
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
            (void)state.corner(v, c).residual(state.camera.data(), state.poses[v].data(),
                                              state.bend.data(), residuals[c].data());
    return residuals;
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

struct Normal {
    Eigen::MatrixXd covariance; /* of the tangent space: free camera parameters, bend, poses */
    std::vector<int> free_parameters;
    std::vector<size_t> views;
    int poses_at = 0; /* column of the first pose */
};

bool covariance_of(State &state, Solution &solution, Normal &normal)
{
    ceres::Problem problem;
    build(state, WHOLE_CAMERA, 0, problem);
    std::vector<double *> blocks = {state.camera.data()};
    const std::vector<int> held = held_parameters(state.options, WHOLE_CAMERA);
    for (int i = 0; i < PARAMETERS_MAX; i++)
        if (std::find(held.begin(), held.end(), i) == held.end())
            normal.free_parameters.push_back(i);
    normal.poses_at = (int)normal.free_parameters.size();
    if (state.options.bend) {
        blocks.push_back(state.bend.data());
        normal.poses_at += 2;
    }
    for (size_t v = 0; v < state.views.size(); v++) {
        if (!problem.HasParameterBlock(state.poses[v].data())) continue;
        blocks.push_back(state.poses[v].data());
        normal.views.push_back(v);
    }
    SolveError found;
    if (!covariance(problem, blocks, extra_residuals(state.options.model), normal.covariance,
                    found))
        return false;
    solution.corners_used = (int)found.residuals / 2;
    solution.rms_px = found.rms * std::sqrt(2.);
    solution.noise_px = found.noise;
    return true;
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

/* Covariance of the free camera parameters and of the mean rotation of the boards. */
Eigen::MatrixXd mean_rotation_covariance(const State &state, const Normal &normal)
{
    const auto free = (Eigen::Index)normal.free_parameters.size();
    Eigen::MatrixXd change = Eigen::MatrixXd::Zero(free + 3, normal.covariance.cols());
    change.topLeftCorner(free, free).setIdentity();
    for (size_t i = 0; i < normal.views.size(); i++) {
        const Pose &pose = state.poses[normal.views[i]];
        change.block<3, 3>(free, normal.poses_at + 6 * (int)i) =
            left_jacobian({pose[0], pose[1], pose[2]}) / (double)normal.views.size();
    }
    return change * normal.covariance * change.transpose();
}

/* Projection of a direction fixed in the scene, which the boards define: when the camera's
 * parameters change, so do the boards' rotations, and their mean change moves the direction. As
 * mrcal's "mean-pcam" at infinity (https://mrcal.secretsauce.net/uncertainty.html). */
double projection_stdev(const State &state, const Normal &normal, const Eigen::MatrixXd &spreads,
                        const fovea_camera &camera, const Pixel &pixel)
{
    double bearing[3], seen[2];
    ProjectionDerivatives by;
    if (fovea_camera_unproject(&camera, pixel.data(), bearing, nullptr) != FOVEA_OK) return NAN;
    if (!project_derivatives(state.options.model, state.camera.data(), bearing, seen, by))
        return NAN;
    const auto free = (Eigen::Index)normal.free_parameters.size();
    Eigen::Matrix<double, 2, Eigen::Dynamic> change(2, free + 3);
    for (Eigen::Index i = 0; i < free; i++)
        change.col(i) = by.by_camera.col(normal.free_parameters[(size_t)i]);
    /* A rotation by r moves the bearing b by r x b = -[b]x r. */
    change.rightCols<3>() = -by.by_point * cross_matrix(Eigen::Vector3d(bearing));
    const Eigen::Matrix2d spread = change * spreads * change.transpose();
    return std::sqrt(Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(spread).eigenvalues()[1]);
}

void uncertainty_of(const State &state, const Normal &normal, fovea_camera camera, int columns,
                    int rows, Uncertainty &map)
{
    map.columns = columns;
    map.rows = rows;
    map.stdev_px.assign((size_t)(map.columns * map.rows), NAN);
    if (fovea_camera_prepare(&camera, nullptr) != FOVEA_OK) return;
    const Eigen::MatrixXd spreads = mean_rotation_covariance(state, normal);
    for (int j = 0; j < map.rows; j++)
        for (int i = 0; i < map.columns; i++)
            map.stdev_px[(size_t)(j * map.columns + i)] =
                projection_stdev(state, normal, spreads, camera,
                                 {(i + .5) * camera.width / map.columns - .5,
                                  (j + .5) * camera.height / map.rows - .5});
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
    solution.camera = camera_of(state.options.model, state.camera, width, height);
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

/* The joint solve of several cameras, rejection, covariance. */
#include "calibrate/rig.h"

#include "calibrate/corner_cost.h"
#include "calibrate/least_squares.h"
#include "calibrate/rig_start.h"

#include <cmath>
#include <numeric>

namespace calibrate
{
namespace
{

constexpr double ROBUST_PX = 1;

struct State {
    const std::vector<RigInput> &inputs;
    std::vector<Point> points;
    std::vector<Parameters> lenses;
    std::vector<Pose> T_cam_first, T_first_board;
    RigSolution choice; /* left_out, used and turned */

    State(const Board &board, const std::vector<RigInput> &of_inputs, const RigSolution &start)
        : inputs(of_inputs), points(board.points()), T_first_board(start.poses), choice(start)
    {
        for (const RigCamera &camera : start.cameras) {
            lenses.push_back(parameters_of(camera.camera));
            T_cam_first.push_back(camera.T_cam_first);
        }
    }
    size_t cameras() const
    {
        return inputs.size();
    }
    size_t instants() const
    {
        return T_first_board.size();
    }
    bool takes(size_t camera, size_t view) const
    {
        return choice.left_out[camera][view].empty();
    }
    RigCorner corner(size_t camera, size_t view, size_t c) const
    {
        return {inputs[camera].model, points[c],
                rig_corner(inputs[camera], choice.turned[camera][view] != 0, view, c)};
    }
    /* False: behind the camera. */
    bool residual(size_t camera, size_t view, size_t c, double out[2]) const
    {
        return corner(camera, view, c)
            .residual(lenses[camera].data(), T_cam_first[camera].data(), T_first_board[view].data(),
                      out);
    }
};

std::vector<int> held_parameters(const RigInput &input)
{
    std::vector<int> held;
    for (int i = 4 + coefficient_count(input.model); i < PARAMETERS_MAX; i++)
        held.push_back(i);
    if (input.four_coefficients && input.model == Model::radtan) held.insert(held.begin(), 8);
    return held;
}

/* Measurements first; the residuals that hold rational coefficients are the last. */
int build(State &state, double loss_px, ceres::Problem &problem)
{
    for (size_t k = 0; k < state.cameras(); k++)
        for (size_t v = 0; v < state.instants(); v++)
            for (size_t c = 0; state.takes(k, v) && c < state.points.size(); c++)
                if (state.choice.used[k][v][c])
                    problem.AddResidualBlock(new RigCornerCost(state.corner(k, v, c)),
                                             loss_px > 0 ? new ceres::CauchyLoss(loss_px) : nullptr,
                                             state.lenses[k].data(), state.T_cam_first[k].data(),
                                             state.T_first_board[v].data());
    int extra = 0;
    for (size_t k = 0; k < state.cameras(); k++) {
        const RigInput &input = state.inputs[k];
        if (!problem.HasParameterBlock(state.lenses[k].data())) continue;
        if (k == 0) problem.SetParameterBlockConstant(state.T_cam_first[0].data());
        if (input.held) {
            problem.SetParameterBlockConstant(state.lenses[k].data());
            continue;
        }
        if (const std::vector<int> held = held_parameters(input); !held.empty())
            problem.SetManifold(state.lenses[k].data(),
                                new ceres::SubsetManifold(PARAMETERS_MAX, held));
        if (extra_residuals(input.model) == 0) continue;
        problem.AddResidualBlock(new SmallCost(new SmallCoefficients()), nullptr,
                                 state.lenses[k].data());
        extra += extra_residuals(input.model);
    }
    return extra;
}

bool minimise(State &state, double loss_px)
{
    ceres::Problem problem;
    build(state, loss_px, problem);
    std::vector<double *> poses, rest;
    for (Pose &pose : state.T_first_board)
        poses.push_back(pose.data());
    for (size_t k = 0; k < state.cameras(); k++) {
        rest.push_back(state.lenses[k].data());
        rest.push_back(state.T_cam_first[k].data());
    }
    return problem.NumResidualBlocks() > 0 && solve_least_squares(problem, poses, rest);
}

/* ---- rejection ------------------------------------------------------------------------------- */

/* As of single cameras (solve.cpp), with the noise of each camera by itself. */
constexpr double CORNER_SIGMAS = 5, VIEW_RATIO = 3.5, RAYLEIGH_MEDIAN = 1.17741;

/* Distances of the corners of a view that were seen. */
std::vector<double> errors_of(const State &state, size_t k, size_t v)
{
    std::vector<double> errors;
    for (size_t c = 0; c < state.points.size(); c++) {
        double residual[2];
        if (!seen(state.corner(k, v, c).found)) continue;
        errors.push_back(state.residual(k, v, c, residual) ? std::hypot(residual[0], residual[1])
                                                           : INFINITY);
    }
    return errors;
}

bool reject(State &state)
{
    bool changed = false;
    for (size_t k = 0; k < state.cameras(); k++) {
        std::vector<double> all, medians;
        for (size_t v = 0; v < state.instants(); v++) {
            if (!state.takes(k, v)) continue;
            const std::vector<double> errors = errors_of(state, k, v);
            all.insert(all.end(), errors.begin(), errors.end());
            medians.push_back(median(errors));
        }
        const double limit = CORNER_SIGMAS * median(all) / RAYLEIGH_MEDIAN + 1e-9;
        const double usual = median(medians);
        for (size_t v = 0; v < state.instants(); v++) {
            if (!state.takes(k, v)) continue;
            for (size_t c = 0; c < state.points.size(); c++) {
                double residual[2];
                const char use = seen(state.corner(k, v, c).found) &&
                                 state.residual(k, v, c, residual) &&
                                 std::hypot(residual[0], residual[1]) <= limit;
                changed |= use != state.choice.used[k][v][c];
                state.choice.used[k][v][c] = use;
            }
            const double its = median(errors_of(state, k, v));
            if (its <= VIEW_RATIO * usual + 1e-9) continue;
            char text[160];
            snprintf(text, sizeof text,
                     "its corners are %.2f px off where the others' are %.2f px: not taken at the "
                     "instant of the other cameras' pictures, or blurred",
                     its, usual);
            state.choice.left_out[k][v] = text;
            changed = true;
        }
    }
    return changed;
}

bool refine(State &state)
{
    constexpr int rounds_max = 10;
    bool solved = minimise(state, ROBUST_PX);
    for (int round = 0; solved && round < rounds_max; round++) {
        if (!reject(state) && round > 0) break;
        solved = minimise(state, 0);
    }
    return solved;
}

/* ---- what is found --------------------------------------------------------------------------- */

/* Per camera: error, counts, and the error of the same corners in pictures posed alone. */
void measure(const Board &board, const State &state, RigSolution &solution)
{
    for (size_t k = 0; k < state.cameras(); k++) {
        RigCamera &camera = solution.cameras[k];
        fovea_camera prepared = camera.camera;
        const bool sees = fovea_camera_prepare(&prepared, nullptr) == FOVEA_OK;
        double squares = 0, alone = 0;
        int alone_count = 0;
        for (size_t v = 0; v < state.instants(); v++) {
            if (!state.takes(k, v)) continue;
            View view = state.inputs[k].views[v];
            int others = 0, count = 0;
            for (size_t other = 0; other < state.cameras(); other++)
                others += other != k && state.takes(other, v);
            for (size_t c = 0; c < state.points.size(); c++) {
                double residual[2];
                view.corners[c] = {NAN, NAN};
                if (!state.choice.used[k][v][c] || !state.residual(k, v, c, residual)) continue;
                squares += residual[0] * residual[0] + residual[1] * residual[1];
                view.corners[c] = state.corner(k, v, c).found;
                count++;
            }
            Pose pose;
            double rms_px;
            if (sees && pose_view(board, prepared, view, pose, rms_px)) {
                alone += count * rms_px * rms_px;
                alone_count += count;
            }
            camera.views_used++;
            camera.views_shared += others > 0;
            camera.corners_used += count;
        }
        camera.rms_px = std::sqrt(squares / std::max(1, camera.corners_used));
        camera.alone_rms_px = std::sqrt(alone / std::max(1, alone_count));
    }
}

/* Covariance of lenses and places: where each begins in it, -1: held. */
struct Spread {
    Eigen::MatrixXd matrix;
    std::vector<std::array<int, 2>> at; /* per camera: lens, place */
};

void set_deviations(const State &state, const Spread &spread, size_t k, RigCamera &camera)
{
    const int lens = spread.at[k][0], place = spread.at[k][1];
    if (place >= 0) {
        const Eigen::Matrix<double, 6, 6> change = change_of_place(camera.T_cam_first);
        const Eigen::Matrix<double, 6, 6> matrix =
            change * spread.matrix.block<6, 6>(place, place) * change.transpose();
        for (int i = 0; i < 6; i++)
            camera.stdev[(size_t)i] = std::sqrt(matrix(i, i));
    }
    if (lens < 0) return;
    const std::vector<int> held = held_parameters(state.inputs[k]);
    int i = lens;
    for (int parameter = 0; parameter < PARAMETERS_MAX; parameter++)
        if (std::find(held.begin(), held.end(), parameter) == held.end()) {
            camera.lens_stdev[(size_t)parameter] = std::sqrt(spread.matrix(i, i));
            i++;
        }
    /* from (fx, fy / fx) to fy */
    const Eigen::RowVector2d fy(state.lenses[k][1], state.lenses[k][0]);
    camera.lens_stdev[1] =
        std::sqrt((fy * spread.matrix.block<2, 2>(lens, lens) * fy.transpose()).value());
}

/* The lenses of the first camera and of another, and the other's place, of which one number after
 * the other is moved. */
struct Transfer {
    std::array<const RigInput *, 2> inputs;
    std::array<Parameters, 2> lenses;
    Pose T_cam_first;

    /* Pixels of the first camera, seen far away, in the other one; NaN: not seen there. */
    std::vector<Pixel> operator()(const std::vector<Pixel> &pixels) const
    {
        std::vector<Pixel> found(pixels.size(), Pixel{NAN, NAN});
        fovea_camera cameras[2];
        for (size_t i = 0; i < 2; i++) {
            const fovea_camera &size = inputs[i]->camera;
            cameras[i] = camera_of(inputs[i]->model, lenses[i], size.width, size.height);
            if (fovea_camera_prepare(&cameras[i], nullptr) != FOVEA_OK) return found;
        }
        const Eigen::Matrix3d R = rigid_of(T_cam_first).R;
        for (size_t i = 0; i < pixels.size(); i++) {
            double bearing[3], seen_at[2];
            if (fovea_camera_unproject(&cameras[0], pixels[i].data(), bearing, nullptr) != FOVEA_OK)
                continue;
            const Eigen::Vector3d there = R * Eigen::Vector3d(bearing[0], bearing[1], bearing[2]);
            if (fovea_camera_project(&cameras[1], there.data(), seen_at, nullptr) == FOVEA_OK &&
                seen_at[0] >= 0 && seen_at[1] >= 0 && seen_at[0] < cameras[1].width &&
                seen_at[1] < cameras[1].height)
                found[i] = {seen_at[0], seen_at[1]};
        }
        return found;
    }
};

/* What is moved, and its columns of the covariance. */
void moved_numbers(const State &state, const Spread &spread, size_t k, Transfer &transfer,
                   std::vector<double *> &moved, std::vector<int> &columns)
{
    for (size_t i = 0; i < 2; i++) {
        const size_t camera = i == 0 ? 0 : k;
        if (spread.at[camera][0] < 0) continue;
        const std::vector<int> held = held_parameters(state.inputs[camera]);
        for (int p = 0, column = spread.at[camera][0]; p < PARAMETERS_MAX; p++) {
            if (std::find(held.begin(), held.end(), p) != held.end()) continue;
            moved.push_back(&transfer.lenses[i][(size_t)p]);
            columns.push_back(column++);
        }
    }
    for (int i = 0; i < 3; i++) {
        moved.push_back(&transfer.T_cam_first[(size_t)i]);
        columns.push_back(spread.at[k][1] + i);
    }
}

std::vector<Pixel> transfer_grid(const fovea_camera &camera)
{
    constexpr int columns = 5, rows = 4;
    constexpr double border = .15; /* of the image, where there may be no corners */
    std::vector<Pixel> pixels;
    for (int i = 0; i < columns * rows; i++)
        pixels.push_back(
            {camera.width * (border + (1 - 2 * border) * (i % columns) / (columns - 1)),
             camera.height * (border + (1 - 2 * border) * (i / columns) / (rows - 1))});
    return pixels;
}

double transfer_stdev_px(const State &state, const Spread &spread, size_t k)
{
    Transfer transfer = {{&state.inputs[0], &state.inputs[k]},
                         {state.lenses[0], state.lenses[k]},
                         state.T_cam_first[k]};
    std::vector<double *> moved;
    std::vector<int> columns;
    moved_numbers(state, spread, k, transfer, moved, columns);
    const std::vector<Pixel> pixels = transfer_grid(state.inputs[0].camera);
    const auto size = (Eigen::Index)moved.size();
    std::vector<Eigen::MatrixXd> change(pixels.size(), Eigen::MatrixXd(2, size));
    Eigen::MatrixXd matrix(size, size);
    for (Eigen::Index i = 0; i < size; i++) {
        for (Eigen::Index j = 0; j < size; j++)
            matrix(i, j) = spread.matrix(columns[(size_t)i], columns[(size_t)j]);
        double &number = *moved[(size_t)i];
        const double step = 1e-2 * std::sqrt(matrix(i, i)) + 1e-15, before = number;
        number = before - step;
        const std::vector<Pixel> below = transfer(pixels);
        number = before + step;
        const std::vector<Pixel> above = transfer(pixels);
        number = before;
        for (size_t p = 0; p < pixels.size(); p++)
            for (size_t axis = 0; axis < 2; axis++)
                change[p]((Eigen::Index)axis, i) = (above[p][axis] - below[p][axis]) / (2 * step);
    }
    double worst = NAN;
    for (const Eigen::MatrixXd &at : change) {
        const Eigen::Matrix2d in_image = at * matrix * at.transpose();
        if (!in_image.allFinite()) continue;
        const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver(in_image);
        const double stdev = std::sqrt(std::max(0., solver.eigenvalues()[1]));
        if (!(stdev <= worst)) worst = stdev;
    }
    return worst;
}

bool deviations(State &state, RigSolution &solution)
{
    ceres::Problem problem;
    const int extra = build(state, 0, problem);
    std::vector<double *> blocks;
    Spread spread;
    spread.at.assign(state.cameras(), {-1, -1});
    int column = 0;
    for (size_t k = 0; k < state.cameras(); k++) {
        if (!state.inputs[k].held) {
            spread.at[k][0] = column;
            blocks.push_back(state.lenses[k].data());
            column += PARAMETERS_MAX - (int)held_parameters(state.inputs[k]).size();
        }
        if (k == 0) continue;
        spread.at[k][1] = column;
        blocks.push_back(state.T_cam_first[k].data());
        column += 6;
    }
    for (Pose &pose : state.T_first_board)
        if (problem.HasParameterBlock(pose.data())) blocks.push_back(pose.data());
    SolveError found;
    if (!covariance(problem, blocks, extra, spread.matrix, found)) return false;
    solution.corners_used = (int)found.residuals / 2;
    solution.rms_px = found.rms * std::sqrt(2.);
    solution.noise_px = found.noise;
    for (size_t k = 0; k < state.cameras(); k++) {
        set_deviations(state, spread, k, solution.cameras[k]);
        if (k > 0) solution.cameras[k].transfer_px = transfer_stdev_px(state, spread, k);
    }
    return true;
}

void keep(const State &state, RigSolution &solution)
{
    solution = state.choice;
    solution.poses = state.T_first_board;
    solution.cameras.assign(state.cameras(), RigCamera());
    for (size_t k = 0; k < state.cameras(); k++) {
        const RigInput &input = state.inputs[k];
        RigCamera &camera = solution.cameras[k];
        camera.model = input.model;
        camera.held = input.held;
        camera.camera = input.held ? input.camera
                                   : camera_of(input.model, state.lenses[k], input.camera.width,
                                               input.camera.height);
        camera.T_cam_first = state.T_cam_first[k];
    }
}

} // namespace

bool solve_rig(const Board &board, const std::vector<RigInput> &inputs, RigSolution &solution,
               std::string &error)
{
    RigSolution start;
    if (!start_rig(board, inputs, start, error)) return false;
    State state(board, inputs, start);
    if (!refine(state)) {
        error = "the solve does not converge: the pictures do not determine the cameras' places";
        return false;
    }
    keep(state, solution);
    if (!deviations(state, solution)) {
        error = "the pictures do not determine the cameras' places: more pictures that several "
                "cameras take of the board are needed";
        return false;
    }
    measure(board, state, solution);
    return true;
}

double held_out_epipolar_px(const Board &board, const std::vector<RigInput> &inputs,
                            const RigSolution &solution, int folds)
{
    double squares = 0;
    int parts = 0;
    for (int fold = 0; fold < folds; fold++) {
        State state(board, inputs, solution);
        std::vector<char> held(state.instants());
        for (size_t v = 0; v < held.size(); v++) {
            held[v] = (int)v % folds == fold;
            for (size_t k = 0; held[v] && k < state.cameras(); k++)
                if (state.takes(k, v)) state.choice.left_out[k][v] = "of the other part";
        }
        if (!minimise(state, 0)) return -1;
        RigSolution part;
        keep(state, part);
        part.left_out = solution.left_out;
        const double rms_px = epipolar_rms_px(inputs, part, held);
        if (rms_px < 0) continue;
        squares += rms_px * rms_px;
        parts++;
    }
    return parts > 0 ? std::sqrt(squares / parts) : -1;
}

} // namespace calibrate

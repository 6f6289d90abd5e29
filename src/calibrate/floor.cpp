/* The plane that all boards lie on: the solve, rejection, covariance, verdict. */
#include "calibrate/floor.h"

#include "calibrate/compare.h"
#include "calibrate/least_squares.h"
#include "calibrate/projection.h"
#include "calibrate/rigid.h"

#include <ceres/rotation.h>

#include <algorithm>
#include <cmath>

namespace calibrate
{
namespace
{

/* Limits of doubt and failure. */
constexpr int VIEWS_PASS = 3, VIEWS_DOUBTFUL = 1;
constexpr double RMS_PASS_PX = .5, RMS_DOUBTFUL_PX = 1.5;
constexpr double TOGETHER_PASS = 1.5, TOGETHER_DOUBTFUL = 4; /* times the error of boards alone */
constexpr double HEIGHT_PASS = .005, HEIGHT_DOUBTFUL = .02;  /* deviation over value */
constexpr double TILT_PASS_RAD = .002, TILT_DOUBTFUL_RAD = .01;
constexpr double LEFT_OUT_PASS = .34;
constexpr double DEGREE = 57.29577951308232;

/* The floor before the camera: the start's rotation, turned by two small angles about the floor's x
 * and y; height. A board on the floor: place and turn, its z axis down. */
using Plane = std::array<double, 3>;
using OnFloor = std::array<double, 3>;

struct FloorCorner {
    Model model;
    const Parameters *lens;
    const Eigen::Matrix3d *R_cam_floor; /* of the start */
    double thickness_m;
    Point point;
    Pixel found;
    template <typename T> bool operator()(const T *plane, const T *on_floor, T *residual) const
    {
        const T c = cos(on_floor[2]), s = sin(on_floor[2]);
        const T at[3] = {on_floor[0] + c * point[0] + s * point[1],
                         on_floor[1] + s * point[0] - c * point[1], T(thickness_m) - plane[2]};
        const T turn[3] = {plane[0], plane[1], T(0)};
        T turned[3], seen[3], pixel[2], parameters[PARAMETERS_MAX];
        ceres::AngleAxisRotatePoint(turn, at, turned);
        for (int i = 0; i < 3; i++) {
            seen[i] = T(0);
            for (int j = 0; j < 3; j++)
                seen[i] += (*R_cam_floor)(i, j) * turned[j];
        }
        for (size_t i = 0; i < PARAMETERS_MAX; i++)
            parameters[i] = T((*lens)[i]);
        if (!project(model, parameters, seen, pixel)) return false;
        residual[0] = pixel[0] - found[0];
        residual[1] = pixel[1] - found[1];
        return true;
    }
};
using FloorCost = ceres::AutoDiffCostFunction<FloorCorner, 2, 3, 3>;

/* R_cam_floor: z up, x along the optical axis or, where that is upright, along the image's up. */
Eigen::Matrix3d floor_axes(const Eigen::Vector3d &up)
{
    constexpr double upright = .99; /* 8 degrees */
    const Eigen::Vector3d axis = Eigen::Vector3d::UnitZ(), top = -Eigen::Vector3d::UnitY();
    const Eigen::Vector3d ahead = std::fabs(up.dot(axis)) < upright ? axis : top;
    Eigen::Matrix3d R;
    R.col(2) = up;
    R.col(0) = (ahead - up * up.dot(ahead)).normalized();
    R.col(1) = R.col(2).cross(R.col(0));
    return R;
}

struct State {
    const std::vector<View> &views;
    std::vector<Point> points;
    Parameters lens;
    Model model;
    double thickness_m;
    Eigen::Matrix3d R_cam_floor;
    Plane plane = {0, 0, 1};
    std::vector<OnFloor> boards;
    std::vector<Rigid> T_cam_board; /* by themselves */
    std::vector<double> alone_rms_px;
    std::vector<std::string> left_out;

    FloorCorner corner(size_t v, size_t c) const
    {
        return {model, &lens, &R_cam_floor, thickness_m, points[c], views[v].corners[c]};
    }
};

/* Each board's own plane; the one in the middle of them is the start. */
bool start_plane(const Board &board, const fovea_camera &camera, State &state)
{
    std::vector<std::pair<double, size_t>> heights;
    for (size_t v = 0; v < state.views.size(); v++) {
        Pose pose;
        double rms_px = 0;
        state.left_out.push_back(state.views[v].left_out);
        state.T_cam_board.emplace_back();
        if (state.left_out[v].empty() && !pose_view(board, camera, state.views[v], pose, rms_px))
            state.left_out[v] = "no pose of the board fits its corners";
        if (state.left_out[v].empty()) {
            state.T_cam_board[v] = rigid_of(pose);
            heights.push_back({state.T_cam_board[v].R.col(2).dot(state.T_cam_board[v].t), v});
        }
        state.alone_rms_px.push_back(rms_px);
    }
    if (heights.empty()) return false;
    std::nth_element(heights.begin(), heights.begin() + (ptrdiff_t)heights.size() / 2,
                     heights.end());
    const auto [depth, middle] = heights[heights.size() / 2];
    state.R_cam_floor = floor_axes(-state.T_cam_board[middle].R.col(2));
    state.plane = {0, 0, depth + state.thickness_m};
    for (const Rigid &T : state.T_cam_board) {
        const Eigen::Vector3d at = state.R_cam_floor.transpose() * T.t;
        const Eigen::Vector3d x = state.R_cam_floor.transpose() * T.R.col(0);
        state.boards.push_back({at[0], at[1], std::atan2(x[1], x[0])});
    }
    return true;
}

void build(State &state, double loss_px, ceres::Problem &problem)
{
    for (size_t v = 0; v < state.views.size(); v++)
        for (size_t c = 0; state.left_out[v].empty() && c < state.points.size(); c++)
            if (seen(state.views[v].corners[c]))
                problem.AddResidualBlock(new FloorCost(new FloorCorner(state.corner(v, c))),
                                         loss_px > 0 ? new ceres::CauchyLoss(loss_px) : nullptr,
                                         state.plane.data(), state.boards[v].data());
}

bool minimise(State &state, double loss_px)
{
    ceres::Problem problem;
    std::vector<double *> boards;
    build(state, loss_px, problem);
    for (OnFloor &one : state.boards)
        boards.push_back(one.data());
    return problem.NumResidualBlocks() > 0 &&
           solve_least_squares(problem, boards, {state.plane.data()});
}

double view_rms_px(const State &state, size_t v, int &count)
{
    double squares = 0;
    count = 0;
    for (size_t c = 0; c < state.points.size(); c++) {
        double residual[2];
        if (!seen(state.views[v].corners[c])) continue;
        count++;
        squares += state.corner(v, c)(state.plane.data(), state.boards[v].data(), residual)
                       ? residual[0] * residual[0] + residual[1] * residual[1]
                       : INFINITY;
    }
    return std::sqrt(squares / std::max(1, count));
}

/* A board that does not lie on the plane of the others: on something, or held. True: one is left
 * out, the worst. */
bool reject(State &state)
{
    constexpr double ratio = 6, least_px = 1;
    size_t worst = 0, used = 0;
    double worst_ratio = 0, worst_rms_px = 0;
    for (size_t v = 0; v < state.views.size(); v++) {
        int count;
        if (!state.left_out[v].empty()) continue;
        used++;
        const double rms_px = view_rms_px(state, v, count);
        const double its = rms_px / std::max(state.alone_rms_px[v], least_px / ratio);
        if (its <= worst_ratio) continue;
        worst_ratio = its;
        worst_rms_px = rms_px;
        worst = v;
    }
    if (used < 4 || worst_ratio < ratio) return false;
    char text[160];
    snprintf(text, sizeof text,
             "its board does not lie on the plane of the others: %.1f px off, %.2f px by itself",
             worst_rms_px, state.alone_rms_px[worst]);
    state.left_out[worst] = text;
    return true;
}

/* From the plane to angles and the body below the camera. */
void read_plane(const State &state, FloorSolution &solution)
{
    const Pose turn = {state.plane[0], state.plane[1], 0, 0, 0, 0};
    const Eigen::Vector3d up = (state.R_cam_floor * rigid_of(turn).R).col(2);
    const Eigen::Matrix3d R = floor_axes(up).transpose(); /* R_body_cam */
    solution.height_m = state.plane[2];
    solution.tilt_rad = std::asin(std::clamp(-up[2], -1., 1.));
    solution.roll_rad = std::atan2(-up[0], -up[1]);
    solution.T_body_cam = rows_of({R, {0, 0, state.plane[2]}});
}

bool deviations(State &state, FloorSolution &solution)
{
    ceres::Problem problem;
    Eigen::MatrixXd spread;
    SolveError found;
    std::vector<double *> blocks = {state.plane.data()};
    build(state, 0, problem);
    for (OnFloor &one : state.boards)
        if (problem.HasParameterBlock(one.data())) blocks.push_back(one.data());
    if (!covariance(problem, blocks, 0, spread, found)) return false;
    solution.lean_stdev_rad = std::sqrt(spread(0, 0));
    solution.tilt_stdev_rad = std::sqrt(spread(1, 1));
    solution.height_stdev_m = std::sqrt(spread(2, 2));
    solution.corners_used = (int)found.residuals / 2;
    solution.rms_px = found.rms * std::sqrt(2.);
    solution.noise_px = found.noise;
    return true;
}

} // namespace

bool solve_floor(const Board &board, const std::vector<View> &views, const fovea_camera &camera,
                 double thickness_m, FloorSolution &solution, std::string &error)
{
    constexpr double robust_px = 1;
    State state = {views,
                   board.points(),
                   parameters_of(camera),
                   model_of(camera),
                   thickness_m,
                   {},
                   {},
                   {},
                   {},
                   {},
                   {}};
    if (!start_plane(board, camera, state)) {
        error = "found no picture with the board, expected one or more";
        solution.left_out = state.left_out;
        return false;
    }
    bool solved = minimise(state, robust_px);
    while (solved && reject(state))
        solved = minimise(state, robust_px);
    if (!solved || !minimise(state, 0) || !deviations(state, solution)) {
        error = "the solve does not converge: the pictures do not determine the floor";
        return false;
    }
    read_plane(state, solution);
    solution.roll_stdev_rad = solution.lean_stdev_rad / std::max(std::cos(solution.tilt_rad), 1e-3);
    double squares = 0;
    solution.views_used = 0;
    for (size_t v = 0; v < views.size(); v++) {
        int count;
        if (!state.left_out[v].empty()) continue;
        (void)view_rms_px(state, v, count);
        squares += count * state.alone_rms_px[v] * state.alone_rms_px[v];
        solution.views_used++;
    }
    solution.alone_rms_px = std::sqrt(squares / solution.corners_used);
    solution.left_out = state.left_out;
    return true;
}

Verdict judge_floor(const std::vector<View> &views, const FloorSolution &solution)
{
    Verdict verdict;
    verdict.views_used = solution.views_used;
    for (const View &view : views)
        verdict.views_with_board += !view.corners.empty();
    Grade grade = grade_of(-solution.views_used, -VIEWS_PASS, -VIEWS_DOUBTFUL);
    if (grade != Grade::pass)
        add_reason(verdict, grade,
                   "%d pictures are used, expected %d or more: take more, with the board in other "
                   "places on the floor",
                   solution.views_used, VIEWS_PASS);
    const int left_out = verdict.views_with_board - solution.views_used;
    if (left_out > LEFT_OUT_PASS * verdict.views_with_board)
        add_reason(verdict, Grade::doubtful,
                   "%d of %d pictures with a board are left out: see their reasons", left_out,
                   verdict.views_with_board);
    const double ratio = solution.rms_px / std::max(solution.alone_rms_px, 1e-9);
    grade = grade_of(solution.rms_px, RMS_PASS_PX, RMS_DOUBTFUL_PX);
    if (solution.rms_px > .2 && ratio > TOGETHER_PASS)
        add_reason(
            verdict, std::max(grade, grade_of(ratio, TOGETHER_PASS, TOGETHER_DOUBTFUL)),
            "RMS error is %.2f px with all boards on one plane, %.2f px with each by itself: "
            "the floor is not flat, a board does not lie flat on it, or the camera moved",
            solution.rms_px, solution.alone_rms_px);
    else if (grade != Grade::pass)
        add_reason(verdict, grade,
                   "RMS error is %.2f px, expected %.1f or less: the board is bent, or the camera "
                   "file is not of this camera",
                   solution.rms_px, RMS_PASS_PX);
    const double height = solution.height_stdev_m / solution.height_m;
    grade = grade_of(height, HEIGHT_PASS, HEIGHT_DOUBTFUL);
    if (grade != Grade::pass)
        add_reason(
            verdict, grade,
            "the height is known to %.2f %% (one standard deviation), expected %.1f or better: "
            "take more pictures, with the board near the camera and far from it, or use a "
            "larger board",
            100 * height, 100 * HEIGHT_PASS);
    const double tilt = std::max(solution.tilt_stdev_rad, solution.lean_stdev_rad);
    grade = grade_of(tilt, TILT_PASS_RAD, TILT_DOUBTFUL_RAD);
    if (grade != Grade::pass)
        add_reason(
            verdict, grade,
            "the tilt is known to %.2f degrees (one standard deviation), expected %.2f or "
            "better: take more pictures, with the board at both sides of the image, or use a "
            "larger board",
            DEGREE * tilt, DEGREE * TILT_PASS_RAD);
    return verdict;
}

} // namespace calibrate

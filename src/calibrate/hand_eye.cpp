#include "calibrate/hand_eye.h"

#include "calibrate/least_squares.h"

#include <ceres/rotation.h>

#include <algorithm>
#include <cmath>

namespace calibrate
{
namespace
{

constexpr double DEGREE = 57.29577951308232;
constexpr int VIEWS_MIN = 3;
constexpr double TURN_MIN_RAD = 5 / DEGREE, SECOND_TURN_MIN_RAD = 2 / DEGREE;

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

struct Sight { /* one view */
    size_t view;
    Rigid T_world_body, T_cam_board;
    Matrix6 spread; /* of T_cam_board: a small rotation about the camera's axes, translation */
    Matrix6 whiten = Matrix6::Identity();
};

/* What a view's corners know of its board's pose, per squared noise. */
bool spread_of(const Board &board, const fovea_camera &camera, const View &view, const Rigid &T,
               Matrix6 &spread)
{
    const std::vector<Point> points = board.points();
    Matrix6 normal = Matrix6::Zero();
    for (size_t c = 0; c < points.size(); c++) {
        if (!seen(view.corners[c])) continue;
        const Eigen::Vector3d turned =
            T.R * Eigen::Vector3d(points[c][0], points[c][1], points[c][2]);
        const Eigen::Vector3d at = turned + T.t;
        double pixel[2];
        Eigen::Matrix<double, 2, 3, Eigen::RowMajor> by_point;
        if (fovea_camera_project(&camera, at.data(), pixel, by_point.data()) != FOVEA_OK) continue;
        Eigen::Matrix<double, 2, 6> change;
        change << by_point * -cross_matrix(turned), by_point;
        normal += change.transpose() * change;
    }
    const Eigen::FullPivLU<Matrix6> factor(normal);
    if (!factor.isInvertible()) return false;
    spread = factor.inverse();
    return spread.allFinite();
}

std::vector<Sight> sights_of(const Board &board, const std::vector<View> &views,
                             const std::vector<BodyPose> &poses, const fovea_camera &camera,
                             HandEyeSolution &solution)
{
    std::vector<Sight> sights;
    double squares = 0, freedom = 0;
    for (size_t v = 0; v < views.size(); v++) {
        Pose pose;
        double rms_px;
        Sight sight;
        std::string &why = solution.left_out.emplace_back(views[v].left_out);
        if (why.empty() && !poses[v].known) why = "no pose of the body is near its time";
        if (!why.empty()) continue;
        if (!pose_view(board, camera, views[v], pose, rms_px) ||
            !spread_of(board, camera, views[v], rigid_of(pose), sight.spread)) {
            why = "no pose of the board fits its corners";
            continue;
        }
        const auto corners =
            (double)std::count_if(views[v].corners.begin(), views[v].corners.end(), seen);
        squares += corners * rms_px * rms_px;
        freedom += 2 * corners - 6;
        sight.view = v;
        sight.T_cam_board = rigid_of(pose);
        sight.T_world_body = poses[v].T_world_body;
        sights.push_back(sight);
    }
    solution.noise_px = std::sqrt(squares / std::max(1., freedom));
    for (Sight &sight : sights)
        sight.spread *= solution.noise_px * solution.noise_px;
    return sights;
}

/* ---- the start ------------------------------------------------------------------------------- */

struct Motion { /* between two views: A of the body, B of the camera; A X = X B */
    Rigid body, camera;
    Eigen::Vector3d body_turn, camera_turn;
};

constexpr double TURN_MOST_RAD = 2.8; /* beyond, an axis may point either way */

/* `half_turns` counts those that are left out since they turn further. */
std::vector<Motion> motions_of(const std::vector<Sight> &sights, int &half_turns)
{
    std::vector<Motion> motions;
    half_turns = 0;
    for (size_t i = 0; i < sights.size(); i++) {
        for (size_t j = 0; j < i; j++) {
            Motion motion;
            motion.body = sights[i].T_world_body.inverse() * sights[j].T_world_body;
            motion.camera = sights[i].T_cam_board * sights[j].T_cam_board.inverse();
            motion.body_turn = angle_axis(motion.body.R);
            motion.camera_turn = angle_axis(motion.camera.R);
            if (motion.body_turn.norm() < TURN_MOST_RAD &&
                motion.camera_turn.norm() < TURN_MOST_RAD)
                motions.push_back(motion);
            else
                half_turns++;
        }
    }
    return motions;
}

/* Motions that do not determine the camera, by name. */
bool check_motions(const std::vector<Motion> &motions, int half_turns, HandEyeSolution &solution,
                   std::string &error)
{
    Eigen::Matrix3d turns = Eigen::Matrix3d::Zero();
    double off = 0;
    for (const Motion &motion : motions) {
        solution.turn_rad = std::max(solution.turn_rad, motion.body_turn.norm());
        turns += motion.body_turn * motion.body_turn.transpose();
        off += std::pow(motion.body_turn.norm() - motion.camera_turn.norm(), 2);
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(turns /
                                                              std::max(1., (double)motions.size()));
    const Eigen::Vector3d axis = axes.eigenvectors().col(2);
    solution.second_turn_rad = std::sqrt(std::max(0., axes.eigenvalues()[1]));
    solution.angle_off_rad = std::sqrt(off / std::max(1., (double)motions.size()));
    char text[320] = "";
    const bool too_little = solution.turn_rad < TURN_MIN_RAD;
    if (half_turns > 0 && (too_little || solution.second_turn_rad < SECOND_TURN_MIN_RAD))
        snprintf(
            text, sizeof text,
            "half turns: %d of %zu motions between two poses turn by more than %.0f degrees, of "
            "which the axis may point either way, and the others %s: turn the robot by 30 to "
            "120 degrees from picture to picture, about two axes",
            half_turns, (size_t)half_turns + motions.size(), DEGREE * TURN_MOST_RAD,
            too_little ? "do not turn" : "turn about one axis alone");
    else if (too_little)
        snprintf(
            text, sizeof text,
            "no rotation: the body's poses turn by %.1f degrees at most, expected %.0f or more "
            "about two axes: turn the robot between the pictures",
            DEGREE * solution.turn_rad, DEGREE * TURN_MIN_RAD);
    else if (solution.second_turn_rad < SECOND_TURN_MIN_RAD)
        snprintf(
            text, sizeof text,
            "rotations about one axis alone, (%.2f, %.2f, %.2f) of the body: they leave the "
            "camera's place along it open: turn the robot about another axis too (a ramp under "
            "some wheels), or find the height by 'fovea-calibrate floor'",
            axis[0], axis[1], axis[2]);
    error = text;
    return error.empty();
}

Rigid start_from(const std::vector<Motion> &motions)
{
    Eigen::Matrix3d turns = Eigen::Matrix3d::Zero(), normal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    Rigid X;
    for (const Motion &motion : motions)
        turns += motion.body_turn * motion.camera_turn.transpose();
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(turns, Eigen::ComputeFullU | Eigen::ComputeFullV);
    const double side = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1;
    X.R = svd.matrixU() * Eigen::Vector3d(1, 1, side).asDiagonal() * svd.matrixV().transpose();
    for (const Motion &motion : motions) {
        const Eigen::Matrix3d factor = motion.body.R - Eigen::Matrix3d::Identity();
        normal += factor.transpose() * factor;
        right += factor.transpose() * (X.R * motion.camera.t - motion.body.t);
    }
    X.t = normal.ldlt().solve(right);
    return X;
}

/* ---- the refinement -------------------------------------------------------------------------- */

/* T_cam_board as measured against that by poses: a small rotation about the camera's axes, and
 * translation, whitened. */
struct SightCost {
    const Sight *sight;
    template <typename T> static void apply(const T *pose, const T *point, T *out)
    {
        ceres::AngleAxisRotatePoint(pose, point, out);
        for (int i = 0; i < 3; i++)
            out[i] += pose[3 + i];
    }
    template <typename T>
    bool operator()(const T *T_cam_body, const T *T_world_board, T *residual) const
    {
        const Pose given = pose_of(sight->T_world_body.inverse()),
                   measured = pose_of(sight->T_cam_board.inverse());
        T q_cb[4], q_bw[4], q_wt[4], q_tc[4], q_ct[4], q_predicted[4], q[4], turn[3];
        T T_body_world[6], in_body[3], in_camera[3];
        for (size_t i = 0; i < 6; i++)
            T_body_world[i] = T(given[i]);
        const T turn_back[3] = {T(measured[0]), T(measured[1]), T(measured[2])};
        ceres::AngleAxisToQuaternion(T_cam_body, q_cb);
        ceres::AngleAxisToQuaternion(T_body_world, q_bw);
        ceres::AngleAxisToQuaternion(T_world_board, q_wt);
        ceres::AngleAxisToQuaternion(turn_back, q_tc);
        ceres::QuaternionProduct(q_cb, q_bw, q_ct);
        ceres::QuaternionProduct(q_ct, q_wt, q_predicted);
        ceres::QuaternionProduct(q_predicted, q_tc, q); /* predicted over measured */
        ceres::QuaternionToAngleAxis(q, turn);
        apply(T_body_world, T_world_board + 3, in_body);
        apply(T_cam_body, in_body, in_camera);
        for (int i = 0; i < 6; i++) {
            residual[i] = T(0);
            for (int j = 0; j < 6; j++)
                residual[i] += sight->whiten(i, j) *
                               (j < 3 ? turn[j] : in_camera[j - 3] - sight->T_cam_board.t[j - 3]);
        }
        return true;
    }
};

struct State {
    std::vector<Sight> sights;
    Pose T_cam_body, T_world_board;

    void build(ceres::Problem &problem)
    {
        for (const Sight &sight : sights)
            problem.AddResidualBlock(
                new ceres::AutoDiffCostFunction<SightCost, 6, 6, 6>(new SightCost{&sight}), nullptr,
                T_cam_body.data(), T_world_board.data());
    }
};

/* How an error of the body's pose (in the body's frame) moves the board in the camera. */
Matrix6 by_body(const State &state, const Sight &sight)
{
    const Rigid T_cam_body = rigid_of(state.T_cam_body);
    const Eigen::Vector3d board = sight.T_world_body.inverse() * rigid_of(state.T_world_board).t;
    Matrix6 change = Matrix6::Zero();
    change.topLeftCorner<3, 3>() = -T_cam_body.R;
    change.bottomLeftCorner<3, 3>() = T_cam_body.R * cross_matrix(board);
    change.bottomRightCorner<3, 3>() = -T_cam_body.R;
    return change;
}

void set_weights(State &state, double noise_rad, double noise_m)
{
    Vector6 squares;
    squares << Eigen::Vector3d::Constant(noise_rad * noise_rad),
        Eigen::Vector3d::Constant(noise_m * noise_m);
    for (Sight &sight : state.sights) {
        const Matrix6 change = by_body(state, sight);
        const Matrix6 whole = sight.spread + change * squares.asDiagonal() * change.transpose();
        const Eigen::LLT<Matrix6> factor(whole);
        sight.whiten = factor.matrixL().solve(Matrix6::Identity());
    }
}

/* Errors of the body's pose that would explain each view, in the body's frame. */
std::vector<Vector6> body_errors(const State &state)
{
    std::vector<Vector6> errors;
    for (const Sight &sight : state.sights) {
        Sight plain = sight;
        Vector6 residual;
        plain.whiten = Matrix6::Identity();
        SightCost{&plain}(state.T_cam_body.data(), state.T_world_board.data(), residual.data());
        errors.push_back(by_body(state, sight).inverse() * residual);
    }
    return errors;
}

/* The noise of poses is what views err beyond that of their corners. */
void estimate_noise(const State &state, double &noise_rad, double &noise_m)
{
    const double n = (double)state.sights.size(), freedom = (6 * n - 12) / (6 * n);
    const std::vector<Vector6> errors = body_errors(state);
    double rad2 = 0, m2 = 0, corners_rad2 = 0, corners_m2 = 0;
    for (size_t i = 0; i < errors.size(); i++) {
        const Matrix6 back = by_body(state, state.sights[i]).inverse();
        const Matrix6 by_corners = back * state.sights[i].spread * back.transpose();
        rad2 += errors[i].head<3>().squaredNorm();
        m2 += errors[i].tail<3>().squaredNorm();
        corners_rad2 += by_corners.topLeftCorner<3, 3>().trace();
        corners_m2 += by_corners.bottomRightCorner<3, 3>().trace();
    }
    noise_rad = std::sqrt(std::max(0., rad2 / freedom - corners_rad2) / (3 * n));
    noise_m = std::sqrt(std::max(0., m2 / freedom - corners_m2) / (3 * n));
}

bool refine(State &state, HandEyeSolution &solution)
{
    constexpr int rounds = 6;
    for (int round = 0; round < rounds; round++) {
        ceres::Problem problem;
        set_weights(state, solution.pose_noise_rad, solution.pose_noise_m);
        state.build(problem);
        if (!solve_least_squares(problem, {state.T_world_board.data()}, {state.T_cam_body.data()}))
            return false;
        estimate_noise(state, solution.pose_noise_rad, solution.pose_noise_m);
    }
    return true;
}

/* Views whose pose is far off those of the others. True: some are left out now. */
bool reject(State &state, HandEyeSolution &solution)
{
    constexpr double ratio = 6, least_m = 1e-4;
    const std::vector<Vector6> errors = body_errors(state);
    std::vector<double> sizes;
    for (const Vector6 &error : errors)
        sizes.push_back(error.tail<3>().norm());
    std::vector<double> sorted = sizes;
    std::sort(sorted.begin(), sorted.end());
    const double usual = std::max(least_m, sorted[sorted.size() / 2]);
    std::vector<Sight> kept;
    for (size_t i = 0; i < sizes.size(); i++) {
        if (sizes[i] <= ratio * usual) {
            kept.push_back(state.sights[i]);
            continue;
        }
        char text[160];
        snprintf(text, sizeof text,
                 "its pose of the body is %.1f mm from where the board says, the others' %.1f mm",
                 1e3 * sizes[i], 1e3 * usual);
        solution.left_out[state.sights[i].view] = text;
    }
    const bool changed = kept.size() < state.sights.size();
    state.sights = kept;
    return changed;
}

bool deviations(State &state, HandEyeSolution &solution)
{
    ceres::Problem problem;
    Eigen::MatrixXd spread;
    SolveError found;
    set_weights(state, solution.pose_noise_rad, solution.pose_noise_m);
    state.build(problem);
    if (!covariance(problem, {state.T_cam_body.data(), state.T_world_board.data()}, 0, spread,
                    found))
        return false;
    /* from T_cam_body: R_body_cam turns by -R_cam_body^T d, its place is -R^T t */
    const Rigid T_cam_body = rigid_of(state.T_cam_body);
    const Eigen::Matrix3d back = T_cam_body.R.transpose();
    Matrix6 change = Matrix6::Zero();
    const Eigen::Matrix3d turn =
        left_jacobian({state.T_cam_body[0], state.T_cam_body[1], state.T_cam_body[2]});
    change.topLeftCorner<3, 3>() = -back * turn;
    change.bottomLeftCorner<3, 3>() = -back * cross_matrix(T_cam_body.t) * turn;
    change.bottomRightCorner<3, 3>() = -back;
    const Matrix6 of_place = change * spread.topLeftCorner<6, 6>() * change.transpose();
    for (int i = 0; i < 6; i++)
        solution.stdev[(size_t)i] = std::sqrt(of_place(i, i));
    return true;
}

} // namespace

bool solve_hand_eye(const Board &board, const std::vector<View> &views,
                    const std::vector<BodyPose> &poses, const fovea_camera &camera,
                    HandEyeSolution &solution, std::string &error)
{
    solution = HandEyeSolution();
    State state;
    state.sights = sights_of(board, views, poses, camera, solution);
    const auto too_few = [&] {
        error = "found " + std::to_string(state.sights.size()) +
                " pictures of the board with a pose of the body, expected " +
                std::to_string(VIEWS_MIN) + " or more";
        return (int)state.sights.size() < VIEWS_MIN;
    };
    if (too_few()) return false;
    int half_turns;
    const std::vector<Motion> motions = motions_of(state.sights, half_turns);
    if (!check_motions(motions, half_turns, solution, error)) return false;
    const Rigid X = start_from(motions);
    const Sight &middle = state.sights[state.sights.size() / 2];
    state.T_cam_body = pose_of(X.inverse());
    state.T_world_board = pose_of(middle.T_world_body * X * middle.T_cam_board);
    bool solved = refine(state, solution);
    while (solved && reject(state, solution)) {
        if (too_few()) return false;
        solved = refine(state, solution);
    }
    error = "the solve does not converge: poses and pictures do not belong together";
    if (!solved || !deviations(state, solution)) return false;
    error.clear();
    solution.T_body_cam = rigid_of(state.T_cam_body).inverse();
    solution.T_world_board = rigid_of(state.T_world_board);
    solution.views_used = (int)state.sights.size();
    return true;
}

Verdict judge_hand_eye(const HandEyeSolution &solution)
{
    constexpr int views_pass = 8, views_doubtful = 4;
    constexpr double turn_pass_rad = .0035, turn_doubtful_rad = .02, place_pass_m = .003,
                     place_doubtful_m = .02;
    constexpr double angle_pass_rad = .01, angle_doubtful_rad = .05;
    Verdict verdict;
    verdict.views_used = solution.views_used;
    Grade grade = grade_of(-solution.views_used, -views_pass, -views_doubtful);
    if (grade != Grade::pass)
        add_reason(verdict, grade, "%d pictures are used, expected %d or more: take more pictures",
                   solution.views_used, views_pass);
    const int left_out = (int)std::count_if(
        solution.left_out.begin(), solution.left_out.end(),
        [](const std::string &why) { return why.compare(0, 8, "its pose") == 0; });
    if (left_out > .34 * (solution.views_used + left_out))
        add_reason(verdict, Grade::fail,
                   "%d of %d pictures do not agree with their poses: their times do not belong "
                   "together, or the board was moved",
                   left_out, solution.views_used + left_out);
    grade = grade_of(solution.angle_off_rad, angle_pass_rad, angle_doubtful_rad);
    if (grade != Grade::pass)
        add_reason(
            verdict, grade,
            "body and camera turn by angles that differ by %.2f degrees rms, expected %.2f or "
            "less: poses and pictures are not of the same times, or the poses are not those "
            "of the camera's body",
            DEGREE * solution.angle_off_rad, DEGREE * angle_pass_rad);
    const double turn = *std::max_element(solution.stdev.begin(), solution.stdev.begin() + 3);
    const double place = *std::max_element(solution.stdev.begin() + 3, solution.stdev.end());
    grade = grade_of(turn, turn_pass_rad, turn_doubtful_rad);
    if (grade != Grade::pass)
        add_reason(
            verdict, grade,
            "the rotation is known to %.2f degrees (one standard deviation), expected %.2f or "
            "better: turn the robot further and about more axes, take more pictures",
            DEGREE * turn, DEGREE * turn_pass_rad);
    grade = grade_of(place, place_pass_m, place_doubtful_m);
    if (grade != Grade::pass)
        add_reason(
            verdict, grade,
            "the place is known to %.1f mm (one standard deviation), expected %.1f or better: "
            "turn the robot further and about more axes, take more pictures",
            1e3 * place, 1e3 * place_pass_m);
    return verdict;
}

} // namespace calibrate

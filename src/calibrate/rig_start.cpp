#include "calibrate/rig_start.h"

#include <algorithm>
#include <cmath>

namespace calibrate
{
namespace
{

/* Pictures that two cameras must have in common. */
constexpr int SHARED_MIN = 2;

/* T_cam_board of every camera and view; not finite: not posed. */
using Posed = std::vector<std::vector<Rigid>>;

/* How far apart two places are: of points a metre away, roughly. */
double distance(const Rigid &a, const Rigid &b)
{
    const double turn = angle_axis(a.R * b.R.transpose()).norm();
    return turn + (a.t - b.t).norm() / (.2 + .5 * (a.t.norm() + b.t.norm()));
}

/* T_b_a as one view shows it, the board counted alike by both or from both ends. */
struct Shown {
    size_t view;
    Rigid alike, turned;
};

std::vector<Shown> shown_by(const Posed &posed, size_t a, size_t b, const Rigid &turn)
{
    std::vector<Shown> shown;
    for (size_t v = 0; v < posed[a].size(); v++) {
        if (!posed[a][v].finite() || !posed[b][v].finite()) continue;
        const Rigid T_board_a = posed[a][v].inverse();
        shown.push_back({v, posed[b][v] * T_board_a, posed[b][v] * turn * T_board_a});
    }
    return shown;
}

/* The one that most views agree with: its distances to the others' nearer choices, each limited,
 * are the least. */
Rigid agreed(const std::vector<Shown> &shown, bool may_turn)
{
    constexpr double limit = .3;
    double best = INFINITY;
    Rigid found;
    for (const Shown &one : shown) {
        for (const Rigid *candidate : {&one.alike, &one.turned}) {
            if (candidate == &one.turned && !may_turn) continue;
            double sum = 0;
            for (const Shown &other : shown) {
                double apart = distance(*candidate, other.alike);
                if (may_turn) apart = std::min(apart, distance(*candidate, other.turned));
                sum += std::min(apart, limit);
            }
            if (sum >= best) continue;
            best = sum;
            found = *candidate;
        }
    }
    return found;
}

Rigid nowhere()
{
    Rigid T;
    T.t = Eigen::Vector3d::Constant(NAN);
    return T;
}

void pose_views(const Board &board, const RigInput &input, std::vector<std::string> &left_out,
                std::vector<Rigid> &T_cam_board)
{
    for (size_t v = 0; v < input.views.size(); v++) {
        Pose pose;
        double rms_px;
        if (!left_out[v].empty()) continue;
        if (pose_view(board, input.camera, input.views[v], pose, rms_px))
            T_cam_board[v] = rigid_of(pose);
        else
            left_out[v] = "no pose of the board fits its corners";
    }
}

bool solve_lens(const Board &board, const RigInput &input, RigCamera &camera,
                std::vector<std::string> &left_out, std::vector<Rigid> &T_cam_board,
                std::string &error)
{
    SolveOptions options;
    Solution alone;
    options.model = input.model;
    options.four_coefficients = input.four_coefficients;
    if (!solve(board, input.views, input.camera.width, input.camera.height, options, alone,
               error)) {
        error = input.source + ": " + error;
        return false;
    }
    camera.camera = alone.camera;
    left_out = alone.left_out;
    for (size_t v = 0; v < left_out.size(); v++)
        if (left_out[v].empty()) T_cam_board[v] = rigid_of(alone.poses[v]);
    return true;
}

bool start_lenses(const Board &board, const std::vector<RigInput> &inputs, RigSolution &start,
                  Posed &posed, std::string &error)
{
    for (const RigInput &input : inputs) {
        RigCamera camera;
        camera.model = input.model;
        camera.held = input.held;
        camera.camera = input.camera;
        std::vector<std::string> left_out;
        for (const View &view : input.views)
            left_out.push_back(view.left_out);
        posed.emplace_back(input.views.size(), nowhere());
        if (input.held)
            pose_views(board, input, left_out, posed.back());
        else if (!solve_lens(board, input, camera, left_out, posed.back(), error))
            return false;
        start.cameras.push_back(camera);
        start.left_out.push_back(left_out);
    }
    return true;
}

/* Cameras are placed one by one: next, the one that shares most views with one that is placed. */
bool place_cameras(const Board &board, const std::vector<RigInput> &inputs, const Posed &posed,
                   RigSolution &start, std::string &error)
{
    const Rigid turn = half_turn(board);
    std::vector<char> placed(inputs.size());
    placed[0] = 1;
    for (size_t round = 1; round < inputs.size(); round++) {
        std::vector<Shown> most;
        size_t from = 0, to = 0;
        for (size_t a = 0; a < inputs.size(); a++) {
            for (size_t b = 0; placed[a] && b < inputs.size(); b++) {
                if (placed[b]) continue;
                std::vector<Shown> shown = shown_by(posed, a, b, turn);
                if (to != 0 && shown.size() <= most.size()) continue;
                most = shown;
                from = a;
                to = b;
            }
        }
        if ((int)most.size() < SHARED_MIN) {
            error = inputs[to].source + ": found " + std::to_string(most.size()) +
                    " pictures of the board taken together with another camera, expected " +
                    std::to_string(SHARED_MIN) +
                    " or more: hold the board where both cameras see it";
            return false;
        }
        const Rigid T_to_from = agreed(most, may_be_turned(board));
        start.cameras[to].T_cam_first =
            pose_of(T_to_from * rigid_of(start.cameras[from].T_cam_first));
        placed[to] = 1;
    }
    return true;
}

/* T_first_board of each view, from the first camera that sees it; views of others that count from
 * the board's other end are turned. */
void place_boards(const Board &board, const std::vector<RigInput> &inputs, const Posed &posed,
                  RigSolution &start)
{
    const Rigid turn = half_turn(board);
    start.poses.assign(inputs[0].views.size(), Pose());
    for (size_t v = 0; v < start.poses.size(); v++) {
        bool any = false;
        for (size_t k = 0; k < inputs.size(); k++) {
            if (!posed[k][v].finite()) continue;
            const Rigid T_first_cam = rigid_of(start.cameras[k].T_cam_first).inverse();
            const Rigid T_first_board = T_first_cam * posed[k][v];
            if (any && may_be_turned(board)) {
                const Rigid there = rigid_of(start.poses[v]);
                start.turned[k][v] =
                    distance(T_first_board * turn, there) < distance(T_first_board, there);
            } else if (!any) {
                start.poses[v] = pose_of(T_first_board);
                any = true;
            }
        }
    }
}

} // namespace

Rigid half_turn(const Board &board)
{
    const Point last = board.points().back();
    Rigid turn;
    turn.R = Eigen::Vector3d(-1, -1, 1).asDiagonal();
    turn.t = {last[0], last[1], 0};
    return turn;
}

/* Markers say which corner is which; of other boards a detector may count from either end. */
bool may_be_turned(const Board &board)
{
    return board.pattern == Pattern::chessboard || board.pattern == Pattern::circles;
}

Pixel rig_corner(const RigInput &input, bool turned, size_t view, size_t c)
{
    const std::vector<Pixel> &corners = input.views[view].corners;
    if (c >= corners.size()) return {NAN, NAN};
    return corners[turned ? corners.size() - 1 - c : c];
}

bool start_rig(const Board &board, const std::vector<RigInput> &inputs, RigSolution &start,
               std::string &error)
{
    Posed posed;
    if (!start_lenses(board, inputs, start, posed, error)) return false;
    start.turned.assign(inputs.size(), std::vector<char>(inputs[0].views.size()));
    if (!place_cameras(board, inputs, posed, start, error)) return false;
    place_boards(board, inputs, posed, start);
    const size_t corners = board.points().size();
    for (size_t k = 0; k < inputs.size(); k++) {
        start.used.emplace_back();
        for (size_t v = 0; v < inputs[k].views.size(); v++) {
            start.used[k].emplace_back(corners);
            for (size_t c = 0; c < corners; c++)
                start.used[k][v][c] = seen(rig_corner(inputs[k], start.turned[k][v] != 0, v, c));
        }
    }
    return true;
}

} // namespace calibrate

#include "calibrate/inertial_start.h"

#include "calibrate/html.h"
#include "calibrate/rig_start.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace calibrate
{
namespace
{

constexpr double CORNER_SIGMAS = 5, RAYLEIGH_MEDIAN = 1.17741;
constexpr double PAIR_S = .25; /* the longest time between two pictures that give a rate */
constexpr int PAIRS_MIN = 20;
constexpr double SEARCH_S = 2, SEARCH_STEP_S = 5e-3; /* of time shifts */
constexpr double FITS_MIN = .5, TURN_MIN_RAD_S = .02;

/* ---- pictures -------------------------------------------------------------------------------- */

double angle_between(const Rigid &a, const Rigid &b)
{
    return angle_axis(a.R.transpose() * b.R).norm();
}

/* Corners of one view that fit its own pose. */
void choose_corners(const InertialInput &input, const Pose &pose, PosedPicture &picture)
{
    const InertialCamera &camera = input.cameras[picture.camera];
    const View &view = camera.views[picture.view];
    const std::vector<Point> points = input.board.points();
    const Rigid T_cam_board = rigid_of(pose);
    std::vector<double> errors;
    for (size_t c = 0; c < points.size(); c++) {
        double pixel[2];
        const Eigen::Vector3d at = T_cam_board * Eigen::Vector3d(points[c][0], points[c][1], 0);
        const bool is_there =
            seen(view.corners[c]) &&
            fovea_camera_project(&camera.camera, at.data(), pixel, nullptr) == FOVEA_OK;
        errors.push_back(
            is_there ? std::hypot(pixel[0] - view.corners[c][0], pixel[1] - view.corners[c][1])
                     : NAN);
    }
    const double limit = CORNER_SIGMAS * median(errors) / RAYLEIGH_MEDIAN + 1e-9;
    for (const double error : errors)
        picture.used.push_back(error <= limit); /* false for NaN */
}

void pose_pictures(const InertialInput &input, InertialStart &start, InertialSolution &solution)
{
    start.begin_ns = INT64_MAX;
    solution.left_out.clear();
    for (const InertialCamera &camera : input.cameras)
        for (const View &view : camera.views)
            if (view.left_out.empty() && view.stamp_ns >= 0)
                start.begin_ns = std::min(start.begin_ns, view.stamp_ns);
    for (size_t k = 0; k < input.cameras.size(); k++) {
        const InertialCamera &camera = input.cameras[k];
        solution.left_out.emplace_back(camera.views.size());
        for (size_t v = 0; v < camera.views.size(); v++) {
            const View &view = camera.views[v];
            std::string &why = solution.left_out[k][v];
            PosedPicture picture = {k, v, 0, false, {}, {}, 0};
            Pose pose;
            solution.views_with_board += !view.corners.empty();
            why = view.left_out;
            if (why.empty() && view.stamp_ns < 0) why = "its time is not known";
            if (why.empty() && !pose_view(input.board, camera.camera, view, pose, picture.rms_px))
                why = "its corners fit no pose of the board";
            if (!why.empty()) continue;
            picture.time_s = 1e-9 * (double)(view.stamp_ns - start.begin_ns);
            picture.T_board_first = rigid_of(pose).inverse() * camera.T_cam_first;
            choose_corners(input, pose, picture);
            start.pictures.push_back(picture);
        }
    }
    std::stable_sort(
        start.pictures.begin(), start.pictures.end(),
        [](const PosedPicture &a, const PosedPicture &b) { return a.time_s < b.time_s; });
}

/* Count every board from the end that the picture before was counted from. */
void turn_boards(const InertialInput &input, InertialStart &start)
{
    if (!may_be_turned(input.board)) return;
    const Rigid other = half_turn(input.board);
    for (size_t i = 1; i < start.pictures.size(); i++) {
        PosedPicture &picture = start.pictures[i];
        const Rigid turned = other * picture.T_board_first;
        const Rigid &before = start.pictures[i - 1].T_board_first;
        if (angle_between(before, turned) >= angle_between(before, picture.T_board_first)) continue;
        picture.turned = true;
        picture.T_board_first = turned;
        std::reverse(picture.used.begin(), picture.used.end());
    }
}

/* ---- rates ----------------------------------------------------------------------------------- */

struct Pair {
    double begin_s, end_s;
    Eigen::Vector3d rate; /* in the first camera's frame */
};

std::vector<Pair> pairs_of(const InertialStart &start, size_t cameras)
{
    std::vector<Pair> pairs;
    std::vector<const PosedPicture *> before(cameras);
    for (const PosedPicture &picture : start.pictures) {
        const PosedPicture *last = before[picture.camera];
        before[picture.camera] = &picture;
        if (last == nullptr) continue;
        const double time_s = picture.time_s - last->time_s;
        if (!(time_s > 0) || time_s > PAIR_S) continue;
        const Eigen::Matrix3d R = last->T_board_first.R.transpose() * picture.T_board_first.R;
        pairs.push_back({last->time_s, picture.time_s, angle_axis(R) / time_s});
    }
    return pairs;
}

/* Angular rates summed over time. */
struct Turns {
    std::vector<double> times_s;
    std::vector<Eigen::Vector3d> sums;

    Turns(const InertialInput &input, int64_t begin_ns)
    {
        Eigen::Vector3d sum = Eigen::Vector3d::Zero(), last = sum;
        for (const fovea_imu_sample &sample : input.samples) {
            const double time_s = 1e-9 * (double)(sample.stamp_ns - begin_ns);
            const Eigen::Vector3d rate(sample.gyro[0], sample.gyro[1], sample.gyro[2]);
            if (!times_s.empty()) sum += .5 * (time_s - times_s.back()) * (last + rate);
            times_s.push_back(time_s);
            sums.push_back(sum);
            last = rate;
        }
    }
    bool at(double time_s, Eigen::Vector3d &sum) const
    {
        const auto next = std::lower_bound(times_s.begin(), times_s.end(), time_s);
        if (next == times_s.begin() || next == times_s.end()) return false;
        const auto i = (size_t)(next - times_s.begin());
        const double share = (time_s - times_s[i - 1]) / (times_s[i] - times_s[i - 1]);
        sum = sums[i - 1] + share * (sums[i] - sums[i - 1]);
        return true;
    }
};

/* How the sensor's rates are the pictures' at one time shift: rate = ratio R_imu_cam of the
 * pictures' + bias, in the least squares (S. Umeyama, Least-squares estimation of transformation
 * parameters between two point patterns, IEEE PAMI 13(4), 1991). */
struct Alignment {
    size_t pairs = 0;
    double fits = -1, ratio = 0, turn_rad_s = 0;
    Eigen::Matrix3d R_imu_cam = Eigen::Matrix3d::Identity();
    Eigen::Vector3d bias = Eigen::Vector3d::Zero();
};

Alignment align(const std::vector<Pair> &pairs, const Turns &turns, double shift_s)
{
    Alignment found;
    std::vector<Eigen::Vector3d> of_imu, of_camera;
    Eigen::Vector3d mean_imu = Eigen::Vector3d::Zero(), mean_camera = mean_imu;
    for (const Pair &pair : pairs) {
        Eigen::Vector3d begin, end;
        if (!turns.at(pair.begin_s + shift_s, begin) || !turns.at(pair.end_s + shift_s, end))
            continue;
        of_imu.emplace_back((end - begin) / (pair.end_s - pair.begin_s));
        of_camera.push_back(pair.rate);
        mean_imu += of_imu.back();
        mean_camera += pair.rate;
    }
    found.pairs = of_imu.size();
    if (found.pairs < PAIRS_MIN) return found;
    mean_imu /= (double)found.pairs;
    mean_camera /= (double)found.pairs;
    Eigen::Matrix3d both = Eigen::Matrix3d::Zero();
    double squares_imu = 0, squares_camera = 0;
    for (size_t i = 0; i < found.pairs; i++) {
        const Eigen::Vector3d a = of_imu[i] - mean_imu, b = of_camera[i] - mean_camera;
        both += a * b.transpose();
        squares_imu += a.squaredNorm();
        squares_camera += b.squaredNorm();
    }
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(both, Eigen::ComputeFullU | Eigen::ComputeFullV);
    Eigen::Vector3d sign(1, 1, (svd.matrixU() * svd.matrixV().transpose()).determinant());
    const double trace = svd.singularValues().dot(sign);
    found.R_imu_cam = svd.matrixU() * sign.asDiagonal() * svd.matrixV().transpose();
    found.ratio = squares_imu / trace; /* of both, the pictures' rates have more noise */
    found.fits = trace * std::fabs(trace) / (squares_imu * squares_camera);
    found.turn_rad_s = std::sqrt(squares_imu / (double)found.pairs);
    found.bias = mean_imu - found.R_imu_cam * mean_camera;
    return found;
}

/* The time shift at which they fit best: on a grid, then by a parabola. */
double best_shift(const std::vector<Pair> &pairs, const Turns &turns)
{
    double best_s = 0, best = -1;
    const auto try_around = [&](double middle_s, double reach_s, double step_s) {
        for (double at_s = -reach_s; at_s <= reach_s + 1e-9; at_s += step_s) {
            const Alignment found = align(pairs, turns, middle_s + at_s);
            if (found.pairs < pairs.size() / 2 || !(found.fits > best)) continue;
            best = found.fits;
            best_s = middle_s + at_s;
        }
    };
    try_around(0, SEARCH_S, SEARCH_STEP_S);
    try_around(best_s, SEARCH_STEP_S, 1e-3);
    constexpr double step_s = 2e-3;
    const double below = align(pairs, turns, best_s - step_s).fits,
                 here = align(pairs, turns, best_s).fits,
                 above = align(pairs, turns, best_s + step_s).fits;
    const double bent = below - 2 * here + above;
    if (bent < 0) best_s += std::clamp(.5 * (below - above) / bent, -1., 1.) * step_s;
    return best_s;
}

std::string other_clocks(const InertialInput &input, const InertialStart &start)
{
    const double begin_s = 1e-9 * (double)start.begin_ns;
    return formatted("the pictures are of %.3f to %.3f s and the samples of %.3f to %.3f s: they "
                     "must be of one clock, and of one time",
                     begin_s, begin_s + start.pictures.back().time_s,
                     1e-9 * (double)input.samples.front().stamp_ns,
                     1e-9 * (double)input.samples.back().stamp_ns);
}

/* Mean acceleration at the pictures, in the board's frame; how the sensor is held is known. */
bool find_gravity(const InertialInput &input, InertialStart &start, std::string &error)
{
    constexpr double least = 5, most = 15;
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    int count = 0;
    for (const PosedPicture &picture : start.pictures) {
        const int64_t stamp_ns =
            start.begin_ns + (int64_t)std::llround(1e9 * (picture.time_s + start.shift_s));
        const auto next = std::lower_bound(
            input.samples.begin(), input.samples.end(), stamp_ns,
            [](const fovea_imu_sample &sample, int64_t stamp) { return sample.stamp_ns < stamp; });
        if (next == input.samples.end()) continue;
        sum += picture.T_board_first.R * start.R_imu_cam.transpose() *
               Eigen::Map<const Eigen::Vector3d>(next->acceleration);
        count++;
    }
    const Eigen::Vector3d mean = sum / std::max(1, count);
    if (!(mean.norm() > least && mean.norm() < most)) {
        error = formatted("the mean acceleration is %.3g m/s^2 in the board's frame, expected "
                          "about 9.8: the samples are not in m/s^2, or the board was moved in "
                          "place of the camera",
                          mean.norm());
        return false;
    }
    start.gravity_m_s2 = -GRAVITY_M_S2 / mean.norm() * mean;
    return true;
}

} // namespace

Pixel inertial_corner(const InertialInput &input, const PosedPicture &picture, size_t c)
{
    const std::vector<Pixel> &corners = input.cameras[picture.camera].views[picture.view].corners;
    return picture.turned ? corners[corners.size() - 1 - c] : corners[c];
}

bool start_inertial(const InertialInput &input, InertialStart &start, InertialSolution &solution,
                    std::string &error)
{
    pose_pictures(input, start, solution);
    turn_boards(input, start);
    const std::vector<Pair> pairs = pairs_of(start, input.cameras.size());
    if ((int)pairs.size() < PAIRS_MIN) {
        error = formatted("found %zu pairs of pictures with the board at most %.2f s apart, "
                          "expected %d or more: keep the board in the image while you move",
                          pairs.size(), PAIR_S, PAIRS_MIN);
        return false;
    }
    if (input.samples.size() < PAIRS_MIN) {
        error = formatted("found %zu samples of the inertial sensor, expected %d or more",
                          input.samples.size(), PAIRS_MIN);
        return false;
    }
    const Turns turns(input, start.begin_ns);
    if (align(pairs, turns, 0).pairs < pairs.size() / 2) {
        error = other_clocks(input, start);
        return false;
    }
    start.shift_s = best_shift(pairs, turns);
    const Alignment found = align(pairs, turns, start.shift_s);
    solution.fits = found.fits;
    solution.rate_ratio = found.ratio;
    if (found.turn_rad_s < TURN_MIN_RAD_S) {
        error = formatted("the sensor turned by %.2g rad/s rms, expected about 0.5: turn it "
                          "quickly about all its axes before the board",
                          found.turn_rad_s);
        return false;
    }
    if (!(found.fits >= FITS_MIN)) {
        error = formatted("the angular rates explain %.0f %% of the pictures' rotation at the best "
                          "time shift: the clocks are more than %.0f s apart or run differently, "
                          "or the sensor is not fixed to the camera",
                          100 * std::max(0., found.fits), SEARCH_S);
        return false;
    }
    if (found.ratio < .8 || found.ratio > 1.25) {
        error = formatted("the angular rates are %.3g times those of the pictures, expected 1: "
                          "%s",
                          found.ratio,
                          found.ratio > 40 && found.ratio < 80
                              ? "they are in degrees per second, expected radians"
                              : "their scale is wrong, or the stamps of pictures or samples are");
        return false;
    }
    start.R_imu_cam = found.R_imu_cam;
    start.gyro_bias = found.bias;
    return find_gravity(input, start, error);
}

} // namespace calibrate

/* Cameras to an inertial sensor: simulated rigs are found as near to the truth as stated, and what
 * is wrong is named. FOVEA_LONG: the number of rigs (default 2; the campaign: 20). */
#include "calibrate/inertial.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "common/cmocka_cpp.h"
#include "common/simulated_boards.h"

using namespace calibrate;
using namespace simulated;

namespace
{

constexpr double DEGREE = 57.29577951308232, GRAVITY = 9.80665;
constexpr double IMU_HZ = 200, PICTURE_HZ = 20, SECONDS = 30;

int rigs()
{
    const char *given = std::getenv("FOVEA_LONG");
    return given != nullptr && std::atoi(given) > 0 ? std::atoi(given) : 2;
}

/* A hand that moves a camera before the board: sums of two sinusoids on each of six axes. */
struct Hand {
    double amplitude[6][2], pulse[6][2], phase[6][2];
    double distance;

    /* Times what a hand usually does: of turns about each axis, of moves. */
    double turns[3] = {1, 1, 1}, moves = 1;

    explicit Hand(Random &random, double focal) : distance(.55 * focal / 400)
    {
        for (int axis = 0; axis < 6; axis++)
            for (int i = 0; i < 2; i++) {
                const double turn = i == 0 ? .18 : .06, place = i == 0 ? .07 : .02;
                amplitude[axis][i] = (axis < 3 ? turn : place) * random.between(.8, 1.2);
                pulse[axis][i] =
                    6.283185307 * (i == 0 ? random.between(.25, .6) : random.between(1, 1.6));
                phase[axis][i] = random.between(0, 6.283185307);
            }
    }
    double at(int axis, double time_s) const
    {
        const double share = axis < 3 ? turns[axis] : moves;
        double sum = 0;
        for (int i = 0; i < 2; i++)
            sum += share * amplitude[axis][i] * std::sin(pulse[axis][i] * time_s + phase[axis][i]);
        return sum;
    }
    /* T_board_cam */
    Rigid camera(double time_s) const
    {
        Rigid T;
        T.R = (Eigen::AngleAxisd(1.6 * at(2, time_s), Eigen::Vector3d::UnitZ()) *
               Eigen::AngleAxisd(at(1, time_s), Eigen::Vector3d::UnitY()) *
               Eigen::AngleAxisd(at(0, time_s), Eigen::Vector3d::UnitX()))
                  .toRotationMatrix();
        /* about the board's middle, turned around it as much as the camera turns */
        const Eigen::Vector3d middle(.12, .075, 0);
        T.t =
            middle + T.R * Eigen::Vector3d(at(3, time_s), at(4, time_s), at(5, time_s) - distance);
        return T;
    }
};

/* What is to be found, and the noise. */
struct Truth {
    Rigid T_cam_imu;
    double shift_s;
    Eigen::Vector3d gravity; /* in the board's frame */
    double bias[INERTIAL_PARTS] = {.02, .15};
    double drift = 0; /* of the sensor's clock */
};

/* What is changed for a rig that is bad on purpose. */
struct Change {
    double turns[3] = {1, 1, 1}, moves = 1, drift = 0, readout_s = 0;
    double seconds = SECONDS, picture_hz = PICTURE_HZ;
    size_t cameras = 1;
};

Rigid any_place(Random &random)
{
    Eigen::Vector3d axis(random.gauss(), random.gauss(), random.gauss());
    axis = axis.normalized() * random.between(0, 3.1);
    return rigid_of({axis[0], axis[1], axis[2], random.between(-.1, .1), random.between(-.1, .1),
                     random.between(-.1, .1)});
}

fovea_rig_imu usual_imu()
{
    fovea_rig_imu imu = {};
    imu.rate_hz = IMU_HZ;
    imu.gyro_noise = 1.7e-4;
    imu.gyro_walk = 2e-5;
    imu.acceleration_noise = 2e-3;
    imu.acceleration_walk = 3e-3;
    return imu;
}

/* What an exact sensor reads. */
void exact(const Hand &hand, const Truth &truth, double time_s, Eigen::Vector3d &gyro,
           Eigen::Vector3d &acceleration)
{
    constexpr double step_s = 5e-4;
    const Rigid before = hand.camera(time_s - step_s) * truth.T_cam_imu,
                here = hand.camera(time_s) * truth.T_cam_imu,
                after = hand.camera(time_s + step_s) * truth.T_cam_imu;
    gyro = angle_axis(before.R.transpose() * after.R) / (2 * step_s);
    acceleration = here.R.transpose() *
                   ((before.t - 2 * here.t + after.t) / (step_s * step_s) - truth.gravity);
}

constexpr int64_t BASE_NS = 1'700'000'000'000'000'000;

int64_t stamp_of(double time_s)
{
    return BASE_NS + (int64_t)std::llround(1e9 * time_s);
}

void add_samples(const Hand &hand, const Truth &truth, double seconds, Random &random,
                 InertialInput &input)
{
    const double step_s = 1 / IMU_HZ, white = std::sqrt(IMU_HZ), walk = std::sqrt(step_s);
    Eigen::Vector3d biases[INERTIAL_PARTS];
    for (int part = 0; part < INERTIAL_PARTS; part++)
        for (int i = 0; i < 3; i++)
            biases[part][i] = truth.bias[part] * random.gauss();
    for (double time_s = -.5; time_s < seconds + .5; time_s += step_s) {
        fovea_imu_sample sample = {};
        Eigen::Vector3d gyro, acceleration;
        exact(hand, truth, time_s, gyro, acceleration);
        sample.stamp_ns = stamp_of(time_s * (1 + truth.drift) + truth.shift_s);
        for (int i = 0; i < 3; i++) {
            biases[0][i] += walk * input.imu.gyro_walk * random.gauss();
            biases[1][i] += walk * input.imu.acceleration_walk * random.gauss();
            sample.gyro[i] = gyro[i] + biases[0][i] + white * input.imu.gyro_noise * random.gauss();
            sample.acceleration[i] = acceleration[i] + biases[1][i] +
                                     white * input.imu.acceleration_noise * random.gauss();
        }
        input.samples.push_back(sample);
    }
}

View view_at(const Hand &hand, const InertialCamera &camera, double time_s, Random &random)
{
    View view;
    view.name = std::to_string(time_s);
    view.stamp_ns = stamp_of(time_s);
    for (const Point &point : board.points()) {
        const double row_s = camera.readout_s; /* of the row: found from where it is seen */
        double pixel[2] = {0, .5 * HEIGHT};
        for (int again = 0; again < (row_s > 0 ? 4 : 1); again++) {
            const Rigid T = camera.T_cam_first *
                            hand.camera(time_s + (pixel[1] / HEIGHT - .5) * row_s).inverse();
            const Eigen::Vector3d seen_at = T * Eigen::Vector3d(point[0], point[1], 0);
            if (!see_point(camera.camera, seen_at.data(), pixel)) return without_board(view);
        }
        view.corners.push_back(with_noise(pixel, random));
    }
    return view;
}

/* A short one, of which a few pictures tell enough. */
Change short_one()
{
    Change change;
    change.seconds = 16;
    change.picture_hz = 10;
    return change;
}

struct Simulated {
    Truth truth;
    InertialInput input;
};

Simulated simulate(unsigned seed, const Change &change = {})
{
    Random random = {std::mt19937_64(seed)};
    Simulated simulated;
    InertialInput &input = simulated.input;
    Truth &truth = simulated.truth;
    const Model models[] = {Model::radtan, Model::equidistant};
    input.board = board;
    input.imu = usual_imu();
    input.cameras.resize(change.cameras);
    for (size_t k = 0; k < change.cameras; k++) {
        input.cameras[k].camera = true_camera(models[random.bits() % 2], random);
        input.cameras[k].readout_s = change.readout_s;
        if (k > 0) input.cameras[k].T_cam_first = rigid_of({0, .05, 0, -.08, 0, .01});
    }
    Hand hand(random, input.cameras[0].camera.fx);
    std::copy(change.turns, change.turns + 3, hand.turns);
    hand.moves = change.moves;
    truth.T_cam_imu = any_place(random);
    truth.shift_s = random.between(-.02, .02) + (seed % 3 == 0 ? .4 : 0);
    truth.drift = change.drift;
    truth.gravity = Eigen::Vector3d(.1 * random.gauss(), 1, .1 * random.gauss()).normalized();
    truth.gravity *= GRAVITY;
    add_samples(hand, truth, change.seconds, random, input);
    for (InertialCamera &camera : input.cameras)
        for (double time_s = 0; time_s < change.seconds; time_s += 1 / change.picture_hz)
            camera.views.push_back(view_at(hand, camera, time_s, random));
    return simulated;
}

InertialSolution solved(const InertialInput &input)
{
    InertialSolution solution;
    std::string error;
    if (!solve_inertial(input, solution, error)) fail_msg("%s", error.c_str());
    return solution;
}

struct Off {
    double turn_rad, place_m, time_s;
    double turn, place, time; /* over what is stated, as standard deviations of one number */
    double squares;           /* of seven numbers over their deviations */
    double worst;
};

/* How far out three numbers are in their common distribution, as that of one number that is as
 * seldom: exact at three standard deviations. */
double as_one(double squares)
{
    constexpr double three_of_three = 3.7625; /* of them .9973 lie within */
    return 3 * std::sqrt(squares) / three_of_three;
}

/* Of the camera's place on the sensor, as the solution's deviations are. */
Off off(const InertialSolution &found, const Truth &truth)
{
    const Eigen::Vector3d turn = angle_axis(found.T_cam_imu.R * truth.T_cam_imu.R.transpose()),
                          place = found.T_cam_imu.inverse().t - truth.T_cam_imu.inverse().t;
    const double time_s = found.time_shift_s - truth.shift_s;
    const Eigen::Matrix3d of_turn = found.covariance.topLeftCorner<3, 3>(),
                          of_place = found.covariance.bottomRightCorner<3, 3>();
    Off off = {turn.norm(), place.norm(), std::fabs(time_s), 0, 0, 0, 0, 0};
    off.turn = as_one(turn.dot(of_turn.ldlt().solve(turn)));
    off.place = as_one(place.dot(of_place.ldlt().solve(place)));
    off.time = std::fabs(time_s) / found.time_shift_stdev_s;
    off.worst = std::max({off.turn, off.place, off.time});
    for (int i = 0; i < 3; i++)
        off.squares += std::pow(turn[i] / found.stdev[(size_t)i], 2) +
                       std::pow(place[i] / found.stdev[(size_t)(3 + i)], 2);
    off.squares += off.time * off.time;
    return off;
}

void rigs_are_found_as_near_as_stated(void **)
{
    double squares = 0;
    for (int seed = 1; seed <= rigs(); seed++) {
        Change change;
        change.cameras = seed % 4 == 0 ? 2 : 1;
        change.readout_s = seed % 2 == 0 ? .015 : 0;
        if (rigs() < 20) change.picture_hz = 10;
        const Simulated one = simulate((unsigned)seed, change);
        const InertialSolution found = solved(one.input);
        const Verdict verdict = judge_inertial(found);
        const Off error = off(found, one.truth);
        printf("rig %d: off by %.4f degrees (%.1f deviations), %.2f mm (%.1f), %.4f ms (%.1f); %d "
               "pictures, noise %.3f px, %.2f and %.2f of stated, %s\n",
               seed, DEGREE * error.turn_rad, error.turn, 1e3 * error.place_m, error.place,
               1e3 * error.time_s, error.time, found.views_used, found.noise_px, found.excess[0],
               found.excess[1], grade_name(verdict.grade));
        for (const Reason &reason : verdict.reasons)
            printf("    %s\n", reason.text.c_str());
        fflush(stdout);
        assert_true(error.turn_rad < .1 / DEGREE);
        assert_true(error.place_m < .005);
        assert_true(error.time_s < 2e-4);
        assert_true(error.worst < 3);
        assert_true(std::fabs(found.noise_px / NOISE_PX - 1) < .05);
        assert_int_equal(verdict.grade, Grade::pass);
        squares += error.squares;
    }
    const double size = std::sqrt(squares / (7 * rigs()));
    printf("%d parameters off by %.2f standard deviations rms\n", 7 * rigs(), size);
    assert_true(size > .5 && size < (rigs() >= 20 ? 1.3 : 1.6));
}

/* The place of a second camera, of which the first one's and its own are known: the formula against
 * draws of both. */
void the_place_of_another_camera_is_as_sure_as_draws_say(void **)
{
    constexpr int draws = 20000;
    Random random = {std::mt19937_64(40)};
    InertialSolution solution;
    solution.T_cam_imu = any_place(random);
    const Rigid T_first_cam = rigid_of({.3, -.9, .4, .5, -.3, .2});
    const std::array<double, 6> own = {2e-3, 1e-3, 3e-3, 1e-3, 2e-3, 4e-3};
    Eigen::Matrix<double, 6, 6> root; /* of the covariance */
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++)
            root(i, j) = 2e-3 * random.gauss();
    solution.covariance = root * root.transpose();
    const Rigid T_imu_first = solution.T_cam_imu.inverse(), T_imu_cam = T_imu_first * T_first_cam;
    std::array<double, 6> squares = {};
    for (int draw = 0; draw < draws; draw++) {
        Eigen::Matrix<double, 6, 1> unit;
        std::array<double, 6> other;
        for (int i = 0; i < 6; i++) {
            unit[i] = random.gauss();
            other[(size_t)i] = own[(size_t)i] * random.gauss();
        }
        const Eigen::Matrix<double, 6, 1> first = root * unit;
        Rigid moved_first = T_imu_first, moved_cam = T_first_cam;
        moved_first.R *= rigid_of({-first[0], -first[1], -first[2], 0, 0, 0}).R;
        moved_first.t += first.tail<3>();
        moved_cam.R *= rigid_of({-other[0], -other[1], -other[2], 0, 0, 0}).R;
        moved_cam.t += Eigen::Vector3d(other[3], other[4], other[5]);
        const Rigid moved = moved_first * moved_cam;
        const Eigen::Vector3d turn = angle_axis(T_imu_cam.R.transpose() * moved.R),
                              place = moved.t - T_imu_cam.t;
        for (int i = 0; i < 6; i++)
            squares[(size_t)i] += std::pow(i < 3 ? turn[i] : place[i - 3], 2);
    }
    const std::array<double, 6> stated = place_stdev(solution, T_first_cam, own);
    for (size_t i = 0; i < 6; i++)
        assert_true(std::fabs(std::sqrt(squares[i] / draws) / stated[i] - 1) < .05);
}

/* ---- rigs that are bad on purpose ------------------------------------------------------------ */

/* Whether the verdict, or the error where nothing is solved, is at least so bad and says `word`. */
void expect_trouble(const InertialInput &input, Grade least, const char *word)
{
    InertialSolution solution;
    std::string error;
    if (!solve_inertial(input, solution, error)) {
        printf("    %s\n", error.c_str());
        if (std::strstr(error.c_str(), word) == nullptr) fail_msg("expected '%s'", word);
        return;
    }
    const Verdict verdict = judge_inertial(solution);
    bool said = false;
    for (const Reason &reason : verdict.reasons) {
        printf("    %s: %s\n", grade_name(reason.grade), reason.text.c_str());
        said |= std::strstr(reason.text.c_str(), word) != nullptr;
    }
    if (!said) fail_msg("expected '%s'", word);
    assert_true(verdict.grade >= least);
}

void turns_about_one_axis_are_named(void **)
{
    Change change = short_one();
    change.turns[0] = change.turns[1] = 0;
    expect_trouble(simulate(31, change).input, Grade::doubtful, "about two");
}

void a_slow_hand_is_named(void **)
{
    Change change = short_one();
    change.moves = .05;
    for (double &turn : change.turns)
        turn = .06;
    expect_trouble(simulate(32, change).input, Grade::doubtful, "accelerated by");
}

void a_clock_that_runs_faster_is_named(void **)
{
    Change change = short_one();
    change.drift = 60e-6;
    expect_trouble(simulate(33, change).input, Grade::doubtful, "clocks differ");
}

void other_clocks_are_named(void **)
{
    Change change = short_one();
    Simulated one = simulate(34, change);
    for (fovea_imu_sample &sample : one.input.samples)
        sample.stamp_ns -= 1'600'000'000'000'000'000;
    expect_trouble(one.input, Grade::fail, "of one clock");
}

void a_gyroscope_at_its_end_is_named(void **)
{
    Change change = short_one();
    Simulated one = simulate(35, change);
    constexpr double end = .8;
    one.input.imu.gyro_range = end;
    for (fovea_imu_sample &sample : one.input.samples)
        for (double &rate : sample.gyro)
            rate = std::clamp(rate, -end, end);
    expect_trouble(one.input, Grade::doubtful, "end of its range");
}

void units_are_named(void **)
{
    Change change = short_one();
    Simulated one = simulate(36, change);
    for (fovea_imu_sample &sample : one.input.samples)
        for (double &value : sample.acceleration)
            value /= GRAVITY;
    expect_trouble(one.input, Grade::fail, "not in m/s^2");
    for (fovea_imu_sample &sample : one.input.samples)
        for (double &rate : sample.gyro)
            rate *= DEGREE;
    expect_trouble(one.input, Grade::fail, "degrees per second");
}

void a_sensor_on_another_body_is_named(void **)
{
    Change change = short_one();
    Simulated one = simulate(37, change);
    one.input.samples = simulate(38, change).input.samples;
    expect_trouble(one.input, Grade::fail, "not fixed to the camera");
}

void too_few_pictures_are_named(void **)
{
    Change change;
    change.seconds = .5;
    expect_trouble(simulate(39, change).input, Grade::fail, "keep the board in the image");
}

} // namespace

int main()
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(rigs_are_found_as_near_as_stated),
        cmocka_unit_test(the_place_of_another_camera_is_as_sure_as_draws_say),
        cmocka_unit_test(turns_about_one_axis_are_named),
        cmocka_unit_test(a_slow_hand_is_named),
        cmocka_unit_test(a_clock_that_runs_faster_is_named),
        cmocka_unit_test(other_clocks_are_named),
        cmocka_unit_test(a_gyroscope_at_its_end_is_named),
        cmocka_unit_test(units_are_named),
        cmocka_unit_test(a_sensor_on_another_body_is_named),
        cmocka_unit_test(too_few_pictures_are_named),
    };
    return cmocka_run_group_tests(tests, nullptr, nullptr);
}

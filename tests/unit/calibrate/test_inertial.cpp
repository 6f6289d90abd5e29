/* Cameras to an inertial sensor: simulated rigs are found as near to the truth as stated, and what
 * is wrong is named. FOVEA_LONG: the number of rigs (default 2; the campaign: 20). */
#include "calibrate/command.h"
#include "calibrate/inertial.h"
#include "calibrate/inertial_cost.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <unistd.h>

#include "support/calibration.h"

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
            if (fovea_camera_project(&camera.camera, seen_at.data(), pixel, nullptr) != FOVEA_OK ||
                pixel[0] < 3 || pixel[1] < 3 || pixel[0] > WIDTH - 4 || pixel[1] > HEIGHT - 4) {
                view.corners.clear();
                view.left_out = "no board";
                return view;
            }
        }
        view.corners.push_back(
            {pixel[0] + NOISE_PX * random.gauss(), pixel[1] + NOISE_PX * random.gauss()});
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

/* ---- derivatives ----------------------------------------------------------------------------- */

/* Those written out against differences, for every block of a cost. */
void expect_derivatives(const ceres::CostFunction &cost, std::vector<std::vector<double>> blocks)
{
    const auto rows = (size_t)cost.num_residuals();
    std::vector<double *> at;
    std::vector<std::vector<double>> jacobians;
    std::vector<double *> to;
    for (std::vector<double> &block : blocks) {
        at.push_back(block.data());
        jacobians.emplace_back(rows * block.size());
    }
    for (std::vector<double> &jacobian : jacobians)
        to.push_back(jacobian.data());
    std::vector<double> residuals(rows), above(rows), below(rows);
    assert_true(cost.Evaluate(at.data(), residuals.data(), to.data()));
    for (size_t b = 0; b < blocks.size(); b++)
        for (size_t i = 0; i < blocks[b].size(); i++) {
            constexpr double step = 1e-6;
            const double before = blocks[b][i];
            blocks[b][i] = before + step;
            assert_true(cost.Evaluate(at.data(), above.data(), nullptr));
            blocks[b][i] = before - step;
            assert_true(cost.Evaluate(at.data(), below.data(), nullptr));
            blocks[b][i] = before;
            for (size_t r = 0; r < rows; r++) {
                const double difference = (above[r] - below[r]) / (2 * step),
                             written = jacobians[b][r * blocks[b].size() + i];
                if (std::fabs(difference - written) > 1e-5 * (1 + std::fabs(written)))
                    fail_msg("block %zu, number %zu, residual %zu: %g, by differences %g", b, i, r,
                             written, difference);
            }
        }
}

std::vector<double> near(Random &random, std::vector<double> values, double spread)
{
    for (double &value : values)
        value += random.between(-spread, spread);
    return values;
}

void derivatives_are_those_of_the_residuals(void **)
{
    Random random = {std::mt19937_64(41)};
    Spline spline(0, 1, .1);
    const Model models[] = {Model::radtan, Model::equidistant};
    for (const Model model : models) {
        PictureCost::Camera camera = {model, {}, rigid_of({.1, 0, .2, .1, 0, 0}), .02, HEIGHT};
        const fovea_camera lens = true_camera(model, random);
        camera.parameters = parameters_of(lens);
        const PictureCost picture(spline, camera,
                                  {{{.1, .05, 2}, {300, 200}}, {{-.2, .1, 2.2}, {100, 400}}}, .51,
                                  .4, .013, .2);
        std::vector<std::vector<double>> blocks;
        for (int j = 0; j < PictureCost::CONTROLS; j++)
            blocks.push_back(near(random, {.1, -.2, .1, 0, 0, 0}, .05));
        blocks.push_back({.1, .2, -.1, .05, .02, .01});
        blocks.push_back({.013, 1e-3});
        expect_derivatives(picture, blocks);
    }
    const ReadingsCost readings(
        spline, 4, .35, .5,
        {{.41, {.1, .2, .3}, {1, 9, 2}, {2, 3}}, {.47, {.1, -.2, .3}, {1, 9, 1}, {2, 0}}});
    std::vector<std::vector<double>> blocks;
    for (int j = 0; j < SPLINE_ORDER; j++)
        blocks.push_back(near(random, {.3, -.5, .8, .1, .2, .3}, .1));
    blocks.push_back(near(random, std::vector<double>(6), .1));
    blocks.push_back(near(random, std::vector<double>(6), .1));
    blocks.push_back({.3, 9.7, -.2});
    expect_derivatives(readings, blocks);
}

/* A polynomial of the spline's degree is met exactly, with both derivatives. */
void a_spline_meets_a_polynomial(void **)
{
    const auto value = [](double t) {
        return 1 + t * (2 - t * (1 + t * (.5 - t * (.2 + .1 * t))));
    };
    std::vector<double> times_s;
    std::vector<Eigen::Matrix<double, 6, 1>> values;
    for (double time_s = 0; time_s < 2; time_s += .01) {
        times_s.push_back(time_s);
        values.emplace_back(Eigen::Matrix<double, 6, 1>::Constant(value(time_s)));
    }
    Spline spline(0, 2, .1);
    fit_spline(times_s, values, spline);
    for (double time_s = .5; time_s < 1.5; time_s += .037) {
        const int at = spline.segment(time_s);
        const SplineWeights weights = spline_weights(spline.within(time_s, at), spline.step_s);
        constexpr double step = 1e-4;
        assert_true(std::fabs(spline.sum(at, weights.value)[3] - value(time_s)) < 1e-5);
        assert_true(std::fabs(spline.sum(at, weights.first)[3] -
                              (value(time_s + step) - value(time_s - step)) / (2 * step)) < 1e-3);
        assert_true(std::fabs(spline.sum(at, weights.second)[3] -
                              (value(time_s + step) - 2 * value(time_s) + value(time_s - step)) /
                                  (step * step)) < 2e-2);
    }
}

/* ---- the program ----------------------------------------------------------------------------- */

int run(std::vector<std::string> words)
{
    std::vector<char *> arguments;
    for (std::string &word : words)
        arguments.push_back(word.data());
    arguments.push_back(nullptr);
    return command_rig((int)words.size(), arguments.data());
}

std::string read_text(const std::string &path)
{
    std::string text;
    FILE *file = fopen(path.c_str(), "r");
    assert_non_null(file);
    for (int c; (c = fgetc(file)) != EOF;)
        text += (char)c;
    fclose(file);
    return text;
}

void expect_in(const std::string &text, const char *words)
{
    if (text.find(words) == std::string::npos)
        fail_msg("expected '%s' in:\n%s", words, text.c_str());
}

/* Pictures that are rendered, corners that are found in them, samples as they come with them. */
void the_simulated_rig_is_found(void **)
{
    char folder[] = "/tmp/fovea-inertial-XXXXXX";
    assert_non_null(mkdtemp(folder));
    const std::string at = folder, lens = at + "/camera.yaml", out = at + "/rig.yaml",
                      sensor = at + "/imu.yaml", json = at + "/verdict.json",
                      html = at + "/report.html";
    const std::string source = "sim:board?width=320&height=240&rate=8&frames=160&lens=pinhole&imu="
                               "200&imu_pose=0.05,-0.03,0.02,10,-20,85&imu_offset=7";
    /* The lens of the simulator, which the source states (drivers/sim/rig.c). */
    FILE *file = fopen(lens.c_str(), "w");
    assert_non_null(file);
    const double focal = 160 / std::tan(40 / DEGREE);
    fprintf(file,
            "image_width: 320\nimage_height: 240\ndistortion_model: plumb_bob\n"
            "camera_matrix: {rows: 3, cols: 3, data: [%.12g, 0, 162.7, 0, %.12g, 117.8, 0, 0, 1]}\n"
            "distortion_coefficients: {rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}\n",
            focal, 1.001 * focal);
    assert_int_equal(fclose(file), 0);
    assert_int_equal(run({"rig", "--source", source, "--target", "chessboard:9x6:0.03", "--camera",
                          lens, "--imu", "source", "--views", "12", "--out", out, "--imu-out",
                          sensor, "--json", json, "--report", html}),
                     0);
    fv_calibration found;
    fovea_error error;
    assert_int_equal(fv_calibration_read(out.c_str(), nullptr, &found, &error), FOVEA_OK);
    assert_true(found.has_T_body_cam && found.has_time_shift);
    /* T_body_imu of the simulator, whose body is the camera */
    const double turn[3] = {10 / DEGREE, -20 / DEGREE, 85 / DEGREE};
    Rigid T_cam_imu;
    T_cam_imu.R = (Eigen::AngleAxisd(turn[2], Eigen::Vector3d::UnitZ()) *
                   Eigen::AngleAxisd(turn[1], Eigen::Vector3d::UnitY()) *
                   Eigen::AngleAxisd(turn[0], Eigen::Vector3d::UnitX()))
                      .toRotationMatrix();
    T_cam_imu.t = {.05, -.03, .02};
    Rigid T_imu_cam;
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++)
            T_imu_cam.R(i, j) = found.T_body_cam[4 * i + j];
        T_imu_cam.t[i] = found.T_body_cam[4 * i + 3];
    }
    const double turned = angle_axis(T_imu_cam.R * T_cam_imu.R).norm();
    const double moved = (T_imu_cam.t - T_cam_imu.inverse().t).norm();
    /* A sample is the mean of the interval before its stamp. */
    const double late_s = found.time_shift_s - (-7e-3 + 2.5e-3);
    printf("off by %.4f degrees, %.2f mm (%.2g %.2g %.2g stated), %.4f ms (%.2g stated)\n",
           DEGREE * turned, 1e3 * moved, 1e3 * found.record.place_stdev[3],
           1e3 * found.record.place_stdev[4], 1e3 * found.record.place_stdev[5], 1e3 * late_s,
           1e3 * found.record.time_shift_stdev_s);
    assert_true(turned < .1 / DEGREE && moved < .005 && std::fabs(late_s) < 2e-4);
    for (const double stdev : found.record.place_stdev)
        assert_true(stdev > 0);
    assert_true(std::fabs(late_s) < 4 * found.record.time_shift_stdev_s);
    expect_in(read_text(sensor), "time_offset_ns: 4");
    expect_in(read_text(json), "\"T_cam0_imu\": [");
    expect_in(read_text(json), "\"time_offset_s\": {\"value\": 0.004");
    expect_in(read_text(html), "Inertial sensor");
    for (const std::string &path : {lens, out, sensor, json, html})
        unlink(path.c_str());
    assert_int_equal(rmdir(folder), 0);
}

void wrong_input_is_refused(void **)
{
    const std::vector<std::string> words = {"rig", "--target", "chessboard:9x6:0.03", "--source",
                                            "sim:board?frames=2"};
    const std::vector<std::vector<std::string>> wrong = {
        {"--imu", "source"}, /* this source has none */
        {"--imu", "none"},
        {"--imu", "lcm:IMU"}, /* without its densities */
        {"--imu", "iio:adis16448", "--imu-file", "/none"},
        {"--imu", "source", "--seconds", "0"},
        {"--imu", "source", "--source", "sim:board?frames=3"},
        {"--imu-file", "imu.yaml"},
    };
    for (const std::vector<std::string> &more : wrong) {
        std::vector<std::string> all = words;
        all.insert(all.end(), more.begin(), more.end());
        assert_int_equal(run(all), 2);
    }
}

} // namespace

int main()
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_spline_meets_a_polynomial),
        cmocka_unit_test(derivatives_are_those_of_the_residuals),
        cmocka_unit_test(rigs_are_found_as_near_as_stated),
        cmocka_unit_test(turns_about_one_axis_are_named),
        cmocka_unit_test(a_slow_hand_is_named),
        cmocka_unit_test(a_clock_that_runs_faster_is_named),
        cmocka_unit_test(other_clocks_are_named),
        cmocka_unit_test(a_gyroscope_at_its_end_is_named),
        cmocka_unit_test(units_are_named),
        cmocka_unit_test(a_sensor_on_another_body_is_named),
        cmocka_unit_test(too_few_pictures_are_named),
        cmocka_unit_test(the_simulated_rig_is_found),
        cmocka_unit_test(wrong_input_is_refused),
    };
    return cmocka_run_group_tests(tests, nullptr, nullptr);
}

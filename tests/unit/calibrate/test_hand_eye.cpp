/* A camera on a body that moves: simulated ones are found as near to the truth as stated; motions
 * that do not determine it are refused by name. */
#include "calibrate/command.h"
#include "calibrate/hand_eye.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <thread>
#include <unistd.h>

#include <lcm/lcm.h>

#include "bot_core_pose_t.h"
#include "drivers/table.h"
#include "fovea/source.h"
#include "support/calibration.h"
#include "support/text.h"

#include "common/calibrate_command.h"
#include "common/cmocka_cpp.h"
#include "common/simulated_boards.h"

using namespace calibrate;
using namespace simulated;

#define LCM_URL "udpm://239.255.76.67:7689"

namespace
{

struct Set {
    Rigid T_body_cam;
    fovea_camera camera;
    std::vector<View> views;
    std::vector<BodyPose> poses;
};

Rigid random_rigid(Random &random, double turn, double place)
{
    Pose pose;
    for (size_t i = 0; i < 6; i++)
        pose[i] = random.between(-1, 1) * (i < 3 ? turn : place);
    return rigid_of(pose);
}

Rigid noisy(const Rigid &T, Random &random, double rad, double m)
{
    const Pose error = {rad * random.gauss(), rad * random.gauss(), rad * random.gauss(),
                        m * random.gauss(),   m * random.gauss(),   m * random.gauss()};
    return T * rigid_of(error);
}

/* The board is held before the camera in as many ways; the body follows from it. */
Set random_set(unsigned seed, double noise_rad, double noise_m, double reach_m = .2)
{
    Random random = {std::mt19937_64(seed)};
    Set set;
    set.camera = true_camera(Model::radtan, random);
    set.T_body_cam = random_rigid(random, 1.5, reach_m);
    const Rigid T_world_board = random_rigid(random, 1, 1);
    while (set.views.size() < 15) {
        Held held;
        const double size = board.square_m * (board.columns - 1),
                     height = board.square_m * (board.rows - 1);
        if (!hold(set.camera, random, Holding(), size, held)) continue;
        Rigid T_cam_board;
        for (int i = 0; i < 3; i++) {
            T_cam_board.R(i, 0) = held.x[i];
            T_cam_board.R(i, 1) = held.y[i];
            T_cam_board.R(i, 2) = held.z[i];
            T_cam_board.t[i] = held.middle[i] - .5 * size * held.x[i] - .5 * height * held.y[i];
        }
        View view;
        for (const Point &point : board.points()) {
            const Eigen::Vector3d at = T_cam_board * Eigen::Vector3d(point[0], point[1], 0);
            double pixel[2];
            if (fovea_camera_project(&set.camera, at.data(), pixel, nullptr) != FOVEA_OK) break;
            view.corners.push_back(
                {pixel[0] + NOISE_PX * random.gauss(), pixel[1] + NOISE_PX * random.gauss()});
        }
        if (view.corners.size() != board.points().size()) continue;
        set.views.push_back(view);
        const Rigid T_world_body = T_world_board * T_cam_board.inverse() * set.T_body_cam.inverse();
        set.poses.push_back({true, noisy(T_world_body, random, noise_rad, noise_m)});
    }
    return set;
}

HandEyeSolution solved(const Set &set)
{
    HandEyeSolution solution;
    std::string error;
    if (!solve_hand_eye(board, set.views, set.poses, set.camera, solution, error))
        fail_msg("%s", error.c_str());
    return solution;
}

void cameras_are_found_as_stated(double noise_rad, double noise_m, double reach_m)
{
    int count = 0, beyond_three = 0;
    double squares[2] = {}; /* of the rotation and of the place: one does not hide the other */
    for (unsigned seed = 1; seed <= 100; seed++) {
        const Set set = random_set(seed, noise_rad, noise_m, reach_m);
        const HandEyeSolution solution = solved(set);
        const Eigen::Vector3d turn =
            angle_axis(solution.T_body_cam.R * set.T_body_cam.R.transpose());
        const Eigen::Vector3d place = solution.T_body_cam.t - set.T_body_cam.t;
        for (int i = 0; i < 6; i++) {
            const double ratio = (i < 3 ? turn[i] : place[i - 3]) / solution.stdev[(size_t)i];
            count++;
            beyond_three += std::fabs(ratio) > 3;
            squares[i / 3] += ratio * ratio;
        }
        assert_true(turn.norm() < .02 && place.norm() < .02 * std::max(1., reach_m / .2));
    }
    const double turns = std::sqrt(2 * squares[0] / count),
                 places = std::sqrt(2 * squares[1] / count);
    printf("poses within %.2g rad, %.2g m: %d parameters, %d beyond three standard deviations, rms "
           "%.3f of turns, %.3f of places\n",
           noise_rad, noise_m, count, beyond_three, turns, places);
    assert_true(beyond_three <= .01 * count);
    for (const double size : {turns, places})
        assert_true(size > .85 && size < 1.15);
}

void cameras_on_exact_bodies_are_found_as_stated(void **)
{
    cameras_are_found_as_stated(0, 0, .2);
}

void cameras_on_bodies_with_noise_are_found_as_stated(void **)
{
    cameras_are_found_as_stated(.002, .001, .2);
}

/* Where a small rotation moves the camera far. */
void cameras_far_from_the_body_are_found_as_stated(void **)
{
    cameras_are_found_as_stated(.002, .001, 1.5);
}

void the_noise_of_poses_is_found(void **)
{
    double rad = 0, m = 0;
    for (unsigned seed = 1; seed <= 20; seed++) {
        const HandEyeSolution solution = solved(random_set(seed, .004, .003));
        rad += solution.pose_noise_rad / 20;
        m += solution.pose_noise_m / 20;
    }
    assert_true(std::fabs(rad / .004 - 1) < .1);
    assert_true(std::fabs(m / .003 - 1) < .1);
}

/* Picture `v` without noise: where the board and the body are. */
void place_view(Set &set, size_t v, const Rigid &T_cam_board, const Rigid &T_world_body)
{
    set.poses[v].T_world_body = T_world_body;
    set.views[v].corners.clear();
    for (const Point &point : board.points()) {
        const Eigen::Vector3d at = T_cam_board * Eigen::Vector3d(point[0], point[1], 0);
        double pixel[2] = {0, 0};
        assert_int_equal(fovea_camera_project(&set.camera, at.data(), pixel, nullptr), FOVEA_OK);
        set.views[v].corners.push_back({pixel[0], pixel[1]});
    }
}

void motions_that_are_not_enough_are_named(void **)
{
    Set set = random_set(1, 0, 0);
    for (int axis = -1; axis < 1; axis++) {
        /* moved along x only; then turned about the body's z, too */
        HandEyeSolution solution;
        std::string error;
        Random random = {std::mt19937_64(2)};
        for (size_t v = 0; v < set.views.size(); v++) {
            Rigid T_world_body;
            const double turn = axis < 0 ? 0 : .02 * ((double)v - 7);
            T_world_body.R = Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitZ());
            T_world_body.t = {.01 * (double)v, .03 * random.gauss(), 0};
            Rigid board_before = Rigid();
            board_before.t = {-.1, -.07, .5};
            const Rigid T_cam_board =
                set.T_body_cam.inverse() * T_world_body.inverse() * set.T_body_cam * board_before;
            place_view(set, v, T_cam_board, T_world_body);
        }
        assert_false(solve_hand_eye(board, set.views, set.poses, set.camera, solution, error));
        assert_non_null(std::strstr(
            error.c_str(), axis < 0 ? "no rotation" : "about one axis alone, (0.00, 0.00, "));
    }
}

/* Half a turn of the camera about its optical axis, there and back. */
void half_turns_are_named(void **)
{
    Set set = random_set(1, 0, 0);
    HandEyeSolution solution;
    std::string error;
    for (size_t v = 0; v < set.views.size(); v++) {
        Rigid turn, board_before;
        turn.R = Eigen::AngleAxisd(v % 2 == 0 ? 0 : 3.1415, Eigen::Vector3d::UnitZ());
        turn.t = {.01 * (double)(v % 3), 0, 0};
        board_before.t = {-.12, -.07, .6};
        place_view(set, v, turn.inverse() * board_before,
                   set.T_body_cam * turn * set.T_body_cam.inverse());
    }
    assert_false(solve_hand_eye(board, set.views, set.poses, set.camera, solution, error));
    if (std::strncmp(error.c_str(), "half turns: 56 of 105 ", 22) != 0)
        fail_msg("%s", error.c_str());
}

void a_wrong_pose_is_left_out(void **)
{
    Set set = random_set(3, .001, .001);
    set.poses[4].T_world_body.t[1] += .05;
    const HandEyeSolution solution = solved(set);
    for (size_t v = 0; v < set.views.size(); v++)
        assert_int_equal(solution.left_out[v].empty(), v != 4);
    assert_int_equal(judge_hand_eye(solution).grade, Grade::pass);
}

void poses_of_other_pictures_do_not_pass(void **)
{
    Set set = random_set(4, 0, 0);
    std::rotate(set.poses.begin(), set.poses.begin() + 1, set.poses.end());
    HandEyeSolution solution;
    std::string error;
    if (solve_hand_eye(board, set.views, set.poses, set.camera, solution, error))
        assert_int_equal(judge_hand_eye(solution).grade, Grade::fail);
}

int run(const std::vector<std::string> &words)
{
    return run_command(command_hand_eye, words);
}

void write(const std::string &path, const std::string &text)
{
    FILE *file = std::fopen(path.c_str(), "w");
    assert_non_null(file);
    std::fputs(text.c_str(), file);
    assert_int_equal(std::fclose(file), 0);
}

/* The command hears on LCM what stands in the lines of a file. Stamps are those of the pictures, as
 * the simulated clock is none of this host. */
void send_poses(const std::string &lines, const std::atomic<bool> &ended)
{
    lcm_t *lcm = lcm_create(LCM_URL "?ttl=0");
    assert_non_null(lcm);
    while (!ended) {
        for (const char *line = lines.c_str(); *line != '\0'; line = std::strchr(line, '\n') + 1) {
            bot_core_pose_t pose = {};
            double stamp_s, *p = pose.pos, *q = pose.orientation;
            if (std::sscanf(line, "%lf %lf %lf %lf %lf %lf %lf %lf", &stamp_s, &p[0], &p[1], &p[2],
                            &q[1], &q[2], &q[3], &q[0]) != 8)
                continue;
            pose.utime = std::llround(1e6 * stamp_s);
            bot_core_pose_t_publish(lcm, "BODY", &pose);
        }
        usleep(20000);
    }
    lcm_destroy(lcm);
}

void hear_poses(std::vector<std::string> words, const std::string &lines, const std::string &json,
                double T_body_cam[12])
{
    const auto value =
        [&](const char *option) { /* what follows it */
                                  return std::find(words.begin(), words.end(), option) + 1;
        };
    *value("--poses") = "lcm:BODY";
    words.insert(words.end(), {"--lcm-url", LCM_URL});
    std::atomic<bool> ended = false;
    std::thread sender(send_poses, std::cref(lines), std::cref(ended));
    const int status = run(words);
    ended = true;
    sender.join();
    assert_int_equal(status, 0);
    char *text = nullptr;
    size_t bytes = 0;
    fovea_error error;
    assert_int_equal(fv_text_read(json.c_str(), 1000000, &text, &bytes, &error), FOVEA_OK);
    const char *at = std::strstr(text, "\"T_body_cam\": [");
    assert_non_null(at);
    at = std::strchr(at, '[');
    for (int i = 0; i < 12; i++)
        T_body_cam[i] = std::strtod(at + 1, const_cast<char **>(&at));
    std::free(text);
    *value("--poses") = "lcm:SILENT";
    *value("--views") = "3";
    assert_int_equal(run(words), 2);
}

/* Whole, by pictures: the true poses of the simulated camera, which are by the time of its frames,
 * stand in the file, moved to a body that the camera is 0.2 m above and turned on. */
void the_command_finds_the_simulated_camera(void **)
{
    char folder[] = "/tmp/fovea-hand-eye-XXXXXX";
    assert_non_null(mkdtemp(folder));
    const std::string uri = "sim:board?frames=60&rate=2&lens=pinhole";
    const std::string camera = std::string(folder) + "/camera.yaml",
                      poses = std::string(folder) + "/poses.txt",
                      out = std::string(folder) + "/out.yaml", json = out + ".json",
                      report = out + ".html";
    const Rigid T_body_cam = rigid_of({.3, -.2, .1, .05, -.02, .2});
    const fovea_source_ops *ops;
    const char *address;
    fovea_error error;
    fovea_source *source;
    fovea_source_selection selection = {};
    selection.step = 1;
    assert_int_equal(fv_source_find(uri.c_str(), &ops, &address, &error), FOVEA_OK);
    assert_int_equal(ops->open(address, &selection, &source, &error), FOVEA_OK);
    const fovea_camera model = ops->info(source)->rig.cameras[0].camera;
    fv_calibration calibration = {};
    calibration.camera = model;
    assert_int_equal(
        fv_calibration_write(camera.c_str(), FV_CALIBRATION_ROS, &calibration, nullptr, &error),
        FOVEA_OK);
    assert_int_equal(ops->start(source, &error), FOVEA_OK);
    std::string lines = "# stamp tx ty tz qx qy qz qw\n";
    fovea_frame frame;
    while (ops->dequeue(source, INT64_MAX, &frame) == FOVEA_OK) {
        double rows[12];
        assert_int_equal(ops->truth_pose(source, &frame, rows), FOVEA_OK);
        Rigid T_world_cam;
        for (int i = 0; i < 3; i++) {
            for (int j = 0; j < 3; j++)
                T_world_cam.R(i, j) = rows[4 * i + j];
            T_world_cam.t[i] = rows[4 * i + 3];
        }
        const Rigid T = T_world_cam * T_body_cam.inverse();
        const Eigen::Quaterniond q(T.R);
        char line[300];
        snprintf(line, sizeof line, "%.9f %.12f %.12f %.12f %.12f %.12f %.12f %.12f\n",
                 (double)frame.stamp_ns * 1e-9, T.t[0], T.t[1], T.t[2], q.x(), q.y(), q.z(), q.w());
        lines += line;
        ops->requeue(source, &frame);
    }
    ops->stop(source);
    ops->close(source);
    write(poses, lines);
    const std::vector<std::string> words = {
        "hand-eye", "--source", uri,       "--target", "chessboard:9x6:0.03",
        "--camera", camera,     "--poses", poses,      "--views",
        "12",       "--out",    out,       "--json",   json,
        "--report", report};
    const int status = run(words);
    double by_lcm[12];
    hear_poses(words, lines, json, by_lcm);
    char *text = nullptr;
    size_t bytes = 0;
    const std::string written =
        fv_text_read(out.c_str(), 100000, &text, &bytes, &error) == FOVEA_OK ? text : "";
    std::free(text);
    std::vector<std::string> few = words;
    *(std::find(few.begin(), few.end(), "--views") + 1) = "3";
    write(poses, "1.0 0 0 0 0 0 0\n");
    assert_int_equal(run(few), 2);
    write(poses, "1e6 0 0 0 0 0 0 1\n"); /* of another clock */
    assert_int_equal(run(few), 2);
    for (const std::string &file : {camera, poses, out, json, report})
        unlink(file.c_str());
    assert_int_equal(rmdir(folder), 0);
    assert_int_equal(status, 0);
    double found[12];
    const char *at = std::strstr(written.c_str(), "T_body_cam:");
    assert_non_null(at);
    for (int i = 0; i < 3; i++) {
        at = std::strchr(at, '[');
        assert_non_null(at);
        assert_int_equal(std::sscanf(at, "[%lf, %lf, %lf, %lf]", &found[4 * i], &found[4 * i + 1],
                                     &found[4 * i + 2], &found[4 * i + 3]),
                         4);
        at++;
    }
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 4; j++)
            for (const double *T : {found, by_lcm})
                assert_true(std::fabs(T[4 * i + j] -
                                      (j < 3 ? T_body_cam.R(i, j) : T_body_cam.t[i])) < .002);
}

} // namespace

int main()
{
    const CMUnitTest tests[] = {
        cmocka_unit_test(cameras_on_exact_bodies_are_found_as_stated),
        cmocka_unit_test(cameras_on_bodies_with_noise_are_found_as_stated),
        cmocka_unit_test(cameras_far_from_the_body_are_found_as_stated),
        cmocka_unit_test(the_noise_of_poses_is_found),
        cmocka_unit_test(motions_that_are_not_enough_are_named),
        cmocka_unit_test(half_turns_are_named),
        cmocka_unit_test(a_wrong_pose_is_left_out),
        cmocka_unit_test(poses_of_other_pictures_do_not_pass),
        cmocka_unit_test(the_command_finds_the_simulated_camera),
    };
    return cmocka_run_group_tests(tests, nullptr, nullptr);
}

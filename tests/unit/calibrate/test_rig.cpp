/* Cameras of a rig to each other: simulated rigs are found as near to the truth as stated, a real
 * pair to a fraction of a pixel of its epipolar lines, and what is wrong is named. FOVEA_LONG: the
 * number of rigs (default 4; the campaign: 100). */
#include "calibrate/command.h"
#include "calibrate/pictures.h"
#include "calibrate/rig_report.h"
#include "calibrate/rigid.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <numeric>
#include <unistd.h>

#include "support/calibration.h"

#include "common/calibrate_command.h"
#include "common/cmocka_cpp.h"
#include "common/data_folder.h"
#include "common/simulated_boards.h"

using namespace calibrate;
using namespace simulated;

namespace
{

int rigs()
{
    const char *given = std::getenv("FOVEA_LONG");
    return given != nullptr && std::atoi(given) > 0 ? std::atoi(given) : 4;
}

Rigid random_place(Random &random)
{
    const double side = random.between(0, 1) < .5 ? -1 : 1;
    return rigid_of({random.between(-.1, .1), random.between(-.1, .1), random.between(-.3, .3),
                     side * random.between(.03, .12), random.between(-.03, .03),
                     random.between(-.03, .03)});
}

struct Truth {
    std::vector<fovea_camera> cameras;
    std::vector<Rigid> T_cam_first;
};

/* What a camera of the rig sees of a board that the first one holds; no corners: not all of it. */
View view_of_board(const Truth &truth, size_t k, const Held &held, Random &random)
{
    const double width = board.square_m * (board.columns - 1),
                 height = board.square_m * (board.rows - 1);
    View view;
    view.edge_px = 2.2;
    for (const Point &point : board.points()) {
        Eigen::Vector3d in_first;
        double pixel[2];
        for (int i = 0; i < 3; i++)
            in_first[i] = held.middle[i] + (point[0] - .5 * width) * held.x[i] +
                          (point[1] - .5 * height) * held.y[i];
        const Eigen::Vector3d in_camera = truth.T_cam_first[k] * in_first;
        if (!see_point(truth.cameras[k], in_camera.data(), pixel)) return without_board(view);
        view.corners.push_back(with_noise(pixel, random));
    }
    return view;
}

std::vector<RigInput> simulated_rig(Random &random, size_t count, bool held_lenses, Truth &truth)
{
    std::vector<RigInput> inputs(count);
    const Model models[] = {Model::radtan, Model::equidistant};
    for (size_t k = 0; k < count; k++) {
        inputs[k].source = "camera " + std::to_string(k);
        inputs[k].model = models[random.bits() % 2];
        truth.cameras.push_back(true_camera(inputs[k].model, random));
        truth.T_cam_first.push_back(k == 0 ? Rigid() : random_place(random));
        inputs[k].camera = truth.cameras[k];
        inputs[k].held = held_lenses;
    }
    for (int tries = 0; inputs[0].views.size() < 20; tries++) {
        Held board_held;
        if (tries == 2000) { /* these see little in common */
            truth = Truth();
            return simulated_rig(random, count, held_lenses, truth);
        }
        const double size = board.square_m * (board.columns - 1);
        Holding holding;
        holding.near = 2.5;
        holding.far = 6;
        if (!hold(truth.cameras[0], random, holding, size, board_held)) continue;
        std::vector<View> views;
        bool all = true;
        for (size_t k = 0; k < count; k++) {
            views.push_back(view_of_board(truth, k, board_held, random));
            all &= views[k].left_out.empty();
        }
        if (!all && inputs[0].views.size() < 12) continue; /* later some see it alone */
        for (size_t k = 0; k < count; k++)
            inputs[k].views.push_back(views[k]);
    }
    return inputs;
}

RigSolution solved(const std::vector<RigInput> &inputs)
{
    RigSolution solution;
    std::string error;
    if (!solve_rig(board, inputs, solution, error)) fail_msg("%s", error.c_str());
    return solution;
}

/* Error of a place over its standard deviations: turn about the camera's axes, its centre. */
std::array<double, 6> ratios_of(const RigCamera &camera, const Rigid &truth)
{
    const Rigid found = rigid_of(camera.T_cam_first);
    const Eigen::Vector3d turn = angle_axis(found.R * truth.R.transpose());
    std::array<double, 6> ratios;
    for (size_t i = 0; i < 3; i++) {
        ratios[i] = turn[(Eigen::Index)i] / camera.stdev[i];
        ratios[i + 3] =
            (found.inverse().t - truth.inverse().t)[(Eigen::Index)i] / camera.stdev[i + 3];
    }
    return ratios;
}

void places_are_as_near_as_stated(bool held_lenses)
{
    int count = 0, beyond_three = 0;
    double squares = 0;
    for (int seed = 1; seed <= rigs(); seed++) {
        Random random = {std::mt19937_64((unsigned)seed + (held_lenses ? 2000 : 0))};
        Truth truth;
        const size_t cameras = 2 + (size_t)seed % 2;
        const std::vector<RigInput> inputs = simulated_rig(random, cameras, held_lenses, truth);
        const RigSolution solution = solved(inputs);
        assert_true(solution.noise_px > .93 * NOISE_PX && solution.noise_px < 1.07 * NOISE_PX);
        for (size_t k = 1; k < cameras; k++) {
            for (const double ratio : ratios_of(solution.cameras[k], truth.T_cam_first[k])) {
                count++;
                beyond_three += std::fabs(ratio) > 3;
                squares += ratio * ratio;
            }
        }
    }
    const double size = std::sqrt(squares / count), spread = rigs() >= 100 ? .15 : .2;
    printf("%s lenses: %d parameters, %d beyond three standard deviations, rms %.3f\n",
           held_lenses ? "held" : "solved", count, beyond_three, size);
    assert_true(size > 1 - spread && size < 1 + spread);
    assert_true(beyond_three <= std::max(1., .01 * count));
}

void places_with_known_lenses_are_found_as_stated(void **)
{
    places_are_as_near_as_stated(true);
}

void places_with_unknown_lenses_are_found_as_stated(void **)
{
    places_are_as_near_as_stated(false);
}

/* The detector may count a board from its other end in some pictures, or in all of a camera that is
 * mounted upside down. */
void boards_counted_from_the_other_end_are_turned(void **)
{
    Random random = {std::mt19937_64(7)};
    Truth truth;
    std::vector<RigInput> inputs = simulated_rig(random, 2, true, truth);
    const RigSolution before = solved(inputs);
    for (size_t v = 0; v < inputs[1].views.size(); v++)
        if (v % 4 != 1)
            std::reverse(inputs[1].views[v].corners.begin(), inputs[1].views[v].corners.end());
    const RigSolution after = solved(inputs);
    for (size_t i = 0; i < 6; i++)
        assert_true(std::fabs(after.cameras[1].T_cam_first[i] - before.cameras[1].T_cam_first[i]) <
                    1e-6);
}

void pictures_of_different_instants_fail(void **)
{
    Random random = {std::mt19937_64(8)};
    Truth truth;
    std::vector<RigInput> inputs = simulated_rig(random, 2, true, truth);
    std::rotate(inputs[1].views.begin(), inputs[1].views.begin() + 1, inputs[1].views.end());
    RigSolution solution;
    std::string error;
    if (!solve_rig(board, inputs, solution, error)) {
        assert_true(!error.empty());
        return;
    }
    const Verdict verdict =
        judge_rig(inputs, solution, held_out_epipolar_px(board, inputs, solution, 5));
    assert_int_equal(verdict.grade, Grade::fail);
    bool named = false;
    for (const Reason &reason : verdict.reasons)
        named |= std::strstr(reason.text.c_str(), "instant") != nullptr ||
                 std::strstr(reason.text.c_str(), "shares") != nullptr;
    assert_true(named);
}

void cameras_that_share_no_board_are_named(void **)
{
    Random random = {std::mt19937_64(9)};
    Truth truth;
    std::vector<RigInput> inputs = simulated_rig(random, 3, true, truth);
    for (size_t v = 1; v < inputs[2].views.size(); v++)
        inputs[2].views[v].left_out = "no board";
    RigSolution solution;
    std::string error;
    assert_false(solve_rig(board, inputs, solution, error));
    assert_string_equal(error.c_str(),
                        "camera 2: found 1 pictures of the board taken together with another "
                        "camera, expected 2 or more: hold the board where both cameras see it");
}

std::string source(const std::string &side)
{
    return std::string("images:") + fv_data_folder() + "/calib_stereo_pinhole/" + side + "*.png";
}

/* Pairs whose numbers begin with these digits. */
std::vector<std::string> words_of_pairs(const std::string &digits, const std::string &out)
{
    return {"rig",
            "--source",
            source("left" + digits),
            "--source",
            source("right" + digits),
            "--target",
            "chessboard:9x6:0.025",
            "--model",
            "radtan",
            "--out",
            out};
}

/* The first nine, which determine the rig well enough for a verdict. */
std::vector<std::string> words_of_nine(const std::string &out)
{
    return words_of_pairs("0", out);
}

bool pair_is_there()
{
    if (access((std::string(fv_data_folder()) + "/calib_stereo_pinhole").c_str(), R_OK) == 0)
        return true;
    printf("SKIPPED the pair of calib_stereo_pinhole: it is not there\n");
    return false;
}

/* Solved from nine pairs, the corners of the other four are at most 0.3 px from their lines. */
void a_real_pair_is_near_its_epipolar_lines(void **)
{
    if (!pair_is_there()) skip();
    Board real;
    std::string error;
    std::vector<Collection> collections;
    fovea_error why;
    assert_true(board_parse("chessboard:9x6:0.025", real, error));
    assert_int_equal(collect_rig({source("left"), source("right")}, real, 40, collections, &why),
                     FOVEA_OK);
    std::vector<RigInput> whole(2);
    RigSolution all;
    for (size_t k = 0; k < 2; k++) {
        whole[k].camera.width = 640;
        whole[k].camera.height = 480;
        whole[k].views = collections[k].views;
    }
    if (!solve_rig(real, whole, all, error)) fail_msg("%s", error.c_str());
    /* OpenCV counts one board of this set from its other end */
    assert_int_equal(std::count(all.turned[1].begin(), all.turned[1].end(), 1), 1);
    for (unsigned split = 1; split <= 6; split++) {
        std::vector<RigInput> inputs(2);
        Random random = {std::mt19937_64(split)};
        std::vector<size_t> order(collections[0].views.size());
        std::iota(order.begin(), order.end(), 0);
        assert_int_equal(order.size(), 13);
        for (size_t i = order.size() - 1; i > 0; i--)
            std::swap(order[i], order[random.bits() % (i + 1)]);
        std::vector<char> held(order.size());
        for (size_t k = 0; k < 2; k++) {
            inputs[k].camera.width = 640;
            inputs[k].camera.height = 480;
            inputs[k].views = collections[k].views;
        }
        for (size_t i = 9; i < order.size(); i++) {
            held[order[i]] = 1;
            for (RigInput &input : inputs)
                if (input.views[order[i]].left_out.empty())
                    input.views[order[i]].left_out = "of the test";
        }
        RigSolution solution;
        if (!solve_rig(real, inputs, solution, error)) fail_msg("%s", error.c_str());
        for (size_t k = 0; k < 2; k++) {
            for (size_t v = 0; v < held.size(); v++) {
                if (!held[v] || inputs[k].views[v].left_out != "of the test") continue;
                solution.left_out[k][v].clear();
                solution.turned[k][v] = all.turned[k][v];
                for (size_t c = 0; c < solution.used[k][v].size(); c++)
                    solution.used[k][v][c] = 1; /* chessboards are seen whole */
            }
        }
        const double rms_px = epipolar_rms_px(inputs, solution, held);
        printf("split %u: %.3f px RMS from the epipolar lines\n", split, rms_px);
        assert_true(rms_px > 0 && rms_px <= .3);
    }
}

int run(const std::vector<std::string> &words)
{
    return run_command(command_rig, words);
}

fovea_camera found_lenses[2]; /* of the real pair; width 0: not yet */

/* The file of the program reads as the rig that it found, also as Kalibr's. */
void the_camchain_reads_as_the_rig(void **)
{
    if (!pair_is_there()) skip();
    char folder[] = "/tmp/fovea-rig-XXXXXX";
    assert_non_null(mkdtemp(folder));
    const std::string out = std::string(folder) + "/rig.yaml", json = out + ".json",
                      report = out + ".html";
    std::vector<std::string> with_reports = words_of_pairs("", out);
    with_reports.insert(with_reports.end(), {"--json", json, "--report", report});
    assert_int_equal(run(with_reports), 0);
    fv_calibration cameras[2], as_kalibr[2];
    fovea_error error;
    assert_int_equal(fv_calibration_read(out.c_str(), nullptr, &cameras[0], &error), FOVEA_OK);
    assert_int_equal(fv_calibration_read(out.c_str(), "cam1", &cameras[1], &error), FOVEA_OK);
    for (int k = 0; k < 2; k++)
        found_lenses[k] = cameras[k].camera;
    std::vector<std::string> for_kalibr = words_of_nine(out);
    for_kalibr.insert(for_kalibr.end(), {"--format", "kalibr"});
    assert_int_equal(run(for_kalibr), 0);
    assert_int_equal(fv_calibration_read(out.c_str(), nullptr, &as_kalibr[0], &error), FOVEA_OK);
    assert_int_equal(fv_calibration_read(out.c_str(), "cam1", &as_kalibr[1], &error), FOVEA_OK);
    unlink(out.c_str());
    unlink(json.c_str());
    unlink(report.c_str());
    assert_int_equal(rmdir(folder), 0);
    assert_false(cameras[0].has_T_body_cam); /* it is the body */
    assert_true(cameras[1].has_T_body_cam);
    assert_true(cameras[1].camera.k[4] != 0 && as_kalibr[1].camera.k[4] == 0);
    /* squares of 25 mm: OpenCV's sample of this pair has a baseline of 3.34 squares */
    assert_true(std::fabs(cameras[1].T_body_cam[3] - 3.34 * .025) < .0005);
    for (int i = 0; i < 3; i++)
        assert_true(cameras[1].record.place_stdev[i] > 0 &&
                    cameras[1].record.place_stdev[3 + i] > 0);
    assert_string_equal(cameras[1].record.verdict, "pass");
}

/* A camera file as ROS has it, with the focal length times `scale`. */
void write_camera(const std::string &path, const fovea_camera &camera, double scale)
{
    FILE *file = fopen(path.c_str(), "w");
    assert_non_null(file);
    fprintf(file,
            "image_width: %d\nimage_height: %d\ndistortion_model: plumb_bob\n"
            "camera_matrix: {rows: 3, cols: 3, data: [%.9g, 0, %.9g, 0, %.9g, %.9g, 0, 0, 1]}\n"
            "distortion_coefficients: {rows: 1, cols: 5, data: [%.9g, %.9g, %.9g, %.9g, %.9g]}\n",
            camera.width, camera.height, scale * camera.fx, camera.cx, scale * camera.fy, camera.cy,
            camera.k[0], camera.k[1], camera.k[2], camera.k[3], camera.k[4]);
    assert_int_equal(fclose(file), 0);
}

/* A lens from a file of another camera: the rig bends around it, its own pictures do not. */
void a_wrong_camera_file_fails(void **)
{
    if (!pair_is_there()) skip();
    char folder[] = "/tmp/fovea-rig-XXXXXX";
    assert_non_null(mkdtemp(folder));
    const std::string out = std::string(folder) + "/rig.yaml", files[2] = {out + ".0", out + ".1"};
    assert_true(found_lenses[0].width > 0 && found_lenses[1].width > 0);
    std::vector<std::string> held = words_of_nine(out);
    held.insert(held.end(), {"--camera", files[0], "--camera", files[1]});
    for (const double scale : {1., 1.02}) {
        unlink(out.c_str());
        write_camera(files[0], found_lenses[0], 1);
        write_camera(files[1], found_lenses[1], scale);
        assert_int_equal(run(held), scale == 1 ? 0 : 1);
        assert_int_equal(access(out.c_str(), F_OK), scale == 1 ? 0 : -1);
    }
    unlink(files[0].c_str());
    unlink(files[1].c_str());
    assert_int_equal(rmdir(folder), 0);
}

void wrong_input_is_refused(void **)
{
    assert_int_equal(run({"rig"}), 2);
    assert_int_equal(
        run({"rig", "--source", "/tmp", "--target", "chessboard:9x6:0.025", "--model", "fisheye"}),
        2);
    assert_int_equal(
        run({"rig", "--source", "sim:board?frames=1", "--target", "chessboard:9x6:0.03"}), 2);
    assert_int_equal(
        run({"rig", "--source", "/tmp", "--source", "/tmp/", "--target", "chessboard:9x6:0.03"}),
        2); /* one camera, named twice */
    assert_int_equal(run({"rig", "--source", "sim:board?frames=1", "--source", "sim:board?frames=2",
                          "--target", "chessboard:9x6:0.03"}),
                     2);
    assert_int_equal(run({"rig", "--source", "sim:board?frames=1&baseline=0.1", "--camera",
                          "one.yaml", "--target", "chessboard:9x6:0.03"}),
                     2);
    /* What Kalibr's files cannot hold is refused before anything is solved. */
    assert_int_equal(run({"rig", "--source", "/none", "--target", "chessboard:9x6:0.03", "--model",
                          "rational", "--format", "kalibr"}),
                     2);
}

} // namespace

int main()
{
    const CMUnitTest tests[] = {
        cmocka_unit_test(places_with_known_lenses_are_found_as_stated),
        cmocka_unit_test(places_with_unknown_lenses_are_found_as_stated),
        cmocka_unit_test(boards_counted_from_the_other_end_are_turned),
        cmocka_unit_test(pictures_of_different_instants_fail),
        cmocka_unit_test(cameras_that_share_no_board_are_named),
        cmocka_unit_test(a_real_pair_is_near_its_epipolar_lines),
        cmocka_unit_test(the_camchain_reads_as_the_rig),
        cmocka_unit_test(a_wrong_camera_file_fails),
        cmocka_unit_test(wrong_input_is_refused),
    };
    return cmocka_run_group_tests(tests, nullptr, nullptr);
}

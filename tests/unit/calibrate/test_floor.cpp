/* A camera over the floor: simulated ones are found as near to the truth as stated, and what is
 * wrong is named. */
#include "calibrate/command.h"
#include "calibrate/floor.h"
#include "calibrate/rigid.h"

#include <cmath>
#include <cstdio>
#include <cstring>
#include <unistd.h>

#include "support/calibration.h"
extern "C" {
#include "support/say.h"
}
#include "support/text.h"

#include "common/calibrate_command.h"
#include "common/cmocka_cpp.h"
#include "common/simulated_boards.h"

using namespace calibrate;
using namespace simulated;

namespace
{

constexpr double PI = 3.14159265358979;

struct Truth {
    fovea_camera camera;
    double height_m, tilt_rad, roll_rad;
    Rigid T_body_cam;
};

/* Level: x of the camera is -y of the body. Turned about its axis, then tilted down. */
Truth random_truth(Random &random, double tilt_least, double tilt_most)
{
    Truth truth;
    truth.camera = true_camera(Model::radtan, random);
    truth.height_m = random.between(.6, 1.5);
    truth.tilt_rad = random.between(tilt_least, tilt_most);
    truth.roll_rad = random.between(-.2, .2);
    Eigen::Matrix3d level;
    level << 0, 0, 1, -1, 0, 0, 0, -1, 0;
    truth.T_body_cam.R = Eigen::AngleAxisd(truth.tilt_rad, Eigen::Vector3d::UnitY()) *
                         Eigen::AngleAxisd(truth.roll_rad, Eigen::Vector3d::UnitX()) * level;
    truth.T_body_cam.t = {0, 0, truth.height_m};
    return truth;
}

/* A board on the floor, somewhere in the image, `above_m` over it; `lean_rad`: one side is lifted.
 */
View board_on_floor(const Truth &truth, Random &random, double above_m, double lean_rad)
{
    for (;;) {
        const double at[2] = {random.between(60, WIDTH - 60), random.between(60, HEIGHT - 60)};
        double bearing[3];
        if (fovea_camera_unproject(&truth.camera, at, bearing, nullptr) != FOVEA_OK) continue;
        const Eigen::Vector3d ray =
            truth.T_body_cam.R * Eigen::Vector3d(bearing[0], bearing[1], bearing[2]);
        if (ray[2] > -.2) continue;
        const Eigen::Vector3d middle =
            truth.T_body_cam.t + ray * ((truth.height_m - above_m) / -ray[2]);
        Rigid T_body_board;
        T_body_board.R =
            Eigen::AngleAxisd(random.between(-PI, PI), Eigen::Vector3d::UnitZ()) *
            Eigen::AngleAxisd(PI + lean_rad, Eigen::Vector3d::UnitX()).toRotationMatrix();
        const Point last = board.points().back();
        T_body_board.t = middle - T_body_board.R * Eigen::Vector3d(.5 * last[0], .5 * last[1], 0);
        const Rigid T_cam_board = truth.T_body_cam.inverse() * T_body_board;
        View view;
        view.edge_px = 2.2;
        for (const Point &point : board.points()) {
            const Eigen::Vector3d seen_at =
                T_cam_board * Eigen::Vector3d(point[0], point[1], point[2]);
            double pixel[2];
            if (fovea_camera_project(&truth.camera, seen_at.data(), pixel, nullptr) != FOVEA_OK ||
                pixel[0] < 3 || pixel[1] < 3 || pixel[0] > WIDTH - 4 || pixel[1] > HEIGHT - 4)
                break;
            view.corners.push_back(
                {pixel[0] + NOISE_PX * random.gauss(), pixel[1] + NOISE_PX * random.gauss()});
        }
        if (view.corners.size() == board.points().size()) return view;
    }
}

FloorSolution solved(const Truth &truth, const std::vector<View> &views, double thickness_m)
{
    FloorSolution solution;
    std::string error;
    if (!solve_floor(board, views, truth.camera, thickness_m, solution, error))
        fail_msg("%s", error.c_str());
    return solution;
}

void floors_are_found_as_stated(void **)
{
    constexpr double thickness_m = .004;
    int count = 0, beyond_three = 0;
    double squares[3] = {}; /* of height, tilt and roll: a wrong one is not hidden by the others */
    for (unsigned seed = 1; seed <= 100; seed++) {
        Random random = {std::mt19937_64(seed)};
        const Truth truth = random_truth(random, .1, 1.2);
        std::vector<View> views;
        while (views.size() < 5)
            views.push_back(board_on_floor(truth, random, thickness_m, 0));
        const FloorSolution solution = solved(truth, views, thickness_m);
        const double ratios[3] = {(solution.height_m - truth.height_m) / solution.height_stdev_m,
                                  (solution.tilt_rad - truth.tilt_rad) / solution.tilt_stdev_rad,
                                  (solution.roll_rad - truth.roll_rad) / solution.roll_stdev_rad};
        assert_int_equal(solution.views_used, 5);
        for (int i = 0; i < 3; i++) {
            count++;
            beyond_three += std::fabs(ratios[i]) > 3;
            squares[i] += ratios[i] * ratios[i];
        }
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 4; j++)
                assert_true(std::fabs(solution.T_body_cam[(size_t)(4 * i + j)] -
                                      (j < 3 ? truth.T_body_cam.R(i, j) : truth.T_body_cam.t[i])) <
                            .02);
    }
    printf("floors: %d parameters, %d beyond three standard deviations, rms", count, beyond_three);
    assert_true(beyond_three <= .01 * count);
    for (const double sum : squares) {
        const double size = std::sqrt(3 * sum / count);
        printf(" %.3f", size);
        assert_true(size > .8 && size < 1.2);
    }
    printf(" of height, tilt and roll\n");
}

/* Straight down there is no direction ahead; the top of the image is taken for it. */
void a_camera_that_looks_straight_down_is_found(void **)
{
    Random random = {std::mt19937_64(3)};
    Truth truth = random_truth(random, .5 * PI, .5 * PI);
    truth.T_body_cam.R =
        Eigen::AngleAxisd(-truth.roll_rad, Eigen::Vector3d::UnitZ()) * truth.T_body_cam.R;
    std::vector<View> views;
    while (views.size() < 5)
        views.push_back(board_on_floor(truth, random, 0, 0));
    const FloorSolution solution = solved(truth, views, 0);
    assert_true(std::fabs(solution.height_m - truth.height_m) < 4 * solution.height_stdev_m);
    assert_true(solution.tilt_rad > 1.55);
    assert_true(solution.T_body_cam[1] < -.99); /* the top of the image is ahead */
    assert_int_equal(judge_floor(views, solution).grade, Grade::pass);
}

void a_board_that_does_not_lie_there_is_left_out(void **)
{
    Random random = {std::mt19937_64(4)};
    const Truth truth = random_truth(random, .4, .8);
    std::vector<View> views;
    while (views.size() < 5)
        views.push_back(board_on_floor(truth, random, 0, 0));
    views.push_back(board_on_floor(truth, random, .05, .1));
    const FloorSolution solution = solved(truth, views, 0);
    assert_int_equal(solution.views_used, 5);
    assert_non_null(std::strstr(solution.left_out[5].c_str(), "does not lie on the plane"));
    assert_true(std::fabs(solution.height_m - truth.height_m) < 4 * solution.height_stdev_m);
}

bool has_reason(const Verdict &verdict, const char *part)
{
    for (const Reason &reason : verdict.reasons)
        if (std::strstr(reason.text.c_str(), part) != nullptr) return true;
    return false;
}

void what_is_wrong_is_named(void **)
{
    Random random = {std::mt19937_64(5)};
    const Truth truth = random_truth(random, .4, .8);
    std::vector<View> views = {board_on_floor(truth, random, 0, 0)};
    Verdict verdict = judge_floor(views, solved(truth, views, 0));
    assert_int_equal(verdict.grade, Grade::doubtful);
    assert_true(has_reason(verdict, "1 pictures are used, expected 3 or more"));
    for (const double lean : {.06, -.05, .04}) /* no two on one plane */
        views.push_back(board_on_floor(truth, random, .02, lean));
    verdict = judge_floor(views, solved(truth, views, 0));
    assert_int_not_equal(verdict.grade, Grade::pass);
    views.assign(2, View());
    views[0].left_out = views[1].left_out = "no board";
    FloorSolution solution;
    std::string error;
    assert_false(solve_floor(board, views, truth.camera, 0, solution, error));
    assert_string_equal(error.c_str(), "found no picture with the board, expected one or more");
}

int run(const std::vector<std::string> &words)
{
    return run_command(command_floor, words);
}

/* Whole, by pictures: the simulated board is turned and tilted before the camera, so no two
 * pictures share a plane, and the verdict says so; one alone is only doubtful, and its file has the
 * keys. */
void the_command_writes_keys_of_the_configuration(void **)
{
    char folder[] = "/tmp/fovea-floor-XXXXXX";
    assert_non_null(mkdtemp(folder));
    const std::string camera = std::string(folder) + "/camera.yaml",
                      out = std::string(folder) + "/floor.yaml", json = out + ".json",
                      report = out + ".html";
    fv_calibration calibration = {};
    fovea_error error;
    calibration.camera.width = 640;
    calibration.camera.height = 480;
    calibration.camera.fx = calibration.camera.fy = 320 / std::tan(40 * PI / 180);
    calibration.camera.cx = 319.5;
    calibration.camera.cy = 239.5;
    assert_int_equal(
        fv_calibration_write(camera.c_str(), FV_CALIBRATION_ROS, &calibration, nullptr, &error),
        FOVEA_OK);
    const int status = run({"floor", "--source", "sim:board?frames=1&time=4&lens=pinhole",
                            "--target", "chessboard:9x6:0.03", "--camera", camera, "--out", out,
                            "--json", json, "--report", report});
    char *text = nullptr;
    size_t bytes = 0;
    const fovea_status read = fv_text_read(out.c_str(), 100000, &text, &bytes, &error);
    const std::string written = read == FOVEA_OK ? text : "";
    std::free(text);
    /* What is read is not written over, whatever the file holds. */
    const std::string picture = std::string(folder) + "/one.png";
    std::FILE *kept = std::fopen(picture.c_str(), "w");
    assert_true(kept != nullptr && std::fputs("kept", kept) >= 0 && std::fclose(kept) == 0);
    for (const char *option : {"--out", "--json", "--report"})
        assert_int_equal(run({"floor", "--source", folder, "--target", "chessboard:9x6:0.03",
                              "--camera", camera, option, picture}),
                         2);
    assert_int_equal(fv_text_read(picture.c_str(), 100, &text, &bytes, &error), FOVEA_OK);
    assert_string_equal(text, "kept");
    std::free(text);
    for (const std::string &file : {camera, out, json, report, picture})
        unlink(file.c_str());
    assert_int_equal(rmdir(folder), 0);
    assert_int_equal(status, 0);
    for (const char *part :
         {"\nT_body_cam:\n- [", "\nscale:\n  source: camera_height\n", "\n  camera_height_m: "})
        assert_non_null(std::strstr(written.c_str(), part));
    assert_int_equal(run({"floor", "--source", folder, "--target", "chessboard:9x6:0.03"}), 2);
    assert_int_equal(run({"floor", "--source", folder, "--target", "chessboard:9x6:0.03",
                          "--camera", camera, "--thickness", "4mm"}),
                     2);
    assert_int_equal(
        run({"floor", "--source", folder, "--target", "chessboard:9x6:0.03", "--camera", camera}),
        2);
}

/* The option --views, of which each command has its own least and usual number. */
void numbers_of_views_are_judged(void **)
{
    int64_t views = 0;
    assert_int_equal(views_check("", 10, 1, views), FV_EXIT_OK);
    assert_int_equal(views, 10);
    assert_int_equal(views_check("2", 10, 2, views), FV_EXIT_OK);
    assert_int_equal(views, 2);
    assert_int_equal(views_check("500", 10, 1, views), FV_EXIT_OK);
    for (const char *wrong : {"1", "0", "-3", "501", "two", "2x"})
        assert_int_equal(views_check(wrong, 10, 2, views), FV_EXIT_WRONG);
}

} // namespace

int main()
{
    const CMUnitTest tests[] = {
        cmocka_unit_test(floors_are_found_as_stated),
        cmocka_unit_test(a_camera_that_looks_straight_down_is_found),
        cmocka_unit_test(a_board_that_does_not_lie_there_is_left_out),
        cmocka_unit_test(what_is_wrong_is_named),
        cmocka_unit_test(the_command_writes_keys_of_the_configuration),
        cmocka_unit_test(numbers_of_views_are_judged),
    };
    return cmocka_run_group_tests(tests, nullptr, nullptr);
}

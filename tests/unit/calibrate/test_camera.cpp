/* Calibration of real cameras: OpenCV's published result from OpenCV's corners, and better corners
 * of our own; boards that are wrong are named. */
#include "calibrate/pictures.h"
#include "calibrate/report.h"
#include "calibrate/verdict.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <unistd.h>

#include "support/calibration.h"

#include "common/cmocka_cpp.h"
#include "common/data_folder.h"

using namespace calibrate;

static const char *const stereo_board = "chessboard:9x6:0.025";

static std::string data(const char *folder)
{
    return std::string(fv_data_folder()) + "/" + folder;
}

/* The views of a set; the test is skipped where it is not there. */
static Collection views_of(const std::string &source, const char *target, Refinement refinement,
                           Board &board)
{
    Collection collection;
    std::string error;
    fovea_error why;
    assert_true(board_parse(target, board, error));
    const std::string folder = source.substr(0, source.rfind('/')).substr(source.find(':') + 1);
    if (access(folder.c_str(), R_OK) != 0) {
        printf("SKIPPED calibration of %s: it is not there\n", folder.c_str());
        skip();
    }
    assert_int_equal(collect(source, board, refinement, 100, collection, &why), FOVEA_OK);
    return collection;
}

static Collection left_views(Refinement refinement, Board &board)
{
    return views_of("images:" + data("calib_stereo_pinhole/left*.png"), stereo_board, refinement,
                    board);
}

/* By our own corners, which are found once for all cases. */
static Collection own_left_views(Board &board)
{
    static Board found_board;
    static Collection found;
    if (found.views.empty()) found = left_views(Refinement::OWN, found_board);
    board = found_board;
    return found;
}

static Solution solved(const Board &board, const Collection &collection,
                       const SolveOptions &options)
{
    Solution solution;
    std::string error;
    if (!solve(board, collection.views, collection.width, collection.height, options, solution,
               error))
        fail_msg("%s", error.c_str());
    return solution;
}

/* https://github.com/opencv/opencv samples/data/left_intrinsics.yml. */
static void opencvs_corners_give_the_published_camera(void **)
{
    Board board;
    const Collection collection = left_views(Refinement::OPENCV_11, board);
    SolveOptions options;
    options.equal_focal = true;
    options.reject = false;
    Solution solution = solved(board, collection, options);
    assert_float_equal(solution.camera.fx, 535.9157, .02);
    assert_float_equal(solution.camera.cx, 342.2832, .05);
    assert_float_equal(solution.camera.cy, 235.5708, .05);
    assert_float_equal(solution.rms_px, .39259, .0001);
    options.equal_focal = false;
    solution = solved(board, collection, options);
    assert_float_equal(solution.camera.fx, 535.889, .02);
    assert_float_equal(solution.camera.fy, 535.846, .02);
}

static void own_corners_have_half_the_error(void **)
{
    Board board;
    const Collection collection = own_left_views(board);
    assert_int_equal(collection.views.size(), 13);
    const Solution solution = solved(board, collection, SolveOptions());
    assert_true(solution.rms_px <= .22);
    assert_float_equal(solution.camera.fx, 532.8, 1);
    const double held_out = held_out_rms_px(board, collection.views, solution, 5, SolveOptions());
    assert_true(held_out > solution.rms_px && held_out < 1.1 * solution.rms_px);
    const Verdict verdict = judge(collection.views, solution, held_out);
    assert_int_equal(verdict.grade, Grade::pass);
}

/* The camera of an independent fit, as the README of the data states it. */
static void a_fisheye_agrees_with_an_independent_fit(void **)
{
    Board board;
    const Collection collection = views_of("images:" + data("calib_fisheye/*.jpg"),
                                           "chessboard:9x6:0.02423", Refinement::OWN, board);
    SolveOptions options;
    options.model = Model::equidistant;
    const Solution solution = solved(board, collection, options);
    const fovea_camera &camera = solution.camera;
    assert_true(solution.rms_px <= .20);
    const double found[8] = {camera.fx,   camera.fy,   camera.cx,   camera.cy,
                             camera.k[0], camera.k[1], camera.k[2], camera.k[3]};
    const double fit[8] = {227.37, 226.55, 471.42, 305.64, .02474, -.02245, .0188, -.00682};
    for (size_t i = 0; i < 8; i++) {
        assert_true(solution.stdev[i] > 0);
        assert_true(std::fabs(found[i] - fit[i]) < 3 * solution.stdev[i]);
    }
}

static void corners_and_views_that_are_wrong_are_named(void **)
{
    Board board;
    Collection collection = own_left_views(board);
    const Solution clean = solved(board, collection, SolveOptions());
    collection.views[2].corners[17][0] += 6; /* one corner elsewhere */
    for (size_t i = 0; i < 54; i++)          /* and a board that is bent */
        collection.views[5].corners[i][1] += .3 * std::pow((double)(i % 9) - 4, 2);
    const Solution solution = solved(board, collection, SolveOptions());
    assert_true(
        std::any_of(solution.corners_left_out.begin(), solution.corners_left_out.end(),
                    [](const LeftOut &corner) { return corner.view == 2 && corner.corner == 17; }));
    for (size_t v = 0; v < collection.views.size(); v++)
        assert_int_equal(solution.left_out[v].empty(), v != 5);
    assert_float_equal(solution.camera.fx, clean.camera.fx, 3 * clean.stdev[0]);
}

static void few_or_frontal_views_are_not_trusted(void **)
{
    Board board;
    Collection collection = own_left_views(board);
    for (size_t v = 2; v < collection.views.size(); v++)
        collection.views[v].left_out = "of the test";
    Solution solution;
    std::string error;
    if (solve(board, collection.views, collection.width, collection.height, SolveOptions(),
              solution, error))
        assert_int_equal(judge(collection.views, solution, -1).grade, Grade::fail);
    else
        assert_true(error.size() > 0);
}

static void a_board_that_is_rarely_found_is_doubted(void **)
{
    Board board;
    Collection collection = own_left_views(board);
    View none;
    none.left_out = "no board";
    collection.views.resize(3 * collection.views.size(), none);
    const Solution solution = solved(board, collection, SolveOptions());
    const Verdict verdict = judge(collection.views, solution, solution.rms_px);
    assert_int_equal(verdict.grade, Grade::doubtful);
    assert_int_equal(verdict.reasons.size(), 1);
    assert_non_null(std::strstr(verdict.reasons[0].text.c_str(), "found in 13 of 39 pictures"));
}

static void a_blurred_view_is_left_out(void **)
{
    std::vector<View> views(5);
    for (View &view : views)
        view.edge_px = 2.2;
    views[3].edge_px = 6;
    leave_out_blurred(views);
    for (size_t v = 0; v < views.size(); v++)
        assert_int_equal(views[v].left_out.empty(), v != 3);
}

static void the_camera_file_reads_as_the_same_camera(void **)
{
    Board board;
    const Collection collection = own_left_views(board);
    Report report;
    report.board = board;
    report.views = collection.views;
    report.solution = solved(board, collection, SolveOptions());
    report.verdict = judge(report.views, report.solution, .22);
    report.camera_name = "left \"eye\"";
    report.date = "2000-01-01T00:00:00Z";
    char path[] = "/tmp/fovea-calibrate-XXXXXX";
    const int file = mkstemp(path);
    assert_true(file >= 0);
    close(file);
    fovea_error error;
    fv_calibration read;
    assert_int_equal(report_camera(report, path, &error), FOVEA_OK);
    const fovea_status status = fv_calibration_read(path, nullptr, &read, &error);
    unlink(path);
    if (status != FOVEA_OK) fail_msg("%s", error.text);
    const fovea_camera &camera = report.solution.camera;
    assert_int_equal(read.camera.width, 640);
    assert_string_equal(read.name, report.camera_name.c_str());
    assert_memory_equal(&read.camera.fx, &camera.fx, sizeof(double) * 4);
    assert_memory_equal(read.camera.k, camera.k, sizeof camera.k);
}

static void targets_are_read_strictly(void **)
{
    Board board;
    std::string error;
    assert_true(board_parse("chessboard:9x6:0.025", board, error));
    assert_int_equal(board.columns, 9);
    assert_int_equal(board.rows, 6);
    assert_int_equal(board.points().size(), 54);
    for (const char *wrong :
         {"", "chessboard", "chessboard:9x6", "chessboard:9x6:0", "chessboard:9x6:-1",
          "chessboard:9x6:0.025x", "chessboard:2x6:0.025", "chessboard:9x51:0.025",
          "aprilgrid:9x6:0.025", "chessboard:9x6:nan", "chessboard:9:6x.025"})
        assert_false(board_parse(wrong, board, error));
}

int main()
{
    const CMUnitTest tests[] = {
        cmocka_unit_test(opencvs_corners_give_the_published_camera),
        cmocka_unit_test(own_corners_have_half_the_error),
        cmocka_unit_test(a_fisheye_agrees_with_an_independent_fit),
        cmocka_unit_test(corners_and_views_that_are_wrong_are_named),
        cmocka_unit_test(few_or_frontal_views_are_not_trusted),
        cmocka_unit_test(a_board_that_is_rarely_found_is_doubted),
        cmocka_unit_test(a_blurred_view_is_left_out),
        cmocka_unit_test(the_camera_file_reads_as_the_same_camera),
        cmocka_unit_test(targets_are_read_strictly),
    };
    return cmocka_run_group_tests(tests, nullptr, nullptr);
}

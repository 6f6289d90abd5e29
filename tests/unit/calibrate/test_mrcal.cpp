/* The solve beside mrcal (https://mrcal.secretsauce.net) on the same corners: the same minimum, and
 * the same uncertainty of projection. */
#include "calibrate/pictures.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <sstream>
#include <string>
#include <unistd.h>

#include "common/cmocka_cpp.h"
#include "common/data_folder.h"

using namespace calibrate;

namespace
{

constexpr int CELLS = 10;

using Answer = std::map<std::string, std::vector<double>>;

/* What mrcal_solve.py says of the corners of the views. */
Answer ask_mrcal(const Board &board, const Collection &collection)
{
    char path[] = "/tmp/fovea-mrcal-XXXXXX";
    const int file = mkstemp(path);
    assert_true(file >= 0);
    FILE *corners = fdopen(file, "w");
    assert_non_null(corners);
    fprintf(corners, "%d %d %.17g %d %d %zu\n", board.columns, board.rows, board.square_m,
            collection.width, collection.height, collection.views.size());
    for (const View &view : collection.views)
        for (const Pixel &corner : view.corners)
            fprintf(corners, "%.17g %.17g\n", corner[0], corner[1]);
    assert_int_equal(fclose(corners), 0);
    const std::string command =
        std::string("/usr/bin/python3 tests/unit/calibrate/mrcal_solve.py <") + path;
    FILE *output = popen(command.c_str(), "r");
    assert_non_null(output);
    std::string text;
    for (int c; (c = fgetc(output)) != EOF;)
        text += (char)c;
    assert_int_equal(pclose(output), 0);
    unlink(path);
    Answer answer;
    std::istringstream lines(text);
    for (std::string line; std::getline(lines, line);) {
        std::istringstream words(line);
        std::string key;
        words >> key;
        for (double value; words >> value;)
            answer[key].push_back(value);
    }
    return answer;
}

/* Both minimise the same sum from seeds of their own, so they end in the same place. */
void compare(const char *pattern, const char *target, Refinement refinement)
{
    const std::string folder = std::string(fv_data_folder()) + "/calib_stereo_pinhole";
    if (access(folder.c_str(), R_OK) != 0) {
        printf("SKIPPED calibration of %s: it is not there\n", folder.c_str());
        skip();
    }
    static const bool installed =
        std::system("/usr/bin/python3 -c 'import mrcal' 2>/dev/null") == 0;
    if (!installed) {
        printf("SKIPPED comparison with mrcal: Debian's python3-mrcal is not installed\n");
        skip();
    }
    Board board;
    Collection collection;
    Solution solution;
    std::string error;
    fovea_error why;
    assert_true(board_parse(target, board, error));
    assert_int_equal(
        collect("images:" + folder + pattern, board, refinement, 100, collection, &why), FOVEA_OK);
    SolveOptions options;
    options.reject = false;
    if (!solve(board, collection.views, collection.width, collection.height, options, solution,
               error))
        fail_msg("%s", error.c_str());
    const Answer answer = ask_mrcal(board, collection);
    const std::vector<double> &camera = answer.at("camera"), &stdev = answer.at("stdev");
    assert_int_equal(camera.size(), 9);
    assert_int_equal(stdev.size(), CELLS * CELLS);

    const double cost = solution.rms_px * solution.rms_px * solution.corners_used;
    const double by_mrcal = answer.at("cost").at(0);
    const double focal = std::fabs(solution.camera.fx / camera[0] - 1);
    assert_int_equal(solution.uncertainty.columns, CELLS);
    assert_int_equal(solution.uncertainty.rows, CELLS);
    double worst = 0;
    for (size_t i = 0; i < stdev.size(); i++) {
        const double ratio = solution.uncertainty.stdev_px[i] / solution.noise_px / stdev[i];
        worst = std::max(worst, std::fabs(ratio - 1));
        assert_true(std::isfinite(ratio));
    }
    printf("beside mrcal: cost %+.1e, focal length %.1e, uncertainty of projection %.1e\n",
           cost / by_mrcal - 1, focal, worst);
    assert_true(std::fabs(cost / by_mrcal - 1) <= 1e-6);
    assert_true(focal <= 1e-6);
    assert_true(worst <= .01);
}

void the_left_camera_is_mrcals(void **)
{
    compare("/left*.png", "chessboard:9x6:0.025", Refinement::OWN);
}

void the_right_camera_by_opencvs_corners_is_mrcals(void **)
{
    compare("/right*.png", "chessboard:9x6:0.025", Refinement::OPENCV_11);
}

} // namespace

int main()
{
    const CMUnitTest tests[] = {
        cmocka_unit_test(the_left_camera_is_mrcals),
        cmocka_unit_test(the_right_camera_by_opencvs_corners_is_mrcals),
    };
    return cmocka_run_group_tests(tests, nullptr, nullptr);
}

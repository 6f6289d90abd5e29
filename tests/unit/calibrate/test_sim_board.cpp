/* The whole way of fovea-calibrate camera without hardware: a simulated camera looks at a board
 * (sim:board), and the camera that is found is the true one. */
#include "calibrate/command.h"
#include "calibrate/compare.h"
#include "calibrate/pictures.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <unistd.h>

#include "drivers/table.h"
#include "fovea/source.h"
#include "support/calibration.h"

#include "common/cmocka_cpp.h"

using namespace calibrate;

namespace
{

const char *const target = "chessboard:9x6:0.03";

fovea_camera true_camera(const std::string &uri)
{
    const fovea_source_ops *ops;
    const char *address;
    fovea_error error;
    fovea_source *source;
    fovea_source_selection selection = {};
    selection.step = 1;
    assert_int_equal(fv_source_find(uri.c_str(), &ops, &address, &error), FOVEA_OK);
    assert_int_equal(ops->open(address, &selection, &source, &error), FOVEA_OK);
    fovea_camera camera = ops->info(source)->rig.cameras[0].camera;
    ops->close(source);
    assert_int_equal(fovea_camera_prepare(&camera, &error), FOVEA_OK);
    return camera;
}

fovea_camera calibrated(const std::string &uri, const char *model)
{
    char path[] = "/tmp/fovea-sim-board-XXXXXX";
    const int file = mkstemp(path);
    assert_true(file >= 0);
    close(file);
    std::string words[] = {"camera",  "--source", uri,     "--target", target,
                           "--model", model,      "--out", path};
    char *arguments[9];
    for (size_t i = 0; i < 9; i++)
        arguments[i] = words[i].data();
    const int status = command_camera(9, arguments);
    fv_calibration found;
    fovea_error error;
    const fovea_status read = fv_calibration_read(path, nullptr, &found, &error);
    unlink(path);
    assert_int_equal(status, 0);
    if (read != FOVEA_OK) fail_msg("%s", error.text);
    assert_string_equal(found.record.verdict, "pass");
    return found.camera;
}

/* The true camera projects as the pictures say, and the file has its focal length and centre. */
void assert_found(const std::string &uri, const char *model)
{
    const fovea_camera truth = true_camera(uri), found = calibrated(uri, model);
    assert_true(std::fabs(found.fx / truth.fx - 1) < .001);
    assert_true(std::fabs(found.fy / truth.fy - 1) < .001);
    assert_true(std::hypot(found.cx - truth.cx, found.cy - truth.cy) < .5);
    int places = 0;
    double worst = 0;
    for (double y = .15 * truth.height; y < .9 * truth.height; y += 40) {
        for (double x = .15 * truth.width; x < .9 * truth.width; x += 40, places++) {
            const double pixel[2] = {x, y};
            double bearing[3], seen[2];
            assert_int_equal(fovea_camera_unproject(&truth, pixel, bearing, nullptr), FOVEA_OK);
            assert_int_equal(fovea_camera_project(&found, bearing, seen, nullptr), FOVEA_OK);
            worst = std::max(worst, std::hypot(seen[0] - x, seen[1] - y));
        }
    }
    printf("%s: focal length %.4f %% off, projection %.3f px at worst\n", uri.c_str(),
           100 * (found.fx / truth.fx - 1), worst);
    assert_true(worst < .5 && places > 50);
}

} // namespace

static void the_true_camera_is_found(void **)
{
    assert_found("sim:board?rate=2&seed=4", "radtan");
}

/* Exit status with a page, for which `out` and `token` are files. */
static int with_page(std::string source, std::string out, std::string token)
{
    std::string words[] = {"camera", "--page", "0", "--source", source, "--target",
                           target,   "--out",  out, "--token",  token};
    char *arguments[11];
    for (size_t i = 0; i < 11; i++)
        arguments[i] = words[i].data();
    return command_camera(11, arguments);
}

static void a_page_is_refused_where_it_has_nothing_to_guide_or_its_token_would_be_lost(void **)
{
    char folder[] = "/tmp/fovea-sim-board-XXXXXX";
    assert_non_null(mkdtemp(folder));
    const std::string out = folder + std::string("/out"), token = folder + std::string("/token");
    assert_int_equal(with_page("sim:board?rate=4&seed=4", token, token), 2);
    assert_int_equal(with_page("sim:board?rate=4&frames=20&seed=4", out, token), 2);
    assert_int_equal(with_page(folder, out, token), 2);
    assert_int_equal(rmdir(folder), 0); /* neither file was made */
}

/* Not after all of them were searched. */
static void a_source_of_another_size_is_refused_before_any_picture(void **)
{
    const std::string uri = "sim:board?seed=1&width=320&height=240";
    Board board;
    std::string error;
    fovea_error why;
    Collection collection, right;
    fovea_camera other = true_camera(uri);
    right.width = other.width;
    right.height = other.height;
    assert_int_equal(size_of(other, "its.yaml")({right}, &why), FOVEA_OK);
    other.width += 2;
    assert_true(board_parse(target, board, error));
    assert_int_equal(
        collect(uri, board, Refinement::OWN, 40, collection, &why, size_of(other, "other.yaml")),
        FOVEA_ERROR_INPUT);
    assert_non_null(std::strstr(why.text, "other.yaml"));
    assert_true(collection.views.empty());
}

static void a_true_fisheye_is_found(void **)
{
    assert_found("sim:board?rate=2&seed=6&lens=equidistant", "equidistant");
}

/* The camera itself passes against pictures of it; a lens that was knocked does not. */
static void a_knocked_lens_is_found(void **)
{
    const std::string uri = "sim:board?rate=1&seed=8";
    fovea_camera camera = true_camera(uri);
    Board board;
    Collection collection;
    std::string error;
    fovea_error why;
    assert_true(board_parse(target, board, error));
    assert_int_equal(collect(uri, board, Refinement::OWN, 40, collection, &why), FOVEA_OK);
    const Comparison same = compare(camera, board, collection.views);
    assert_int_equal(same.verdict.grade, Grade::pass);
    assert_true(same.difference_px < .5);
    camera.fx *= 1.02;
    camera.fy *= 1.02;
    assert_int_equal(fovea_camera_prepare(&camera, &why), FOVEA_OK);
    assert_int_equal(compare(camera, board, collection.views).verdict.grade, Grade::fail);
}

int main()
{
    const CMUnitTest tests[] = {
        cmocka_unit_test(the_true_camera_is_found),
        cmocka_unit_test(
            a_page_is_refused_where_it_has_nothing_to_guide_or_its_token_would_be_lost),
        cmocka_unit_test(a_source_of_another_size_is_refused_before_any_picture),
        cmocka_unit_test(a_true_fisheye_is_found),
        cmocka_unit_test(a_knocked_lens_is_found),
    };
    return cmocka_run_group_tests(tests, nullptr, nullptr);
}

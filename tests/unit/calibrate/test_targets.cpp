/* Every kind of board is found in pictures of it, whole or in part, to a fraction of a pixel; other
 * boards are not, and the reason is stated. */
#include <opencv2/aruco/charuco.hpp>
#include <opencv2/imgproc.hpp>

#include "calibrate/detect.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>

#include "common/board_picture.h"
#include "common/cmocka_cpp.h"

using namespace calibrate;

namespace
{

constexpr int WIDTH = 640, HEIGHT = 480;

Board board_of(const char *text)
{
    Board board;
    std::string error;
    if (!board_parse(text, board, error)) fail_msg("%s", error.c_str());
    return board;
}

Drawing drawing_of(const Board &board)
{
    Drawing drawing;
    std::string error;
    if (!draw(board, drawing, error)) fail_msg("%s", error.c_str());
    return drawing;
}

fovea_camera camera_of(bool fisheye)
{
    fovea_camera camera = {};
    camera.width = WIDTH;
    camera.height = HEIGHT;
    camera.lens = fisheye ? FOVEA_LENS_EQUIDISTANT : FOVEA_LENS_RADTAN;
    camera.fx = camera.fy = fisheye ? 260 : 500;
    camera.cx = 324;
    camera.cy = 236;
    camera.k[0] = fisheye ? .01 : -.2;
    assert_int_equal(fovea_camera_prepare(&camera, nullptr), FOVEA_OK);
    return camera;
}

/* The board's middle at `x`, `y` of the image's half width, filling `fill` of it; turned about the
 * optical axis by `turn` and tilted by `tilt` radians. */
BoardPlace place_of(const Drawing &drawing, const fovea_camera &camera, double x, double y,
                    double fill, double turn, double tilt)
{
    BoardPlace place;
    const double distance = drawing.width_m * camera.fx / (fill * WIDTH);
    const double c = std::cos(turn), s = std::sin(turn);
    const double axes[2][3] = {{c, s, 0},
                               {-s * std::cos(tilt), c * std::cos(tilt), std::sin(tilt)}};
    const double middle[2] = {.5 * drawing.width_m - drawing.x_m,
                              .5 * drawing.height_m - drawing.y_m};
    const double centre[3] = {x * .5 * WIDTH / camera.fx * distance,
                              y * .5 * WIDTH / camera.fx * distance, distance};
    for (int i = 0; i < 3; i++) {
        place.x[i] = axes[0][i];
        place.y[i] = axes[1][i];
        place.origin[i] = centre[i] - middle[0] * axes[0][i] - middle[1] * axes[1][i];
    }
    return place;
}

std::vector<Pixel> true_pixels(const Board &board, const fovea_camera &camera,
                               const BoardPlace &place)
{
    std::vector<Pixel> pixels;
    for (const Point &point : board.points()) {
        double seen[3], pixel[2];
        for (int i = 0; i < 3; i++)
            seen[i] = place.origin[i] + point[0] * place.x[i] + point[1] * place.y[i];
        assert_int_equal(fovea_camera_project(&camera, seen, pixel, nullptr), FOVEA_OK);
        pixels.push_back({pixel[0], pixel[1]});
    }
    return pixels;
}

/* As a lens draws it. */
View found_in(std::vector<uint8_t> picture, const Board &board)
{
    View view;
    cv::Mat pixels(HEIGHT, WIDTH, CV_8UC1, picture.data());
    cv::GaussianBlur(pixels, pixels, cv::Size(7, 7), .7);
    detect_board({picture.data(), WIDTH, HEIGHT, WIDTH}, board, Refinement::OWN, view);
    return view;
}

/* Root mean square distance of the points that were found from the true ones; boards without
 * markers may be found turned round. */
double error_of(const View &view, std::vector<Pixel> truth, int *count)
{
    const auto distance = [&](size_t i, size_t k) {
        return std::hypot(view.corners[i][0] - truth[k][0], view.corners[i][1] - truth[k][1]);
    };
    double squares = 0;
    *count = 0;
    assert_int_equal(view.corners.size(), truth.size());
    if (seen(view.corners[0]) && distance(0, truth.size() - 1) < distance(0, 0))
        std::reverse(truth.begin(), truth.end());
    for (size_t i = 0; i < truth.size(); i++) {
        if (!seen(view.corners[i])) continue;
        squares += std::pow(distance(i, i), 2);
        (*count)++;
    }
    return std::sqrt(squares / *count);
}

/* Large circles seen at a slant through a fisheye are off the most. */
struct Target {
    const char *text;
    double error_px;
};

const Target targets[] = {{"chessboard:9x6:0.025", .03},
                          {"charuco:8x6:0.03:0.022:4x4_50", .04},
                          {"charuco:7x5:0.035:0.026:5x5_100", .04},
                          {"charuco:6x5:0.03:0.024:apriltag_36h11", .04},
                          {"aprilgrid:6x6:0.02:0.3", .04},
                          {"aprilgrid:5x4:0.03:0.25", .04},
                          {"circles:7x5:0.03", .2},
                          {"asymmetric_circles:4x11:0.02", .1}};

} // namespace

static void every_board_is_found_in_its_picture(void **)
{
    for (const bool fisheye : {false, true}) {
        const fovea_camera camera = camera_of(fisheye);
        for (const Target &target : targets) {
            const Board board = board_of(target.text);
            const Drawing drawing = drawing_of(board);
            const double poses[][5] = {{0, 0, .55, .1, 0}, {-.1, .05, .65, -.2, .5}};
            for (const double *pose : {poses[0], poses[1]}) {
                const double fill = board.pattern == Pattern::asymmetric_circles ? .55 : 1;
                const BoardPlace place =
                    place_of(drawing, camera, pose[0], pose[1], fill * pose[2], pose[3], pose[4]);
                const View view = found_in(board_picture(drawing, camera, place), board);
                if (!view.left_out.empty()) fail_msg("%s: %s", target.text, view.left_out.c_str());
                int count;
                const double error = error_of(view, true_pixels(board, camera, place), &count);
                /* Of small tags OpenCV may miss one. */
                const double least = board.pattern == Pattern::aprilgrid ? .9 : 1;
                if (error > target.error_px || count < least * (double)view.corners.size())
                    fail_msg("%s: found %d of %zu points, %.3f px off, expected all, at most %.2f "
                             "px",
                             target.text, count, view.corners.size(), error, target.error_px);
                assert_true(view.edge_px > .3 && view.edge_px < 2.5);
                assert_string_equal(view.note.c_str(), "");
            }
        }
    }
}

/* The board reaches beyond the picture, and something lies on it. */
static void boards_with_markers_may_be_partly_hidden(void **)
{
    const fovea_camera camera = camera_of(false);
    for (const char *text : {"charuco:8x6:0.03:0.022:4x4_50", "aprilgrid:6x6:0.02:0.3"}) {
        const Board board = board_of(text);
        const Drawing drawing = drawing_of(board);
        const BoardPlace place = place_of(drawing, camera, .6, .1, .7, .2, .3);
        std::vector<uint8_t> picture = board_picture(drawing, camera, place);
        const std::vector<Pixel> truth = true_pixels(board, camera, place);
        const Pixel thing = truth[truth.size() / 2];
        for (int y = -15; y <= 15; y++)
            for (int x = -15; x <= 15; x++)
                picture[(size_t)(((int)thing[1] + y) * WIDTH + (int)thing[0] + x)] = 90;
        const View view = found_in(picture, board);
        assert_string_equal(view.left_out.c_str(), "");
        int count;
        const double error = error_of(view, truth, &count);
        assert_in_range(count, 12, truth.size() - 4);
        if (error > .1) fail_msg("%s: %.3f px off", text, error);
        assert_false(seen(view.corners[truth.size() / 2]));
        for (size_t i = 0; i < truth.size(); i++)
            if (truth[i][0] > WIDTH || truth[i][1] > HEIGHT) assert_false(seen(view.corners[i]));
    }
}

static void another_board_is_named(void **)
{
    const fovea_camera camera = camera_of(false);
    const struct {
        const char *shown, *expected, *reason;
    } rows[] = {
        {"charuco:8x6:0.03:0.022:4x4_50", "charuco:6x8:0.03:0.022:4x4_50", "do not lie as on"},
        {"charuco:8x6:0.03:0.022:4x4_50", "charuco:9x6:0.03:0.022:4x4_50", "do not lie as on"},
        {"charuco:8x6:0.03:0.022:4x4_50", "charuco:8x6:0.03:0.022:6x6_250", "expected 2 or more"},
        {"aprilgrid:6x6:0.02:0.3", "aprilgrid:5x7:0.02:0.3", "do not lie as on"},
        {"aprilgrid:6x6:0.02:0.3", "charuco:8x6:0.03:0.022:5x5_50", "expected 2 or more"},
        {"chessboard:9x6:0.025", "chessboard:8x6:0.025", "8 x 6 inner corners"},
        {"circles:7x5:0.03", "circles:8x5:0.03", "8 x 5 circles"},
    };
    for (const auto &row : rows) {
        const Drawing drawing = drawing_of(board_of(row.shown));
        const View view =
            found_in(board_picture(drawing, camera, place_of(drawing, camera, 0, 0, .5, .1, .2)),
                     board_of(row.expected));
        if (view.left_out.find(row.reason) == std::string::npos)
            fail_msg("%s for %s: found '%s', expected '%s'", row.shown, row.expected,
                     view.left_out.c_str(), row.reason);
        assert_true(view.corners.empty());
    }
}

/* Where the stated board is found in a part of a larger one, beyond any of its sides; not where it
 * is the whole. */
static void the_rest_of_a_larger_board_is_seen(void **)
{
    const Board shown = board_of("chessboard:9x6:0.025");
    const Drawing drawing = drawing_of(shown);
    for (const bool fisheye : {false, true}) {
        const fovea_camera camera = camera_of(fisheye);
        const BoardPlace place = place_of(drawing, camera, -.1, .05, .65, -.2, .6);
        std::vector<uint8_t> picture = board_picture(drawing, camera, place);
        cv::Mat pixels(HEIGHT, WIDTH, CV_8UC1, picture.data());
        cv::GaussianBlur(pixels, pixels, cv::Size(7, 7), .7);
        const std::vector<Pixel> all = true_pixels(shown, camera, place);
        /* without the last column, the first one, the last row, the first one; whole */
        for (int part = 0; part < 5; part++) {
            Board stated = shown;
            View view;
            stated.columns -= part < 2;
            stated.rows -= part == 2 || part == 3;
            for (int j = 0; j < stated.rows; j++)
                for (int i = 0; i < stated.columns; i++)
                    view.corners.push_back(
                        all[(size_t)((j + (part == 3)) * shown.columns + i + (part == 1))]);
            explain_board({picture.data(), WIDTH, HEIGHT, WIDTH}, stated, view);
            assert_int_equal(view.shown_columns, part < 4 ? 9 : 0);
            assert_int_equal(view.shown_rows, part < 4 ? 6 : 0);
        }
    }
}

/* As OpenCV before 4.6 drew boards with an even number of rows. */
static void the_older_layout_of_charuco_is_found_and_named(void **)
{
    const fovea_camera camera = camera_of(false);
    Board older = board_of("charuco:8x6:0.03:0.022:4x4_50");
    older.white_first = true;
    const Drawing drawing = drawing_of(older);
    const BoardPlace place = place_of(drawing, camera, 0, 0, .6, .1, .2);
    const Board board = board_of("charuco:8x6:0.03:0.022:4x4_50");
    const View view = found_in(board_picture(drawing, camera, place), board);
    int count;
    assert_true(error_of(view, true_pixels(board, camera, place), &count) < .04);
    assert_int_equal(count, 35);
    assert_non_null(std::strstr(view.note.c_str(), "before 4.6"));
}

/* Our drawings and those of OpenCV itself are the same boards. */
static void drawings_are_those_of_opencv(void **)
{
    for (const char *text : {"charuco:8x6:0.03:0.024:4x4_50", "charuco:7x5:0.03:0.02:6x6_250"}) {
        const Board board = board_of(text);
        const auto theirs = cv::aruco::CharucoBoard::create(
            board.columns, board.rows, (float)board.square_m, (float)board.marker_m,
            cv::aruco::getPredefinedDictionary(board.dictionary));
        constexpr int side = 60; /* pixels of a square */
        cv::Mat picture;
        theirs->draw(cv::Size(board.columns * side, board.rows * side), picture, 0, 1);
        const BoardPaint paint(drawing_of(board));
        int different = 0;
        for (int y = 0; y < picture.rows; y++)
            for (int x = 0; x < picture.cols; x++)
                different += paint.black((x + .5) * board.square_m / side - board.square_m,
                                         (y + .5) * board.square_m / side - board.square_m) !=
                             (picture.at<uint8_t>(y, x) < 128);
        if (different > picture.rows * picture.cols * 3 / 100) /* its cells are whole pixels */
            fail_msg("%s: found %d other pixels", text, different);
    }
}

static void texts_of_boards_come_back(void **)
{
    for (const Target &target : targets)
        assert_string_equal(board_of(target.text).text().c_str(), target.text);
    for (const char *wrong :
         {"charuco:8x6:0.03:0.03:4x4_50", "charuco:8x6:0.03:0.02:4x4_51", "charuco:8x6:0.03",
          "aprilgrid:6x6:0.088", "aprilgrid:1x6:0.088:0.3", "chessboard:9x6:0.025:1", "rings:7x5:1",
          "circles:7x51:0.03", "circles:7:5:0.03", ""}) {
        Board board;
        std::string error;
        assert_false(board_parse(wrong, board, error));
        assert_non_null(std::strstr(error.c_str(), ", expected chessboard:9x6:0.025"));
    }
    Drawing drawing;
    std::string error;
    assert_false(draw(board_of("charuco:12x12:0.03:0.02:4x4_50"), drawing, error));
    assert_non_null(std::strstr(error.c_str(), "dictionary has, 50"));
}

int main()
{
    const CMUnitTest tests[] = {
        cmocka_unit_test(every_board_is_found_in_its_picture),
        cmocka_unit_test(boards_with_markers_may_be_partly_hidden),
        cmocka_unit_test(another_board_is_named),
        cmocka_unit_test(the_rest_of_a_larger_board_is_seen),
        cmocka_unit_test(the_older_layout_of_charuco_is_found_and_named),
        cmocka_unit_test(drawings_are_those_of_opencv),
        cmocka_unit_test(texts_of_boards_come_back),
    };
    return cmocka_run_group_tests(tests, nullptr, nullptr);
}

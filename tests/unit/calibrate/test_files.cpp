/* Boards to print, and camera files that are converted. */
#include "calibrate/command.h"
#include "calibrate/detect.h"
#include "calibrate/page.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sys/wait.h>
#include <unistd.h>

#include "support/calibration.h"

#include "common/cmocka_cpp.h"

using namespace calibrate;

static std::string page_of(const Board &board, const char *page)
{
    std::string pdf, error;
    if (!page_write(board, page, pdf, error)) fail_msg("%s", error.c_str());
    return pdf;
}

/* Rectangles of a page painted at 4 pixels per millimetre. */
static std::vector<uint8_t> painted(const std::string &pdf, int width, int height)
{
    constexpr double pixels_per_point = 4 * 25.4 / 72;
    std::vector<uint8_t> pixels((size_t)width * (size_t)height, 255);
    for (size_t at = pdf.find("0 g\n") + 4; at < pdf.size();) {
        const size_t end = pdf.find('\n', at);
        double r[4];
        if (std::sscanf(pdf.c_str() + at, "%lf %lf %lf %lf re", r, r + 1, r + 2, r + 3) == 4)
            for (int y = (int)std::lround(height - (r[1] + r[3]) * pixels_per_point);
                 y < (int)std::lround(height - r[1] * pixels_per_point); y++)
                for (int x = (int)std::lround(r[0] * pixels_per_point);
                     x < (int)std::lround((r[0] + r[2]) * pixels_per_point); x++)
                    pixels[(size_t)(y * width + x)] = 0;
        at = end == std::string::npos ? pdf.size() : end + 1;
    }
    return pixels;
}

static void a_printed_board_is_found_at_its_exact_size(void **)
{
    const Board board = {9, 6, .025};
    const std::string pdf = page_of(board, "a4");
    const int width = 4 * 297, height = 4 * 210;
    const std::vector<uint8_t> pixels = painted(pdf, width, height);
    View view;
    detect_board({pixels.data(), width, height, width}, board, Refinement::OWN, view);
    assert_string_equal(view.left_out.c_str(), "");
    for (size_t i = 0; i + 1 < view.corners.size(); i++) {
        if (i % 9 == 8) continue;
        const double side = std::hypot(view.corners[i + 1][0] - view.corners[i][0],
                                       view.corners[i + 1][1] - view.corners[i][1]);
        assert_float_equal(side / 4, 25, .13); /* half a pixel */
    }
}

static void the_table_of_a_page_leads_to_its_objects(void **)
{
    const std::string pdf = page_of({7, 5, .03}, "letter");
    const size_t start = pdf.rfind("startxref\n");
    const size_t table = (size_t)std::atol(pdf.c_str() + start + 10);
    assert_int_equal(pdf.compare(table, 5, "xref\n"), 0);
    for (int object = 1; object <= 5; object++) {
        const size_t row = table + 9 + 20 * (size_t)object;
        const size_t at = (size_t)std::atol(pdf.c_str() + row);
        const std::string begin = std::to_string(object) + " 0 obj\n";
        assert_int_equal(pdf.compare(at, begin.size(), begin), 0);
    }
}

static void a_board_that_does_not_fit_is_refused(void **)
{
    std::string pdf, error;
    assert_false(page_write({9, 6, .03}, "a4", pdf, error));
    assert_non_null(std::strstr(error.c_str(), "(0.0257 m in place of 0.03)"));
    assert_true(page_write({9, 6, .03}, "a3", pdf, error));
    assert_true(page_write({6, 9, .01}, "a4", pdf, error)); /* upright */
    assert_false(page_write({9, 6, .01}, "a5", pdf, error));
}

struct Folder {
    char path[64] = "/tmp/fovea-convert-XXXXXX";
    Folder()
    {
        assert_non_null(mkdtemp(path));
    }
    std::string file(const char *name) const
    {
        return std::string(path) + "/" + name;
    }
    ~Folder()
    {
        std::error_code ignored;
        std::filesystem::remove_all(path, ignored);
    }
};

static int convert(const std::string &in, const std::string &out, const char *format)
{
    std::string words[] = {"convert", in, out, "--format", format};
    char *argv[5];
    for (int i = 0; i < 5; i++)
        argv[i] = words[i].data();
    return command_convert(5, argv);
}

static fovea_camera read_camera(const std::string &path)
{
    fv_calibration calibration;
    fovea_error error;
    if (fv_calibration_read(path.c_str(), nullptr, &calibration, &error) != FOVEA_OK)
        fail_msg("%s", error.text);
    return calibration.camera;
}

/* Over a grid of the image: where the one camera sees what the other projects. */
static void assert_same_projection(const fovea_camera &a, const fovea_camera &b)
{
    assert_int_equal(a.width, b.width);
    assert_int_equal(a.height, b.height);
    int seen = 0;
    for (double y = 0; y < a.height; y += 40) {
        for (double x = 0; x < a.width; x += 40) {
            const double pixel[2] = {x, y};
            double bearing[3], first[2], second[2];
            if (fovea_camera_unproject(&a, pixel, bearing, nullptr) != FOVEA_OK) continue;
            assert_int_equal(fovea_camera_project(&a, bearing, first, nullptr), FOVEA_OK);
            assert_int_equal(fovea_camera_project(&b, bearing, second, nullptr), FOVEA_OK);
            assert_true(std::hypot(first[0] - second[0], first[1] - second[1]) < 1e-9);
            seen++;
        }
    }
    assert_true(seen > 50);
}

static void converted_files_project_alike(void **)
{
    const Folder folder;
    for (const fovea_lens lens : {FOVEA_LENS_RADTAN, FOVEA_LENS_EQUIDISTANT}) {
        fv_calibration calibration = {};
        calibration.camera = {640, 480, lens, 401.1, 402.7, 318.3, 243.9, {-.2, .05, 1e-3, -2e-3},
                              0};
        fovea_error error;
        assert_int_equal(fv_calibration_write(folder.file("in.yaml").c_str(), FV_CALIBRATION_ROS,
                                              &calibration, nullptr, &error),
                         FOVEA_OK);
        for (const char *format : {"ros", "ros-message", "opencv", "kalibr", "euroc", "orb-slam3",
                                   "basalt", "photonvision"}) {
            if (lens == FOVEA_LENS_EQUIDISTANT && std::strcmp(format, "photonvision") == 0)
                continue;
            assert_int_equal(convert(folder.file("in.yaml"), folder.file("out.yaml"), format), 0);
            assert_int_equal(convert(folder.file("out.yaml"), folder.file("back.yaml"), "ros"), 0);
            assert_same_projection(read_camera(folder.file("in.yaml")),
                                   read_camera(folder.file("back.yaml")));
        }
    }
}

static void what_a_format_cannot_hold_is_refused(void **)
{
    const Folder folder;
    fv_calibration calibration = {};
    calibration.camera = {
        640, 480, FOVEA_LENS_RADTAN, 401, 402, 318, 243, {-.2, .05, 1e-3, -2e-3, .01}, 0};
    fovea_error error;
    assert_int_equal(fv_calibration_write(folder.file("in.yaml").c_str(), FV_CALIBRATION_ROS,
                                          &calibration, nullptr, &error),
                     FOVEA_OK);
    assert_int_equal(convert(folder.file("in.yaml"), folder.file("out.yaml"), "kalibr"), 2);
    assert_int_not_equal(access(folder.file("out.yaml").c_str(), F_OK), 0);
    assert_int_equal(convert(folder.file("in.yaml"), folder.file("out.yaml"), "bibtex"), 2);
    assert_int_equal(convert(folder.file("no.yaml"), folder.file("out.yaml"), "ros"), 2);
}

/* What a command prints in a process of its own. */
static std::string printed(const Command &command, const char *option)
{
    const Folder folder;
    const std::string file = folder.file("out");
    std::fflush(nullptr);
    const pid_t child = fork();
    if (child == 0) {
        std::string words[2] = {command.name, option};
        char *arguments[] = {&words[0][0], &words[1][0], nullptr};
        if (std::freopen(file.c_str(), "w", stdout) == nullptr) _exit(99);
        const int left = command.run(2, arguments);
        std::fflush(nullptr);
        _exit(left);
    }
    int status = -1;
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_int_equal(status, 0);
    std::ifstream stream(file);
    return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

static void every_option_of_the_help_is_in_the_manual_page(void **)
{
    for (const Command &command : commands) {
        const std::string help = printed(command, "--help"), page = printed(command, "--man");
        assert_int_equal(page.find(".TH FOVEA"), 0);
        int options = 0;
        for (size_t at = help.find("\n  --"); at != std::string::npos;
             at = help.find("\n  --", at + 1), options++) {
            std::string item = "\\fB\\-\\-";
            for (const char letter : help.substr(at + 5, help.find(' ', at + 5) - at - 5))
                item += letter == '-' ? std::string("\\-") : std::string(1, letter);
            item += "\\fR";
            if (page.find(item) == std::string::npos) fail_msg("%s: no %s", command.name, &item[0]);
        }
        assert_true(options >= 4); /* --help, --man and at least two of its own */
        assert_true(page.find(command.help) != std::string::npos);
    }
}

int main()
{
    const CMUnitTest tests[] = {
        cmocka_unit_test(a_printed_board_is_found_at_its_exact_size),
        cmocka_unit_test(the_table_of_a_page_leads_to_its_objects),
        cmocka_unit_test(a_board_that_does_not_fit_is_refused),
        cmocka_unit_test(converted_files_project_alike),
        cmocka_unit_test(what_a_format_cannot_hold_is_refused),
        cmocka_unit_test(every_option_of_the_help_is_in_the_manual_page),
    };
    return cmocka_run_group_tests(tests, nullptr, nullptr);
}

/* The HTML report: whole and by itself, with the numbers of the JSON verdict, whatever files are
 * called; a disk that is full leaves what was there. */
#include "calibrate/command.h"
#include "calibrate/html.h"
#include "calibrate/report_html.h"
#include "calibrate/residuals.h"

#include <algorithm>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <dirent.h>
#include <fcntl.h>
#include <fstream>
#include <iterator>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

extern "C" {
#include "support/decode.h"
#include "support/picture.h"
}

#include "common/board_picture.h"
#include "common/cmocka_cpp.h"
#include "common/simulated_boards.h"

using namespace calibrate;

namespace
{

constexpr int WIDTH = 320, HEIGHT = 240, PICTURES = 6;
const char *const target = "chessboard:7x5:0.03";
/* The name of a picture as a rude file may have it, and as the report has it. */
const char *const rude = "<b>&\"'\x01\xff.png";
const char *const tame = "&#60;b&#62;&#38;&#34;&#39;\xef\xbf\xbd\xef\xbf\xbd.png";

/* The folder of a test: pictures below `in`, outputs beside it. */
struct Folder {
    char path[64] = "/tmp/fovea-report-XXXXXX";
    Folder()
    {
        assert_non_null(mkdtemp(path));
        assert_int_equal(mkdir(file("in").c_str(), 0700), 0);
    }
    Folder(const Folder &) = delete;
    std::string file(const std::string &name) const
    {
        return std::string(path) + "/" + name;
    }
    std::vector<std::string> files(const std::string &folder) const
    {
        std::vector<std::string> names;
        DIR *stream = opendir(folder.c_str());
        while (const dirent *entry = stream != nullptr ? readdir(stream) : nullptr)
            if (entry->d_name[0] != '.') names.push_back(entry->d_name);
        if (stream != nullptr) closedir(stream);
        std::sort(names.begin(), names.end());
        return names;
    }
    ~Folder()
    {
        for (const std::string &name : files(file("in")))
            unlink(file("in/" + name).c_str());
        rmdir(file("in").c_str());
        for (const std::string &name : files(path))
            unlink(file(name).c_str());
        rmdir(path);
    }
};

void write_picture(const std::string &path, const std::vector<uint8_t> &pixels)
{
    fovea_image image = {};
    image.data = pixels.data();
    image.width = WIDTH;
    image.height = HEIGHT;
    image.stride_bytes = WIDTH;
    image.format = FOVEA_PIXEL_GREY8;
    image.size_bytes = pixels.size();
    fovea_error error;
    if (fv_picture_write(path.c_str(), &image, &error) != FOVEA_OK) fail_msg("%s", error.text);
}

/* A board in several places, and a picture with none. */
void write_pictures(const Folder &folder)
{
    Board board;
    Drawing drawing;
    std::string error;
    assert_true(board_parse(target, board, error) && draw(board, drawing, error));
    fovea_camera camera = {};
    camera.width = WIDTH;
    camera.height = HEIGHT;
    camera.fx = camera.fy = 260;
    camera.cx = 162;
    camera.cy = 118;
    camera.k[0] = -.1;
    assert_int_equal(fovea_camera_prepare(&camera, nullptr), FOVEA_OK);
    for (int i = 0; i < PICTURES; i++) {
        const double a = .4 * std::sin(2.1 * i), b = .5 * std::cos(1.3 * i);
        const double shift[2] = {.06 * (i % 3 - 1), .04 * (i % 2) - .02};
        BoardPlace place = {{-.09 + shift[0], -.06 + shift[1], .33 + .01 * i},
                            {std::cos(a), 0, std::sin(a)},
                            {-std::sin(a) * std::sin(b), std::cos(b), std::cos(a) * std::sin(b)}};
        write_picture(folder.file("in/" + (i == 2 ? rude : std::to_string(i) + ".png")),
                      board_picture(drawing, camera, place));
    }
    write_picture(folder.file("in/none.png"), std::vector<uint8_t>((size_t)(WIDTH * HEIGHT), 90));
}

std::string content(const std::string &path)
{
    std::ifstream stream(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

/* The command in a process of its own, which may write files of `file_bytes` at most; 0: of any
 * size. What it says goes to the file "said". */
int calibrate_camera(const Folder &folder, const std::string &report, rlim_t file_bytes)
{
    std::fflush(nullptr);
    const pid_t child = fork();
    if (child == 0) {
        std::string words[] = {"camera",   "--source", folder.file("in"),
                               "--target", target,     "--model",
                               "radtan",   "--json",   folder.file("json"),
                               "--report", report,     std::string("--name=<i>")};
        std::vector<char *> arguments;
        for (std::string &word : words)
            arguments.push_back(word.data());
        const int said = open(folder.file("said").c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
        const int nothing = open("/dev/null", O_WRONLY);
        if (said < 0 || dup2(said, 2) < 0 || nothing < 0 || dup2(nothing, 1) < 0) _exit(99);
        const rlimit limit = {file_bytes, file_bytes};
        std::signal(SIGXFSZ, SIG_IGN);
        if (file_bytes > 0 && setrlimit(RLIMIT_FSIZE, &limit) != 0) _exit(98);
        const int left = command_camera((int)arguments.size(), arguments.data());
        std::fflush(nullptr);
        _exit(left);
    }
    int status = -1;
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_true(WIFEXITED(status));
    return WEXITSTATUS(status);
}

/* Values of <data class="NAME">, in order; NaN for those that are not known. */
std::vector<double> data_of(const std::string &page, const std::string &name)
{
    std::vector<double> values;
    const std::string begin = "<data class=\"" + name + "\" value=\"";
    for (size_t at = page.find(begin); at != std::string::npos; at = page.find(begin, at + 1)) {
        const char *text = page.c_str() + at + begin.size();
        values.push_back(*text == '"' ? NAN : std::strtod(text, nullptr));
    }
    return values;
}

/* Numbers after each `key` of the JSON from `at` to `end`. */
std::vector<double> numbers_after(const std::string &json, const std::string &key, size_t at,
                                  size_t end)
{
    std::vector<double> values;
    for (at = json.find(key, at); at < end; at = json.find(key, at + 1))
        values.push_back(std::strtod(json.c_str() + at + key.size(), nullptr));
    return values;
}

void assert_near(const std::vector<double> &found, const std::vector<double> &expected)
{
    assert_int_equal(found.size(), expected.size());
    assert_true(found.size() > 0);
    for (size_t i = 0; i < found.size(); i++)
        assert_true(std::fabs(found[i] - expected[i]) <= 1e-5 * std::fabs(expected[i]) + 1e-12);
}

/* Every element is closed in order: the page is well-formed as XML has it. */
void assert_well_formed(const std::string &page)
{
    std::vector<std::string> open;
    for (size_t at = page.find('<'); at != std::string::npos; at = page.find('<', at + 1)) {
        const size_t end = page.find('>', at);
        assert_true(end != std::string::npos);
        assert_true(page.find('<', at + 1) > end);
        if (page[at + 1] == '!') continue;
        const std::string name = page.substr(at + 1, page.find_first_of(" />\n", at + 2) - at - 1);
        if (page[at + 1] == '/') {
            assert_true(!open.empty());
            assert_string_equal(page.substr(at + 2, end - at - 2).c_str(), open.back().c_str());
            open.pop_back();
        } else if (page[end - 1] != '/') {
            open.push_back(name);
        }
        int quotes = 0;
        for (size_t i = at; i < end; i++)
            quotes += page[i] == '"';
        assert_int_equal(quotes % 2, 0);
    }
    assert_int_equal(open.size(), 0);
    for (size_t at = page.find('&'); at != std::string::npos; at = page.find('&', at + 1))
        assert_int_equal(page[at + 1], '#');
}

size_t count_of(const std::string &page, const std::string &text)
{
    size_t count = 0;
    for (size_t at = page.find(text); at != std::string::npos; at = page.find(text, at + 1))
        count++;
    return count;
}

std::vector<uint8_t> base64_bytes(const std::string &text)
{
    static const std::string digits =
        "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::vector<uint8_t> bytes;
    uint32_t group = 0;
    int bits = 0;
    for (const char digit : text) {
        if (digit == '=') break;
        group = group << 6 | (uint32_t)digits.find(digit);
        bits += 6;
        if (bits < 8) continue;
        bits -= 8;
        bytes.push_back((uint8_t)(group >> bits));
    }
    return bytes;
}

} // namespace

static void the_report_has_the_numbers_of_the_json_verdict(void **)
{
    const Folder folder;
    write_pictures(folder);
    const int status = calibrate_camera(folder, folder.file("report.html"), 0);
    assert_true(status == 0 || status == 1);
    const std::string page = content(folder.file("report.html")),
                      json = content(folder.file("json"));
    const size_t views = json.find("\"views\": [");
    for (const char *name :
         {"rms_px", "noise_px", "held_out_rms_px", "cross_solve_px", "views_used", "corners_used",
          "projection_stdev_seen_px", "residual_pattern"})
        assert_near(data_of(page, name),
                    numbers_after(json, "\"" + std::string(name) + "\": ", 0, views));
    const size_t parameters = json.find("\"parameters\"");
    for (int i = 0; parameter_name(Model::radtan, i) != nullptr; i++) {
        const std::string name = parameter_name(Model::radtan, i);
        const size_t at = json.find("\"" + name + "\"", parameters), line = json.find('}', at);
        assert_near(data_of(page, name), numbers_after(json, "\"value\": ", at, line));
        assert_near(data_of(page, name + "-stdev"), numbers_after(json, "\"stdev\": ", at, line));
    }
    assert_near(data_of(page, "view_rms_px"),
                numbers_after(json, "\"rms_px\": ", views, json.find("\"compared\"")));
    std::vector<double> map;
    for (size_t at = json.find("\"projection_stdev_px\"") + 21; at < views;)
        if (std::strchr("0123456789", json[at]) != nullptr) {
            map.push_back(std::strtod(json.c_str() + at, nullptr));
            at = json.find_first_of(",]", at);
        } else {
            at++;
        }
    assert_near(data_of(page, "projection_stdev_px"), map);
    const std::string grade = json.substr(json.find("\"verdict\": \"") + 12, 4);
    assert_int_equal(page.find(grade, page.find("id=\"grade\">")), page.find("id=\"grade\">") + 11);
    assert_int_equal(count_of(json, "{\"grade\""), count_of(page, "<li>"));
}

static void the_report_needs_nothing_else(void **)
{
    const Folder folder;
    write_pictures(folder);
    (void)calibrate_camera(folder, folder.file("report.html"), 0);
    const std::string page = content(folder.file("report.html"));
    assert_well_formed(page);
    for (const char *section : {"parameters", "errors", "coverage", "residual-directions",
                                "projection-uncertainty", "views", "left-out"})
        assert_int_equal(count_of(page, "<section id=\"" + std::string(section) + "\">"), 1);
    for (const char *outside : {"http:", "https:", "src=", "<script", "<link", "@import", "<a "})
        assert_int_equal(count_of(page, outside), 0);
    assert_int_equal(count_of(page, "url("), count_of(page, "url(#beyond)"));
    assert_int_equal(count_of(page, "href="), count_of(page, "href=\"data:image/png;base64,"));
    assert_int_equal(count_of(page, "<svg class=\"view\""), PICTURES + 1);
    assert_int_equal(count_of(page, "<circle class=\"used\""), 35 * PICTURES);
}

static void names_of_files_stay_text(void **)
{
    const Folder folder;
    write_pictures(folder);
    (void)calibrate_camera(folder, folder.file("report.html"), 0);
    const std::string page = content(folder.file("report.html"));
    assert_int_equal(count_of(page, rude), 0);
    assert_int_equal(count_of(page, tame), 2); /* its bar and its picture */
    assert_int_equal(count_of(page, "<i>"), 0);
    assert_int_equal(count_of(page, "Calibration of &#60;i&#62;"), 1);
    assert_string_equal(escaped("a\tb\xc3\xa9\xed\xa0\x80\x7f").c_str(),
                        "a\tb\xc3\xa9\xef\xbf\xbd\xef\xbf\xbd\xef\xbf\xbd\xef\xbf\xbd");
}

static void the_pictures_are_those_of_the_set(void **)
{
    Thumbnail picture;
    picture.width = 65;
    picture.height = 66;
    for (int i = 0; i < 65 * 66; i++)
        picture.grey.push_back((uint8_t)(11 * i));
    const std::string uri = picture_uri(picture), head = "data:image/png;base64,";
    assert_int_equal(uri.compare(0, head.size(), head), 0);
    const std::vector<uint8_t> bytes = base64_bytes(uri.substr(head.size()));
    std::vector<uint8_t> pixels(65 * 66);
    fv_decode_image into = {};
    fovea_error error;
    if (fv_decode_probe(bytes.data(), bytes.size(), &into.width, &into.height, &error) != FOVEA_OK)
        fail_msg("%s", error.text);
    assert_int_equal(into.width, 65);
    assert_int_equal(into.height, 66);
    into.pixels = pixels.data();
    into.stride_bytes = 65;
    assert_int_equal(fv_decode(bytes.data(), bytes.size(), &into, &error), FOVEA_OK);
    assert_memory_equal(pixels.data(), picture.grey.data(), pixels.size());
    assert_string_equal(picture_uri(Thumbnail()).c_str(), "");
}

static void one_line(const Folder &folder, const char *what)
{
    const std::string said = content(folder.file("said"));
    assert_int_equal(std::count(said.begin(), said.end(), '\n'), 1);
    if (said.find(what) == std::string::npos) fail_msg("said: %s", said.c_str());
}

static void a_report_is_written_whole_or_not_at_all(void **)
{
    const Folder folder;
    write_pictures(folder);
    const std::string report = folder.file("report.html");
    std::ofstream(report) << "what was there";
    assert_int_equal(calibrate_camera(folder, report, 20000), 1); /* as on a full disk */
    one_line(folder, "report.html");
    assert_string_equal(content(report).c_str(), "what was there");
    assert_int_equal(access((report + ".part").c_str(), F_OK), -1);
    unlink(folder.file("json").c_str());
    assert_int_equal(calibrate_camera(folder, folder.file("no/report.html"), 0), 2);
    one_line(folder, "no/report.html");
    assert_int_equal(access(folder.file("json").c_str(), F_OK), -1); /* before any work */
}

static void a_set_without_a_board_has_a_report_too(void **)
{
    const Folder folder;
    write_picture(folder.file("in/none.png"), std::vector<uint8_t>((size_t)(WIDTH * HEIGHT), 90));
    assert_int_equal(calibrate_camera(folder, folder.file("report.html"), 0), 1);
    const std::string page = content(folder.file("report.html"));
    assert_well_formed(page);
    assert_int_equal(count_of(page, "id=\"grade\">fail<"), 1);
    assert_int_equal(count_of(page, "no board of 7 x 5 inner corners was found"), 1);
    assert_int_equal(count_of(page, "<svg class=\"view\""), 1);
}

/* A lens that the model does not fit leaves residuals that point the same way in parts of the
 * image; noise alone does not. */
static void a_wrong_model_leaves_a_pattern(void **)
{
    for (const bool fits : {true, false}) {
        simulated::Random random = {std::mt19937_64(5)};
        fovea_camera truth = simulated::true_camera(Model::equidistant, random);
        truth.fx = truth.fy = 220;
        truth.k[0] = fits ? truth.k[0] : .3;
        assert_int_equal(fovea_camera_prepare(&truth, nullptr), FOVEA_OK);
        const std::vector<View> views = simulated::see_boards(truth, random, 20, nullptr);
        SolveOptions options;
        options.model = fits ? Model::equidistant : Model::radtan;
        options.reject = false;
        Solution solution;
        std::string error;
        if (!solve(simulated::board, views, simulated::WIDTH, simulated::HEIGHT, options, solution,
                   error))
            fail_msg("%s", error.c_str());
        const ResidualPattern pattern = residual_pattern(views, solution);
        printf("%s: residual pattern %.2f\n", model_name(options.model), pattern.ratio);
        if (fits)
            assert_true(pattern.ratio > .6 && pattern.ratio < 1.4);
        else
            assert_true(pattern.ratio > 2);
        const std::vector<Pixel> hull = corner_hull(views, solution);
        assert_true(hull.size() >= 3);
        for (const View &view : views)
            for (const Pixel &corner : view.corners)
                for (size_t i = 0; i < hull.size(); i++) {
                    const Pixel &a = hull[i], &b = hull[(i + 1) % hull.size()];
                    assert_true((b[0] - a[0]) * (corner[1] - a[1]) -
                                    (b[1] - a[1]) * (corner[0] - a[0]) >
                                -1e-6);
                }
    }
}

int main()
{
    const CMUnitTest tests[] = {
        cmocka_unit_test(the_report_has_the_numbers_of_the_json_verdict),
        cmocka_unit_test(the_report_needs_nothing_else),
        cmocka_unit_test(names_of_files_stay_text),
        cmocka_unit_test(the_pictures_are_those_of_the_set),
        cmocka_unit_test(a_report_is_written_whole_or_not_at_all),
        cmocka_unit_test(a_set_without_a_board_has_a_report_too),
        cmocka_unit_test(a_wrong_model_leaves_a_pattern),
    };
    return cmocka_run_group_tests(tests, nullptr, nullptr);
}

/* Boards, and the names of models and parameters. */
#include "calibrate/calibrate.h"

#include <algorithm>
#include <cstdio>
#include <cstring>

#include "support/text.h"

namespace calibrate
{
namespace
{

struct Kind {
    const char *name;
    Pattern pattern;
    int count_min;
};

const Kind kinds[] = {{"chessboard", Pattern::chessboard, 3},
                      {"charuco", Pattern::charuco, 3},
                      {"aprilgrid", Pattern::aprilgrid, 2},
                      {"circles", Pattern::circles, 3},
                      {"asymmetric_circles", Pattern::asymmetric_circles, 3}};

/* In the order of OpenCV's predefined dictionaries, whose names they have without DICT_. */
const char *const dictionaries[] = {
    "4x4_50",        "4x4_100",        "4x4_250",       "4x4_1000", "5x5_50",   "5x5_100",
    "5x5_250",       "5x5_1000",       "6x6_50",        "6x6_100",  "6x6_250",  "6x6_1000",
    "7x7_50",        "7x7_100",        "7x7_250",       "7x7_1000", "original", "apriltag_16h5",
    "apriltag_25h9", "apriltag_36h10", "apriltag_36h11"};

std::vector<std::string> split(const std::string &text)
{
    std::vector<std::string> parts(1);
    for (const char c : text) {
        if (c == ':')
            parts.emplace_back();
        else
            parts.back() += c;
    }
    return parts;
}

bool length_of(const std::string &text, double &length)
{
    constexpr double length_max_m = 10;
    return fv_text_number(text.c_str(), &length) && length > 0 && length <= length_max_m;
}

bool counts_of(const std::string &text, int least, Board &board)
{
    constexpr int most = 50;
    int64_t columns, rows;
    const size_t cross = text.find('x');
    if (cross == std::string::npos || !fv_text_integer(text.substr(0, cross).c_str(), &columns) ||
        !fv_text_integer(text.substr(cross + 1).c_str(), &rows) || columns < least ||
        rows < least || columns > most || rows > most)
        return false;
    board.columns = (int)columns;
    board.rows = (int)rows;
    return true;
}

bool dictionary_of(const std::string &text, int &dictionary)
{
    const std::string bare = text.compare(0, 5, "DICT_") == 0 ? text.substr(5) : text;
    for (dictionary = 0; dictionary_name(dictionary) != nullptr; dictionary++)
        if (strcasecmp(bare.c_str(), dictionary_name(dictionary)) == 0) return true;
    return false;
}

bool markers_of(const std::vector<std::string> &parts, Board &board)
{
    if (board.pattern == Pattern::aprilgrid) {
        double ratio;
        if (parts.size() != 4 || !length_of(parts[3], ratio) || ratio > 1) return false;
        board.marker_m = ratio * board.square_m;
        return true;
    }
    if (board.pattern != Pattern::charuco) return parts.size() == 3;
    return parts.size() == 5 && length_of(parts[3], board.marker_m) &&
           board.marker_m < board.square_m && dictionary_of(parts[4], board.dictionary);
}

} // namespace

const char board_forms[] =
    "chessboard:9x6:0.025 (inner corners, metres), charuco:8x6:0.03:0.022:4x4_50 (squares, side of "
    "a square and of a marker, dictionary), aprilgrid:6x6:0.088:0.3 (tags, side, gap over side), "
    "circles:7x5:0.03 or asymmetric_circles:4x11:0.02 (circles, spacing)";

const char *dictionary_name(int dictionary)
{
    constexpr int count = sizeof dictionaries / sizeof dictionaries[0];
    return dictionary >= 0 && dictionary < count ? dictionaries[dictionary] : nullptr;
}

int Board::point_columns() const
{
    return pattern == Pattern::charuco     ? columns - 1
           : pattern == Pattern::aprilgrid ? 2 * columns
                                           : columns;
}

int Board::point_rows() const
{
    return pattern == Pattern::charuco ? rows - 1 : pattern == Pattern::aprilgrid ? 2 * rows : rows;
}

std::vector<Point> Board::points() const
{
    std::vector<Point> points;
    const auto along = [this](int i) { /* of a point of an AprilGrid */
                                       return i / 2 * (square_m + marker_m) + i % 2 * square_m;
    };
    for (int j = 0; j < point_rows(); j++) {
        for (int i = 0; i < point_columns(); i++) {
            if (pattern == Pattern::aprilgrid)
                points.push_back({along(i), along(j), 0});
            else if (pattern == Pattern::asymmetric_circles)
                points.push_back({(2 * i + j % 2) * square_m, j * square_m, 0});
            else
                points.push_back({i * square_m, j * square_m, 0});
        }
    }
    return points;
}

std::string Board::text() const
{
    char text[160];
    const char *name = "";
    for (const Kind &kind : kinds)
        if (kind.pattern == pattern) name = kind.name;
    const int length = snprintf(text, sizeof text, "%s:%dx%d:%.9g", name, columns, rows, square_m);
    char *const end = text + length;
    const size_t room = sizeof text - (size_t)length;
    if (pattern == Pattern::charuco)
        snprintf(end, room, ":%.9g:%s", marker_m, dictionary_name(dictionary));
    if (pattern == Pattern::aprilgrid) snprintf(end, room, ":%.9g", marker_m / square_m);
    return text;
}

bool board_parse(const std::string &text, Board &board, std::string &error)
{
    const std::vector<std::string> parts = split(text);
    for (const Kind &kind : kinds) {
        Board found;
        found.pattern = kind.pattern;
        if (parts.size() < 3 || parts[0] != kind.name ||
            !counts_of(parts[1], kind.count_min, found) || !length_of(parts[2], found.square_m) ||
            !markers_of(parts, found))
            continue;
        board = found;
        return true;
    }
    char quoted[FV_TEXT_QUOTED_BYTES];
    error = std::string("--target: found ") + fv_text_quote(text.c_str(), quoted, sizeof quoted) +
            ", expected " + board_forms + "; at most 50 a side";
    return false;
}

const char *model_name(Model model)
{
    return model == Model::radtan     ? "radtan"
           : model == Model::rational ? "rational"
                                      : "equidistant";
}

int coefficient_count(Model model)
{
    return model == Model::radtan ? 5 : model == Model::rational ? 8 : 4;
}

const char *parameter_name(Model model, int parameter)
{
    static const char *const radtan[] = {"fx", "fy", "cx", "cy", "k1", "k2",
                                         "p1", "p2", "k3", "k4", "k5", "k6"};
    static const char *const equidistant[] = {"fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4"};
    if (parameter < 0 || parameter >= 4 + coefficient_count(model)) return nullptr;
    return model == Model::equidistant ? equidistant[parameter] : radtan[parameter];
}

double median(std::vector<double> values)
{
    values.erase(std::remove_if(values.begin(), values.end(),
                                [](double value) { return std::isnan(value); }),
                 values.end());
    if (values.empty()) return 0;
    const auto half = values.begin() + (ptrdiff_t)values.size() / 2;
    std::nth_element(values.begin(), half, values.end());
    return *half;
}

} // namespace calibrate

/* Chessboards, circles and markers by OpenCV. */
#include <opencv2/aruco.hpp>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "calibrate/corners.h"

#include <algorithm>
#include <climits>

namespace calibrate
{
namespace
{

/* From each corner to the nearest of its neighbours in row and column. */
double spacing(const Board &board, const std::vector<Pixel> &corners, int column, int row)
{
    const size_t at = (size_t)(row * board.columns + column);
    double least = INFINITY;
    if (column > 0) least = std::min(least, distance(corners[at], corners[at - 1]));
    if (column + 1 < board.columns) least = std::min(least, distance(corners[at], corners[at + 1]));
    if (row > 0)
        least = std::min(least, distance(corners[at], corners[at - (size_t)board.columns]));
    if (row + 1 < board.rows)
        least = std::min(least, distance(corners[at], corners[at + (size_t)board.columns]));
    return least;
}

void refine_own(const Grey &image, const Board &board, View &view)
{
    constexpr double half_max_px = 5.5, half_min_px = 2, half_share = .4;
    const std::vector<Pixel> rough = view.corners;
    for (int j = 0; j < board.rows; j++) {
        for (int i = 0; i < board.columns; i++) {
            const double half =
                std::clamp(half_share * spacing(board, rough, i, j), half_min_px, half_max_px);
            Pixel &corner = view.corners[(size_t)(j * board.columns + i)];
            Pixel coarse = corner;
            if (refine_corner(image, half, coarse)) corner = coarse;
        }
    }
}

/* Across the edges along rows and columns. */
double chessboard_edge(const Grey &image, const Board &board, const std::vector<Pixel> &corners)
{
    constexpr double reach = .35;
    std::vector<double> widths;
    for (int j = 0; j < board.rows; j++) {
        for (int i = 0; i < board.columns; i++) {
            const size_t at = (size_t)(j * board.columns + i);
            if (i + 1 < board.columns)
                widths.push_back(edge_width(image, corners[at], corners[at + 1], reach));
            if (j + 1 < board.rows)
                widths.push_back(
                    edge_width(image, corners[at], corners[at + (size_t)board.columns], reach));
        }
    }
    return median(widths);
}

/* From the centre of each circle to the middle between it and the next of its row. */
double circle_edge(const Grey &image, const Board &board, const std::vector<Pixel> &centres)
{
    std::vector<double> widths;
    for (size_t at = 0; at + 1 < centres.size(); at++) {
        if ((int)at % board.columns == board.columns - 1) continue;
        const Pixel &a = centres[at], &b = centres[at + 1];
        widths.push_back(step_width(image, a, {.5 * (a[0] + b[0]), .5 * (a[1] + b[1])}));
    }
    return median(widths);
}

/* Rows are turned round where the board is numbered as its mirror image, so that a bend has the
 * same sign in all views. */
void same_hand(const Board &board, std::vector<Pixel> &corners)
{
    const Pixel &o = corners[0], &x = corners[(size_t)board.columns - 1],
                &y = corners[(size_t)(board.columns * (board.rows - 1))];
    if ((x[0] - o[0]) * (y[1] - o[1]) - (x[1] - o[1]) * (y[0] - o[0]) > 0) return;
    for (int j = 0; j < board.rows; j++)
        std::reverse(corners.begin() + j * board.columns,
                     corners.begin() + (j + 1) * board.columns);
}

cv::Mat picture_of(const Grey &image)
{
    return {image.height, image.width, CV_8UC1, const_cast<uint8_t *>(image.pixels),
            (size_t)image.stride_bytes};
}

/* The size of the chessboard that the picture shows, the larger number first; false: none. */
bool chessboard_size(const Grey &image, int &more, int &fewer)
{
    constexpr int smallest = 3;
    std::vector<cv::Point2f> corners;
    cv::Mat grid;
    if (!cv::findChessboardCornersSB(picture_of(image), cv::Size(smallest, smallest), corners,
                                     cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_LARGER, grid))
        return false;
    more = std::max(grid.cols, grid.rows);
    fewer = std::min(grid.cols, grid.rows);
    return true;
}

bool same_size(const Board &board, int more, int fewer)
{
    return more == std::max(board.columns, board.rows) &&
           fewer == std::min(board.columns, board.rows);
}

bool find_chessboard(const Grey &image, const Board &board, Refinement refinement, View &view)
{
    const cv::Mat picture = picture_of(image);
    const cv::Size size(board.columns, board.rows);
    constexpr int usual = cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_NORMALIZE_IMAGE;
    std::vector<cv::Point2f> found;
    const auto find = [&](int how) { return cv::findChessboardCorners(picture, size, found, how); };
    /* Without normalisation, which takes seconds where it makes noise strong; published results
     * have it. */
    const int first = refinement == Refinement::OWN ? cv::CALIB_CB_ADAPTIVE_THRESH : usual;
    if (!find(first | cv::CALIB_CB_FAST_CHECK)) {
        int more, fewer;
        if (chessboard_size(image, more, fewer)) { /* finds blurred ones, too */
            if (!same_size(board, more, fewer)) {
                view.shown_columns = more;
                view.shown_rows = fewer;
                return false;
            }
            if (!cv::findChessboardCornersSB(picture, size, found, cv::CALIB_CB_NORMALIZE_IMAGE))
                return false;
        } else if (!find(usual | cv::CALIB_CB_FAST_CHECK) && !find(usual)) {
            return false;
        }
    }
    if (refinement == Refinement::OPENCV_11)
        cv::cornerSubPix(picture, found, cv::Size(11, 11), cv::Size(-1, -1),
                         cv::TermCriteria(cv::TermCriteria::EPS + cv::TermCriteria::COUNT, 30, .1));
    for (const cv::Point2f &corner : found)
        view.corners.push_back({corner.x, corner.y});
    if (refinement == Refinement::OWN) refine_own(image, board, view);
    view.edge_px = chessboard_edge(image, board, view.corners);
    return true;
}

/* Black circles. */
bool find_circles(const Grey &image, const Board &board, View &view)
{
    std::vector<cv::Point2f> found;
    const cv::Size size(board.columns, board.rows);
    const int kind = board.pattern == Pattern::circles ? cv::CALIB_CB_SYMMETRIC_GRID
                                                       : cv::CALIB_CB_ASYMMETRIC_GRID;
    if (!cv::findCirclesGrid(picture_of(image), size, found, kind) &&
        !cv::findCirclesGrid(picture_of(image), size, found, kind | cv::CALIB_CB_CLUSTERING))
        return false;
    for (const cv::Point2f &centre : found)
        view.corners.push_back({centre.x, centre.y});
    view.edge_px = circle_edge(image, board, view.corners);
    correct_circles(image, board, view);
    return true;
}

/* OpenCV gives a pointer to a dictionary before 4.7, and a dictionary since. */
[[maybe_unused]] cv::Ptr<cv::aruco::Dictionary> held(cv::Ptr<cv::aruco::Dictionary> dictionary)
{
    return dictionary;
}

[[maybe_unused]] cv::Ptr<cv::aruco::Dictionary> held(const cv::aruco::Dictionary &dictionary)
{
    return cv::makePtr<cv::aruco::Dictionary>(dictionary);
}

cv::Ptr<cv::aruco::Dictionary> dictionary_of(int dictionary)
{
    return held(cv::aruco::getPredefinedDictionary(dictionary));
}

} // namespace

std::vector<Marker> find_markers(const Grey &image, int dictionary, int border, int ids,
                                 size_t enough)
{
    constexpr int twice_pixels_max = 1300000;
    const auto how = cv::makePtr<cv::aruco::DetectorParameters>();
    how->markerBorderBits = border;
    how->perspectiveRemoveIgnoredMarginPerCell = .25; /* finds more of small, tilted tags */
    how->adaptiveThreshConstant = 10;
    how->cornerRefinementMethod = cv::aruco::CORNER_REFINE_SUBPIX;
    how->cornerRefinementWinSize = 3; /* to each side: less than the cells of small markers */
    std::vector<Marker> markers;
    const cv::Mat picture = picture_of(image);
    const auto wanted = [&](const Marker &marker) { return marker.id < ids; };
    /* At twice the size, too, where small cells are recognised more often. */
    for (const int scale : {1, 2}) {
        std::vector<std::vector<cv::Point2f>> corners;
        std::vector<int> found;
        cv::Mat scaled = picture;
        if (scale > 1 && image.width * image.height > twice_pixels_max) break;
        if ((size_t)std::count_if(markers.begin(), markers.end(), wanted) >= enough) break;
        if (scale > 1) cv::resize(picture, scaled, cv::Size(), scale, scale, cv::INTER_CUBIC);
        cv::aruco::detectMarkers(scaled, dictionary_of(dictionary), corners, found, how);
        for (size_t i = 0; i < found.size(); i++) {
            Marker marker = {found[i], {}};
            for (size_t k = 0; k < 4; k++)
                marker.corners[k] = {(corners[i][k].x + .5) / scale - .5,
                                     (corners[i][k].y + .5) / scale - .5};
            if (std::none_of(markers.begin(), markers.end(),
                             [&](const Marker &other) { return other.id == marker.id; }))
                markers.push_back(marker);
        }
    }
    return markers;
}

std::vector<uint8_t> marker_cells(int dictionary, int id, int border, int &side)
{
    const auto found = dictionary_of(dictionary);
    const int bits = found->markerSize;
    const cv::Mat inner =
        cv::aruco::Dictionary::getBitsFromByteList(found->bytesList.rowRange(id, id + 1), bits);
    side = bits + 2 * border;
    std::vector<uint8_t> white((size_t)(side * side));
    for (int j = 0; j < bits; j++)
        for (int i = 0; i < bits; i++)
            white[(size_t)((j + border) * side + i + border)] = inner.at<uint8_t>(j, i) != 0;
    return white;
}

int marker_count(int dictionary)
{
    return dictionary_of(dictionary)->bytesList.rows;
}

namespace
{

/* Whether the squares may go on beyond a board that was found: half of the places where the next
 * corners beyond one of its sides would lie have one. */
bool may_go_on(const Grey &image, const Board &board, const std::vector<Pixel> &corners)
{
    constexpr double half_max_px = 5.5, half_min_px = 2, half_share = .4;
    const int across = board.columns, last = across * (board.rows - 1);
    const struct {
        int first, next, inwards, count;
    } sides[] = {{0, 1, across, across},
                 {last, 1, -across, across},
                 {0, across, 1, board.rows},
                 {across - 1, across, -1, board.rows}};
    for (const auto &side : sides) {
        int crossings = 0;
        for (int k = 0; k < side.count; k++) {
            const Pixel *at = &corners[(size_t)(side.first + k * side.next)];
            const Pixel &a = at[0], &b = at[side.inwards], &c = at[2 * side.inwards];
            Pixel beyond = {3 * (a[0] - b[0]) + c[0], 3 * (a[1] - b[1]) + c[1]};
            const double half =
                std::clamp(half_share * distance(a, beyond), half_min_px, half_max_px);
            crossings += refine_corner(image, half, beyond);
        }
        if (2 * crossings >= side.count) return true;
    }
    return false;
}

void explain_chessboard(const Grey &image, const Board &board, View &view)
{
    int more = view.shown_columns, fewer = view.shown_rows;
    if (!view.corners.empty() && !may_go_on(image, board, view.corners)) return;
    if (more == 0 && !chessboard_size(image, more, fewer)) return;
    if (same_size(board, more, fewer)) return;
    /* Of a board that was found, a part may have been seen. */
    if (!view.corners.empty() && more <= std::max(board.columns, board.rows) &&
        fewer <= std::min(board.columns, board.rows))
        return;
    view.shown_columns = more;
    view.shown_rows = fewer;
    if (view.corners.empty())
        view.left_out += ", but one of " + std::to_string(more) + " x " + std::to_string(fewer);
}

void explain_markers(const Grey &image, const Board &board, View &view)
{
    constexpr size_t markers_min = 3;
    if (view.left_out.empty()) return;
    const bool grid = board.pattern == Pattern::aprilgrid;
    cv::Mat flipped;
    cv::flip(picture_of(image), flipped, 1);
    const Grey mirror = {flipped.data, image.width, image.height, (int)flipped.step};
    const std::vector<Marker> markers =
        find_markers(mirror, grid ? (int)APRILGRID_DICTIONARY : board.dictionary,
                     grid ? APRILGRID_BORDER : 1, INT_MAX, markers_min);
    if (markers.size() < markers_min) return;
    view.mirrored = true;
    view.left_out = "the picture is mirrored: its markers are found when it is flipped";
}

} // namespace

void explain_board(const Grey &image, const Board &board, View &view)
{
    if (board.pattern == Pattern::chessboard)
        explain_chessboard(image, board, view);
    else if (board.pattern == Pattern::charuco || board.pattern == Pattern::aprilgrid)
        explain_markers(image, board, view);
}

void detect_board(const Grey &image, const Board &board, Refinement refinement, View &view)
{
    view.corners.clear();
    if (board.pattern == Pattern::charuco || board.pattern == Pattern::aprilgrid) {
        const bool grid = board.pattern == Pattern::aprilgrid;
        const int ids = board.columns * board.rows / (grid ? 1 : 2);
        detect_by_markers(image, board,
                          find_markers(image, grid ? (int)APRILGRID_DICTIONARY : board.dictionary,
                                       grid ? APRILGRID_BORDER : 1, ids, (size_t)ids),
                          view);
        return;
    }
    const bool found = board.pattern == Pattern::chessboard
                           ? find_chessboard(image, board, refinement, view)
                           : find_circles(image, board, view);
    if (!found) {
        view.left_out =
            "no board of " + std::to_string(board.columns) + " x " + std::to_string(board.rows) +
            (board.pattern == Pattern::chessboard ? " inner corners" : " circles") + " was found";
        return;
    }
    if (board.pattern != Pattern::asymmetric_circles) same_hand(board, view.corners);
}

} // namespace calibrate

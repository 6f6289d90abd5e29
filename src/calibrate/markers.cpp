/* Points of ChArUco boards and AprilGrids from the markers that were found. */
#include "calibrate/corners.h"

#include <Eigen/Dense>

#include <algorithm>
#include <map>

namespace calibrate
{
namespace
{

using Four = std::array<Point, 4>;

/* How markers may lie on a board: programs differ in which square is white, where they count from,
 * and how their markers are turned. */
struct Layout {
    bool white_first; /* charuco: the first square is white, as OpenCV before 4.6 with even rows */
    bool from_top;    /* aprilgrid: the first tag is at the top left, not at the bottom left */
    int turns;        /* aprilgrid: quarter turns of all tags */
};

Four square_at(double x, double y, double side)
{
    return {Point{x, y, 0}, Point{x + side, y, 0}, Point{x + side, y + side, 0},
            Point{x, y + side, 0}};
}

/* The corners of every marker by its number, as printed, in the coordinates of Board::points. */
std::map<int, Four> marker_places(const Board &board, const Layout &layout)
{
    std::map<int, Four> places;
    if (board.pattern == Pattern::aprilgrid) {
        const double pitch = board.square_m + board.marker_m;
        for (int id = 0; id < board.columns * board.rows; id++) {
            const int row = id / board.columns;
            const Four square =
                square_at(id % board.columns * pitch,
                          (layout.from_top ? row : board.rows - 1 - row) * pitch, board.square_m);
            Four &place = places[id];
            for (size_t k = 0; k < 4; k++)
                place[k] = square[(k + (size_t)layout.turns) % 4];
        }
        return places;
    }
    int id = 0;
    const double margin = .5 * (board.square_m - board.marker_m) - board.square_m;
    for (int j = 0; j < board.rows; j++)
        for (int i = 0; i < board.columns; i++)
            if ((i + j) % 2 != (layout.white_first ? 0 : 1))
                continue;
            else
                places[id++] = square_at(i * board.square_m + margin, j * board.square_m + margin,
                                         board.marker_m);
    return places;
}

std::vector<Layout> layouts_of(const Board &board)
{
    std::vector<Layout> layouts;
    if (board.pattern == Pattern::charuco) {
        layouts.push_back({false, false, 0});
        if (board.rows % 2 == 0) layouts.push_back({true, false, 0});
        return layouts;
    }
    for (const bool from_top : {false, true})
        for (int turns = 0; turns < 4; turns++)
            layouts.push_back({false, from_top, turns});
    return layouts;
}

/* The homography that takes four points of the board to a marker's corners; lengths in units of
 * the marker. */
struct Local {
    Eigen::Matrix3d H;
    Point origin;
    double unit;

    Local(const Four &place, const Marker &marker)
        : origin(place[0]), unit(std::hypot(place[1][0] - place[0][0], place[1][1] - place[0][1]))
    {
        Eigen::Matrix<double, 8, 8> A;
        Eigen::Matrix<double, 8, 1> b;
        for (int k = 0; k < 4; k++) {
            const double x = (place[(size_t)k][0] - origin[0]) / unit,
                         y = (place[(size_t)k][1] - origin[1]) / unit;
            const double u = marker.corners[(size_t)k][0], v = marker.corners[(size_t)k][1];
            A.row(2 * k) << x, y, 1, 0, 0, 0, -u * x, -u * y;
            A.row(2 * k + 1) << 0, 0, 0, x, y, 1, -v * x, -v * y;
            b[2 * k] = u;
            b[2 * k + 1] = v;
        }
        const Eigen::Matrix<double, 8, 1> h = A.fullPivLu().solve(b);
        H << h[0], h[1], h[2], h[3], h[4], h[5], h[6], h[7], 1;
    }
    Pixel operator()(const Point &point) const
    {
        const Eigen::Vector3d p =
            H * Eigen::Vector3d((point[0] - origin[0]) / unit, (point[1] - origin[1]) / unit, 1);
        if (!(p[2] > 1e-6)) return {NAN, NAN};
        return {p[0] / p[2], p[1] / p[2]};
    }
};

double side_of(const Marker &marker)
{
    return .25 * (distance(marker.corners[0], marker.corners[1]) +
                  distance(marker.corners[1], marker.corners[2]) +
                  distance(marker.corners[2], marker.corners[3]) +
                  distance(marker.corners[3], marker.corners[0]));
}

double apart(const Four &a, const Four &b)
{
    return std::hypot(a[0][0] + a[2][0] - b[0][0] - b[2][0], a[0][1] + a[2][1] - b[0][1] - b[2][1]);
}

/* How far a marker lies from where another predicts it, in its own sides and over the way between
 * them, with which the error of a right prediction grows. */
double prediction_error(const Marker &marker, const Four &place, const Marker &by, const Four &at)
{
    const Local local(at, by);
    double worst = 0;
    for (size_t k = 0; k < 4; k++) {
        const double error = distance(local(place[k]), marker.corners[k]);
        worst = std::isfinite(error) ? std::max(worst, error) : INFINITY;
    }
    const double side = std::hypot(at[1][0] - at[0][0], at[1][1] - at[0][1]);
    return worst / side_of(marker) / (1 + .5 * apart(place, at) / side);
}

/* How far markers lie from where those around predict them: for each the middle one of the nearest
 * four, and of these the error that four in five keep. Lens distortion hardly matters from one
 * marker to the next. */
double misfit(const std::vector<Marker> &markers, const std::map<int, Four> &places)
{
    constexpr size_t around = 4;
    std::vector<double> errors;
    for (const Marker &marker : markers) {
        const Four &place = places.at(marker.id);
        std::vector<const Marker *> others;
        for (const Marker &other : markers)
            if (other.id != marker.id) others.push_back(&other);
        std::sort(others.begin(), others.end(), [&](const Marker *a, const Marker *b) {
            return apart(places.at(a->id), place) < apart(places.at(b->id), place);
        });
        others.resize(std::min(others.size(), around));
        std::vector<double> found;
        for (const Marker *other : others)
            found.push_back(prediction_error(marker, place, *other, places.at(other->id)));
        std::sort(found.begin(), found.end());
        errors.push_back(found[found.size() / 2]);
    }
    std::sort(errors.begin(), errors.end());
    return errors[errors.size() * 4 / 5];
}

/* Corners of a marker that are points of an AprilGrid; the black squares between the tags make each
 * one a crossing. */
void aprilgrid_corners(const Grey &image, const Board &board, const std::vector<Marker> &markers,
                       const std::map<int, Four> &places, View &view)
{
    constexpr double half_max_px = 5.5, half_min_px = 2, gap_share = .6;
    std::vector<double> widths;
    const double gap = board.marker_m / board.square_m;
    for (const Marker &marker : markers) {
        const Four &place = places.at(marker.id);
        double gap_px = INFINITY; /* where it is seen smallest */
        for (size_t k = 0; k < 4; k++)
            gap_px =
                std::min(gap_px, gap * distance(marker.corners[k], marker.corners[(k + 1) % 4]));
        for (size_t k = 0; k < 4; k++) {
            const double pitch = board.square_m + board.marker_m;
            const auto index =
                [&](double at) { /* of a coordinate among the points */
                                 const int whole = (int)std::lround(std::floor(at / pitch + 1e-6));
                                 return 2 * whole +
                                        (at - whole * pitch > .5 * board.square_m ? 1 : 0);
                };
            Pixel corner = marker.corners[k];
            const double half = std::clamp(gap_share * gap_px, half_min_px, half_max_px);
            if (refine_corner(image, half, corner) &&
                distance(corner, marker.corners[k]) < std::max(.5 * gap_px, 1.))
                view.corners[(size_t)(index(place[k][1]) * board.point_columns() +
                                      index(place[k][0]))] = corner;
            widths.push_back(edge_width(image, marker.corners[k], marker.corners[(k + 1) % 4],
                                        std::min(.16, .5 * gap)));
        }
    }
    view.edge_px = median(widths);
}

/* Inner corners from the markers in the two white squares beside each. */
void charuco_corners(const Grey &image, const Board &board, const std::vector<Marker> &markers,
                     const std::map<int, Four> &places, View &view)
{
    constexpr double half_max_px = 5.5, half_min_px = 2, near = 1.2;
    const std::vector<Point> points = board.points();
    const double margin = .5 * (board.square_m - board.marker_m);
    for (size_t c = 0; c < points.size(); c++) {
        Pixel sum = {0, 0};
        double side_px = 0;
        int count = 0;
        for (const Marker &marker : markers) {
            const Four &place = places.at(marker.id);
            const double away = std::hypot(.5 * (place[0][0] + place[2][0]) - points[c][0],
                                           .5 * (place[0][1] + place[2][1]) - points[c][1]);
            if (away > near * .70711 * board.square_m) continue;
            const Pixel there = Local(place, marker)(points[c]);
            sum = {sum[0] + there[0], sum[1] + there[1]};
            side_px += side_of(marker);
            count++;
        }
        if (count == 0 || !std::isfinite(sum[0])) continue;
        const Pixel predicted = {sum[0] / count, sum[1] / count};
        const double margin_px = margin / board.marker_m * side_px / count;
        Pixel corner = predicted;
        if (refine_corner(image, std::clamp(margin_px, half_min_px, half_max_px), corner) &&
            distance(corner, predicted) < std::max(1.4 * margin_px, 1.5))
            view.corners[c] = corner;
    }
    std::vector<double> widths;
    for (size_t c = 0; c + 1 < points.size(); c++)
        if ((int)c % board.point_columns() != board.point_columns() - 1 && seen(view.corners[c]) &&
            seen(view.corners[c + 1]))
            widths.push_back(edge_width(image, view.corners[c], view.corners[c + 1],
                                        .8 * margin / board.square_m));
    view.edge_px = median(widths);
}

/* Whether the points that were seen span a plane: at least 8 points in at least two columns and two
 * rows. */
bool spans(const Board &board, const View &view)
{
    constexpr int points_min = 8, lines_min = 2;
    std::vector<char> columns((size_t)board.point_columns()), rows((size_t)board.point_rows());
    int count = 0;
    for (size_t c = 0; c < view.corners.size(); c++) {
        if (!seen(view.corners[c])) continue;
        count++;
        columns[c % columns.size()] = 1;
        rows[c / columns.size()] = 1;
    }
    return count >= points_min && std::count(columns.begin(), columns.end(), 1) >= lines_min &&
           std::count(rows.begin(), rows.end(), 1) >= lines_min;
}

} // namespace

void detect_by_markers(const Grey &image, const Board &board, const std::vector<Marker> &markers,
                       View &view)
{
    constexpr double misfit_max = .25;
    std::vector<Marker> own; /* numbers that the board has, once each */
    const std::map<int, Four> usual = marker_places(board, layouts_of(board)[0]);
    for (const Marker &marker : markers) {
        const auto same = [&](const Marker &other) { return other.id == marker.id; };
        if (usual.count(marker.id) > 0 && std::none_of(own.begin(), own.end(), same))
            own.push_back(marker);
    }
    if (own.size() < 2) {
        view.left_out = "found " + std::to_string(own.size()) +
                        (own.size() == 1 ? " marker" : " markers") + " of " + board.text() +
                        ", expected 2 or more";
        return;
    }
    double best = INFINITY;
    Layout chosen = {};
    for (const Layout &layout : layouts_of(board)) {
        const double error = misfit(own, marker_places(board, layout));
        if (error >= best) continue;
        best = error;
        chosen = layout;
    }
    if (best > misfit_max) {
        view.left_out = "its markers do not lie as on " + board.text() +
                        ": other numbers of columns and rows, other sizes, or another dictionary";
        return;
    }
    view.corners.assign(board.points().size(), Pixel{NAN, NAN});
    if (board.pattern == Pattern::charuco)
        charuco_corners(image, board, own, marker_places(board, chosen), view);
    else
        aprilgrid_corners(image, board, own, marker_places(board, chosen), view);
    if (chosen.white_first)
        view.note = "the board has the layout of OpenCV before 4.6: its first square is white";
    if (chosen.from_top) view.note = "the first tag is at the top left, not at the bottom left";
    if (spans(board, view)) return;
    view.corners.clear();
    view.left_out = "too little of the board is seen: fewer than 8 points in 2 rows and columns";
}

} // namespace calibrate

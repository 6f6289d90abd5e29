#include "calibrate/verdict.h"

#include "calibrate/residuals.h"

#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <map>

namespace calibrate
{
namespace
{

/* Limits of doubt and failure. */
constexpr int VIEWS_PASS = 8, VIEWS_DOUBTFUL = 4;
constexpr double RMS_PASS_PX = .5, RMS_DOUBTFUL_PX = 1.5;
constexpr double HELD_OUT_PASS = 1.3, HELD_OUT_DOUBTFUL = 2; /* times the RMS */
constexpr double FOCAL_PASS = .003, FOCAL_DOUBTFUL = .01;    /* deviation over value */
constexpr double PROJECTION_DOUBTFUL_PX = 3;
constexpr double COVERAGE_PASS = .55, COVERAGE_DOUBTFUL = .2;
constexpr double TILT_PASS_RAD = .35, TILT_DOUBTFUL_RAD = .09;
constexpr double LEFT_OUT_PASS = .34;
constexpr double FOUND_PASS = .4; /* fraction of pictures in which the board was found */
constexpr double EDGE_PASS_PX = 5;
constexpr double SHOWN_SHARE = .5; /* of the boards, that are another one or mirrored */
constexpr double BEND_PASS = .003; /* height over the board's width */
constexpr double BEND_SIGMAS = 5;
constexpr int CELL_COLUMNS = 6, CELL_ROWS = 5;
constexpr double HALVES_PASS_PX = 1, HALVES_DOUBTFUL_PX = 4;
/* Chance exceeds them in one of 1000 sets, and in one of 100. */
constexpr double HALVES_SIGMAS = 3.0902, HALVES_FOCAL_SIGMAS = 2.5758;

/* Corners of views that are used, per cell of the image. */
std::vector<int> cells_of(const std::vector<View> &views, const Solution &solution, int columns,
                          int rows)
{
    std::vector<int> cells((size_t)(columns * rows));
    for (size_t v = 0; v < views.size(); v++) {
        if (!solution.left_out[v].empty()) continue;
        for (const Pixel &corner : views[v].corners) {
            if (!seen(corner)) continue;
            const int i = (int)((corner[0] + .5) / solution.camera.width * columns);
            const int j = (int)((corner[1] + .5) / solution.camera.height * rows);
            if (i >= 0 && i < columns && j >= 0 && j < rows) cells[(size_t)(j * columns + i)]++;
        }
    }
    return cells;
}

void judge_coverage(const std::vector<View> &views, const Solution &solution, Verdict &verdict)
{
    const std::vector<int> cells = cells_of(views, solution, CELL_COLUMNS, CELL_ROWS);
    fovea_camera camera = solution.camera;
    const bool prepared = fovea_camera_prepare(&camera, nullptr) == FOVEA_OK;
    int filled = 0, seeing = 0;  /* cells with a corner; cells whose centre the lens sees by */
    int empty[4] = {0, 0, 0, 0}; /* left, right, top, bottom */
    for (int j = 0; j < CELL_ROWS; j++) {
        for (int i = 0; i < CELL_COLUMNS; i++) {
            const bool has = cells[(size_t)(j * CELL_COLUMNS + i)] > 0;
            const double centre[2] = {(i + .5) * camera.width / CELL_COLUMNS - .5,
                                      (j + .5) * camera.height / CELL_ROWS - .5};
            double bearing[3];
            if (prepared && !has &&
                fovea_camera_unproject(&camera, centre, bearing, nullptr) != FOVEA_OK)
                continue;
            filled += has;
            seeing++;
            if (has) continue;
            empty[0] += i < CELL_COLUMNS / 2;
            empty[1] += i >= CELL_COLUMNS / 2;
            empty[2] += j < CELL_ROWS / 2;
            empty[3] += j > CELL_ROWS / 2;
        }
    }
    verdict.coverage = (double)filled / seeing;
    const Grade grade = grade_of(-verdict.coverage, -COVERAGE_PASS, -COVERAGE_DOUBTFUL);
    if (grade == Grade::pass) return;
    add_reason(
        verdict, grade,
        "corners cover %.0f %% of the image, expected %.0f %% or more: take pictures with the board "
        "at the %s and the %s",
        100 * verdict.coverage, 100 * COVERAGE_PASS, empty[0] >= empty[1] ? "left" : "right",
        empty[2] >= empty[3] ? "top" : "bottom");
}

/* The board's z axis in the camera: the third column of its rotation. */
Point normal_of(const Pose &pose)
{
    const double angle = std::sqrt(pose[0] * pose[0] + pose[1] * pose[1] + pose[2] * pose[2]);
    if (angle < 1e-12) return {0, 0, 1};
    const double x = pose[0] / angle, y = pose[1] / angle, z = pose[2] / angle;
    const double c = std::cos(angle), s = std::sin(angle);
    return {x * z * (1 - c) + y * s, y * z * (1 - c) - x * s, c + z * z * (1 - c)};
}

void judge_tilt(const Solution &solution, Verdict &verdict)
{
    for (size_t a = 0; a < solution.poses.size(); a++) {
        for (size_t b = 0; b < a; b++) {
            if (!solution.left_out[a].empty() || !solution.left_out[b].empty()) continue;
            const Point m = normal_of(solution.poses[a]), n = normal_of(solution.poses[b]);
            const double cosine = m[0] * n[0] + m[1] * n[1] + m[2] * n[2];
            verdict.tilt_rad = std::max(verdict.tilt_rad, std::acos(std::clamp(cosine, -1., 1.)));
        }
    }
    const Grade grade = grade_of(-verdict.tilt_rad, -TILT_PASS_RAD, -TILT_DOUBTFUL_RAD);
    if (grade == Grade::pass) return;
    constexpr double degree = 57.29577951308232;
    add_reason(
        verdict, grade,
        "the boards' tilts differ by %.0f degrees at most, expected %.0f or more: take pictures with "
        "the board tilted about 30 degrees to each side",
        verdict.tilt_rad * degree, TILT_PASS_RAD * degree);
}

void judge_projection(const std::vector<View> &views, const Solution &solution, Verdict &verdict)
{
    const Uncertainty &map = solution.uncertainty_fine; /* larger cells reach beyond the corners */
    const std::vector<int> cells = cells_of(views, solution, map.columns, map.rows);
    for (size_t i = 0; i < cells.size(); i++) {
        if (cells[i] == 0) continue;
        const double stdev = map.stdev_px[i];
        if (std::isfinite(stdev))
            verdict.uncertainty_seen_px = std::max(verdict.uncertainty_seen_px, stdev);
    }
    const Grade grade =
        grade_of(verdict.uncertainty_seen_px, PROJECTION_PASS_PX, PROJECTION_DOUBTFUL_PX);
    if (grade == Grade::pass) return;
    add_reason(
        verdict, grade,
        "projection is uncertain by up to %.2f px (one standard deviation) where corners were seen, "
        "expected %.1f or less: take more pictures, with the board near the border of the image",
        verdict.uncertainty_seen_px, PROJECTION_PASS_PX);
}

/* One board, one size, and not mirrored. */
void judge_boards(const std::vector<View> &views, Verdict &verdict)
{
    std::map<std::pair<int, int>, int> shown, sizes;
    int mirrored = 0, showing = 0; /* a board, whichever */
    for (const View &view : views) {
        mirrored += view.mirrored;
        showing += view.mirrored || view.shown_columns > 0 || !view.corners.empty();
        if (view.shown_columns > 0) shown[{view.shown_columns, view.shown_rows}]++;
        if (view.width > 0 && !view.corners.empty()) sizes[{view.width, view.height}]++;
    }
    for (const auto &[board, count] : shown)
        if (count >= SHOWN_SHARE * showing)
            add_reason(verdict, Grade::doubtful,
                       "%d of %d boards have %d x %d inner corners: state these in --target", count,
                       showing, board.first, board.second);
    if (mirrored > 0 && mirrored >= SHOWN_SHARE * showing)
        add_reason(
            verdict, Grade::doubtful,
            "%d of %d pictures of the board are mirrored: switch the mirror off in the camera or its "
            "driver",
            mirrored, showing);
    if (sizes.size() < 2) return;
    std::string list;
    for (const auto &[size, count] : sizes)
        list += (list.empty() ? "" : ", ") + std::to_string(count) + " of " +
                std::to_string(size.first) + " x " + std::to_string(size.second);
    add_reason(
        verdict, Grade::doubtful,
        "pictures have different sizes (%s): take all of them at the size that is used later",
        list.c_str());
}

void judge_pictures(const std::vector<View> &views, Verdict &verdict)
{
    std::vector<double> edges;
    for (const View &view : views) {
        if (view.corners.empty()) continue;
        verdict.views_with_board++;
        edges.push_back(view.edge_px);
    }
    judge_boards(views, verdict);
    if (verdict.views_with_board < FOUND_PASS * (double)views.size())
        add_reason(
            verdict, Grade::doubtful,
            "the board was found in %d of %zu pictures: check the numbers of inner corners in "
            "--target, and that the whole board is in the pictures",
            verdict.views_with_board, views.size());
    if (median(edges) > EDGE_PASS_PX)
        add_reason(
            verdict, Grade::doubtful,
            "edges of the board are %.1f px wide, expected %.0f or less: focus the lens, hold the "
            "board still, give more light",
            median(edges), EDGE_PASS_PX);
}

void judge_views(const Solution &solution, Verdict &verdict)
{
    for (const std::string &why : solution.left_out)
        verdict.views_used += why.empty();
    const Grade grade = grade_of(-verdict.views_used, -VIEWS_PASS, -VIEWS_DOUBTFUL);
    if (grade != Grade::pass)
        add_reason(verdict, grade, "%d pictures are used, expected %d or more: take more pictures",
                   verdict.views_used, VIEWS_PASS);
    const int left_out = verdict.views_with_board - verdict.views_used;
    if (left_out > LEFT_OUT_PASS * verdict.views_with_board)
        add_reason(verdict, Grade::doubtful,
                   "%d of %d pictures with a board are left out: see their reasons", left_out,
                   verdict.views_with_board);
}

/* The corner, moved towards the centre of the image by what noise may have moved it from there. */
Pixel moved_inwards(const Pixel &corner, const Solution &solution)
{
    constexpr double sigmas = 3;
    const double away[2] = {corner[0] - solution.camera.cx, corner[1] - solution.camera.cy};
    const double radius = std::hypot(away[0], away[1]);
    const double kept = std::max(0., 1 - sigmas * solution.noise_px / std::max(radius, 1.));
    return {solution.camera.cx + kept * away[0], solution.camera.cy + kept * away[1]};
}

/* The model must have a ray where corners were seen: one with too many coefficients may fold there.
 * A lens whose image ends inside the picture has corners there that noise moves beyond its end. */
void judge_rays(const std::vector<View> &views, const Solution &solution,
                const fovea_camera &camera, Verdict &verdict)
{
    int without = 0;
    for (size_t v = 0; v < views.size(); v++) {
        if (!solution.left_out[v].empty()) continue;
        for (const Pixel &corner : views[v].corners) {
            double bearing[3];
            if (!seen(corner)) continue;
            const Pixel inwards = moved_inwards(corner, solution);
            without +=
                fovea_camera_unproject(&camera, inwards.data(), bearing, nullptr) != FOVEA_OK;
        }
    }
    if (without == 0) return;
    add_reason(verdict, without > .02 * solution.corners_used ? Grade::fail : Grade::doubtful,
               "the model has no ray for %d of the corners that were seen: use a model with fewer "
               "coefficients, or take more pictures with the board near the border of the image",
               without);
}

} // namespace

void add_reason(Verdict &verdict, Grade grade, const char *format, ...)
{
    char text[400];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    verdict.reasons.push_back({grade, text});
    verdict.grade = std::max(verdict.grade, grade);
}

Grade grade_of(double value, double pass, double doubtful)
{
    return value <= pass ? Grade::pass : value <= doubtful ? Grade::doubtful : Grade::fail;
}

const char *grade_name(Grade grade)
{
    return grade == Grade::pass ? "pass" : grade == Grade::doubtful ? "doubtful" : "fail";
}

void leave_out_blurred(std::vector<View> &views)
{
    constexpr double ratio = 1.8, more_px = .5;
    std::vector<double> edges;
    for (const View &view : views)
        if (view.left_out.empty()) edges.push_back(view.edge_px);
    const double usual = median(edges);
    for (View &view : views) {
        if (!view.left_out.empty() || view.edge_px <= ratio * usual + more_px) continue;
        char text[120];
        snprintf(text, sizeof text, "blurred: its edges are %.1f px wide, the others' %.1f px",
                 view.edge_px, usual);
        view.left_out = text;
    }
}

Verdict judge_unsolved(const std::vector<View> &views, const std::string &error)
{
    Verdict verdict;
    judge_pictures(views, verdict);
    add_reason(verdict, Grade::fail, "%s", error.c_str());
    return verdict;
}

/* Two parameters more lower the sum of squares by 2 noise^2 where the board is flat. */
void judge_bend(const Board &board, const Solution &flat, const Solution &bent, Verdict &verdict)
{
    const double height_m = std::max(std::fabs(bent.bend_m[0]), std::fabs(bent.bend_m[1]));
    const double width_m = board.square_m * (board.point_columns() - 1);
    const double gain =
        std::sqrt(std::max(0., flat.rms_px * flat.rms_px - bent.rms_px * bent.rms_px) *
                  flat.corners_used) /
        bent.noise_px;
    if (gain < BEND_SIGMAS || height_m < BEND_PASS * width_m) return;
    add_reason(
        verdict, Grade::doubtful,
        "the board is bent: its middle is %.1f mm off, expected %.1f mm or less: mount it on a flat "
        "plate, or use --bend yes",
        1e3 * height_m, 1e3 * BEND_PASS * width_m);
}

void judge_halves(const Halves &halves, Verdict &verdict)
{
    const bool refocused = std::fabs(halves.focal_sigmas) > HALVES_FOCAL_SIGMAS;
    if (!refocused && !(halves.sigmas > HALVES_SIGMAS)) return;
    const Grade grade = grade_of(halves.difference_px, HALVES_PASS_PX, HALVES_DOUBTFUL_PX);
    if (!std::isfinite(halves.difference_px) || grade == Grade::pass) return;
    char focal[80] = "";
    if (refocused)
        snprintf(focal, sizeof focal, " (focal lengths differ by %.2f %%)",
                 100 * std::fabs(halves.focal_change));
    add_reason(verdict, grade,
               "every second picture and the others, solved apart, project up to %.1f px apart%s, "
               "expected %.1f or less: the lens or the board changed between pictures (focus, "
               "zoom), or the model does not fit",
               halves.difference_px, focal, HALVES_PASS_PX);
}

Verdict judge(const std::vector<View> &views, const Solution &solution, double held_out_px)
{
    Verdict verdict;
    judge_pictures(views, verdict);
    judge_views(solution, verdict);
    Grade grade = grade_of(solution.rms_px, RMS_PASS_PX, RMS_DOUBTFUL_PX);
    if (grade != Grade::pass)
        add_reason(
            verdict, grade,
            "RMS error is %.2f px, expected %.1f or less: the board is not flat, its size is wrong, "
            "or the model does not fit the lens",
            solution.rms_px, RMS_PASS_PX);
    const double ratio = held_out_px >= 0 ? held_out_px / solution.rms_px : INFINITY;
    grade = grade_of(ratio, HELD_OUT_PASS, HELD_OUT_DOUBTFUL);
    if (grade != Grade::pass && held_out_px >= 0)
        add_reason(
            verdict, grade,
            "pictures that the solve did not see have an error of %.2f px, expected %.2f or less: "
            "take more pictures, or use a model with fewer coefficients",
            held_out_px, HELD_OUT_PASS * solution.rms_px);
    if (held_out_px < 0)
        add_reason(
            verdict, Grade::doubtful,
            "no part of the pictures determines the camera without the rest: take more pictures");
    const double focal =
        std::max(solution.stdev[0] / solution.camera.fx, solution.stdev[1] / solution.camera.fy);
    grade = grade_of(focal, FOCAL_PASS, FOCAL_DOUBTFUL);
    if (grade != Grade::pass)
        add_reason(
            verdict, grade,
            "the focal length is known to %.2f %%, expected %.1f or better: take pictures with the "
            "board tilted and at different distances",
            100 * focal, 100 * FOCAL_PASS);
    judge_projection(views, solution, verdict);
    judge_coverage(views, solution, verdict);
    judge_tilt(solution, verdict);
    verdict.residual_pattern = residual_pattern(views, solution).ratio;
    fovea_camera camera = solution.camera;
    fovea_error why;
    if (fovea_camera_prepare(&camera, &why) != FOVEA_OK)
        add_reason(verdict, Grade::fail, "the model is of no use: %s", why.text);
    else
        judge_rays(views, solution, camera, verdict);
    return verdict;
}

} // namespace calibrate

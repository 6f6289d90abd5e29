#include "calibrate/compare.h"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>

namespace calibrate
{
namespace
{

/* Limits of doubt and failure: of projection where it is known to differ by so many deviations. */
constexpr double DIFFERENCE_PASS_PX = 1, DIFFERENCE_DOUBTFUL_PX = 3, SIGMAS = 3;
constexpr double RMS_RATIO_PASS = 1.5, RMS_PASS_PX = .5;

/* Places of the image with corners, by the cells of the map of uncertainty. */
struct Place {
    Eigen::Vector3d bearing; /* by the file's camera */
    Eigen::Vector2d pixel;
    double stdev_px;
};

std::vector<Place> places_of(const fovea_camera &camera, const std::vector<View> &views,
                             const Solution &fresh)
{
    const Uncertainty &map = fresh.uncertainty;
    std::vector<int> counts((size_t)(map.columns * map.rows));
    for (size_t v = 0; v < views.size(); v++) {
        if (!fresh.left_out[v].empty()) continue;
        for (const Pixel &corner : views[v].corners) {
            if (!seen(corner)) continue;
            const int i = (int)((corner[0] + .5) / camera.width * map.columns);
            const int j = (int)((corner[1] + .5) / camera.height * map.rows);
            if (i >= 0 && i < map.columns && j >= 0 && j < map.rows)
                counts[(size_t)(j * map.columns + i)]++;
        }
    }
    std::vector<Place> places;
    for (int cell = 0; cell < (int)counts.size(); cell++) {
        const double pixel[2] = {(cell % map.columns + .5) * camera.width / map.columns - .5,
                                 (cell / map.columns + .5) * camera.height / map.rows - .5};
        double bearing[3];
        if (counts[(size_t)cell] == 0 || !std::isfinite(map.stdev_px[(size_t)cell])) continue;
        if (fovea_camera_unproject(&camera, pixel, bearing, nullptr) != FOVEA_OK) continue;
        places.push_back({{bearing[0], bearing[1], bearing[2]},
                          {pixel[0], pixel[1]},
                          map.stdev_px[(size_t)cell]});
    }
    return places;
}

/* Where the camera sees a place's direction, less where the file's camera does; NaN: nowhere. */
Eigen::Vector2d difference_at(const fovea_camera &camera, const Eigen::Matrix3d &turn,
                              const Place &place)
{
    const Eigen::Vector3d turned = turn * place.bearing;
    double pixel[2];
    if (fovea_camera_project(&camera, turned.data(), pixel, nullptr) != FOVEA_OK) return {NAN, NAN};
    return Eigen::Vector2d(pixel[0], pixel[1]) - place.pixel;
}

Eigen::Matrix3d rotation_of(const Eigen::Vector3d &axis)
{
    const double angle = axis.norm();
    if (angle < 1e-15) return Eigen::Matrix3d::Identity();
    return Eigen::AngleAxisd(angle, axis / angle).toRotationMatrix();
}

/* The rotation with the least squared difference over all places. */
Eigen::Matrix3d best_turn(const fovea_camera &camera, const std::vector<Place> &places)
{
    constexpr double small = 1e-6;
    constexpr int rounds = 8;
    Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
    for (int round = 0; round < rounds; round++) {
        Eigen::Matrix3d normal = 1e-9 * Eigen::Matrix3d::Identity();
        Eigen::Vector3d right = Eigen::Vector3d::Zero();
        for (const Place &place : places) {
            const Eigen::Vector2d here = difference_at(camera, turn, place);
            Eigen::Matrix<double, 2, 3> slope;
            for (int axis = 0; axis < 3; axis++)
                slope.col(axis) =
                    (difference_at(camera, rotation_of(small * Eigen::Vector3d::Unit(axis)) * turn,
                                   place) -
                     here) /
                    small;
            if (!here.allFinite() || !slope.allFinite()) continue;
            normal += slope.transpose() * slope;
            right += slope.transpose() * here;
        }
        turn = rotation_of(-normal.ldlt().solve(right)) * turn;
    }
    return turn;
}

/* The difference that counts most: of those that are known, the largest, else the largest. */
void find_difference(const fovea_camera &camera, const std::vector<View> &views,
                     Comparison &comparison)
{
    fovea_camera fresh = comparison.fresh.camera;
    if (fovea_camera_prepare(&fresh, nullptr) != FOVEA_OK) return;
    const std::vector<Place> places = places_of(camera, views, comparison.fresh);
    const Eigen::Matrix3d turn = best_turn(fresh, places);
    bool known = false;
    for (const Place &place : places) {
        comparison.uncertainty_px = std::max(comparison.uncertainty_px, place.stdev_px);
        const double difference = difference_at(fresh, turn, place).norm();
        const double size = std::isfinite(difference) ? difference : INFINITY;
        const bool is_known = size > SIGMAS * place.stdev_px;
        if (known > is_known || (known == is_known && size <= comparison.difference_px)) continue;
        known = is_known;
        comparison.difference_px = size;
        comparison.difference_stdev_px = place.stdev_px;
    }
}

void add(Verdict &verdict, Grade grade, const std::string &text)
{
    verdict.reasons.push_back({grade, text});
    verdict.grade = std::max(verdict.grade, grade);
}

std::string rounded(double value, int digits)
{
    char text[40];
    snprintf(text, sizeof text, "%.*f", digits, value);
    return text;
}

/* Whether the file explains the pictures worse than noise allows in 999 of 1000 cases: the rise of
 * the squared errors is chi-square, by as many degrees of freedom as the model has parameters
 * (bound by Wilson and Hilferty, 1931). All corners together find what no place of the image shows
 * alone. */
bool explains_worse(const Comparison &comparison)
{
    constexpr double quantile = 3.0902; /* of the normal distribution, for .999 */
    const Solution &fresh = comparison.fresh;
    double degrees = 0;
    for (const double deviation : fresh.stdev)
        degrees += deviation > 0;
    const double root = 1 - 2 / (9 * degrees) + quantile * std::sqrt(2 / (9 * degrees));
    const double rise =
        fresh.corners_used * (comparison.rms_px * comparison.rms_px - fresh.rms_px * fresh.rms_px);
    return rise > fresh.noise_px * fresh.noise_px * degrees * root * root * root;
}

void judge_difference(Comparison &comparison)
{
    const double size = comparison.difference_px, stdev = comparison.difference_stdev_px;
    Verdict &verdict = comparison.verdict;
    const bool is_known = size > SIGMAS * stdev || explains_worse(comparison);
    if (is_known && size > DIFFERENCE_PASS_PX) {
        add(verdict, size > DIFFERENCE_DOUBTFUL_PX ? Grade::fail : Grade::doubtful,
            "the file projects up to " + rounded(size, 2) + " px (+- " + rounded(stdev, 2) +
                ") from where the new pictures say, expected " + rounded(DIFFERENCE_PASS_PX, 1) +
                " or less; their focal length differs by " +
                rounded(100 * comparison.focal_change, 2) + " %: calibrate again");
        return;
    }
    if (comparison.uncertainty_px > PROJECTION_PASS_PX)
        add(verdict, Grade::doubtful,
            "the new pictures know the projection to " + rounded(comparison.uncertainty_px, 2) +
                " px where corners were seen, expected " + rounded(PROJECTION_PASS_PX, 1) +
                " or better: take more pictures, with the board tilted and near the border");
}

void judge_rms(Comparison &comparison)
{
    const double fresh = comparison.fresh.rms_px;
    if (comparison.rms_px <= RMS_PASS_PX || comparison.rms_px <= RMS_RATIO_PASS * fresh) return;
    add(comparison.verdict, Grade::doubtful,
        "corners are " + rounded(comparison.rms_px, 2) +
            " px RMS from where the file projects them, and " + rounded(fresh, 2) +
            " px from where a new camera does: calibrate again");
}

} // namespace

Model model_of(const fovea_camera &camera)
{
    if (camera.lens == FOVEA_LENS_EQUIDISTANT) return Model::equidistant;
    const bool rational = camera.k[5] != 0 || camera.k[6] != 0 || camera.k[7] != 0;
    return rational ? Model::rational : Model::radtan;
}

Comparison compare(const fovea_camera &camera, const Board &board, const std::vector<View> &views)
{
    Comparison comparison;
    SolveOptions options;
    options.model = model_of(camera);
    comparison.solved = solve(board, views, camera.width, camera.height, options, comparison.fresh,
                              comparison.why_not);
    if (!comparison.solved) {
        comparison.verdict.grade = Grade::fail;
        comparison.verdict.reasons.push_back(
            {Grade::fail, "the new pictures say nothing of the file: " + comparison.why_not});
        return comparison;
    }
    const Solution &fresh = comparison.fresh;
    for (size_t v = 0; v < views.size(); v++) {
        comparison.verdict.views_used += fresh.left_out[v].empty();
        comparison.verdict.views_with_board += !views[v].corners.empty();
    }
    comparison.focal_change = fresh.camera.fx / camera.fx - 1;
    comparison.rms_px = held_camera_rms_px(board, views, fresh, camera);
    find_difference(camera, views, comparison);
    judge_difference(comparison);
    judge_rms(comparison);
    return comparison;
}

} // namespace calibrate

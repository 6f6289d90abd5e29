#include "calibrate/compare.h"

#include "calibrate/report.h"

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

/* The deviation of the normal distribution that chance exceeds as rarely as this one of chi-square
 * (E. B. Wilson and M. M. Hilferty, 1931). */
double chi_square_sigmas(double value, double degrees)
{
    const double variance = 2 / (9 * degrees);
    return (std::cbrt(value / degrees) - (1 - variance)) / std::sqrt(variance);
}

/* Whether the file explains the pictures worse than noise allows in 999 of 1000 cases: the rise of
 * the squared errors is chi-square, by as many degrees of freedom as the model has parameters. All
 * corners together find what no place of the image shows alone. */
bool explains_worse(const Comparison &comparison)
{
    constexpr double quantile = 3.0902; /* of the normal distribution, for .999 */
    const Solution &fresh = comparison.fresh;
    double degrees = 0;
    for (const double deviation : fresh.stdev)
        degrees += deviation > 0;
    const double rise =
        fresh.corners_used * (comparison.rms_px * comparison.rms_px - fresh.rms_px * fresh.rms_px);
    return chi_square_sigmas(rise / (fresh.noise_px * fresh.noise_px), degrees) > quantile;
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

/* ---- halves ---------------------------------------------------------------------------------- */

constexpr size_t HALF_VIEWS_MIN = 3;

struct Half {
    std::vector<View> views;
    Solution solution;
    fovea_camera camera; /* prepared */
};

/* False: it determines no camera. */
bool solve_half(const Board &board, const SolveOptions &options, Half &half)
{
    const int width = half.camera.width, height = half.camera.height;
    std::string why;
    if (half.views.size() < HALF_VIEWS_MIN ||
        !solve(board, half.views, width, height, options, half.solution, why))
        return false;
    half.camera = half.solution.camera;
    return fovea_camera_prepare(&half.camera, nullptr) == FOVEA_OK;
}

/* Worst where both saw corners. */
double difference_of(const Half &one, const Half &other)
{
    std::vector<Place> both;
    for (const Place &place : places_of(one.camera, one.views, one.solution))
        for (const Place &same : places_of(one.camera, other.views, other.solution))
            if (same.pixel == place.pixel) both.push_back(place);
    if (both.empty()) return NAN;
    const Eigen::Matrix3d turn = best_turn(other.camera, both);
    double worst = 0;
    for (const Place &place : both) {
        const double difference = difference_at(other.camera, turn, place).norm();
        worst = std::max(worst, std::isfinite(difference) ? difference : INFINITY);
    }
    return worst;
}

/* Both halves' parameters are known by their covariances. Chi-square of the difference; and a focal
 * length that changed alone, fitted to it. */
void test_parameters(const Half &one, const Half &other, bool equal_focal, Halves &halves)
{
    std::vector<int> which;
    for (int i = 0; i < PARAMETERS_MAX; i++)
        if (one.solution.stdev[(size_t)i] > 0 && !(i == 1 && equal_focal)) which.push_back(i);
    const auto count = (Eigen::Index)which.size();
    Eigen::MatrixXd covariance(count, count);
    Eigen::VectorXd difference(count), focal(count);
    for (Eigen::Index i = 0; i < count; i++) {
        const int of = which[(size_t)i];
        const double from = parameter(one.camera, of);
        difference[i] = parameter(other.camera, of) - from;
        focal[i] = of < 2 ? from : 0;
        for (Eigen::Index j = 0; j < count; j++) {
            const auto at = (size_t)(of * PARAMETERS_MAX + which[(size_t)j]);
            covariance(i, j) = one.solution.covariance[at] + other.solution.covariance[at];
        }
    }
    /* Their sizes are from 1e-9 to 1e3. */
    const Eigen::VectorXd scale = covariance.diagonal().cwiseSqrt().cwiseInverse();
    const Eigen::LDLT<Eigen::MatrixXd> factor(scale.asDiagonal() * covariance * scale.asDiagonal());
    difference = scale.cwiseProduct(difference);
    focal = scale.cwiseProduct(focal);
    const Eigen::VectorXd weighed = factor.solve(focal);
    const double chi_square = difference.dot(factor.solve(difference)),
                 information = weighed.dot(focal);
    if (!(chi_square > 0) || !(information > 0)) return;
    halves.sigmas = chi_square_sigmas(chi_square, (double)count);
    halves.focal_change = weighed.dot(difference) / information;
    halves.focal_sigmas = halves.focal_change * std::sqrt(information);
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

Halves compare_halves(const Board &board, const std::vector<View> &views, const Solution &whole,
                      SolveOptions options)
{
    std::vector<View> used = views;
    for (const LeftOut &corner : whole.corners_left_out)
        used[(size_t)corner.view].corners[(size_t)corner.corner] = {NAN, NAN};
    Half parts[2];
    size_t count = 0;
    for (size_t v = 0; v < views.size(); v++)
        if (whole.left_out[v].empty()) parts[count++ % 2].views.push_back(used[v]);
    options.model = whole.model;
    options.reject = false;
    Halves halves;
    for (Half &half : parts) {
        half.camera = whole.camera;
        if (!solve_half(board, options, half)) return halves;
    }
    halves.difference_px = difference_of(parts[0], parts[1]);
    test_parameters(parts[0], parts[1], options.equal_focal, halves);
    return halves;
}

} // namespace calibrate

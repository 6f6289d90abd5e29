/* The uncertainty of projection against repeats: the same boards before the same camera, with other
 * noise each time. (That of the radial-tangential model is mrcal's: test_mrcal.) FOVEA_LONG: the
 * number of repeats (default and least 20; the campaign: 100). */
#include "calibrate/rigid.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "common/cmocka_cpp.h"
#include "common/simulated_boards.h"

using namespace calibrate;
using namespace simulated;

namespace
{

constexpr int CELLS = 10;

int repeats()
{
    constexpr int least = 20;
    const char *given = std::getenv("FOVEA_LONG");
    return given != nullptr ? std::max(least, std::atoi(given)) : least;
}

bool is_campaign()
{
    return repeats() >= 100;
}

/* A true camera with the boards before it. */
struct Scene {
    fovea_camera camera;
    std::vector<View> exact;
    std::vector<Rigid> boards; /* T_cam_board */
};

Scene scene_of(Model model, Random &random)
{
    Scene scene;
    scene.camera = true_camera(model, random);
    (void)see_boards(scene.camera, random, is_campaign() ? VIEWS : VIEWS / 2, &scene.exact);
    for (const View &view : scene.exact) {
        Pose pose;
        double rms_px;
        assert_true(pose_view(board, scene.camera, view, pose, rms_px) && rms_px < 1e-3);
        scene.boards.push_back(rigid_of(pose));
    }
    return scene;
}

/* Cells of the map in which corners are. */
std::vector<int> seen_cells(const Scene &scene)
{
    std::vector<int> cells;
    std::array<bool, CELLS *CELLS> seen_at = {};
    for (const View &view : scene.exact)
        for (const Pixel &corner : view.corners)
            seen_at[(size_t)((int)((corner[1] + .5) * CELLS / HEIGHT) * CELLS +
                             (int)((corner[0] + .5) * CELLS / WIDTH))] = true;
    for (int cell = 0; cell < CELLS * CELLS; cell++)
        if (seen_at[(size_t)cell]) cells.push_back(cell);
    return cells;
}

/* Where the solution sees what the true camera sees in the middle of a cell: a direction of the
 * scene, which the boards define by the mean of their rotations. False: nowhere. */
bool seen_by(const Scene &scene, const Solution &solution, int cell, Eigen::Vector2d &error)
{
    const int row = cell / CELLS;
    const double pixel[2] = {(cell % CELLS + .5) * WIDTH / CELLS - .5,
                             (row + .5) * HEIGHT / CELLS - .5};
    double bearing[3], seen_at[2];
    if (fovea_camera_unproject(&scene.camera, pixel, bearing, nullptr) != FOVEA_OK) return false;
    Eigen::Vector3d moved = Eigen::Vector3d::Zero();
    for (size_t v = 0; v < scene.boards.size(); v++)
        moved += rigid_of(solution.poses[v]).R *
                 (scene.boards[v].R.transpose() * Eigen::Vector3d(bearing));
    fovea_camera camera = solution.camera;
    if (fovea_camera_prepare(&camera, nullptr) != FOVEA_OK ||
        fovea_camera_project(&camera, moved.data(), seen_at, nullptr) != FOVEA_OK)
        return false;
    error = {seen_at[0] - pixel[0], seen_at[1] - pixel[1]};
    return true;
}

/* Errors of one cell over all repeats, and what the repeats state. */
struct Errors {
    std::vector<Eigen::Vector2d> all;
    double stated_squares = 0;

    /* Variance in the worst direction over the stated one. The direction is that of every second
     * repeat, and the variance that of the others: the largest of the same would be too large. */
    double ratio() const
    {
        double squares = 0;
        for (size_t part = 0; part < 2; part++) {
            const Eigen::Matrix2d one = spread(part), other = spread(1 - part);
            const Eigen::Vector2d worst =
                Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(one).eigenvectors().col(1);
            squares += .5 * worst.dot(other * worst);
        }
        return squares / (stated_squares / (double)all.size());
    }

  private:
    Eigen::Matrix2d spread(size_t part) const
    {
        Eigen::Vector2d sum = Eigen::Vector2d::Zero();
        Eigen::Matrix2d squares = Eigen::Matrix2d::Zero();
        double count = 0;
        for (size_t i = part; i < all.size(); i += 2, count++) {
            sum += all[i];
            squares += all[i] * all[i].transpose();
        }
        return (squares - sum * sum.transpose() / count) / (count - 1);
    }
};

/* Mean ratio of the variances of a camera's cells. */
double variance_ratio(Model model, unsigned seed)
{
    Random random = {std::mt19937_64(seed)};
    const Scene scene = scene_of(model, random);
    const std::vector<int> cells = seen_cells(scene);
    std::vector<Errors> errors(cells.size());
    for (int repeat = 0; repeat < repeats(); repeat++) {
        std::vector<View> views = scene.exact;
        for (View &view : views) {
            view.edge_px = 2.2;
            for (Pixel &corner : view.corners)
                corner = with_noise(corner.data(), random);
        }
        SolveOptions options;
        options.model = model;
        Solution solution;
        std::string why;
        if (!solve(board, views, WIDTH, HEIGHT, options, solution, why))
            fail_msg("%s", why.c_str());
        for (size_t i = 0; i < cells.size(); i++) {
            const double stated = solution.uncertainty.stdev_px[(size_t)cells[i]];
            Eigen::Vector2d error;
            if (!seen_by(scene, solution, cells[i], error) || !std::isfinite(stated)) continue;
            errors[i].all.push_back(error);
            errors[i].stated_squares += stated * stated;
        }
    }
    double sum = 0, count = 0;
    for (const Errors &of_cell : errors) {
        if ((int)of_cell.all.size() < .9 * repeats()) continue;
        sum += of_cell.ratio();
        count++;
    }
    assert_true(count > .8 * (double)cells.size());
    return sum / count;
}

/* The bar of a hundred repeats; of few, what chance leaves of it. */
void projection_is_as_uncertain_as_stated(Model model)
{
    const unsigned cameras = is_campaign() ? 3 : 1;
    double mean = 0;
    for (unsigned seed = 1; seed <= cameras; seed++) {
        const double ratio = variance_ratio(model, seed);
        printf("%s, camera %u: %.3f of the stated deviation\n", model_name(model), seed,
               std::sqrt(ratio));
        mean += ratio / cameras;
    }
    const double ratio = std::sqrt(mean);
    printf("%s: %.3f of the stated deviation\n", model_name(model), ratio);
    assert_true(std::fabs(ratio - 1) < (is_campaign() ? .1 : .25));
}

void fisheye_projection_is_as_uncertain_as_stated(void **)
{
    projection_is_as_uncertain_as_stated(Model::equidistant);
}

void rational_projection_is_as_uncertain_as_stated(void **)
{
    projection_is_as_uncertain_as_stated(Model::rational);
}

} // namespace

int main()
{
    const CMUnitTest tests[] = {
        cmocka_unit_test(fisheye_projection_is_as_uncertain_as_stated),
        cmocka_unit_test(rational_projection_is_as_uncertain_as_stated),
    };
    return cmocka_run_group_tests(tests, nullptr, nullptr);
}

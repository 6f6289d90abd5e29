/* Boards seen by random true cameras: what is found is as near to the truth as the stated standard
 * deviations say. FOVEA_LONG: the number of cameras of each model (default 4; the campaign: 100).
 */
#include "calibrate/verdict.h"

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

/* How far the solution sees a corner from where the true camera does; infinite where it has no ray.
 */
double worst_at_corners_px(const Solution &solution, const std::vector<View> &exact)
{
    double worst = 0;
    const std::vector<Point> points = board.points();
    for (size_t v = 0; v < exact.size(); v++) {
        const Pose &pose = solution.poses[v];
        double axis[3] = {pose[0], pose[1], pose[2]};
        const double angle = std::hypot(pose[0], pose[1], pose[2]);
        normalise(axis);
        for (size_t c = 0; c < points.size(); c++) { /* Rodrigues */
            const double *p = points[c].data();
            double turned[3], seen[3], pixel[2];
            cross(axis, p, turned);
            const double along = axis[0] * p[0] + axis[1] * p[1] + axis[2] * p[2];
            for (size_t i = 0; i < 3; i++)
                seen[i] = std::cos(angle) * p[i] + std::sin(angle) * turned[i] +
                          (1 - std::cos(angle)) * along * axis[i] + pose[3 + i];
            if (fovea_camera_project(&solution.camera, seen, pixel, nullptr) != FOVEA_OK)
                return INFINITY;
            worst = std::max(worst, std::hypot(pixel[0] - exact[v].corners[c][0],
                                               pixel[1] - exact[v].corners[c][1]));
        }
    }
    return worst;
}

int cameras()
{
    const char *given = std::getenv("FOVEA_LONG");
    return given != nullptr && std::atoi(given) > 0 ? std::atoi(given) : 4;
}

/* Errors over standard deviations, of all parameters of all cameras. */
struct Ratios {
    int count = 0, beyond_three = 0;
    double squares = 0;
    void add(double ratio)
    {
        count++;
        beyond_three += std::fabs(ratio) > 3;
        squares += ratio * ratio;
    }
    /* The bars of a hundred cameras; of few, what chance leaves of them. */
    void judge(const char *what) const
    {
        const double size = std::sqrt(squares / count), spread = cameras() >= 100 ? .15 : .45;
        printf("%s: %d parameters, %d beyond three standard deviations, rms %.3f\n", what, count,
               beyond_three, size);
        assert_true(size > 1 - spread && size < 1 + spread);
        assert_true(beyond_three <= std::max(1., .01 * count));
    }
};

Solution solve_simulated(Model model, unsigned seed, fovea_camera &truth, std::vector<View> &views,
                         std::vector<View> *exact)
{
    Random random = {std::mt19937_64(seed)};
    truth = true_camera(model, random);
    views = see_boards(truth, random, VIEWS, exact);
    SolveOptions options;
    options.model = model;
    Solution solution;
    std::string error;
    if (!solve(board, views, WIDTH, HEIGHT, options, solution, error))
        fail_msg("%s, camera %u: %s", model_name(model), seed, error.c_str());
    return solution;
}

void parameters_are_as_near_as_stated(Model model)
{
    Ratios ratios;
    double worst = 0;
    for (int seed = 1; seed <= cameras(); seed++) {
        fovea_camera truth;
        std::vector<View> views, exact;
        Solution solution = solve_simulated(model, (unsigned)seed, truth, views, &exact);
        assert_int_equal(fovea_camera_prepare(&solution.camera, nullptr), FOVEA_OK);
        worst = std::max(worst, worst_at_corners_px(solution, exact));
        const double first[4] = {solution.camera.fx - truth.fx, solution.camera.fy - truth.fy,
                                 solution.camera.cx - truth.cx, solution.camera.cy - truth.cy};
        for (int i = 0; i < 4 + coefficient_count(model); i++) {
            const double error = i < 4 ? first[i] : solution.camera.k[i - 4] - truth.k[i - 4];
            assert_true(solution.stdev[(size_t)i] > 0);
            ratios.add(error / solution.stdev[(size_t)i]);
        }
        assert_true(solution.noise_px > .93 * NOISE_PX && solution.noise_px < 1.07 * NOISE_PX);
    }
    printf("%s: at most %.3f px off at the corners\n", model_name(model), worst);
    assert_true(worst < .5);
    ratios.judge(model_name(model));
}

void radial_tangential_cameras_are_found_as_stated(void **)
{
    parameters_are_as_near_as_stated(Model::radtan);
}

void fisheye_cameras_are_found_as_stated(void **)
{
    parameters_are_as_near_as_stated(Model::equidistant);
}

/* Coefficients of the rational model replace each other, so its projection is judged. A model that
 * folds inside the image is rare, and never passes. */
void rational_cameras_project_within_half_a_pixel(void **)
{
    int folded = 0;
    for (int seed = 1; seed <= cameras(); seed++) {
        fovea_camera truth;
        std::vector<View> views, exact;
        Solution solution = solve_simulated(Model::rational, (unsigned)seed, truth, views, &exact);
        assert_int_equal(fovea_camera_prepare(&solution.camera, nullptr), FOVEA_OK);
        const double worst = worst_at_corners_px(solution, exact);
        folded += std::isinf(worst);
        if (std::isinf(worst))
            assert_int_not_equal(judge(views, solution, solution.rms_px).grade, Grade::pass);
        else
            assert_true(worst < .5);
        assert_true(solution.noise_px > .93 * NOISE_PX && solution.noise_px < 1.07 * NOISE_PX);
    }
    printf("rational: %d of %d models fold where corners were seen\n", folded, cameras());
    assert_true(folded <= .05 * cameras());
}

} // namespace

int main()
{
    const CMUnitTest tests[] = {
        cmocka_unit_test(radial_tangential_cameras_are_found_as_stated),
        cmocka_unit_test(fisheye_cameras_are_found_as_stated),
        cmocka_unit_test(rational_cameras_project_within_half_a_pixel),
    };
    return cmocka_run_group_tests(tests, nullptr, nullptr);
}

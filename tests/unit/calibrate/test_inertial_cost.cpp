/* The spline of a motion, and the derivatives of residuals that depend on it. */
#include "calibrate/inertial_cost.h"

#include <cmath>

#include "common/cmocka_cpp.h"
#include "common/simulated_boards.h"

using namespace calibrate;
using namespace simulated;

namespace
{

/* Those written out against differences, for every block of a cost. */
void expect_derivatives(const ceres::CostFunction &cost, std::vector<std::vector<double>> blocks)
{
    const auto rows = (size_t)cost.num_residuals();
    std::vector<double *> at;
    std::vector<std::vector<double>> jacobians;
    std::vector<double *> to;
    for (std::vector<double> &block : blocks) {
        at.push_back(block.data());
        jacobians.emplace_back(rows * block.size());
    }
    for (std::vector<double> &jacobian : jacobians)
        to.push_back(jacobian.data());
    std::vector<double> residuals(rows), above(rows), below(rows);
    assert_true(cost.Evaluate(at.data(), residuals.data(), to.data()));
    for (size_t b = 0; b < blocks.size(); b++)
        for (size_t i = 0; i < blocks[b].size(); i++) {
            constexpr double step = 1e-6;
            const double before = blocks[b][i];
            blocks[b][i] = before + step;
            assert_true(cost.Evaluate(at.data(), above.data(), nullptr));
            blocks[b][i] = before - step;
            assert_true(cost.Evaluate(at.data(), below.data(), nullptr));
            blocks[b][i] = before;
            for (size_t r = 0; r < rows; r++) {
                const double difference = (above[r] - below[r]) / (2 * step),
                             written = jacobians[b][r * blocks[b].size() + i];
                if (std::fabs(difference - written) > 1e-5 * (1 + std::fabs(written)))
                    fail_msg("block %zu, number %zu, residual %zu: %g, by differences %g", b, i, r,
                             written, difference);
            }
        }
}

std::vector<double> near(Random &random, std::vector<double> values, double spread)
{
    for (double &value : values)
        value += random.between(-spread, spread);
    return values;
}

void derivatives_are_those_of_the_residuals(void **)
{
    Random random = {std::mt19937_64(41)};
    Spline spline(0, 1, .1);
    const Model models[] = {Model::radtan, Model::equidistant};
    for (const Model model : models) {
        PictureCost::Camera camera = {model, {}, rigid_of({.1, 0, .2, .1, 0, 0}), .02, HEIGHT};
        const fovea_camera lens = true_camera(model, random);
        camera.parameters = parameters_of(lens);
        const PictureCost picture(spline, camera,
                                  {{{.1, .05, 2}, {300, 200}}, {{-.2, .1, 2.2}, {100, 400}}}, .51,
                                  .4, .013, .2);
        std::vector<std::vector<double>> blocks;
        for (int j = 0; j < PictureCost::CONTROLS; j++)
            blocks.push_back(near(random, {.1, -.2, .1, 0, 0, 0}, .05));
        blocks.push_back({.1, .2, -.1, .05, .02, .01});
        blocks.push_back({.013, 1e-3});
        expect_derivatives(picture, blocks);
    }
    const ReadingsCost readings(
        spline, 4, .35, .5,
        {{.41, {.1, .2, .3}, {1, 9, 2}, {2, 3}}, {.47, {.1, -.2, .3}, {1, 9, 1}, {2, 0}}});
    std::vector<std::vector<double>> blocks;
    for (int j = 0; j < SPLINE_ORDER; j++)
        blocks.push_back(near(random, {.3, -.5, .8, .1, .2, .3}, .1));
    blocks.push_back(near(random, std::vector<double>(6), .1));
    blocks.push_back(near(random, std::vector<double>(6), .1));
    blocks.push_back({.3, 9.7, -.2});
    expect_derivatives(readings, blocks);
}

/* A polynomial of the spline's degree is met exactly, with both derivatives. */
void a_spline_meets_a_polynomial(void **)
{
    const auto value = [](double t) {
        return 1 + t * (2 - t * (1 + t * (.5 - t * (.2 + .1 * t))));
    };
    std::vector<double> times_s;
    std::vector<Eigen::Matrix<double, 6, 1>> values;
    for (double time_s = 0; time_s < 2; time_s += .01) {
        times_s.push_back(time_s);
        values.emplace_back(Eigen::Matrix<double, 6, 1>::Constant(value(time_s)));
    }
    Spline spline(0, 2, .1);
    fit_spline(times_s, values, spline);
    for (double time_s = .5; time_s < 1.5; time_s += .037) {
        const int at = spline.segment(time_s);
        const SplineWeights weights = spline_weights(spline.within(time_s, at), spline.step_s);
        constexpr double step = 1e-4;
        assert_true(std::fabs(spline.sum(at, weights.value)[3] - value(time_s)) < 1e-5);
        assert_true(std::fabs(spline.sum(at, weights.first)[3] -
                              (value(time_s + step) - value(time_s - step)) / (2 * step)) < 1e-3);
        assert_true(std::fabs(spline.sum(at, weights.second)[3] -
                              (value(time_s + step) - 2 * value(time_s) + value(time_s - step)) /
                                  (step * step)) < 2e-2);
    }
}

} // namespace

int main()
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_spline_meets_a_polynomial),
        cmocka_unit_test(derivatives_are_those_of_the_residuals),
    };
    return cmocka_run_group_tests(tests, nullptr, nullptr);
}

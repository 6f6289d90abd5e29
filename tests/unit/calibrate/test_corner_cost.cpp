/* The derivatives of corners that are written out are those that Ceres finds by itself from the
 * projection. */
#include "calibrate/corner_cost.h"

#include <ceres/rotation.h>

#include <cmath>

#include "common/cmocka_cpp.h"
#include "common/simulated_boards.h"

using namespace calibrate;
using namespace simulated;

namespace
{

constexpr int SEEDS = 200;

/* The corner of a rig in one camera: with one more pose it is a corner seen alone. */
struct Automatic {
    Model model;
    Point point;
    Pixel found;
    template <typename T>
    bool operator()(const T *camera, const T *outer, const T *inner, T *residual) const
    {
        const T at[3] = {T(point[0]), T(point[1]), T(point[2])};
        T moved[3], seen[3];
        ceres::AngleAxisRotatePoint(inner, at, moved);
        for (int i = 0; i < 3; i++)
            moved[i] += inner[3 + i];
        ceres::AngleAxisRotatePoint(outer, moved, seen);
        for (int i = 0; i < 3; i++)
            seen[i] += outer[3 + i];
        if (!project(model, camera, seen, residual)) return false;
        for (int i = 0; i < 2; i++)
            residual[i] -= found[i];
        return true;
    }
};

struct Bent {
    Corner corner;
    template <typename T>
    bool operator()(const T *camera, const T *pose, const T *bend, T *residual) const
    {
        const T at[3] = {T(corner.point[0]), T(corner.point[1]),
                         bend[0] * (1 - corner.x * corner.x) + bend[1] * (1 - corner.y * corner.y)};
        T seen[3];
        ceres::AngleAxisRotatePoint(pose, at, seen);
        for (int i = 0; i < 3; i++)
            seen[i] += pose[3 + i];
        if (!project(corner.model, camera, seen, residual)) return false;
        for (int i = 0; i < 2; i++)
            residual[i] -= corner.found[i];
        return true;
    }
};

/* Of two costs at one place: residuals and all derivatives, each against the largest of its
 * block. */
template <int BLOCKS>
void same(const ceres::CostFunction &a, const ceres::CostFunction &b,
          const double *const (&blocks)[BLOCKS])
{
    double residuals[2][2], values[2][BLOCKS][2 * PARAMETERS_MAX], *jacobians[2][BLOCKS];
    for (int which = 0; which < 2; which++)
        for (int i = 0; i < BLOCKS; i++)
            jacobians[which][i] = values[which][i];
    assert_true(a.Evaluate(blocks, residuals[0], jacobians[0]));
    assert_true(b.Evaluate(blocks, residuals[1], jacobians[1]));
    for (int i = 0; i < 2; i++)
        assert_true(std::abs(residuals[0][i] - residuals[1][i]) < 1e-9);
    for (int i = 0; i < BLOCKS; i++) {
        const int count = 2 * a.parameter_block_sizes()[(size_t)i];
        double largest = 0;
        for (int k = 0; k < count; k++)
            largest = std::max(largest, std::abs(values[1][i][k]));
        for (int k = 0; k < count; k++)
            assert_true(std::abs(values[0][i][k] - values[1][i][k]) < 1e-9 * (1 + largest));
    }
    double alone[2];
    assert_true(a.Evaluate(blocks, alone, nullptr));
    for (int i = 0; i < 2; i++)
        assert_true(std::abs(alone[i] - residuals[0][i]) < 1e-9);
}

Pose pose_near(Random &random, double turn_rad, double away_m)
{
    Pose pose;
    for (size_t i = 0; i < 3; i++) {
        pose[i] = random.between(-turn_rad, turn_rad);
        pose[3 + i] = random.between(-.1, .1);
    }
    pose[5] += away_m;
    return pose;
}

void derivatives_are_those_of_the_projection(void **)
{
    for (const Model model : {Model::radtan, Model::rational, Model::equidistant})
        for (int seed = 0; seed < SEEDS; seed++) {
            Random random{std::mt19937_64((unsigned)seed)};
            const Parameters camera = parameters_of(true_camera(model, random));
            /* the last ones: no rotation at all, and a corner on the axis of the camera */
            const bool still = seed == SEEDS - 1, on_axis = seed == SEEDS - 2;
            Pose pose = pose_near(random, still || on_axis ? 0 : 1, .6),
                 outer = pose_near(random, still || on_axis ? 0 : .3, .2);
            Point point = {random.between(-.2, .2), random.between(-.2, .2), 0};
            if (on_axis) {
                pose[3] = pose[4] = outer[3] = outer[4] = 0;
                point = {0, 0, 0};
            }
            const Pixel found = {random.between(0, WIDTH), random.between(0, HEIGHT)};
            const double bend[2] = {random.between(-.01, .01), random.between(-.01, .01)};
            const Corner corner = {model, point, random.between(-1, 1), random.between(-1, 1),
                                   found};
            const ceres::AutoDiffCostFunction<Bent, 2, PARAMETERS_MAX, 6, 2> bent(new Bent{corner});
            const double *const alone[3] = {camera.data(), pose.data(), bend};
            same(CornerCost(corner), bent, alone);
            const ceres::AutoDiffCostFunction<Automatic, 2, PARAMETERS_MAX, 6, 6> automatic(
                new Automatic{model, point, found});
            const double *const in_rig[3] = {camera.data(), outer.data(), pose.data()};
            same(RigCornerCost({model, point, found}), automatic, in_rig);
        }
}

void a_corner_behind_the_camera_has_no_residual(void **)
{
    Random random{std::mt19937_64(0)};
    const Parameters camera = parameters_of(true_camera(Model::radtan, random));
    const Pose behind = {0, 0, 0, 0, 0, -1}, unmoved = {};
    const double bend[2] = {0, 0}, *const blocks[3] = {camera.data(), behind.data(), bend};
    double residual[2], by_camera[2 * PARAMETERS_MAX],
        *jacobians[3] = {by_camera, nullptr, nullptr};
    const CornerCost cost(Corner{Model::radtan, {0, 0, 0}, 0, 0, {0, 0}});
    assert_false(cost.Evaluate(blocks, residual, nullptr));
    assert_false(cost.Evaluate(blocks, residual, jacobians));
    const double *const in_rig[3] = {camera.data(), behind.data(), unmoved.data()};
    assert_false(
        RigCornerCost({Model::radtan, {0, 0, 0}, {0, 0}}).Evaluate(in_rig, residual, jacobians));
}

} // namespace

int main()
{
    const CMUnitTest tests[] = {
        cmocka_unit_test(derivatives_are_those_of_the_projection),
        cmocka_unit_test(a_corner_behind_the_camera_has_no_residual),
    };
    return cmocka_run_group_tests(tests, nullptr, nullptr);
}

/* The window beside Ceres: from the same start to the same robust cost, on scenes with noise,
 * outliers and free scale. */
#include <ceres/ceres.h>
#include <ceres/rotation.h>

#include "common/cmocka_cpp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <vector>

#include "common/carved.h"
#include "common/window_by_hand.h"
#include "geometry/vec.h"
#include "map/window.h"

enum { LANDMARKS_MAX = 600, OBSERVATIONS_MAX = 9000, PASSES = 200 };

struct scene {
    int fixed, moved, landmarks;
    double noise_px, outliers; /* fraction of observations that are up to 40 px off */
};

static double spread(fv_random *random, double size)
{
    return size * (2 * fv_random_unit(random) - 1);
}

static void carve(void *window, fv_arena *arena)
{
    const fv_window_limits limits = {FV_WINDOW_KEYFRAMES_MAX, LANDMARKS_MAX, OBSERVATIONS_MAX,
                                     PASSES, 1e-10};
    fv_window_carve(static_cast<fv_window *>(window), &limits, NULL, false, arena);
}

static void *make_window(fv_window *window)
{
    void *memory = carved(carve, window);
    fv_window_clear(window);
    return memory;
}

/* What a pinhole of 450 px sees of a point, with noise; bearings and derivatives as a frame has
 * them. */
static bool observe(fv_random *random, const scene *scene, const double q[3], fv_keypoint *p)
{
    const double f = 450;
    double x = q[0] / q[2] + scene->noise_px / f * fv_random_normal(random),
           y = q[1] / q[2] + scene->noise_px / f * fv_random_normal(random);
    if (q[2] < 0.5 || fabs(x) > 0.9 || fabs(y) > 0.6) return false;
    if (fv_random_unit(random) < scene->outliers) x += spread(random, 40 / f);
    const double n = sqrt(x * x + y * y + 1);
    memset(p, 0, sizeof *p);
    p->bearing[0] = (float)(x / n), p->bearing[1] = (float)(y / n), p->bearing[2] = (float)(1 / n);
    p->A[0] = (float)(f * n), p->A[2] = (float)(-f * n * x);
    p->A[4] = (float)(f * n), p->A[5] = (float)(-f * n * y);
    p->weight = fv_random_unit(random) < 0.5 ? 1.0F : 0.48F;
    return true;
}

/* Cameras in a row, before a cloud; poses and points start off the truth. */
static void fill(fv_window *w, fv_random *random, const scene *scene)
{
    std::vector<fv_se3> truth;
    for (int v = 0; v < scene->fixed + scene->moved; v++) {
        const double turn[3] = {spread(random, .05), spread(random, .05), spread(random, .05)};
        double step[6];
        fv_se3 T;
        fv_so3_exp(turn, T.R);
        T.t[0] = -0.5 * v, T.t[1] = spread(random, .1), T.t[2] = spread(random, .1);
        truth.push_back(T);
        const bool moved = v >= scene->fixed;
        for (int i = 0; i < 6; i++)
            step[i] = moved ? (i < 3 ? 0.02 : 0.005) * fv_random_normal(random) : 0;
        fv_se3_move(&T, step);
        (void)window_put_pose(w, &T, moved);
    }
    for (int i = 0; i < scene->landmarks; i++) {
        const double point[3] = {spread(random, 5) + 2, spread(random, 2), 5 + spread(random, 2.5)};
        fv_keypoint seen[FV_WINDOW_POSES_MAX];
        uint32_t by[FV_WINDOW_POSES_MAX], count = 0;
        for (uint32_t v = 0; v < truth.size(); v++) {
            double q[3];
            fv_se3_apply(&truth[v], point, q);
            if (observe(random, scene, q, &seen[count])) by[count++] = v;
        }
        if (count < 3) continue;
        double start[3];
        for (int k = 0; k < 3; k++)
            start[k] = point[k] + 0.05 * fv_random_normal(random);
        fv_window_put_landmark(w, start);
        for (uint32_t k = 0; k < count; k++)
            window_put_observation(w, &seen[k], by[k]);
    }
}

struct SightError {
    const fv_window_observation *o;
    template <typename T> bool operator()(const T *pose, const T *point, T *residual) const
    {
        T q[3], along = T(0);
        ceres::AngleAxisRotatePoint(pose, point, q);
        for (int i = 0; i < 3; i++) {
            q[i] += pose[3 + i];
            along += q[i] * double(o->bearing[i]);
        }
        for (int r = 0; r < 2; r++) {
            residual[r] = T(0);
            for (int i = 0; i < 3; i++)
                residual[r] += q[i] * double(o->A[3 * r + i]);
            residual[r] *= sqrt(double(o->weight)) / along;
        }
        return true;
    }
};

/* Twice Ceres's cost: it counts half the squares. */
static double solve_with_ceres(const fv_window *w)
{
    const fv_window_state *s = w->state;
    std::vector<double> poses(6 * s->pose_count), points(3 * s->landmark_count);
    ceres::Problem problem;
    for (uint32_t v = 0; v < s->pose_count; v++) {
        double column[9];
        for (int r = 0; r < 3; r++)
            for (int c = 0; c < 3; c++)
                column[3 * c + r] = s->poses[v].T_cam_world.R[3 * r + c];
        ceres::RotationMatrixToAngleAxis(column, &poses[6 * v]);
        fv_copy3(s->poses[v].T_cam_world.t, &poses[6 * v + 3]);
        problem.AddParameterBlock(&poses[6 * v], 6);
        if (s->poses[v].column < 0) problem.SetParameterBlockConstant(&poses[6 * v]);
    }
    for (uint32_t i = 0; i < s->landmark_count; i++) {
        const fv_window_landmark *l = &w->landmarks[i];
        fv_copy3(l->point, &points[3 * i]);
        for (uint32_t k = 0; k < l->count; k++) {
            const fv_window_observation *o = &w->observations[l->first + k];
            problem.AddResidualBlock(
                new ceres::AutoDiffCostFunction<SightError, 2, 6, 3>(new SightError{o}),
                new ceres::HuberLoss(sqrt(5.991)), &poses[6 * o->pose], &points[3 * i]);
        }
    }
    ceres::Solver::Options options;
    options.max_num_iterations = 300;
    options.function_tolerance = 1e-14;
    options.gradient_tolerance = 1e-12;
    options.parameter_tolerance = 1e-14;
    options.linear_solver_type = ceres::DENSE_SCHUR;
    options.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    return 2 * summary.final_cost;
}

static void test_same_cost_as_ceres(void **)
{
    const scene scenes[] = {
        {2, 4, 150, 0.5, 0},     {2, 10, 500, 1, 0},     {3, 8, 400, 0.7, 0.02},
        {6, 6, 300, 1, 0.05},    {1, 5, 200, 0.8, 0.02}, /* scale is free */
        {8, 12, 600, 0.6, 0.01},
    };
    fv_random random;
    fv_random_seed(&random, 23);
    for (size_t n = 0; n < sizeof scenes / sizeof *scenes; n++) {
        fv_window window;
        void *memory = make_window(&window);
        fill(&window, &random, &scenes[n]);
        const double expected = solve_with_ceres(&window);
        fv_window_begin(&window, PASSES);
        while (fv_window_unit(&window)) {
        }
        const fv_window_state *s = window.state;
        print_message(
            "scene %zu: %u observations, cost %.3f, then %.9g in %u passes; Ceres %.9g, %+.1e\n", n,
            s->observation_count, s->cost_at_start, s->cost_before, s->pass, expected,
            s->cost_before / expected - 1);
        assert_true(s->cost_before < 0.5 * s->cost_at_start);
        if (!(fabs(s->cost_before - expected) <= 1e-6 * expected))
            fail_msg("scene %zu: cost %.12g, Ceres %.12g", n, s->cost_before, expected);
        free(memory);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_same_cost_as_ceres)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}

/* Bundle adjustment: derivatives against numeric ones, the optimum against truth and against outliers, slicing. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fovea/elementary.h"
#include "geometry/bundle.h"

enum { POSES = 8, LANDMARKS = 300 };
static const double FOCAL = 450;

static struct fovea_random dice;

static double normal(double sigma)
{
    return sigma * fovea_random_normal(&dice);
}

struct scene {
    struct fv_bundle_pose pose[POSES];
    double X[LANDMARKS][3];
};

/* A camera that moves sideways and turns a little in front of a cloud of points. */
static void make_scene(struct scene *scene)
{
    for (int i = 0; i < POSES; i++) {
        const double yaw = 0.03 * i, pitch = 0.02 * sin(i);
        const double cy = cos(yaw), sy = sin(yaw), cp = cos(pitch), sp = sin(pitch);
        const double R[9] = {cy, 0, sy, sp * sy, cp, -sp * cy, -cp * sy, sp, cp * cy};
        const double centre[3] = {0.25 * i, 0.05 * cos(i), 0.1 * sin(0.5 * i)};
        memcpy(scene->pose[i].R, R, sizeof R);
        for (int r = 0; r < 3; r++) {
            scene->pose[i].t[r] = -(R[3 * r] * centre[0] + R[3 * r + 1] * centre[1] + R[3 * r + 2] * centre[2]);
        }
        scene->pose[i].free = i == 0 || i == POSES - 1 ? -1 : i - 1; /* the ends hold the scale */
    }
    for (int k = 0; k < LANDMARKS; k++) {
        scene->X[k][0] = -2 + 6 * fovea_random_unit(&dice);
        scene->X[k][1] = -2 + 4 * fovea_random_unit(&dice);
        scene->X[k][2] = 3 + 8 * fovea_random_unit(&dice);
    }
}

static void see(const struct fv_bundle_pose *pose, const double X[3], double p[3])
{
    for (int r = 0; r < 3; r++) {
        p[r] = pose->R[3 * r] * X[0] + pose->R[3 * r + 1] * X[1] + pose->R[3 * r + 2] * X[2] + pose->t[r];
    }
}

static struct fv_bundle_observation observe(uint32_t pose, const double p[3], double noise_px)
{
    struct fv_bundle_observation observation = {.pose = pose};
    const double x = p[0] / p[2] + normal(noise_px) / FOCAL, y = p[1] / p[2] + normal(noise_px) / FOCAL;
    const double norm = sqrt(x * x + y * y + 1);
    double *b = observation.bearing, *A = observation.A;
    b[0] = x / norm;
    b[1] = y / norm;
    b[2] = 1 / norm;
    A[0] = A[4] = FOCAL / b[2];
    A[2] = -FOCAL * b[0] / (b[2] * b[2]);
    A[5] = -FOCAL * b[1] / (b[2] * b[2]);
    return observation;
}

static void *memory_of(struct fv_bundle *bundle)
{
    struct fv_arena arena;
    memset(bundle, 0, sizeof *bundle);
    fv_arena_count(&arena);
    fv_bundle_carve(bundle, POSES, LANDMARKS, POSES * LANDMARKS, &arena);
    const size_t bytes = arena.used;
    void *memory = aligned_alloc(64, bytes);
    fv_arena_init(&arena, memory, bytes);
    fv_bundle_carve(bundle, POSES, LANDMARKS, POSES * LANDMARKS, &arena);
    return memory;
}

/* Observations of the scene with noise and a share of gross outliers; poses and landmarks disturbed. */
static void *pose_problem(struct fv_bundle *bundle, const struct scene *scene, double noise_px, double outliers)
{
    void *memory = memory_of(bundle);
    bundle->pose_count = POSES;
    bundle->landmark_count = LANDMARKS;
    for (uint32_t i = 0; i < POSES; i++) {
        bundle->poses[i] = scene->pose[i];
        if (scene->pose[i].free < 0) continue;
        for (int r = 0; r < 3; r++) bundle->poses[i].t[r] += normal(0.03);
    }
    for (uint32_t k = 0; k < LANDMARKS; k++) {
        struct fv_bundle_landmark *landmark = &bundle->landmarks[k];
        landmark->first = bundle->observation_count;
        landmark->count = 0;
        for (uint32_t i = 0; i < POSES; i++) {
            double p[3];
            see(&scene->pose[i], scene->X[k], p);
            if ((i + k) % 3 == 0 || p[2] < 0.5) continue;
            struct fv_bundle_observation observation = observe(i, p, noise_px);
            if (fovea_random_unit(&dice) < outliers) {
                p[0] += p[2] * (0.05 + 0.1 * fovea_random_unit(&dice));
                observation = observe(i, p, noise_px);
            }
            bundle->observations[bundle->observation_count++] = observation;
            landmark->count++;
        }
        for (int r = 0; r < 3; r++) landmark->X[r] = scene->X[k][r] + normal(0.1);
    }
    return memory;
}

static uint32_t run(struct fv_bundle *bundle, uint32_t iterations)
{
    uint32_t units = 1;
    fv_bundle_start(bundle, iterations);
    while (!fv_bundle_unit(bundle)) units++;
    return units;
}

static double worst_centre_error(const struct fv_bundle *bundle, const struct scene *scene)
{
    double worst = 0;
    for (int i = 0; i < POSES; i++) {
        double sum = 0;
        for (int r = 0; r < 3; r++) {
            double a = 0, b = 0;
            for (int c = 0; c < 3; c++) {
                a -= bundle->poses[i].R[3 * c + r] * bundle->poses[i].t[c];
                b -= scene->pose[i].R[3 * c + r] * scene->pose[i].t[c];
            }
            sum += (a - b) * (a - b);
        }
        if (sqrt(sum) > worst) worst = sqrt(sum);
    }
    return worst;
}

static void derivative_is_right(void **state)
{
    (void)state;
    for (int trial = 0; trial < 200; trial++) {
        const double seen[3] = {normal(1), normal(1), 2 + fovea_random_unit(&dice)};
        const struct fv_bundle_observation observation = observe(0, seen, 0);
        double p[3], r[2], J[6];
        for (int i = 0; i < 3; i++) p[i] = seen[i] + normal(0.05);
        assert_true(fv_bundle_residual(&observation, seen, r, NULL));
        assert_true(fabs(r[0]) + fabs(r[1]) < 1e-9); /* none on the bearing */
        assert_true(fv_bundle_residual(&observation, p, r, J));
        for (int i = 0; i < 3; i++) {
            double ahead[3], behind[3], ra[2], rb[2];
            const double h = 1e-6;
            memcpy(ahead, p, sizeof p);
            memcpy(behind, p, sizeof p);
            ahead[i] += h;
            behind[i] -= h;
            fv_bundle_residual(&observation, ahead, ra, NULL);
            fv_bundle_residual(&observation, behind, rb, NULL);
            for (int row = 0; row < 2; row++) {
                const double numeric = (ra[row] - rb[row]) / (2 * h);
                assert_true(fabs(numeric - J[3 * row + i]) < 1e-4 * (1 + fabs(numeric)));
            }
        }
        const double away[3] = {-seen[0], -seen[1], -seen[2]};
        assert_false(fv_bundle_residual(&observation, away, r, J));
    }
}

static void finds_the_truth_without_noise(void **state)
{
    (void)state;
    struct scene scene;
    struct fv_bundle bundle;
    make_scene(&scene);
    void *memory = pose_problem(&bundle, &scene, 0, 0);
    run(&bundle, 30);
    assert_true(worst_centre_error(&bundle, &scene) < 1e-6);
    assert_true(bundle.cost < 1e-6);
    free(memory);
}

/* With pixel noise the cost must come to what noise explains: half of (2 residuals per observation less the unknowns). */
static void cost_is_that_of_the_noise(void **state)
{
    (void)state;
    struct scene scene;
    struct fv_bundle bundle;
    make_scene(&scene);
    void *memory = pose_problem(&bundle, &scene, 1.0, 0);
    run(&bundle, 30);
    const double freedom = 2.0 * bundle.observation_count - 3.0 * LANDMARKS - 6.0 * (POSES - 2);
    assert_true(fabs(2 * bundle.cost / freedom - 1) < 0.12);
    assert_true(worst_centre_error(&bundle, &scene) < 0.01);
    free(memory);
}

static void outliers_are_resisted_and_marked(void **state)
{
    (void)state;
    struct scene scene;
    struct fv_bundle bundle;
    make_scene(&scene);
    void *memory = pose_problem(&bundle, &scene, 0.5, 0.05);
    run(&bundle, 30);
    assert_true(worst_centre_error(&bundle, &scene) < 0.01);
    uint32_t marked = 0;
    for (uint32_t i = 0; i < bundle.observation_count; i++) marked += bundle.observations[i].chi2 > 9.21f;
    assert_in_range(marked, bundle.observation_count * 3 / 100, bundle.observation_count * 15 / 100);
    free(memory);
}

static void a_stationary_point_has_no_gradient(void **state)
{
    (void)state;
    struct scene scene;
    struct fv_bundle bundle;
    make_scene(&scene);
    void *memory = pose_problem(&bundle, &scene, 1.0, 0);
    run(&bundle, 50);
    const double best = bundle.cost;
    for (int trial = 0; trial < 60; trial++) { /* no small move of anything lowers the cost */
        double *value = trial % 2 ? &bundle.poses[1 + trial / 2 % 6].t[trial % 3] : &bundle.landmarks[trial].X[trial % 3];
        const double kept = *value;
        for (int sign = -1; sign <= 1; sign += 2) {
            *value = kept + sign * 1e-3;
            run(&bundle, 0);
            assert_true(bundle.cost >= best - 1e-3 * best);
        }
        *value = kept;
    }
    free(memory);
}

static void hopeless_input_ends(void **state)
{
    (void)state;
    struct scene scene;
    struct fv_bundle bundle;
    make_scene(&scene);
    void *memory = pose_problem(&bundle, &scene, 1.0, 0);
    for (uint32_t k = 0; k < LANDMARKS; k++) bundle.landmarks[k].X[2] = k % 3 == 0 ? -50 : k % 3 == 1 ? NAN : 1e300;
    assert_in_range(run(&bundle, 10), 1, 10000);
    free(memory);
}

int main(void)
{
    fovea_random_seed(&dice, 2024);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(derivative_is_right),
        cmocka_unit_test(finds_the_truth_without_noise),
        cmocka_unit_test(cost_is_that_of_the_noise),
        cmocka_unit_test(outliers_are_resisted_and_marked),
        cmocka_unit_test(a_stationary_point_has_no_gradient),
        cmocka_unit_test(hopeless_input_ends),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

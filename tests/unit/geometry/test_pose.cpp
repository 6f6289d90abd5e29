/* P3P, robust sampling, refinement and triangulation: synthetic truth at 0, 30 and 50 % outliers,
 * and beside OpenCV. */
#include <opencv2/calib3d.hpp>

#include "common/cmocka_cpp.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "fovea/camera.h"
#include "geometry/linear.h"
#include "geometry/pose.h"
#include "geometry/triangulate.h"
#include "geometry/vec.h"

enum { COUNT = 500 };

static double uniform(fv_random *random, double low, double high)
{
    return low + (high - low) * fv_random_unit(random);
}

static fovea_camera drone_camera(void)
{
    fovea_camera camera = {
        752,     480,     FOVEA_LENS_RADTAN, 458.654,
        457.296, 367.215, 248.375,           {-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05},
        0};
    assert_int_equal(fovea_camera_prepare(&camera, NULL), FOVEA_OK);
    return camera;
}

static void random_motion(fv_random *random, fv_se3 *T)
{
    double turn[3];
    for (double &v : turn)
        v = uniform(random, -1.5, 1.5);
    fv_so3_exp(turn, T->R);
    for (double &v : T->t)
        v = uniform(random, -3, 3);
}

static double motion_error(const fv_se3 &A, const fv_se3 &B)
{
    fv_se3 inverse, D;
    fv_se3_invert(&A, &inverse);
    fv_se3_compose(&inverse, &B, &D);
    double w[3];
    fv_so3_log(D.R, w);
    return fv_norm3(w) + fv_norm3(D.t) / 5;
}

static void make_observations(const fovea_camera &camera, fv_random *random, const fv_se3 &T,
                              double outliers, double noise, fv_observation observations[COUNT])
{
    for (int i = 0; i < COUNT; i++) {
        fv_observation &s = observations[i];
        double pixel[2] = {uniform(random, 5, 745), uniform(random, 5, 475)}, b[3], p[3];
        assert_int_equal(fovea_camera_unproject(&camera, pixel, b, NULL), FOVEA_OK);
        double depth = uniform(random, 2, 12);
        for (int k = 0; k < 3; k++)
            p[k] = depth * b[k];
        fv_se3_apply_inverse(&T, p, s.point);
        bool wrong = uniform(random, 0, 1) < outliers;
        double seen[2];
        seen[0] = wrong ? uniform(random, 5, 745) : pixel[0] + noise * fv_random_normal(random);
        seen[1] = wrong ? uniform(random, 5, 475) : pixel[1] + noise * fv_random_normal(random);
        assert_int_equal(fovea_camera_unproject(&camera, seen, s.bearing, NULL), FOVEA_OK);
        assert_int_equal(fovea_camera_project(&camera, s.bearing, pixel, s.A), FOVEA_OK);
        s.weight = 1;
        s.inlier = true;
    }
}

static void three_exact_points_give_the_truth(void **)
{
    fv_random random;
    fv_random_seed(&random, 31);
    int missed = 0;
    for (int trial = 0; trial < 5000; trial++) {
        fv_se3 T, found[FV_P3P_SOLUTIONS_MAX];
        random_motion(&random, &T);
        double bearings[3][3], points[3][3];
        for (int k = 0; k < 3; k++) {
            double b[3] = {uniform(&random, -1, 1), uniform(&random, -.7, .7), 1}, p[3],
                   depth = uniform(&random, 2, 12);
            fv_normalise3(b);
            for (int i = 0; i < 3; i++)
                p[i] = depth * b[i];
            fv_se3_apply_inverse(&T, p, points[k]);
            fv_copy3(b, bearings[k]);
        }
        int count = fv_p3p(bearings, points, found);
        double best = 1e9;
        for (int k = 0; k < count; k++)
            best = fmin(best, motion_error(found[k], T));
        missed += best > 1e-5;
    }
    printf("p3p: %d of 5000 truths missed\n", missed);
    assert_true(missed <= 25);
}

static void sampling_and_refinement_find_the_pose(void **)
{
    const fovea_camera camera = drone_camera();
    const double fractions[] = {0, 0.3, 0.5};
    for (double fraction : fractions) {
        fv_random random;
        fv_random_seed(&random, 32);
        double worst_sample = 0, worst = 0, mean_chi = 0;
        for (int trial = 0; trial < 100; trial++) {
            fv_se3 T, found;
            fv_observation observations[COUNT];
            fv_pose_fit fit;
            random_motion(&random, &T);
            make_observations(camera, &random, T, fraction, 1, observations);
            fv_sampling sampling = {3.0 / 458, 0.999, 300};
            uint32_t inliers = fv_pose_sample(observations, COUNT, &sampling, &random, &found);
            assert_true(inliers > 0.85 * (1 - fraction) * COUNT);
            worst_sample = fmax(worst_sample, motion_error(found, T));
            assert_true(fv_pose_refine(observations, NULL, COUNT, 3, 5, &found, &fit));
            worst = fmax(worst, motion_error(found, T));
            mean_chi += fit.cost / fit.inliers / 100;
        }
        printf(
            "outliers %.0f %%: worst pose error sampled %.4f, refined %.4f; chi-square per observation %.3f\n",
            100 * fraction, worst_sample, worst, mean_chi);
        assert_true(worst_sample < 0.03 && worst < 0.003);
        assert_true(mean_chi > 1.4 &&
                    mean_chi < 2.0); /* two residuals of unit variance, cut at 95 % */
    }
}

/* The information matrix is that of the pose: over many noise draws the normalised error square has
 * mean six.
 */
static void information_is_consistent(void **)
{
    const fovea_camera camera = drone_camera();
    fv_random random;
    fv_random_seed(&random, 33);
    double mean = 0;
    enum { TRIALS = 300 };
    for (int trial = 0; trial < TRIALS; trial++) {
        fv_se3 T, found, inverse, D;
        fv_observation observations[COUNT];
        fv_pose_fit fit;
        random_motion(&random, &T);
        make_observations(camera, &random, T, 0, 1, observations);
        found = T;
        assert_true(fv_pose_refine(observations, NULL, COUNT, 2, 5, &found, &fit));
        fv_se3_invert(&found, &inverse);
        fv_se3_compose(&T, &inverse, &D); /* truth = D found */
        double e[6], q = 0;
        fv_copy3(D.t, e);
        fv_so3_log(D.R, e + 3);
        for (int a = 0; a < 6; a++)
            for (int b = 0; b < 6; b++)
                q += e[a] * fit.information[6 * a + b] * e[b];
        mean += q / TRIALS;
    }
    printf("mean normalised error square %.3f (6 expected)\n", mean);
    assert_true(mean > 4.8 && mean < 7.2);
}

static double cpu_seconds(void)
{
    timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return t.tv_sec + 1e-9 * t.tv_nsec;
}

/* The bar: P3P sampling in at most 0.6 of the time of OpenCV's solvePnPRansac with P3P, 500 points.
 */
/* Least squares of `rows` numbers by six; errors of all at the solution. Parts but `without` count.
 */
static void fit_rows(const double (*rows)[6], const double *values, int count, int per_part,
                     int without, double x[6], double A[36])
{
    memset(A, 0, 36 * sizeof *A);
    memset(x, 0, 6 * sizeof *x);
    for (int n = 0; n < count; n++)
        for (int k = 0; k < 6 && n / per_part != without; k++) {
            x[k] += rows[n][k] * values[n];
            for (int i = 0; i < 6; i++)
                A[6 * k + i] += rows[n][k] * rows[n][i];
        }
    double factored[36];
    memcpy(factored, A, sizeof factored);
    assert_true(fv_ldlt_solve(factored, 6, x));
}

/* The jackknife is what the fits without each part differ by, also where a part has most of the
 * leverage on a number; and there is none where a number hangs on one part alone. */
static void parts_are_left_out(void **)
{
    enum { PARTS = 5, PER_PART = 12, ROWS = PARTS * PER_PART };
    static double rows[ROWS][6], values[ROWS];
    double x[6], expected[36] = {0}, square = 0, shares = 0;
    fv_pose_shown shown;
    fv_random random;
    fv_pose_fit fit = {};
    fv_pose_part parts[PARTS] = {};
    fv_random_seed(&random, 3);
    for (int n = 0; n < ROWS; n++) {
        for (int k = 0; k < 6; k++)
            rows[n][k] = fv_random_unit(&random) - .5;
        if (n / PER_PART != 2) rows[n][4] *= .05; /* hangs on part 2 */
        values[n] = fv_random_unit(&random) + (n / PER_PART == 2 ? 1 : 0);
    }
    fit_rows(rows, values, ROWS, PER_PART, -1, x, fit.information);
    for (int n = 0; n < ROWS; n++) {
        double error = -values[n];
        for (int k = 0; k < 6; k++)
            error += rows[n][k] * x[k];
        fv_pose_part_add(&parts[n / PER_PART], 1, error, rows[n]);
    }
    for (int p = 0; p < PARTS; p++) {
        double without[6], A[36];
        fit_rows(rows, values, ROWS, PER_PART, p, without, A);
        double share = 0;
        for (int r = 0; r < 6; r++)
            for (int c = 0; c < 6; c++) {
                const double product = (without[r] - x[r]) * (without[c] - x[c]);
                expected[6 * r + c] += product;
                share += product * fit.information[6 * r + c];
            }
        shares += share * share;
    }
    assert_true(fv_pose_jackknife(&fit, parts, PARTS, &shown));
    for (int r = 0, k = 0; r < 6; r++)
        for (int c = 0; c < 6; c++) {
            square += expected[6 * r + c] * fit.information[6 * r + c];
            if (c >= r) assert_true(fabs(shown.covariance[k++] - expected[6 * r + c]) < 1e-9);
        }
    assert_true(fabs(shown.variance - square / 6) < 1e-9 * square);
    assert_true(fabs(shown.counted - square * square / shares) < 1e-9 * PARTS);
    memset(parts, 0, sizeof parts);
    memset(&fit, 0, sizeof fit);
    for (int n = 0; n < ROWS; n++) {
        if (n / PER_PART != 2) rows[n][4] = 0;
        fv_pose_part_add(&parts[n / PER_PART], 1, .1, rows[n]);
    }
    for (const fv_pose_part &part : parts)
        for (int k = 0; k < 36; k++)
            fit.information[k] += part.information[k];
    assert_false(fv_pose_jackknife(&fit, parts, PARTS, &shown));
}

/* A part that pulls in one direction alone counts as one, and what it shows beyond independent
 * errors is spread over the others, each by 6 of 7 of its mean; what is not beyond is not. */
static void what_few_parts_show_is_spread(void **)
{
    enum { PARTS = 8 };
    const double pulled = 3, pull[6] = {0, 0, pulled, 0, 0, 0};
    fv_pose_fit fit = {};
    fv_pose_part parts[PARTS] = {};
    fv_pose_shown shown;
    for (int p = 0; p < PARTS; p++)
        for (int k = 0; k < 6; k++) {
            parts[p].information[7 * k] = k + 1;
            fit.information[7 * k] += k + 1;
        }
    memcpy(parts[5].pull, pull, sizeof pull);
    assert_true(fv_pose_jackknife(&fit, parts, PARTS, &shown));
    const double moved = pulled / (3 * (PARTS - 1)), mean = moved * moved * 3 * PARTS / 6;
    assert_true(fabs(shown.variance - mean) < 1e-12 && fabs(shown.counted - 1) < 1e-12);
    for (double variance : {mean / 4, mean}) {
        fv_pose_shown spread = shown;
        fv_pose_spread(&fit, variance, &spread);
        for (int row = 0, k = 0; row < 6; row++)
            for (int column = row; column < 6; column++, k++) {
                const double open =
                    column > row ? 0 : 6. / 7 * (mean - variance) / ((row + 1) * PARTS);
                assert_true(fabs(spread.covariance[k] - shown.covariance[k] - open) < 1e-12);
            }
    }
    parts[5].pull[2] = 0; /* nothing pulls */
    assert_true(fv_pose_jackknife(&fit, parts, PARTS, &shown));
    assert_true(shown.variance == 0 && shown.counted == 0);
    fv_pose_spread(&fit, 0, &shown);
    for (double value : shown.covariance)
        assert_true(value == 0);
}

static void faster_than_opencv(void **)
{
    cv::setNumThreads(1);
    fovea_camera camera = drone_camera();
    memset(camera.k, 0, sizeof camera.k);
    assert_int_equal(fovea_camera_prepare(&camera, NULL), FOVEA_OK);
    cv::Mat K =
        (cv::Mat_<double>(3, 3) << camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1);
    const double fractions[] = {0, 0.3};
    for (double fraction : fractions) {
        fv_random random;
        fv_random_seed(&random, 34);
        double ours = 0, theirs = 0, error_ours = 0, error_theirs = 0;
        for (int trial = 0; trial < 60; trial++) {
            fv_se3 T, found;
            fv_observation observations[COUNT];
            random_motion(&random, &T);
            make_observations(camera, &random, T, fraction, 0.5, observations);
            std::vector<cv::Point3d> points;
            std::vector<cv::Point2d> pixels;
            for (const fv_observation &s : observations) {
                points.emplace_back(s.point[0], s.point[1], s.point[2]);
                pixels.emplace_back(camera.fx * s.bearing[0] / s.bearing[2] + camera.cx,
                                    camera.fy * s.bearing[1] / s.bearing[2] + camera.cy);
            }
            fv_sampling sampling = {3.0 / 458, 0.99, 100};
            double start = cpu_seconds();
            assert_true(fv_pose_sample(observations, COUNT, &sampling, &random, &found) > 0);
            ours += cpu_seconds() - start;
            error_ours += motion_error(found, T) / 60;
            cv::Mat r, t, R, in;
            start = cpu_seconds();
            cv::solvePnPRansac(points, pixels, K, cv::noArray(), r, t, false, 100, 3.0f, 0.99, in,
                               cv::SOLVEPNP_P3P);
            theirs += cpu_seconds() - start;
            cv::Rodrigues(r, R);
            fv_se3 C;
            memcpy(C.R, R.ptr<double>(), sizeof C.R);
            memcpy(C.t, t.ptr<double>(), sizeof C.t);
            error_theirs += motion_error(C, T) / 60;
        }
        printf(
            "outliers %.0f %%: ours %.1f us, OpenCV %.1f us (ratio %.3f); mean error %.5f, OpenCV %.5f\n",
            100 * fraction, 1e6 * ours / 60, 1e6 * theirs / 60, ours / theirs, error_ours,
            error_theirs);
        if (getenv("FOVEA_TIMED") != NULL) assert_true(ours <= 0.6 * theirs);
    }
}

static void triangulation_is_exact_and_splits_errors(void **)
{
    fv_random random;
    fv_random_seed(&random, 35);
    for (int trial = 0; trial < 1000; trial++) {
        fv_se3 T;
        double turn[3] = {uniform(&random, -.2, .2), uniform(&random, -.2, .2),
                          uniform(&random, -.2, .2)};
        fv_so3_exp(turn, T.R);
        for (double &v : T.t)
            v = uniform(&random, -0.5, 0.5);
        double p[3] = {uniform(&random, -2, 2), uniform(&random, -2, 2), uniform(&random, 2, 8)},
               q[3], got[3], c;
        fv_se3_apply(&T, p, q);
        double x1[3] = {p[0], p[1], p[2]}, x2[3] = {q[0], q[1], q[2]};
        fv_normalise3(x1);
        fv_normalise3(x2);
        if (!fv_triangulate(&T, x1, x2, got, &c)) continue;
        assert_true(fabs(got[0] - p[0]) + fabs(got[1] - p[1]) + fabs(got[2] - p[2]) < 1e-6);
        double back[3] = {-x2[0], -x2[1], -x2[2]};
        assert_false(fv_triangulate(&T, x1, back, got, &c));
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(three_exact_points_give_the_truth),
        cmocka_unit_test(sampling_and_refinement_find_the_pose),
        cmocka_unit_test(information_is_consistent),
        cmocka_unit_test(parts_are_left_out),
        cmocka_unit_test(what_few_parts_show_is_spread),
        cmocka_unit_test(faster_than_opencv),
        cmocka_unit_test(triangulation_is_exact_and_splits_errors),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

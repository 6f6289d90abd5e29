/* Fundamental matrix: of seven pairs it is one of those found; and beside OpenCV's on the same
 * matches, at 0, 30 and 50 % outliers. */
#include <cmath>
#include <cstdio>
#include <vector>

#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

#include "common/cmocka_cpp.h"
#include "geometry/fundamental.h"
#include "geometry/vec.h"

namespace
{

const int matches = 300, scenes = 40;
const double focal_px = 700, centre_px[2] = {320, 240};

struct scene {
    std::vector<fv_pair> pairs, exact; /* with noise and outliers; as the cameras see them */
    std::vector<cv::Point2d> a, b;     /* in pixels */
};

double uniform(fv_random *random, double low, double high)
{
    return low + (high - low) * fv_random_unit(random);
}

void set_pair(const double a[2], const double b[2], fv_pair *pair)
{
    for (int k = 0; k < 2; k++) {
        pair->x1[k] = (a[k] - centre_px[k]) / focal_px;
        pair->x2[k] = (b[k] - centre_px[k]) / focal_px;
    }
    pair->x1[2] = pair->x2[2] = 1;
    (void)fv_normalise3(pair->x1);
    (void)fv_normalise3(pair->x2);
}

/* Points 3 to 12 away before two cameras of different focal length. */
void make_scene(scene &s, fv_random *random, double outliers, double noise_px)
{
    fv_se3 T;
    double turn[3];
    const double other_px = uniform(random, 500, 900);
    for (double &t : turn)
        t = uniform(random, -.15, .15);
    fv_so3_exp(turn, T.R);
    for (double &t : T.t)
        t = uniform(random, -.8, .8);
    s = scene();
    for (int i = 0; i < matches; i++) {
        const double depth = uniform(random, 3, 12), u = uniform(random, 0, 640),
                     v = uniform(random, 0, 480);
        const double X[3] = {(u - 320) / focal_px * depth, (v - 240) / focal_px * depth, depth};
        double Y[3], a[2] = {u, v}, b[2];
        fv_pair pair;
        fv_rotate3(T.R, X, Y);
        for (int k = 0; k < 2; k++)
            b[k] = other_px * (Y[k] + T.t[k]) / (Y[2] + T.t[2]) + centre_px[k];
        set_pair(a, b, &pair);
        s.exact.push_back(pair);
        for (int k = 0; k < 2; k++) {
            a[k] += noise_px * fv_random_normal(random);
            b[k] += noise_px * fv_random_normal(random);
        }
        if (uniform(random, 0, 1) < outliers) {
            b[0] = uniform(random, 0, 640);
            b[1] = uniform(random, 0, 480);
        }
        set_pair(a, b, &pair);
        s.pairs.push_back(pair);
        s.a.emplace_back(a[0], a[1]);
        s.b.emplace_back(b[0], b[1]);
    }
}

/* Root mean square, px, of how far the exact pairs are from F. */
double error_px(const double F[9], const scene &s)
{
    double sum = 0;
    for (const fv_pair &pair : s.exact)
        sum += fv_essential_residual2(F, &pair);
    return focal_px * std::sqrt(sum / matches);
}

/* F of pixels to bearings: K^T F K. */
void to_bearings(const cv::Mat &of, double F[9])
{
    const cv::Matx33d K(focal_px, 0, centre_px[0], 0, focal_px, centre_px[1], 0, 0, 1);
    const cv::Matx33d on = K.t() * cv::Matx33d(of.ptr<double>()) * K;
    for (int i = 0; i < 9; i++)
        F[i] = on.val[i];
}

void seven_pairs_have_the_true_matrix_among_theirs(void **)
{
    for (uint64_t seed = 0; seed < 200; seed++) {
        fv_random random;
        scene s;
        double F[FV_FUNDAMENTAL_SOLUTIONS_MAX][9], least = 1e9;
        fv_random_seed(&random, 77 + seed);
        make_scene(s, &random, 0, 0);
        const int count = fv_fundamental_seven_point(s.exact.data(), F);
        assert_true(count >= 1 && count <= FV_FUNDAMENTAL_SOLUTIONS_MAX);
        for (int k = 0; k < count; k++) {
            assert_true(std::fabs(fv_determinant33(F[k])) < 1e-10);
            least = std::fmin(least, error_px(F[k], s));
        }
        assert_true(least < 1e-4);
    }
}

void pairs_that_do_not_determine_it_give_none(void **)
{
    fv_random random;
    scene s;
    double F[FV_FUNDAMENTAL_SOLUTIONS_MAX][9], kept[9] = {0, 1, 2, 3, 4, 5, 6, 7, 8};
    const fv_sampling sampling = {1 / focal_px, 0.999, 1000};
    uint8_t inlier[matches];
    fv_random_seed(&random, 3);
    make_scene(s, &random, 0, 0);
    for (int i = 1; i < 7; i++)
        s.exact[i] = s.exact[0];
    assert_int_equal(fv_fundamental_seven_point(s.exact.data(), F), 0);
    assert_int_equal(fv_fundamental_estimate(s.pairs.data(), 8, &sampling, &random, kept, inlier),
                     0);
    make_scene(s, &random, 1, 0);
    const uint32_t few =
        fv_fundamental_estimate(s.pairs.data(), 12, &sampling, &random, kept, inlier);
    assert_true(few == 0 && kept[8] == 8);
}

void no_worse_than_opencv(void **)
{
    cv::setNumThreads(1);
    for (double outliers : {0.0, 0.3, 0.5}) {
        double ours = 0, theirs = 0, worst = 0;
        for (int k = 0; k < scenes; k++) {
            fv_random random;
            fv_random_seed(&random, 1000 + (uint64_t)k);
            scene s;
            make_scene(s, &random, outliers, .5);
            const fv_sampling sampling = {1.5 / focal_px, 0.999, 2000};
            double F[9], C[9];
            std::vector<uint8_t> inlier(matches);
            assert_true(fv_fundamental_estimate(s.pairs.data(), matches, &sampling, &random, F,
                                                inlier.data()) > 0);
            to_bearings(cv::findFundamentalMat(s.a, s.b, cv::FM_RANSAC, 1.5, .999, 2000), C);
            const double error = error_px(F, s);
            ours += error / scenes;
            theirs += error_px(C, s) / scenes;
            worst = std::fmax(worst, error);
        }
        std::printf("outliers %.0f %%: mean error %.3f px, worst %.3f; OpenCV %.3f px\n",
                    100 * outliers, ours, worst, theirs);
        assert_true(ours < 1.25 * theirs && worst < 1);
    }
}

} // namespace

int main()
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(seven_pairs_have_the_true_matrix_among_theirs),
        cmocka_unit_test(pairs_that_do_not_determine_it_give_none),
        cmocka_unit_test(no_worse_than_opencv)};
    return cmocka_run_group_tests(tests, nullptr, nullptr);
}

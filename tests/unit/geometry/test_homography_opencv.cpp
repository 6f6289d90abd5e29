/* Homography beside OpenCV's on the same matches, at 0, 30 and 50 % outliers. */
#include <cmath>
#include <cstdio>
#include <vector>

#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

#include "common/cmocka_cpp.h"
#include "geometry/homography.h"
#include "geometry/vec.h"

namespace
{

const int matches = 300, scenes = 40;
const double focal_px = 500;

struct scene {
    double H[9]; /* true, on rays */
    std::vector<fv_pair> pairs;
    std::vector<cv::Point2d> a, b; /* on the plane at distance 1 */
};

double uniform(fv_random *random, double low, double high)
{
    return low + (high - low) * fv_random_unit(random);
}

void make_scene(scene &s, fv_random *random, double outliers)
{
    fv_se3 T;
    double turn[3], n[3] = {uniform(random, -.4, .4), uniform(random, -.4, .4), 1},
                    d = uniform(random, 3, 6);
    for (double &t : turn)
        t = uniform(random, -.1, .1);
    fv_so3_exp(turn, T.R);
    for (double &t : T.t)
        t = uniform(random, -.6, .6);
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++)
            s.H[3 * r + c] = T.R[3 * r + c] + T.t[r] * n[c] / d;
    s.pairs.resize(matches);
    s.a.resize(matches);
    s.b.resize(matches);
    for (int i = 0; i < matches; i++) {
        double x1[3] = {uniform(random, -.7, .7), uniform(random, -.5, .5), 1}, x2[3];
        fv_rotate3(s.H, x1, x2);
        for (int k = 0; k < 2; k++)
            x2[k] = x2[k] / x2[2] + fv_random_normal(random) / focal_px;
        x2[2] = 1;
        if (uniform(random, 0, 1) < outliers) {
            x2[0] = uniform(random, -.7, .7);
            x2[1] = uniform(random, -.5, .5);
        }
        s.a[i] = {x1[0], x1[1]};
        s.b[i] = {x2[0], x2[1]};
        fv_copy3(x1, s.pairs[i].x1);
        fv_copy3(x2, s.pairs[i].x2);
        (void)fv_normalise3(s.pairs[i].x1);
        (void)fv_normalise3(s.pairs[i].x2);
    }
}

/* Root mean square distance, px, between where H and the truth take a grid of points. */
double grid_error(const double H[9], const double truth[9])
{
    double sum = 0;
    int count = 0;
    for (double y = -.5; y <= .5; y += .1) {
        for (double x = -.7; x <= .7; x += .1, count++) {
            const double p[3] = {x, y, 1};
            double a[3], b[3];
            fv_rotate3(H, p, a);
            fv_rotate3(truth, p, b);
            sum += std::pow(a[0] / a[2] - b[0] / b[2], 2) + std::pow(a[1] / a[2] - b[1] / b[2], 2);
        }
    }
    return focal_px * std::sqrt(sum / count);
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
            make_scene(s, &random, outliers);
            const fv_sampling sampling = {2.5 / focal_px, 0.999, 1000};
            double H[9];
            std::vector<uint8_t> inlier(matches);
            assert_true(fv_homography_estimate(s.pairs.data(), matches, &sampling, &random, H,
                                               inlier.data()) > 0);
            cv::Mat C = cv::findHomography(s.a, s.b, cv::RANSAC, 2.5 / focal_px, cv::noArray(),
                                           1000, 0.999);
            double error = grid_error(H, s.H);
            ours += error / scenes;
            theirs += grid_error(C.ptr<double>(), s.H) / scenes;
            worst = std::fmax(worst, error);
        }
        std::printf("outliers %.0f %%: mean error %.3f px, worst %.3f; OpenCV %.3f px\n",
                    100 * outliers, ours, worst, theirs);
        assert_true(ours < 1.25 * theirs && worst < 1.5);
    }
}

} // namespace

int main()
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(no_worse_than_opencv)};
    return cmocka_run_group_tests(tests, nullptr, nullptr);
}

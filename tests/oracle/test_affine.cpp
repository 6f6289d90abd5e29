/* Matching score of our ORB beside OpenCV's on the Oxford affine sets (Mikolajczyk et al., IJCV
 * 2005): image 1 against images 2 to 6, related by known homographies, the same number of features
 * asked of both.
 *
 * A match is a pair of mutually nearest descriptors; it is right when the homography brings one
 * point within 2.5 pixels of the other in both images. Score = right matches / features of image 1
 * that lie in image 2 (or the other way round, whichever are fewer). Also printed: median distance
 * of the right matches in image 2, and the fraction of 16 x 16 cells of image 1 that hold a
 * feature.
 *
 *   test_affine [COUNT]     default 1000 */
#include "oracle/images.h"

#include <cmath>
#include <cstdio>
#include <cstring>
#include <vector>

#include <opencv2/features2d.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "bench/memory.h"
#include "features/features.h"
#include "features/orb.h"

namespace
{

struct Set {
    std::vector<cv::Point2d> points;
    cv::Mat descriptors;
    double spread;
};

double spread_of(const std::vector<cv::Point2d> &points, cv::Size size)
{
    cv::Mat cells = cv::Mat::zeros(16, 16, CV_8U);
    for (const auto &p : points)
        cells.at<uint8_t>(std::min(15, static_cast<int>(p.y * 16 / size.height)),
                          std::min(15, static_cast<int>(p.x * 16 / size.width))) = 1;
    return cv::countNonZero(cells) / 256.0;
}

Set ours(const cv::Mat &image, uint32_t count)
{
    struct fv_kernels kernels;
    struct fv_features features;
    struct fv_orb orb;
    fv_kernels_init(&kernels, fv_cpu_best(fv_cpu_detect()));
    const struct fovea_features_config config = {count, 8, 20, 7, 8, FOVEA_FEATURES_FAST};
    bench::Pyramid made(image, 8);
    bench::Block block([&](struct fv_arena *arena) {
        fv_features_carve(&features, &config, &made.pyramid, arena);
        fv_orb_carve(&orb, count, &made.pyramid, arena);
    });
    fv_pyramid_build(&made.pyramid, &kernels, &made.frame);
    const uint32_t found = fv_features_find(&features, &kernels, &made.pyramid, nullptr, count);
    fv_orb_describe(&orb, &kernels, &made.pyramid, features.corners, found);
    Set set;
    for (uint32_t i = 0; i < found; i++)
        set.points.emplace_back(features.list[i].x_px, features.list[i].y_px);
    set.descriptors =
        cv::Mat(static_cast<int>(found), FV_DESCRIPTOR_BYTES, CV_8U, orb.descriptors).clone();
    set.spread = spread_of(set.points, image.size());
    return set;
}

Set theirs(const cv::Mat &image, uint32_t count)
{
    std::vector<cv::KeyPoint> points;
    Set set;
    cv::ORB::create(static_cast<int>(count))
        ->detectAndCompute(image, cv::noArray(), points, set.descriptors);
    for (const auto &p : points)
        set.points.emplace_back(p.pt.x, p.pt.y);
    set.spread = spread_of(set.points, image.size());
    return set;
}

cv::Point2d through(const cv::Matx33d &H, cv::Point2d p)
{
    const cv::Vec3d q = H * cv::Vec3d(p.x, p.y, 1);
    return {q[0] / q[2], q[1] / q[2]};
}

int inside(const std::vector<cv::Point2d> &points, const cv::Matx33d &H, cv::Size size)
{
    int count = 0;
    for (const auto &p : points) {
        const cv::Point2d q = through(H, p);
        count += q.x >= 0 && q.y >= 0 && q.x < size.width && q.y < size.height;
    }
    return count;
}

struct Score {
    double score = 0, error_px = 0;
    int right = 0;
};

Score match(const Set &a, const Set &b, const cv::Matx33d &H, cv::Size size_a, cv::Size size_b)
{
    std::vector<cv::DMatch> matches;
    cv::BFMatcher(cv::NORM_HAMMING, true).match(a.descriptors, b.descriptors, matches);
    std::vector<double> errors;
    for (const auto &m : matches) {
        const cv::Point2d p = a.points[static_cast<size_t>(m.queryIdx)],
                          q = b.points[static_cast<size_t>(m.trainIdx)];
        const double there = cv::norm(through(H, p) - q), back = cv::norm(through(H.inv(), q) - p);
        if (std::max(there, back) < 2.5) errors.push_back(there);
    }
    Score score;
    score.right = static_cast<int>(errors.size());
    score.score =
        score.right / static_cast<double>(std::max(1, std::min(inside(a.points, H, size_b),
                                                               inside(b.points, H.inv(), size_a))));
    if (!errors.empty()) {
        std::nth_element(errors.begin(), errors.begin() + score.right / 2, errors.end());
        score.error_px = errors[static_cast<size_t>(score.right / 2)];
    }
    return score;
}

bool read_homography(const std::string &path, cv::Matx33d &H)
{
    cv::FileStorage file(path, cv::FileStorage::READ);
    cv::Mat matrix;
    if (!file.isOpened()) return false;
    file.getFirstTopLevelNode() >> matrix;
    if (matrix.rows != 3 || matrix.cols != 3) return false;
    matrix.convertTo(matrix, CV_64F);
    H = matrix;
    return true;
}

} // namespace

int main(int argc, char **argv)
{
    const auto count = static_cast<uint32_t>(argc > 1 ? std::atoi(argv[1]) : 1000);
    bool good = true;
    for (const std::string name : {"graf", "bikes", "boat"}) {
        const std::string folder = data_folder() + "/affine/" + name + "/";
        const cv::Mat first = cv::imread(folder + "img1.png", cv::IMREAD_GRAYSCALE);
        if (first.empty()) {
            std::printf("SKIPPED %s: not there\n", folder.c_str());
            continue;
        }
        const Set a = ours(first, count), cv_a = theirs(first, count);
        double sum = 0, cv_sum = 0;
        std::printf("%-6s spread %.2f, OpenCV %.2f; features %zu, OpenCV %zu\n", name.c_str(),
                    a.spread, cv_a.spread, a.points.size(), cv_a.points.size());
        for (int i = 2; i <= 6; i++) {
            const cv::Mat image =
                cv::imread(folder + "img" + std::to_string(i) + ".png", cv::IMREAD_GRAYSCALE);
            cv::Matx33d H;
            if (image.empty() || !read_homography(folder + "H1to" + std::to_string(i) + "p.xml", H))
                return 1;
            const Score s = match(a, ours(image, count), H, first.size(), image.size());
            const Score cv_s = match(cv_a, theirs(image, count), H, first.size(), image.size());
            std::printf(
                "  1-%d   score %.3f, %3d right, %.2f px;   OpenCV %.3f, %3d right, %.2f px\n", i,
                s.score, s.right, s.error_px, cv_s.score, cv_s.right, cv_s.error_px);
            sum += s.score;
            cv_sum += cv_s.score;
        }
        std::printf("  mean  score %.3f;   OpenCV %.3f\n", sum / 5, cv_sum / 5);
        good = good && sum >= cv_sum && a.spread >= 0.85;
    }
    if (!good) std::printf("FAILED: a mean score below OpenCV's, or a spread below 0.85\n");
    return good ? 0 : 1;
}

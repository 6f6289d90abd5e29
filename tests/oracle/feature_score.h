/* How well features of one image are found again in another that a homography relates to it. */
#ifndef FOVEA_TESTS_ORACLE_FEATURE_SCORE_H
#define FOVEA_TESTS_ORACLE_FEATURE_SCORE_H

#include <algorithm>
#include <cmath>
#include <tuple>
#include <vector>

#include <opencv2/features2d.hpp>

struct FeatureSet {
    std::vector<cv::Point2d> points;
    cv::Mat descriptors; /* a row for each; float or bytes */
};

struct FeatureScore {
    double repeatability = 0; /* features with one of their own within 2.5 px / those in both */
    double matching = 0;      /* right mutual nearest neighbours / those in both */
};

inline cv::Point2d through(const cv::Matx33d &H, cv::Point2d p)
{
    const cv::Vec3d q = H * cv::Vec3d(p.x, p.y, 1);
    return {q[0] / q[2], q[1] / q[2]};
}

/* Pairs within 2.5 px in both images, the nearest first, each feature in one pair at most. */
inline int repeated(const std::vector<cv::Point2d> &a, const std::vector<cv::Point2d> &b,
                    const cv::Matx33d &H)
{
    std::vector<std::tuple<double, size_t, size_t>> pairs;
    const cv::Matx33d back = H.inv();
    std::vector<cv::Point2d> b_in_a;
    for (const auto &p : b)
        b_in_a.push_back(through(back, p));
    for (size_t i = 0; i < a.size(); i++) {
        const cv::Point2d q = through(H, a[i]);
        for (size_t k = 0; k < b.size(); k++) {
            const double error = std::max(cv::norm(q - b[k]), cv::norm(a[i] - b_in_a[k]));
            if (error < 2.5) pairs.emplace_back(error, i, k);
        }
    }
    std::sort(pairs.begin(), pairs.end());
    std::vector<char> used_a(a.size()), used_b(b.size());
    int count = 0;
    for (const auto &[error, i, k] : pairs) {
        if (used_a[i] || used_b[k]) continue;
        used_a[i] = used_b[k] = 1;
        count++;
    }
    return count;
}

inline int inside(const std::vector<cv::Point2d> &points, const cv::Matx33d &H, cv::Size size)
{
    int count = 0;
    for (const auto &p : points) {
        const cv::Point2d q = through(H, p);
        count += q.x >= 0 && q.y >= 0 && q.x < size.width && q.y < size.height;
    }
    return count;
}

inline FeatureScore score(const FeatureSet &a, const FeatureSet &b, int norm, const cv::Matx33d &H,
                          cv::Size size_a, cv::Size size_b)
{
    std::vector<cv::DMatch> matches;
    if (!a.points.empty() && !b.points.empty())
        cv::BFMatcher(norm, true).match(a.descriptors, b.descriptors, matches);
    int right = 0;
    for (const auto &m : matches) {
        const cv::Point2d p = a.points[static_cast<size_t>(m.queryIdx)],
                          q = b.points[static_cast<size_t>(m.trainIdx)];
        right += std::max(cv::norm(through(H, p) - q), cv::norm(through(H.inv(), q) - p)) < 2.5;
    }
    const double both =
        std::max(1, std::min(inside(a.points, H, size_b), inside(b.points, H.inv(), size_a)));
    return {repeated(a.points, b.points, H) / both, right / both};
}

#endif

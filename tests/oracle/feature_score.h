/* How well features of one image are found again in another that a homography relates to it. */
#ifndef FOVEA_TESTS_ORACLE_FEATURE_SCORE_H
#define FOVEA_TESTS_ORACLE_FEATURE_SCORE_H

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <tuple>
#include <utility>
#include <vector>

#include <opencv2/features2d.hpp>

struct FeatureSet {
    std::vector<cv::Point2d> points;
    cv::Mat descriptors;       /* a row for each; float or bytes */
    std::vector<double> sizes; /* of each; may be empty */
};

struct FeatureScore {
    double repeatability = 0; /* features with one of their own within 2.5 px / those in both */
    double matching = 0;      /* right mutual nearest neighbours / those in both */
    double alike = 0;         /* repeatability of pairs of like size; 0 without sizes */
};

inline cv::Point2d through(const cv::Matx33d &H, cv::Point2d p)
{
    const cv::Vec3d q = H * cv::Vec3d(p.x, p.y, 1);
    return {q[0] / q[2], q[1] / q[2]};
}

/* How much larger H makes what lies at p. */
inline double growth(const cv::Matx33d &H, cv::Point2d p)
{
    const cv::Point2d x(.5, 0), y(0, .5);
    const cv::Point2d along = through(H, p + x) - through(H, p - x);
    const cv::Point2d across = through(H, p + y) - through(H, p - y);
    return std::sqrt(std::abs(along.cross(across)));
}

/* Circles around one place whose union they share to 60 %, as regions that count as found again do
 * in Mikolajczyk et al., "A comparison of affine region detectors", IJCV 2005. */
inline bool alike(double size_a, double size_b)
{
    const double least = std::sqrt(.6);
    return size_a >= least * size_b && size_b >= least * size_a;
}

/* Pairs within 2.5 px in both images, of like size where `sized`, the nearest first, each feature
 * in one pair at most. */
inline int repeated(const FeatureSet &set_a, const FeatureSet &set_b, const cv::Matx33d &H,
                    bool sized)
{
    const std::vector<cv::Point2d> &a = set_a.points, &b = set_b.points;
    std::vector<std::tuple<double, size_t, size_t>> pairs;
    const cv::Matx33d back = H.inv();
    std::vector<cv::Point2d> b_in_a;
    for (const auto &p : b)
        b_in_a.push_back(through(back, p));
    for (size_t i = 0; i < a.size(); i++) {
        const cv::Point2d q = through(H, a[i]);
        const double size = sized ? set_a.sizes[i] * growth(H, a[i]) : 0;
        for (size_t k = 0; k < b.size(); k++) {
            if (std::abs(q.x - b[k].x) >= 2.5 || std::abs(q.y - b[k].y) >= 2.5) continue;
            if (sized && !alike(size, set_b.sizes[k])) continue;
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

/* Distances of the rows of `a` from those of `b`, a row for each of `b`; squares where not Hamming.
 */
inline cv::Mat distances(const cv::Mat &a, const cv::Mat &b, int norm)
{
    cv::Mat found;
    if (norm != cv::NORM_HAMMING) { /* |a - b|^2 = |a|^2 + |b|^2 - 2 a b */
        cv::Mat of_a, of_b;
        cv::reduce(a.mul(a), of_a, 1, cv::REDUCE_SUM);
        cv::reduce(b.mul(b), of_b, 1, cv::REDUCE_SUM);
        cv::gemm(b, a, -2, cv::repeat(of_a.t(), b.rows, 1) + cv::repeat(of_b, 1, a.rows), 1, found,
                 cv::GEMM_2_T);
        return found;
    }
    found.create(b.rows, a.rows, CV_32F);
    for (int k = 0; k < b.rows; k++) {
        for (int i = 0; i < a.rows; i++) {
            int bits = 0;
            for (int at = 0; at < a.cols; at += 8) { /* descriptors have 32 bytes */
                uint64_t x, y;
                std::memcpy(&x, a.ptr(i) + at, sizeof x);
                std::memcpy(&y, b.ptr(k) + at, sizeof y);
                bits += __builtin_popcountll(x ^ y);
            }
            found.at<float>(k, i) = static_cast<float>(bits);
        }
    }
    return found;
}

/* Mutual nearest neighbours, as cv::BFMatcher with its cross-check finds them, in less time. */
inline std::vector<std::pair<size_t, size_t>> mutual(const cv::Mat &a, const cv::Mat &b, int norm)
{
    const cv::Mat all = distances(a, b, norm);
    std::vector<float> best(static_cast<size_t>(a.rows), INFINITY);
    std::vector<size_t> of_a(static_cast<size_t>(a.rows)), of_b;
    for (int k = 0; k < b.rows; k++) {
        const float *row = all.ptr<float>(k);
        of_b.push_back(static_cast<size_t>(std::min_element(row, row + a.rows) - row));
        for (size_t i = 0; i < of_a.size(); i++) {
            if (!(row[i] < best[i])) continue;
            best[i] = row[i];
            of_a[i] = static_cast<size_t>(k);
        }
    }
    std::vector<std::pair<size_t, size_t>> pairs;
    for (size_t i = 0; i < of_a.size(); i++)
        if (of_b[of_a[i]] == i) pairs.emplace_back(i, of_a[i]);
    return pairs;
}

inline FeatureScore score(const FeatureSet &a, const FeatureSet &b, int norm, const cv::Matx33d &H,
                          cv::Size size_a, cv::Size size_b)
{
    std::vector<std::pair<size_t, size_t>> matches;
    if (!a.points.empty() && !b.points.empty())
        matches = mutual(a.descriptors, b.descriptors, norm);
    int right = 0;
    for (const auto &[i, k] : matches) {
        const cv::Point2d p = a.points[i], q = b.points[k];
        right += std::max(cv::norm(through(H, p) - q), cv::norm(through(H.inv(), q) - p)) < 2.5;
    }
    const double both =
        std::max(1, std::min(inside(a.points, H, size_b), inside(b.points, H.inv(), size_a)));
    const bool sized = !a.sizes.empty() && !b.sizes.empty();
    return {repeated(a, b, H, false) / both, right / both,
            sized ? repeated(a, b, H, true) / both : 0};
}

#endif

/* Exact matching beside OpenCV's on boat 1 and 2, SIFT and ORB features: the same pairs as its
 * brute force with the ratio test, so no other is accepted. With --flann also: a fifth of the
 * processor's time of the fastest setting of FLANN, its index included, that keeps 0.95 of them.
 *
 *   test_match_opencv [--flann] [COUNT]     default 5000 features of each image */
#include "oracle/images.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include <opencv2/core/utility.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/flann.hpp>
#include <opencv2/imgcodecs.hpp>

#include "fovea/match.h"

namespace
{

using Memory = std::unique_ptr<void, void (*)(void *)>;

Memory take(size_t bytes)
{
    return Memory(std::aligned_alloc(64, (bytes + 63) / 64 * 64), std::free);
}

/* Features of an image, in memory of their own. */
struct Features {
    Memory memory{nullptr, std::free};
    struct fovea_extracted found = {};
    cv::Mat descriptors; /* of bytes */

    Features(const cv::Mat &image, enum fovea_feature_method method, uint32_t count)
    {
        struct fovea_extract_config config;
        struct fovea_extract *extract = nullptr;
        fovea_extract_config_default(&config, method);
        config.count_max = count;
        config.contrast = .5f;
        const size_t bytes = fovea_extract_size(&config, image.cols, image.rows, nullptr);
        memory = take(bytes);
        fovea_extract_init(&extract, &config, image.cols, image.rows, memory.get(), bytes, nullptr);
        const struct fovea_image view = {
            image.data,        image.cols,
            image.rows,        static_cast<int32_t>(image.step),
            FOVEA_PIXEL_GREY8, image.step * static_cast<size_t>(image.rows)};
        fovea_extract_run(extract, &view, nullptr, &found);
        descriptors =
            cv::Mat(static_cast<int>(found.count), static_cast<int>(found.descriptor_bytes), CV_8U,
                    const_cast<uint8_t *>(found.descriptors));
    }
};

/* Milliseconds of the processor. */
double time_of(const std::function<void()> &run)
{
    struct timespec start, end;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &start);
    run();
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &end);
    return 1e3 * static_cast<double>(end.tv_sec - start.tv_sec) +
           1e-6 * static_cast<double>(end.tv_nsec - start.tv_nsec);
}

using Pairs = std::map<int, int>;

Pairs accepted(const std::vector<std::vector<cv::DMatch>> &matches)
{
    Pairs pairs;
    for (const auto &m : matches)
        if (m.size() == 2 && m[0].distance < .8f * m[1].distance)
            pairs[m[0].queryIdx] = m[0].trainIdx;
    return pairs;
}

double kept(const Pairs &found, const Pairs &expected)
{
    size_t count = 0;
    for (const auto &[q, t] : expected) {
        const auto at = found.find(q);
        count += at != found.end() && at->second == t;
    }
    return static_cast<double>(count) / static_cast<double>(expected.size());
}

/* A setting of FLANN, whose trees are random: the least time of its rounds, their mean part of the
 * pairs of brute force. */
struct Setting {
    std::string name;
    std::function<cv::Ptr<cv::flann::IndexParams>()> index;
    int checks;
    double least_ms = 1e9, kept_sum = 0;

    void round(const cv::Mat &a, const cv::Mat &b, const Pairs &expected)
    {
        std::vector<std::vector<cv::DMatch>> matches;
        least_ms = std::min(least_ms, time_of([&] {
                                cv::FlannBasedMatcher matcher(
                                    index(), cv::makePtr<cv::flann::SearchParams>(checks));
                                matcher.knnMatch(a, b, matches, 2);
                            }));
        kept_sum += kept(accepted(matches), expected);
    }
};

std::vector<Setting> grid(bool binary)
{
    std::vector<Setting> settings;
    if (binary) {
        for (const auto &[tables, key, probes] :
             {std::array{6, 12, 1}, std::array{12, 12, 1}, std::array{12, 20, 2}})
            settings.push_back({cv::format("LSH %d %d %d", tables, key, probes),
                                [tables = tables, key = key, probes = probes] {
                                    return cv::makePtr<cv::flann::LshIndexParams>(tables, key,
                                                                                  probes);
                                },
                                32});
        return settings;
    }
    for (int checks = 16; checks <= 512; checks *= 2)
        for (int trees = 1; trees <= 4; trees *= 2)
            settings.push_back(
                {cv::format("%d trees, %3d checks", trees, checks),
                 [trees] { return cv::makePtr<cv::flann::KDTreeIndexParams>(trees); }, checks});
    return settings;
}

/* Over the fastest setting that keeps 0.95 of `expected`: the least time of as many rounds of each,
 * in turns, so that what else the machine does meets all alike. */
double over_flann(const std::function<void()> &ours, const cv::Mat &a, const cv::Mat &b,
                  bool binary, const Pairs &expected)
{
    constexpr int rounds = 7;
    std::vector<Setting> settings = grid(binary);
    double least_ms = 1e9, fastest_ms = 1e9;
    for (int i = 0; i < rounds; i++) {
        least_ms = std::min(least_ms, time_of(ours));
        for (Setting &setting : settings)
            setting.round(a, b, expected);
    }
    for (const Setting &setting : settings) {
        const double part = setting.kept_sum / rounds;
        std::printf("    %s: %.1f ms, keeps %.4f\n", setting.name.c_str(), setting.least_ms, part);
        if (part >= .95) fastest_ms = std::min(fastest_ms, setting.least_ms);
    }
    std::printf("  least of %d rounds: ours %.2f ms, the fastest FLANN that keeps 0.95 %.1f ms: "
                "%.3f\n",
                rounds, least_ms, fastest_ms, least_ms / fastest_ms);
    return least_ms / fastest_ms;
}

bool check(enum fovea_feature_method method, uint32_t count, bool held)
{
    const std::string folder = data_folder() + "/affine/boat/";
    const cv::Mat first = cv::imread(folder + "img1.png", cv::IMREAD_GRAYSCALE);
    const cv::Mat second = cv::imread(folder + "img2.png", cv::IMREAD_GRAYSCALE);
    if (first.empty() || second.empty()) {
        std::printf("SKIPPED %s: not there\n", folder.c_str());
        return true;
    }
    const Features a(first, method, count), b(second, method, count);
    const bool binary = method == FOVEA_FEATURES_ORB;
    struct fovea_match_config config;
    fovea_match_config_default(&config, binary ? FOVEA_DESCRIPTOR_BINARY : FOVEA_DESCRIPTOR_FLOAT);
    config.count_max = count;
    config.cross_check = 0;
    const size_t bytes = fovea_match_size(&config, nullptr);
    const Memory memory = take(bytes);
    struct fovea_matcher *matcher = nullptr;
    fovea_match_init(&matcher, &config, memory.get(), bytes, nullptr);
    struct fovea_matched matched = {};
    const double ours = time_of([&] { fovea_match_run(matcher, &a.found, &b.found, &matched); });

    cv::Mat a_cv = a.descriptors, b_cv = b.descriptors;
    if (!binary) {
        a_cv.convertTo(a_cv, CV_32F);
        b_cv.convertTo(b_cv, CV_32F);
    }
    std::vector<std::vector<cv::DMatch>> matches;
    const double brute = time_of([&] {
        matches.clear();
        cv::BFMatcher(binary ? cv::NORM_HAMMING : cv::NORM_L2).knnMatch(a_cv, b_cv, matches, 2);
    });
    const Pairs expected = accepted(matches);
    size_t same = 0;
    for (uint32_t i = 0; i < matched.count; i++) {
        const auto at = expected.find(static_cast<int>(matched.matches[i].a));
        same += at != expected.end() && at->second == static_cast<int>(matched.matches[i].b);
    }
    std::printf("%s, %u x %u: %u matches, OpenCV %zu, the same %zu; %.2f ms, OpenCV's brute force "
                "%.1f ms\n",
                fovea_feature_method_name(method), a.found.count, b.found.count, matched.count,
                expected.size(), same, ours, brute);
    bool good = matched.count == expected.size() && same == expected.size();
    if (held) {
        const auto run = [&] { fovea_match_run(matcher, &a.found, &b.found, &matched); };
        good = over_flann(run, a_cv, b_cv, binary, expected) <= .2 && good;
    }
    if (!good) std::printf("FAILED\n");
    return good;
}

} // namespace

int main(int argc, char **argv)
{
    const bool held = argc > 1 && std::strcmp(argv[1], "--flann") == 0;
    const char *number = argc > 1 + held ? argv[1 + held] : "5000";
    const auto count = static_cast<uint32_t>(std::atoi(number));
    cv::setNumThreads(1);
    bool good = check(FOVEA_FEATURES_SIFT, count, held);
    good = check(FOVEA_FEATURES_ORB, count, held) && good;
    return good ? 0 : 1;
}

/* Every feature method beside OpenCV's on the Oxford affine sets (Mikolajczyk et al., IJCV 2005):
 * image 1 against images 2 to 6, related by known homographies, the same number of features asked
 * of both. Held: the mean over the pairs of repeatability and of matching score (feature_score.h)
 * is at least OpenCV's less 0.005, and no pair is more than 0.04 below. Also prints the time of
 * both on image 1.
 *
 *   test_features_opencv [METHOD [COUNT]]     default: every method, 1000 features */
#include "oracle/images.h"

#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <opencv2/core/utility.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "fovea/extract.h"
#include "oracle/feature_score.h"

namespace
{

using Config = struct fovea_extract_config;

struct Extractor {
    std::unique_ptr<void, void (*)(void *)> memory{nullptr, std::free};
    struct fovea_extract *extract = nullptr;

    Extractor(const Config &config, cv::Size size)
    {
        struct fovea_error error;
        const size_t bytes = fovea_extract_size(&config, size.width, size.height, &error);
        memory.reset(std::aligned_alloc(64, (bytes + 63) / 64 * 64));
        if (bytes == 0 || fovea_extract_init(&extract, &config, size.width, size.height,
                                             memory.get(), bytes, &error) != FOVEA_OK) {
            std::printf("FAILED %s\n", error.text);
            std::exit(1);
        }
    }

    struct fovea_extracted run(const cv::Mat &image) const
    {
        const struct fovea_image view = {
            image.data,        image.cols,
            image.rows,        static_cast<int32_t>(image.step),
            FOVEA_PIXEL_GREY8, image.step * static_cast<size_t>(image.rows)};
        struct fovea_extracted found = {};
        if (fovea_extract_run(extract, &view, nullptr, &found) != FOVEA_OK)
            std::printf("FAILED run\n");
        return found;
    }
};

FeatureSet ours(const Config &config, const cv::Mat &image)
{
    const Extractor extractor(config, image.size());
    const struct fovea_extracted found = extractor.run(image);
    FeatureSet set;
    for (uint32_t i = 0; i < found.count; i++)
        set.points.emplace_back(found.features[i].x_px, found.features[i].y_px);
    set.descriptors =
        cv::Mat(static_cast<int>(found.count), static_cast<int>(found.descriptor_bytes), CV_8U,
                const_cast<uint8_t *>(found.descriptors))
            .clone();
    if (config.descriptor != FOVEA_DESCRIPTOR_BINARY)
        set.descriptors.convertTo(set.descriptors, CV_32F);
    return set;
}

using Peer = std::function<void(const cv::Mat &, std::vector<cv::KeyPoint> &, cv::Mat &)>;

struct Method {
    Config config;
    int norm;
    Peer theirs;
};

Method method_of(enum fovea_feature_method method, int count)
{
    Method made;
    fovea_extract_config_default(&made.config, method);
    made.config.count_max = static_cast<uint32_t>(count);
    made.norm = made.config.descriptor == FOVEA_DESCRIPTOR_BINARY ? cv::NORM_HAMMING : cv::NORM_L2;
    cv::Ptr<cv::Feature2D> detector, descriptor = cv::ORB::create(count);
    if (method == FOVEA_FEATURES_SIFT) detector = descriptor = cv::SIFT::create(count);
    if (method == FOVEA_FEATURES_ORB) detector = descriptor;
    if (method == FOVEA_FEATURES_HARRIS || method == FOVEA_FEATURES_SHI_TOMASI)
        detector = cv::GFTTDetector::create(count, .01, 1, 3, method == FOVEA_FEATURES_HARRIS);
    made.theirs = [=](const cv::Mat &image, std::vector<cv::KeyPoint> &points, cv::Mat &out) {
        if (detector == descriptor) {
            detector->detectAndCompute(image, cv::noArray(), points, out);
            return;
        }
        if (detector) {
            detector->detect(image, points);
        } else {
            cv::FAST(image, points, 20);
            cv::KeyPointsFilter::retainBest(points, count);
        }
        descriptor->compute(image, points, out);
    };
    return made;
}

FeatureSet theirs(const Method &method, const cv::Mat &image)
{
    FeatureSet set;
    std::vector<cv::KeyPoint> points;
    method.theirs(image, points, set.descriptors);
    for (const auto &p : points)
        set.points.emplace_back(p.pt.x, p.pt.y);
    return set;
}

cv::Mat read_image(const std::string &name, int i)
{
    return cv::imread(data_folder() + "/affine/" + name + "/img" + std::to_string(i) + ".png",
                      cv::IMREAD_GRAYSCALE);
}

cv::Matx33d homography(const std::string &name, int i)
{
    cv::FileStorage file(data_folder() + "/affine/" + name + "/H1to" + std::to_string(i) + "p.xml",
                         cv::FileStorage::READ);
    cv::Mat matrix;
    file.getFirstTopLevelNode() >> matrix;
    matrix.convertTo(matrix, CV_64F);
    return matrix;
}

/* Of the processor, so that other programs do not count. */
double median_ms(const std::function<void()> &run)
{
    std::vector<double> times;
    for (int i = 0; i < 9; i++) {
        struct timespec start, end;
        clock_gettime(CLOCK_THREAD_CPUTIME_ID, &start);
        run();
        clock_gettime(CLOCK_THREAD_CPUTIME_ID, &end);
        times.push_back(1e3 * static_cast<double>(end.tv_sec - start.tv_sec) +
                        1e-6 * static_cast<double>(end.tv_nsec - start.tv_nsec));
    }
    std::nth_element(times.begin(), times.begin() + 4, times.end());
    return times[4];
}

void print_times(const Method &method, const cv::Mat &image)
{
    const Extractor extractor(method.config, image.size());
    const double our_ms = median_ms([&] { extractor.run(image); });
    const double their_ms = median_ms([&] { theirs(method, image); });
    std::printf("  %d x %d: %.2f ms, OpenCV %.2f ms (%.2f)\n", image.cols, image.rows, our_ms,
                their_ms, our_ms / their_ms);
}

bool check(const Method &method)
{
    FeatureScore sum, cv_sum, worst = {1, 1};
    std::printf("%s, %u features\n", fovea_feature_method_name(method.config.method),
                method.config.count_max);
    for (const std::string name : {"graf", "bikes", "boat"}) {
        const cv::Mat first = read_image(name, 1);
        if (first.empty()) {
            std::printf("SKIPPED %s: not there\n", name.c_str());
            return true;
        }
        const FeatureSet a = ours(method.config, first), cv_a = theirs(method, first);
        for (int i = 2; i <= 6; i++) {
            const cv::Mat image = read_image(name, i);
            const cv::Matx33d H = homography(name, i);
            const FeatureScore s =
                score(a, ours(method.config, image), method.norm, H, first.size(), image.size());
            const FeatureScore t =
                score(cv_a, theirs(method, image), method.norm, H, first.size(), image.size());
            std::printf("  %-5s 1-%d  repeatability %.3f, OpenCV %.3f;  matching %.3f, %.3f\n",
                        name.c_str(), i, s.repeatability, t.repeatability, s.matching, t.matching);
            sum.repeatability += s.repeatability / 15;
            sum.matching += s.matching / 15;
            cv_sum.repeatability += t.repeatability / 15;
            cv_sum.matching += t.matching / 15;
            worst.repeatability = std::min(worst.repeatability, s.repeatability - t.repeatability);
            worst.matching = std::min(worst.matching, s.matching - t.matching);
        }
        if (name == "graf") print_times(method, first);
    }
    std::printf("  mean       repeatability %.3f, OpenCV %.3f, least difference %.3f;  matching "
                "%.3f, %.3f, %.3f\n",
                sum.repeatability, cv_sum.repeatability, worst.repeatability, sum.matching,
                cv_sum.matching, worst.matching);
    const bool good = sum.repeatability >= cv_sum.repeatability - .005 &&
                      sum.matching >= cv_sum.matching - .005 && worst.repeatability >= -.04 &&
                      worst.matching >= -.04;
    if (good) return true;
    std::printf("FAILED: below OpenCV\n");
    return false;
}

} // namespace

int main(int argc, char **argv)
{
    const int count = argc > 2 ? std::atoi(argv[2]) : 1000;
    bool good = true;
    cv::setNumThreads(1);
    for (int i = 0; i < FOVEA_FEATURE_METHOD_COUNT; i++) {
        const auto method = static_cast<enum fovea_feature_method>(i);
        if (argc > 1 && std::string(argv[1]) != fovea_feature_method_name(method)) continue;
        good = check(method_of(method, count)) && good;
    }
    return good ? 0 : 1;
}

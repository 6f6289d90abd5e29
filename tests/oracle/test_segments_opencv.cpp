/* Line segments beside OpenCV's LSD (createLineSegmentDetector with its defaults) on real images:
 * an F-score by length, of points every pixel along the segments, one that has a segment of the
 * other within 2 pixels and 10 degrees counts. At least .9 in the mean, .85 in each image; the same
 * segments with every kernel set of this processor.
 *
 *   test_segments_opencv [FOLDER [LIMIT]]     default: 8 images of $FOVEA_DATA; LIMIT 0: all */
#include "oracle/images.h"

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <vector>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "fovea/segments.h"
#include "kernels/kernels.h"

namespace
{

using Segments = std::vector<cv::Vec4f>;

constexpr double distance_px = 2, angle_degrees = 10, mean_least = .9, least = .85;

Segments ours(const cv::Mat &image)
{
    struct fovea_segments_config config;
    struct fovea_segments *detector = nullptr;
    struct fovea_segments_found found = {};
    struct fovea_error error;
    fovea_segments_config_default(&config);
    config.count_max = 20000;
    const size_t bytes = fovea_segments_size(&config, image.cols, image.rows, &error);
    const std::unique_ptr<void, void (*)(void *)> memory{
        std::aligned_alloc(64, (bytes + 63) / 64 * 64), std::free};
    const struct fovea_image view = {image.data,        image.cols,
                                     image.rows,        static_cast<int32_t>(image.step),
                                     FOVEA_PIXEL_GREY8, image.step * image.rows};
    Segments segments;
    if (bytes == 0 ||
        fovea_segments_init(&detector, &config, image.cols, image.rows, memory.get(), bytes,
                            &error) != FOVEA_OK ||
        fovea_segments_run(detector, &view, &found) != FOVEA_OK) {
        std::printf("FAILED %s\n", error.text);
        std::exit(1);
    }
    for (uint32_t i = 0; i < found.count; i++) {
        const struct fovea_segment &s = found.list[i];
        segments.emplace_back(s.x0_px, s.y0_px, s.x1_px, s.y1_px);
    }
    return segments;
}

Segments theirs(const cv::Mat &image)
{
    Segments segments;
    cv::createLineSegmentDetector()->detect(image, segments);
    return segments;
}

struct Line {
    cv::Point2d from, along; /* a unit vector */
    double length;
    cv::Rect2d around; /* all places that it may cover */

    explicit Line(const cv::Vec4f &s) : from(s[0], s[1]), along(s[2] - s[0], s[3] - s[1])
    {
        length = std::hypot(along.x, along.y);
        around = {std::min(from.x, from.x + along.x) - distance_px - 1,
                  std::min(from.y, from.y + along.y) - distance_px - 1,
                  std::abs(along.x) + 2 * (distance_px + 1),
                  std::abs(along.y) + 2 * (distance_px + 1)};
        along = length > 0 ? along / length : cv::Point2d(1, 0);
    }
    bool covers(const cv::Point2d &at) const
    {
        const cv::Point2d r = at - from;
        const double t = std::min(std::max(r.dot(along), 0.0), length);
        const cv::Point2d off = r - t * along;
        return std::hypot(off.x, off.y) <= distance_px;
    }
};

/* The fraction of the length of `a` that `b` covers. */
double covered(const Segments &a, const Segments &b)
{
    const double parallel = std::cos(angle_degrees * CV_PI / 180);
    const std::vector<Line> others(b.begin(), b.end());
    double hits = 0, points = 0;
    for (const cv::Vec4f &s : a) {
        const Line line(s);
        std::vector<const Line *> near;
        for (const Line &other : others)
            if (std::abs(other.along.dot(line.along)) >= parallel &&
                (other.around & line.around).area() > 0)
                near.push_back(&other);
        for (double t = .5; t < line.length; t += 1) {
            const cv::Point2d at = line.from + t * line.along;
            points++;
            hits += std::any_of(near.begin(), near.end(),
                                [&](const Line *other) { return other->covers(at); });
        }
    }
    return points > 0 ? hits / points : b.empty() ? 1 : 0;
}

} // namespace

int main(int argc, char **argv)
{
    const std::vector<std::string> names = images_of(argc, argv, 8);
    if (names.empty()) return argc > 1 ? 1 : 0; /* named as skipped, or nothing in FOLDER */
    bool good = true;
    double sum = 0;
    int count = 0;
    for (const std::string &name : names) {
        const cv::Mat image = cv::imread(name, cv::IMREAD_GRAYSCALE);
        if (image.cols < 64 || image.rows < 64) continue;
        Segments first;
        for (int set = 0; set < FV_CPU_SET_COUNT; set++) {
            struct fv_kernels kernels;
            fv_kernels_init(&kernels, static_cast<enum fv_cpu_set>(set));
            if (kernels.set != set) continue;
            setenv("FOVEA_CPU", fv_cpu_set_name(kernels.set), 1);
            const Segments found = ours(image);
            if (set == 0) first = found;
            if (found != first) {
                std::printf("FAILED %s: other segments with %s\n", name.c_str(),
                            fv_cpu_set_name(kernels.set));
                good = false;
            }
        }
        const Segments reference = theirs(image);
        const double precision = covered(first, reference), recall = covered(reference, first);
        const double score =
            precision + recall > 0 ? 2 * precision * recall / (precision + recall) : 0;
        std::printf("%-60s %5zu %5zu segments, precision %.3f, recall %.3f, F %.3f\n",
                    name.substr(name.size() > 60 ? name.size() - 60 : 0).c_str(), first.size(),
                    reference.size(), precision, recall, score);
        good = good && score >= least;
        sum += score;
        count++;
    }
    std::printf("%d images, F %.3f in the mean, at least %.2f is asked\n", count, sum / count,
                mean_least);
    return good && count > 0 && sum / count >= mean_least ? 0 : 1;
}

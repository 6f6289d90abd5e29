/* ORB against OpenCV's, on real images with every kernel set of this processor:
 *  - smoothing equals cv::GaussianBlur(7x7, 2, 2) bit for bit;
 *  - descriptors equal, bit for bit, OpenCV's formula written out here over cv::GaussianBlur's
 *    image;
 *  - orientation is the nearest of our directions, within the error of OpenCV's approximate arc
 *    tangent;
 *  - cv::ORB::compute itself, whose blur of a sub-image is floating point, gives nearly the same
 *    bits.
 *
 *   test_orb_opencv [FOLDER [LIMIT]]     default: up to 12 images of $FOVEA_DATA */
#include "oracle/images.h"

#include <cmath>
#include <cstdio>
#include <cstring>
#include <vector>

#include <opencv2/features2d.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "features/features.h"
#include "features/orb.h"
#include "bench/memory.h"

namespace
{

const float degree = static_cast<float>(CV_PI / 180.0);

struct Described {
    std::vector<struct fv_corner> corners;
    std::vector<float> angle_rad;
    std::vector<uint8_t> descriptors;
};

/* Everything of one image with one kernel set; the pyramid's levels are left in `made`. */
Described describe(bench::Pyramid &made, const struct fv_kernels &kernels)
{
    struct fv_features features;
    struct fv_orb orb;
    const struct fovea_features_config config = {1000, made.pyramid.levels, 20, 7,
                                                 8,    FOVEA_FEATURES_FAST};
    bench::Block features_block([&](struct fv_arena *arena) {
        fv_features_carve(&features, &config, &made.pyramid, arena);
    });
    bench::Block orb_block(
        [&](struct fv_arena *arena) { fv_orb_carve(&orb, 1000, &made.pyramid, arena); });
    fv_pyramid_build(&made.pyramid, &kernels, &made.frame);
    const uint32_t count = fv_features_find(&features, &kernels, &made.pyramid, nullptr, 1000);
    fv_orb_describe(&orb, &kernels, &made.pyramid, features.corners, count);
    return {{features.corners, features.corners + count},
            {orb.angle_rad, orb.angle_rad + count},
            {orb.descriptors, orb.descriptors + FV_DESCRIPTOR_BYTES * static_cast<size_t>(count)}};
}

/* OpenCV's computeOrbDescriptor for one point: float arithmetic, sine and cosine of the C library,
 * cvRound.
 */
void formula(const cv::Mat &smooth, cv::Point at, float angle,
             uint8_t descriptor[FV_DESCRIPTOR_BYTES])
{
    const float a = static_cast<float>(std::cos(static_cast<double>(angle)));
    const float b = static_cast<float>(std::sin(static_cast<double>(angle)));
    const auto value = [&](int sample) {
        const float px = fv_orb_places[0][sample], py = fv_orb_places[1][sample];
        const int x = cvRound(px * a - py * b), y = cvRound(px * b + py * a);
        return smooth.at<uint8_t>(at.y + y, at.x + x);
    };
    std::memset(descriptor, 0, FV_DESCRIPTOR_BYTES);
    for (int i = 0; i < FV_BRIEF_BITS; i++)
        if (value(i) < value(FV_BRIEF_BITS + i))
            descriptor[i / 8] |= static_cast<uint8_t>(1 << i % 8);
}

/* OpenCV computes angles for key points that it detects itself, so ask for the moments' formula on
 * its image.
 */
float centroid_angle(const cv::Mat &level, cv::Point at)
{
    double m10 = 0, m01 = 0;
    for (int v = -15; v <= 15; v++)
        for (int u = -15; u <= 15; u++) {
            const int half = fv_moments_half_width[std::abs(v)];
            if (std::abs(u) > half) continue;
            m10 += u * level.at<uint8_t>(at.y + v, at.x + u);
            m01 += v * level.at<uint8_t>(at.y + v, at.x + u);
        }
    return cv::fastAtan2(static_cast<float>(m01), static_cast<float>(m10)) * degree;
}

struct Totals {
    size_t images = 0, points = 0, cv_same = 0, cv_points = 0;
    long cv_bits = 0;
    double angle_worst = 0;
};

bool check_level(const cv::Mat &level, const Described &found, size_t first, size_t count,
                 Totals &totals)
{
    cv::Mat smooth;
    cv::GaussianBlur(level, smooth, cv::Size(7, 7), 2, 2, cv::BORDER_REFLECT_101);
    std::vector<cv::KeyPoint> points;
    for (size_t i = first; i < first + count; i++) {
        const cv::Point at(found.corners[i].x, found.corners[i].y);
        uint8_t expected[FV_DESCRIPTOR_BYTES];
        formula(smooth, at, found.angle_rad[i], expected);
        if (std::memcmp(expected, &found.descriptors[FV_DESCRIPTOR_BYTES * i], sizeof expected) !=
            0) {
            std::printf("FAILED descriptor at (%d, %d), angle %.9g rad, level %d x %d\n", at.x,
                        at.y, found.angle_rad[i], level.cols, level.rows);
            return false;
        }
        const double turn =
            std::remainder(centroid_angle(level, at) - found.angle_rad[i], 2 * CV_PI);
        totals.angle_worst = std::max(totals.angle_worst, std::abs(turn));
        points.emplace_back(static_cast<float>(at.x), static_cast<float>(at.y), 31.0f,
                            found.angle_rad[i] / degree, 1.0f, 0, static_cast<int>(i));
    }
    totals.points += count;

    /* cv::ORB drops points closer than 31 to the border; class_id tells which are left. */
    cv::Mat theirs;
    cv::ORB::create(1000, 1.2f, 1)->compute(level, points, theirs);
    for (size_t k = 0; k < points.size(); k++) {
        const double distance =
            cv::norm(theirs.row(static_cast<int>(k)),
                     cv::Mat(1, FV_DESCRIPTOR_BYTES, CV_8U,
                             const_cast<uint8_t *>(
                                 &found.descriptors[FV_DESCRIPTOR_BYTES *
                                                    static_cast<size_t>(points[k].class_id)])),
                     cv::NORM_HAMMING);
        totals.cv_points++;
        totals.cv_same += distance == 0;
        totals.cv_bits += static_cast<long>(distance);
    }
    return true;
}

/* The circle's half widths are what makes the angles; they follow from OpenCV's own rule. */
bool check_circle()
{
    int half[17] = {0}, inner = 0;
    const int radius = 15;
    const int upper = cvFloor(radius * std::sqrt(2.0) / 2 + 1),
              lower = cvCeil(radius * std::sqrt(2.0) / 2);
    for (int v = 0; v <= upper; v++)
        half[v] = cvRound(std::sqrt(static_cast<double>(radius * radius - v * v)));
    for (int v = radius; v >= lower; v--) {
        while (half[inner] == half[inner + 1])
            inner++;
        half[v] = inner++;
    }
    for (int v = 0; v <= radius; v++)
        if (half[v] != fv_moments_half_width[v]) {
            std::printf("FAILED circle: row %d is %d wide, expected %d\n", v,
                        fv_moments_half_width[v], half[v]);
            return false;
        }
    return true;
}

bool check_blur(const cv::Mat &image, const struct fv_kernels &kernels)
{
    cv::Mat expected;
    cv::GaussianBlur(image, expected, cv::Size(7, 7), 2, 2, cv::BORDER_REFLECT_101);
    std::vector<uint16_t> memory(static_cast<size_t>(image.cols) + FV_BLUR7_PAD + 32);
    auto *scratch =
        reinterpret_cast<uint16_t *>((reinterpret_cast<uintptr_t>(memory.data()) + 63) / 64 * 64);
    std::vector<uint8_t> row(static_cast<size_t>(image.cols));
    for (int y = 0; y < image.rows; y++) {
        const uint8_t *rows[7];
        for (int i = 0; i < 7; i++)
            rows[i] =
                image.ptr(cv::borderInterpolate(y + i - 3, image.rows, cv::BORDER_REFLECT_101));
        kernels.blur7_row_u8(row.data(), rows, image.cols, scratch);
        if (std::memcmp(row.data(), expected.ptr(y), row.size()) != 0) {
            std::printf("FAILED blur, row %d, kernels %s\n", y, fv_cpu_set_name(kernels.set));
            return false;
        }
    }
    return true;
}

bool check_image(const cv::Mat &image, const std::vector<struct fv_kernels> &sets, Totals &totals)
{
    bench::Pyramid made(image, 8);
    const Described found = describe(made, sets.front());
    for (const auto &kernels : sets) {
        const Described again = describe(made, kernels);
        if (again.angle_rad != found.angle_rad || again.descriptors != found.descriptors) {
            std::printf("FAILED kernels %s: differ from %s\n", fv_cpu_set_name(kernels.set),
                        fv_cpu_set_name(sets[0].set));
            return false;
        }
        if (!check_blur(image, kernels)) return false;
    }
    for (size_t start = 0, end; start < found.corners.size(); start = end) {
        for (end = start;
             end < found.corners.size() && found.corners[end].level == found.corners[start].level;)
            end++;
        const struct fv_plane &level = made.pyramid.level[found.corners[start].level];
        const cv::Mat view(level.height, level.width, CV_8U, level.pixels,
                           static_cast<size_t>(level.stride));
        if (!check_level(view.clone(), found, start, end - start, totals)) return false;
    }
    totals.images++;
    return true;
}

} // namespace

int main(int argc, char **argv)
{
    const std::vector<std::string> names = images_of(argc, argv, 12);

    std::vector<struct fv_kernels> sets;
    for (int set = 0; set < FV_CPU_SET_COUNT; set++) {
        struct fv_kernels kernels;
        fv_kernels_init(&kernels, static_cast<enum fv_cpu_set>(set));
        if (kernels.set == set) sets.push_back(kernels);
    }
    if (!check_circle()) return 1;
    Totals totals;
    for (const auto &name : names) {
        const cv::Mat image = cv::imread(name, cv::IMREAD_GRAYSCALE);
        if (image.empty() || image.cols < 200 || image.rows < 200) continue;
        if (!check_image(image, sets, totals)) {
            std::printf("  in %s\n", name.c_str());
            return 1;
        }
    }
    cv::Mat drawn(300, 400, CV_8U);
    cv::RNG random(9);
    random.fill(drawn, cv::RNG::UNIFORM, 0, 256);
    cv::GaussianBlur(drawn, drawn, cv::Size(5, 5), 1);
    if (!check_image(drawn, sets, totals)) return 1;

    const double bits = totals.cv_points ? static_cast<double>(totals.cv_bits) /
                                               (256.0 * static_cast<double>(totals.cv_points))
                                         : 0;
    std::printf(
        "%zu images, %zu descriptors, all equal to the formula on cv::GaussianBlur; angles within %.3f degrees\n",
        totals.images, totals.points, totals.angle_worst / degree);
    std::printf("cv::ORB::compute: %.3f %% of bits differ, %.1f %% of descriptors are the same\n",
                100 * bits,
                100.0 * static_cast<double>(totals.cv_same) /
                    static_cast<double>(std::max<size_t>(1, totals.cv_points)));
    /* Half a step between directions; fastAtan2 errs by up to about 0.01 degrees. */
    return totals.points > 500 &&
                   totals.angle_worst < (180.0 / FV_ORB_DIRECTIONS + 0.02) * degree && bits < 0.005
               ? 0
               : 1;
}

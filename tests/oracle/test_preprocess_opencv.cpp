/* Preprocessing beside OpenCV on real images of odd sizes, with every kernel set of this processor:
 * equal to the bit where fovea/preprocess.h says so, else within one grey level.
 *
 *   test_preprocess_opencv [FOLDER [LIMIT]]     default: 3 images of $FOVEA_DATA, of which
 *   the first is taken whole, of the others parts; LIMIT 0: all */
#include "oracle/images.h"

#include <cmath>
#include <cstdio>
#include <cstring>
#include <functional>
#include <vector>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "image/preprocess.h"

namespace
{

using Config = struct fovea_preprocess_config;

Config config_of(enum fovea_operation operation)
{
    Config config;
    fovea_preprocess_config_default(&config);
    config.operations.count = 1;
    config.operations.items[0] = operation;
    return config;
}

cv::Mat ours(const struct fv_kernels &kernels, const Config &config, const cv::Mat &image,
             bool in_place)
{
    struct fv_arena arena;
    struct fv_preprocess chain = {};
    fv_arena_count(&arena);
    fv_preprocess_carve(&chain, &config, image.cols, image.rows, &arena);
    std::vector<uint8_t> memory(arena.used + 64);
    auto base = reinterpret_cast<uintptr_t>(memory.data());
    fv_arena_init(&arena, memory.data() + (64 - base % 64) % 64, memory.size() - 64);
    fv_preprocess_carve(&chain, &config, image.cols, image.rows, &arena);
    fv_preprocess_prepare(&chain);
    cv::Mat out = in_place ? image.clone() : cv::Mat(image.size(), CV_8U);
    const struct fv_plane from = fv_plane_of(image.data, image.cols, image.rows,
                                             static_cast<int32_t>(image.step)),
                          to = fv_plane_of(out.data, out.cols, out.rows,
                                           static_cast<int32_t>(out.step));
    fv_preprocess_run(&chain, &kernels, in_place ? &to : &from, &to);
    return out;
}

struct Comparison {
    std::string name;
    Config config;
    int tolerance; /* grey levels */
    std::function<cv::Mat(const cv::Mat &)> theirs;
};

void add_gaussians(std::vector<Comparison> &all)
{
    for (int size : {3, 5, 7})
        for (double sigma : {0.0, 0.4, 0.7, 0.95, 1.2, 1.6, 2.0, 3.5, 9.0}) {
            Config config = config_of(FOVEA_OPERATION_DENOISE);
            config.denoise_size = static_cast<uint32_t>(size);
            config.denoise_sigma_px = sigma;
            const double same = config.denoise_sigma_px;
            char name[64];
            std::snprintf(name, sizeof name, "Gaussian %d, sigma %g", size, sigma);
            all.push_back({name, config, 0, [=](const cv::Mat &in) {
                               cv::Mat out;
                               cv::GaussianBlur(in, out, cv::Size(size, size), same);
                               return out;
                           }});
        }
}

void add_other_neighbourhoods(std::vector<Comparison> &all)
{
    Config median = config_of(FOVEA_OPERATION_DENOISE);
    median.denoise_method = FOVEA_DENOISE_MEDIAN;
    all.push_back({"median 3", median, 0, [](const cv::Mat &in) {
                       cv::Mat out;
                       cv::medianBlur(in, out, 3);
                       return out;
                   }});
    for (double grey : {5.0, 25.0, 60.0, 200.0})
        for (double px : {0.8, 2.0, 10.0}) {
            Config bilateral = config_of(FOVEA_OPERATION_DENOISE);
            bilateral.denoise_method = FOVEA_DENOISE_BILATERAL;
            bilateral.denoise_sigma_px = px;
            bilateral.denoise_sigma_grey = grey;
            char name[64];
            std::snprintf(name, sizeof name, "bilateral, sigma %g px, %g grey levels", px, grey);
            all.push_back({name, bilateral, 1, [=](const cv::Mat &in) {
                               cv::Mat out;
                               cv::bilateralFilter(in, out, 5, grey, px);
                               return out;
                           }});
        }
    for (double amount : {1.0, 1.5, 2.25, 8.0}) {
        Config sharpen = config_of(FOVEA_OPERATION_SHARPEN);
        sharpen.sharpen_amount = amount;
        char name[64];
        std::snprintf(name, sizeof name, "sharpen %g", amount);
        all.push_back({name, sharpen, 1, [=](const cv::Mat &in) {
                           cv::Mat smooth, out;
                           cv::GaussianBlur(in, smooth, cv::Size(5, 5), 0);
                           cv::addWeighted(in, amount, smooth, 1 - amount, 0, out);
                           return out;
                       }});
    }
}

void add_tables(std::vector<Comparison> &all)
{
    all.push_back({"histogram equalization", config_of(FOVEA_OPERATION_HISTOGRAM_EQUALIZATION), 0,
                   [](const cv::Mat &in) {
                       cv::Mat out;
                       cv::equalizeHist(in, out);
                       return out;
                   }});
    for (auto [low, high] : std::vector<std::pair<int, int>>{{0, 255}, {10, 200}, {97, 98}}) {
        Config range = config_of(FOVEA_OPERATION_NORMALIZE);
        range.normalize_low = static_cast<uint32_t>(low);
        range.normalize_high = static_cast<uint32_t>(high);
        const int a = low, b = high;
        all.push_back({"normalize to " + std::to_string(low) + ".." + std::to_string(high), range,
                       0, [=](const cv::Mat &in) {
                           cv::Mat out;
                           cv::normalize(in, out, a, b, cv::NORM_MINMAX);
                           return out;
                       }});
    }
    Config deviation = config_of(FOVEA_OPERATION_NORMALIZE);
    deviation.normalize_method = FOVEA_NORMALIZE_DEVIATION;
    all.push_back({"normalize deviation", deviation, 1, [](const cv::Mat &in) {
                       cv::Scalar mean, sigma;
                       cv::Mat out;
                       cv::meanStdDev(in, mean, sigma);
                       const double scale = sigma[0] > 0 ? 50 / sigma[0] : 0;
                       in.convertTo(out, CV_8U, scale, 128 - mean[0] * scale);
                       return out;
                   }});
    for (double gamma : {0.45, 0.8, 1.0, 2.2}) {
        Config config = config_of(FOVEA_OPERATION_GAMMA);
        config.gamma = gamma;
        const double same = config.gamma;
        char name[64];
        std::snprintf(name, sizeof name, "gamma %g", gamma);
        all.push_back({name, config, 0, [=](const cv::Mat &in) {
                           cv::Mat table(1, 256, CV_8U), out;
                           for (int i = 0; i < 256; i++)
                               table.at<uint8_t>(i) =
                                   cv::saturate_cast<uint8_t>(255 * std::pow(i / 255.0, same));
                           cv::LUT(in, table, out);
                           return out;
                       }});
    }
    for (double limit : {0.0, 2.0, 4.5, 40.0})
        for (int tiles : {1, 3, 8, 16}) {
            Config contrast = config_of(FOVEA_OPERATION_CONTRAST_ENHANCEMENT);
            contrast.contrast_limit = limit;
            contrast.contrast_tiles = static_cast<uint32_t>(tiles);
            char name[64];
            std::snprintf(name, sizeof name, "CLAHE, limit %g, %d x %d tiles", limit, tiles, tiles);
            all.push_back({name, contrast, 1, [=](const cv::Mat &in) {
                               cv::Mat out;
                               cv::createCLAHE(limit, cv::Size(tiles, tiles))->apply(in, out);
                               return out;
                           }});
        }
}

/* Parts of the image whose sizes no vector divides, and itself where `whole`. */
std::vector<cv::Mat> parts_of(const cv::Mat &image, bool whole)
{
    std::vector<cv::Mat> parts;
    if (whole) parts.push_back(image);
    for (cv::Size size : {cv::Size(331, 217), cv::Size(97, 65), cv::Size(64, 255)})
        if (image.cols > size.width + 7 && image.rows > size.height + 5)
            parts.push_back(image(cv::Rect(7, 5, size.width, size.height)).clone());
    return parts;
}

bool compare(const Comparison &c, const std::string &name, const cv::Mat &image,
             const std::vector<struct fv_kernels> &sets, int &worst)
{
    const cv::Mat expected = c.theirs(image);
    for (const auto &kernels : sets) {
        const bool in_place = kernels.set % 2 == 0;
        const cv::Mat found = ours(kernels, c.config, image, in_place);
        const int difference = static_cast<int>(cv::norm(expected, found, cv::NORM_INF));
        worst = std::max(worst, difference);
        if (difference <= c.tolerance) continue;
        cv::Mat far;
        cv::absdiff(expected, found, far);
        cv::Point at;
        cv::minMaxLoc(far, nullptr, nullptr, nullptr, &at);
        std::printf("FAILED %s, %s %d x %d, kernels %s: at (%d, %d) OpenCV %d, found %d\n",
                    c.name.c_str(), name.c_str(), image.cols, image.rows,
                    fv_cpu_set_name(kernels.set), at.x, at.y, expected.at<uint8_t>(at),
                    found.at<uint8_t>(at));
        return false;
    }
    return true;
}

} // namespace

int main(int argc, char **argv)
{
    const std::vector<std::string> names = images_of(argc, argv, 3);
    std::vector<struct fv_kernels> sets;
    for (int set = 0; set < FV_CPU_SET_COUNT; set++) {
        struct fv_kernels kernels;
        fv_kernels_init(&kernels, static_cast<enum fv_cpu_set>(set));
        if (kernels.set == set) sets.push_back(kernels);
    }
    std::vector<Comparison> all;
    add_gaussians(all);
    add_other_neighbourhoods(all);
    add_tables(all);
    std::vector<cv::Mat> images;
    for (const std::string &name : names) {
        const cv::Mat image = cv::imread(name, cv::IMREAD_GRAYSCALE);
        if (!image.empty() && image.cols >= 64 && image.rows >= 64) images.push_back(image);
    }
    images.push_back(cv::Mat(71, 83, CV_8U, cv::Scalar(140))); /* of one grey level */
    bool good = true;
    for (const Comparison &c : all) {
        int worst = 0;
        for (size_t i = 0; i < images.size(); i++)
            for (const cv::Mat &part :
                 parts_of(images[i], argc > 1 || i == 0 || i + 1 == images.size()))
                good = compare(c, i < names.size() ? names[i] : "one level", part, sets, worst) &&
                       good;
        std::printf("%-44s worst difference %d\n", c.name.c_str(), worst);
    }
    std::printf("%zu images, %zu kernel sets\n", images.size(), sets.size());
    return good ? 0 : 1;
}

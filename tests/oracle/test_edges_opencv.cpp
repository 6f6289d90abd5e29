/* Edges beside OpenCV on real images of odd sizes, with every kernel set of this processor: Sobel,
 * Scharr, Laplacian and Canny are equal to the bit.
 *
 *   test_edges_opencv [FOLDER [LIMIT]]     default: 4 images of $FOVEA_DATA; LIMIT 0: all */
#include "oracle/images.h"

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <vector>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "fovea/edges.h"
#include "kernels/kernels.h"

namespace
{

using Config = struct fovea_edges_config;

/* A detector for an image, with the kernel set that FOVEA_CPU names. */
struct Detector {
    std::unique_ptr<void, void (*)(void *)> memory{nullptr, std::free};
    struct fovea_edges *edges = nullptr;
    struct fovea_image view = {};

    Detector(const Config &config, const cv::Mat &image)
    {
        struct fovea_error error;
        const size_t bytes = fovea_edges_size(&config, image.cols, image.rows, &error);
        memory.reset(std::aligned_alloc(64, (bytes + 63) / 64 * 64));
        if (bytes == 0 || fovea_edges_init(&edges, &config, image.cols, image.rows, memory.get(),
                                           bytes, &error) != FOVEA_OK) {
            std::printf("FAILED %s\n", error.text);
            std::exit(1);
        }
        view = {image.data,        image.cols,
                image.rows,        static_cast<int32_t>(image.step),
                FOVEA_PIXEL_GREY8, image.step * static_cast<size_t>(image.rows)};
    }
};

Config config_of(enum fovea_edge_method method)
{
    Config config;
    fovea_edges_config_default(&config);
    config.method = method;
    return config;
}

cv::Mat bitmap(const Config &config, const cv::Mat &image)
{
    const Detector detector(config, image);
    const int stride = (image.cols + 7) / 8 + 3;
    std::vector<uint8_t> bits(static_cast<size_t>(stride) * image.rows);
    cv::Mat out(image.size(), CV_8U, cv::Scalar(7));
    if (fovea_edges_run(detector.edges, &detector.view, bits.data(), stride) != FOVEA_OK)
        return out;
    for (int y = 0; y < image.rows; y++)
        for (int x = 0; x < image.cols; x++)
            out.at<uint8_t>(y, x) =
                bits[static_cast<size_t>(y) * stride + x / 8] >> (7 - x % 8) & 1 ? 255 : 0;
    return out;
}

cv::Mat gradient(const Config &config, const cv::Mat &image, bool down)
{
    const Detector detector(config, image);
    cv::Mat out(image.size(), CV_16S, cv::Scalar(7));
    int16_t *to = out.ptr<int16_t>();
    if (fovea_edges_gradient(detector.edges, &detector.view, down ? nullptr : to,
                             down ? to : nullptr, out.cols) != FOVEA_OK)
        std::printf("FAILED gradient\n");
    return out;
}

bool same(const char *what, const std::string &name, const cv::Mat &expected, const cv::Mat &found)
{
    cv::Mat different;
    cv::compare(expected, found, different, cv::CMP_NE);
    const int count = cv::countNonZero(different);
    if (count == 0) return true;
    cv::Point at;
    cv::minMaxLoc(different, nullptr, nullptr, nullptr, &at);
    std::printf("FAILED %s, %s %d x %d, kernels %s: %d pixels differ, the first at (%d, %d)\n",
                what, name.c_str(), expected.cols, expected.rows, std::getenv("FOVEA_CPU"), count,
                at.x, at.y);
    return false;
}

bool check_gradients(const std::string &name, const cv::Mat &image)
{
    cv::Mat expected;
    bool good = true;
    for (int down = 0; down < 2; down++) {
        cv::Sobel(image, expected, CV_16S, 1 - down, down);
        good = same(down ? "Sobel y" : "Sobel x", name, expected,
                    gradient(config_of(FOVEA_EDGES_SOBEL), image, down)) &&
               good;
        cv::Scharr(image, expected, CV_16S, 1 - down, down);
        good = same(down ? "Scharr y" : "Scharr x", name, expected,
                    gradient(config_of(FOVEA_EDGES_SCHARR), image, down)) &&
               good;
    }
    for (uint32_t size : {1u, 3u}) {
        Config config = config_of(FOVEA_EDGES_LAPLACIAN);
        config.laplacian_size = size;
        cv::Laplacian(image, expected, CV_16S, static_cast<int>(size));
        good = same("Laplacian", name, expected, gradient(config, image, false)) && good;
        config.high = 40;
        cv::Mat above = cv::abs(expected) > 40;
        good = same("Laplacian above 40", name, above, bitmap(config, image)) && good;
    }
    return good;
}

bool check_canny(const std::string &name, const cv::Mat &image, long &edges)
{
    bool good = true;
    for (auto [low, high] : std::vector<std::pair<double, double>>{
             {50, 150}, {10, 20}, {0, 0}, {33.5, 99.7}, {20, 400}, {300, 1200}})
        for (bool squares : {false, true}) {
            Config config = config_of(FOVEA_EDGES_CANNY);
            config.low = low;
            config.high = high;
            config.norm = squares ? FOVEA_GRADIENT_L2 : FOVEA_GRADIENT_L1;
            cv::Mat expected;
            cv::Canny(image, expected, static_cast<double>(config.low),
                      static_cast<double>(config.high), 3, squares);
            edges += cv::countNonZero(expected);
            char what[64];
            std::snprintf(what, sizeof what, "Canny %g %g %s", low, high, squares ? "L2" : "L1");
            good = same(what, name, expected, bitmap(config, image)) && good;
        }
    return good;
}

} // namespace

int main(int argc, char **argv)
{
    const std::vector<std::string> names = images_of(argc, argv, 4);
    if (names.empty()) return argc > 1 ? 1 : 0; /* named as skipped, or nothing in FOLDER */
    bool good = true;
    int count = 0, sets = 0;
    long edges = 0;
    for (int set = 0; set < FV_CPU_SET_COUNT; set++) {
        struct fv_kernels kernels;
        fv_kernels_init(&kernels, static_cast<enum fv_cpu_set>(set));
        if (kernels.set != set) continue;
        setenv("FOVEA_CPU", fv_cpu_set_name(kernels.set), 1);
        sets++;
        for (const std::string &name : names) {
            const cv::Mat image = cv::imread(name, cv::IMREAD_GRAYSCALE);
            for (cv::Size size : {image.size(), cv::Size(331, 217), cv::Size(64, 255)}) {
                if (size.width > image.cols || size.height > image.rows || size.width < 64)
                    continue;
                const cv::Mat part =
                    image(cv::Rect(image.cols - size.width, 0, size.width, size.height)).clone();
                good = check_gradients(name, part) && check_canny(name, part, edges) && good;
                count++;
            }
        }
    }
    std::printf("%d images, %d kernel sets, %ld pixels of edges\n", count, sets, edges);
    return good && edges > 0 ? 0 : 1;
}

/* Rows of the image room: preprocessing. */
#include "bench/bench.h"
#include "bench/memory.h"

#include <cmath>

#include <opencv2/imgproc.hpp>

#include "image/preprocess.h"

using bench::Input;
using bench::Run;

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

struct Chain {
    struct fv_preprocess chain = {};
    std::unique_ptr<bench::Block> block;
    cv::Mat out;

    Chain(const Config &config, const cv::Mat &image) : out(image.size(), CV_8U)
    {
        block = std::make_unique<bench::Block>([&](struct fv_arena *arena) {
            fv_preprocess_carve(&chain, &config, image.cols, image.rows, arena);
        });
        fv_preprocess_prepare(&chain);
    }
};

std::function<Run(const Input &, const struct fv_kernels &)> ours(const Config &config)
{
    return [config](const Input &input, const struct fv_kernels &kernels) -> Run {
        auto made = std::make_shared<Chain>(config, input.image);
        const cv::Mat image = input.image;
        return [=] {
            const struct fv_plane in = bench::plane(image), out = bench::plane(made->out);
            fv_preprocess_run(&made->chain, &kernels, &in, &out);
        };
    };
}

std::function<Run(const Input &)> theirs(const std::function<void(const cv::Mat &, cv::Mat &)> &f)
{
    return [f](const Input &input) -> Run {
        auto out = std::make_shared<cv::Mat>(input.image.size(), CV_8U);
        const cv::Mat image = input.image;
        return [=] { f(image, *out); };
    };
}

Config gaussian(uint32_t size)
{
    Config config = config_of(FOVEA_OPERATION_DENOISE);
    config.denoise_size = size;
    return config;
}

Config denoise(enum fovea_denoise_method method)
{
    Config config = config_of(FOVEA_OPERATION_DENOISE);
    config.denoise_method = method;
    return config;
}

Config gamma_of(double gamma)
{
    Config config = config_of(FOVEA_OPERATION_GAMMA);
    config.gamma = gamma;
    return config;
}

void blur(const cv::Mat &in, cv::Mat &out, int size)
{
    cv::GaussianBlur(in, out, cv::Size(size, size), 0);
}

const bench::Stage gaussian3("preprocess, Gaussian 3", "752x480", "GaussianBlur 3x3",
                             ours(gaussian(3)),
                             theirs([](const cv::Mat &in, cv::Mat &out) { blur(in, out, 3); }));
const bench::Stage gaussian5("preprocess, Gaussian 5", "752x480", "GaussianBlur 5x5",
                             ours(gaussian(5)),
                             theirs([](const cv::Mat &in, cv::Mat &out) { blur(in, out, 5); }));
const bench::Stage gaussian7("preprocess, Gaussian 7", "752x480", "GaussianBlur 7x7",
                             ours(gaussian(7)),
                             theirs([](const cv::Mat &in, cv::Mat &out) { blur(in, out, 7); }));
const bench::Stage
    median("preprocess, median 3", "752x480", "medianBlur 3", ours(denoise(FOVEA_DENOISE_MEDIAN)),
           theirs([](const cv::Mat &in, cv::Mat &out) { cv::medianBlur(in, out, 3); }));
const bench::Stage bilateral("preprocess, bilateral 5", "752x480", "bilateralFilter 5",
                             ours(denoise(FOVEA_DENOISE_BILATERAL)),
                             theirs([](const cv::Mat &in, cv::Mat &out) {
                                 cv::bilateralFilter(in, out, 5, 25, 2);
                             }));
const bench::Stage
    equalize("preprocess, equalization", "752x480", "equalizeHist",
             ours(config_of(FOVEA_OPERATION_HISTOGRAM_EQUALIZATION)),
             theirs([](const cv::Mat &in, cv::Mat &out) { cv::equalizeHist(in, out); }));
const bench::Stage contrast("preprocess, CLAHE 8x8", "752x480", "CLAHE::apply",
                            ours(config_of(FOVEA_OPERATION_CONTRAST_ENHANCEMENT)),
                            [](const Input &input) -> Run {
                                auto out = std::make_shared<cv::Mat>(input.image.size(), CV_8U);
                                const cv::Mat image = input.image;
                                const cv::Ptr<cv::CLAHE> clahe = cv::createCLAHE(2, cv::Size(8, 8));
                                return [=] { clahe->apply(image, *out); };
                            });
const bench::Stage normalize("preprocess, normalize range", "752x480", "normalize MINMAX",
                             ours(config_of(FOVEA_OPERATION_NORMALIZE)),
                             theirs([](const cv::Mat &in, cv::Mat &out) {
                                 cv::normalize(in, out, 0, 255, cv::NORM_MINMAX);
                             }));
const bench::Stage gamma_table("preprocess, gamma", "752x480", "LUT", ours(gamma_of(0.45)),
                               [](const Input &input) -> Run {
                                   auto out = std::make_shared<cv::Mat>(input.image.size(), CV_8U);
                                   cv::Mat table(1, 256, CV_8U);
                                   for (int i = 0; i < 256; i++)
                                       table.at<uint8_t>(i) = cv::saturate_cast<uint8_t>(
                                           255 * std::pow(i / 255.0, 0.45));
                                   const cv::Mat image = input.image;
                                   return [=] { cv::LUT(image, table, *out); };
                               });
const bench::Stage sharpen("preprocess, sharpen 5", "752x480", "GaussianBlur, addWeighted",
                           ours(config_of(FOVEA_OPERATION_SHARPEN)),
                           theirs([](const cv::Mat &in, cv::Mat &out) {
                               blur(in, out, 5);
                               cv::addWeighted(in, 1.5, out, -0.5, 0, out);
                           }));

} // namespace

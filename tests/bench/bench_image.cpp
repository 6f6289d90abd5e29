/* Rows of the image room: pyramid and grey conversion. */
#include "bench/bench.h"
#include "bench/memory.h"

#include <opencv2/imgproc.hpp>

#include "image/pyramid.h"

using bench::Input;
using bench::Run;

static const bench::Stage pyramid(
    "pyramid, 8 levels", "752x480", "resize linear, 7 times",
    [](const Input &input, const struct fv_kernels &kernels) -> Run {
        auto made = std::make_shared<bench::Pyramid>(input.image, 8);
        return [made, kernels] { fv_pyramid_build(&made->pyramid, &kernels, &made->frame); };
    },
    [](const Input &input) -> Run {
        auto levels = std::make_shared<std::vector<cv::Mat>>(8);
        const cv::Mat image = input.image;
        const bench::Pyramid sizes(image, 8);
        for (int i = 1; i < 8; i++)
            (*levels)[i].create(sizes.pyramid.level[i].height, sizes.pyramid.level[i].width, CV_8U);
        return [levels, image] {
            image.copyTo((*levels)[0]);
            for (int i = 1; i < 8; i++)
                cv::resize((*levels)[i - 1], (*levels)[i], (*levels)[i].size(), 0, 0,
                           cv::INTER_LINEAR);
        };
    });

/* The peer of a grey conversion: OpenCV's cvtColor of the image in as many channels, into a made
 * image. */
static Run convert(const Input &input, int channels, int code)
{
    cv::Mat source, grey(input.image.size(), CV_8U);
    cv::merge(std::vector<cv::Mat>(static_cast<size_t>(channels), input.image), source);
    return [source, grey, code]() mutable { cv::cvtColor(source, grey, code); };
}

static const bench::Peer mix("grey_mix_u8", "cvtColor RGB2GRAY", [](const Input &input) {
    return convert(input, 3, cv::COLOR_RGB2GRAY);
});
static const bench::Peer pick("grey_pick_u8", "cvtColor YUV2GRAY_YUY2", [](const Input &input) {
    return convert(input, 2, cv::COLOR_YUV2GRAY_YUY2);
});
static const bench::Peer bayer("grey_bayer_u8", "cvtColor BayerBG2GRAY", [](const Input &input) {
    return convert(input, 1, cv::COLOR_BayerBG2GRAY);
});
static const bench::Peer shift("grey_shift_u16", "Mat::convertTo", [](const Input &input) -> Run {
    cv::Mat source, grey(input.image.size(), CV_8U);
    input.image.convertTo(source, CV_16U, 4);
    return [source, grey]() mutable { source.convertTo(grey, CV_8U, 0.25); };
});

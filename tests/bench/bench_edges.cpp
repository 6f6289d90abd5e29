/* Rows of the image room: edges. */
#include "bench/bench.h"
#include "bench/memory.h"

#include <cstdlib>
#include <vector>

#include <opencv2/imgproc.hpp>

#include "fovea/edges.h"
#include "fovea/segments.h"

using bench::Input;
using bench::Run;

namespace
{

struct Detector {
    std::unique_ptr<void, void (*)(void *)> memory{nullptr, std::free};
    struct fovea_edges *edges = nullptr;
    struct fovea_image view = {};
    cv::Mat image;
    std::vector<int16_t> out;
    std::vector<uint8_t> bits;

    Detector(enum fovea_edge_method method, const cv::Mat &grey, const struct fv_kernels &kernels)
        : image(grey), out(grey.total()), bits(grey.total())
    {
        struct fovea_edges_config config;
        fovea_edges_config_default(&config);
        config.method = method;
        setenv("FOVEA_CPU", fv_cpu_set_name(kernels.set), 1);
        const size_t bytes = fovea_edges_size(&config, grey.cols, grey.rows, nullptr);
        memory.reset(std::aligned_alloc(64, (bytes + 63) / 64 * 64));
        fovea_edges_init(&edges, &config, grey.cols, grey.rows, memory.get(), bytes, nullptr);
        unsetenv("FOVEA_CPU");
        view = {image.data,        image.cols,
                image.rows,        static_cast<int32_t>(image.step),
                FOVEA_PIXEL_GREY8, image.step * static_cast<size_t>(image.rows)};
    }
};

std::function<Run(const Input &, const struct fv_kernels &)> gradient(enum fovea_edge_method method)
{
    return [=](const Input &input, const struct fv_kernels &kernels) -> Run {
        auto made = std::make_shared<Detector>(method, input.image, kernels);
        return [=] {
            fovea_edges_gradient(made->edges, &made->view, made->out.data(), nullptr,
                                 made->image.cols);
        };
    };
}

std::function<Run(const Input &)> theirs(const std::function<void(const cv::Mat &, cv::Mat &)> &f)
{
    return [f](const Input &input) -> Run {
        auto out = std::make_shared<cv::Mat>();
        const cv::Mat image = input.image;
        return [=] { f(image, *out); };
    };
}

const bench::Stage
    sobel("edges, Sobel x", "752x480", "Sobel 16S", gradient(FOVEA_EDGES_SOBEL),
          theirs([](const cv::Mat &in, cv::Mat &out) { cv::Sobel(in, out, CV_16S, 1, 0); }));
const bench::Stage
    scharr("edges, Scharr x", "752x480", "Scharr 16S", gradient(FOVEA_EDGES_SCHARR),
           theirs([](const cv::Mat &in, cv::Mat &out) { cv::Scharr(in, out, CV_16S, 1, 0); }));
const bench::Stage
    laplacian("edges, Laplacian", "752x480", "Laplacian 16S", gradient(FOVEA_EDGES_LAPLACIAN),
              theirs([](const cv::Mat &in, cv::Mat &out) { cv::Laplacian(in, out, CV_16S); }));
const bench::Stage canny(
    "edges, Canny 50 150", "752x480", "Canny",
    [](const Input &input, const struct fv_kernels &kernels) -> Run {
        auto made = std::make_shared<Detector>(FOVEA_EDGES_CANNY, input.image, kernels);
        return [=] {
            fovea_edges_run(made->edges, &made->view, made->bits.data(),
                            (made->image.cols + 7) / 8);
        };
    },
    theirs([](const cv::Mat &in, cv::Mat &out) { cv::Canny(in, out, 50, 150); }));

/* The peer is the line segment detector of OpenCV with its defaults. */
const bench::Stage lines(
    "line segments", "752x480", "LineSegmentDetector",
    [](const Input &input, const struct fv_kernels &kernels) -> Run {
        struct Made {
            std::unique_ptr<void, void (*)(void *)> memory{nullptr, std::free};
            struct fovea_segments *segments = nullptr;
            struct fovea_image view = {};
            cv::Mat image;
        };
        auto made = std::make_shared<Made>();
        struct fovea_segments_config config;
        fovea_segments_config_default(&config);
        made->image = input.image;
        const cv::Mat &grey = made->image;
        setenv("FOVEA_CPU", fv_cpu_set_name(kernels.set), 1);
        const size_t bytes = fovea_segments_size(&config, grey.cols, grey.rows, nullptr);
        made->memory.reset(std::aligned_alloc(64, (bytes + 63) / 64 * 64));
        fovea_segments_init(&made->segments, &config, grey.cols, grey.rows, made->memory.get(),
                            bytes, nullptr);
        unsetenv("FOVEA_CPU");
        made->view = {grey.data,         grey.cols,
                      grey.rows,         static_cast<int32_t>(grey.step),
                      FOVEA_PIXEL_GREY8, grey.step * static_cast<size_t>(grey.rows)};
        return [made] {
            struct fovea_segments_found found;
            fovea_segments_run(made->segments, &made->view, &found);
        };
    },
    [](const Input &input) -> Run {
        auto detector = cv::createLineSegmentDetector();
        const cv::Mat image = input.image;
        return [detector, image] {
            std::vector<cv::Vec4f> found;
            detector->detect(image, found);
        };
    });

} // namespace

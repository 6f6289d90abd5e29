/* Rows of the features room: corners and their spread. */
#include "bench/bench.h"
#include "bench/memory.h"

#include <cstdlib>
#include <memory>

#include <opencv2/features2d.hpp>

#include "features/fast.h"
#include "features/features.h"
#include "fovea/extract.h"

using bench::Input;
using bench::Run;

/* FAST on the raw frame, with suppression: threshold 20 as OpenCV's users mostly take it, and 7 as
 * in weak texture. */
static Run fast(const Input &input, const struct fv_kernels &kernels, int threshold)
{
    auto made = std::make_shared<bench::Pyramid>(input.image, 1);
    auto scratch = std::make_shared<struct fv_fast_scratch>();
    auto block = std::make_shared<bench::Block>(
        [&](struct fv_arena *arena) { fv_fast_carve(scratch.get(), input.image.cols, arena); });
    auto corners = std::make_shared<std::vector<struct fv_corner>>(input.image.total() / 4);
    fv_pyramid_build(&made->pyramid, &kernels, &made->frame);
    return [=] {
        (void)block; /* kept alive with the run */
        const struct fv_plane &level = made->pyramid.level[0];
        struct fv_fast scan;
        size_t count = 0;
        fv_fast_begin(&scan, &kernels, &level, 3, threshold, scratch.get());
        while (fv_fast_next(&scan))
            for (int32_t i = 0; i < scan.count; i++)
                (*corners)[count++] = {scan.columns[i], static_cast<uint16_t>(scan.y), 0,
                                       scan.scores[scan.columns[i]]};
    };
}

static Run fast_opencv(const Input &input, int threshold)
{
    const cv::Mat image = input.image;
    auto points = std::make_shared<std::vector<cv::KeyPoint>>();
    return [=] { cv::FAST(image, *points, threshold, true, cv::FastFeatureDetector::TYPE_9_16); };
}

static const bench::Stage fast_20(
    "FAST, threshold 20, suppression", "752x480", "FAST",
    [](const Input &input, const struct fv_kernels &kernels) { return fast(input, kernels, 20); },
    [](const Input &input) { return fast_opencv(input, 20); });

static const bench::Stage fast_7(
    "FAST, threshold 7, suppression", "752x480", "FAST",
    [](const Input &input, const struct fv_kernels &kernels) { return fast(input, kernels, 7); },
    [](const Input &input) { return fast_opencv(input, 7); });

static const bench::Stage features(
    "features, 1000 on 8 levels, spread", "752x480", "",
    [](const Input &input, const struct fv_kernels &kernels) -> Run {
        auto made = std::make_shared<bench::Pyramid>(input.image, 8);
        auto found = std::make_shared<struct fv_features>();
        const struct fovea_features_config config = {1000, 8, 20, 7, 8, FOVEA_FEATURES_FAST};
        auto block = std::make_shared<bench::Block>([&](struct fv_arena *arena) {
            fv_features_carve(found.get(), &config, &made->pyramid, arena);
        });
        fv_pyramid_build(&made->pyramid, &kernels, &made->frame);
        return [=] {
            (void)block;
            fv_features_find(found.get(), &kernels, &made->pyramid, nullptr, 1000);
        };
    },
    nullptr);

/* An extractor of a method, and OpenCV's. */
static Run extract(const Input &input, const struct fv_kernels &kernels,
                   enum fovea_feature_method method, uint32_t count)
{
    struct fovea_extract_config config;
    struct fovea_extract *extract = nullptr;
    const cv::Mat image = input.image;
    fovea_extract_config_default(&config, method);
    config.count_max = count;
    setenv("FOVEA_CPU", fv_cpu_set_name(kernels.set), 1);
    const size_t bytes = fovea_extract_size(&config, image.cols, image.rows, nullptr);
    const std::shared_ptr<void> memory(std::aligned_alloc(64, (bytes + 63) / 64 * 64), std::free);
    fovea_extract_init(&extract, &config, image.cols, image.rows, memory.get(), bytes, nullptr);
    unsetenv("FOVEA_CPU");
    return [=] {
        (void)memory; /* kept alive with the run */
        const struct fovea_image view = {
            image.data,        image.cols,
            image.rows,        static_cast<int32_t>(image.step),
            FOVEA_PIXEL_GREY8, image.step * static_cast<size_t>(image.rows)};
        struct fovea_extracted found;
        fovea_extract_run(extract, &view, nullptr, &found);
    };
}

static const bench::Stage sift(
    "SIFT, 500 features", "752x480", "SIFT",
    [](const Input &input, const struct fv_kernels &kernels) {
        return extract(input, kernels, FOVEA_FEATURES_SIFT, 500);
    },
    [](const Input &input) -> Run {
        const cv::Mat image = input.image;
        const auto detector = cv::SIFT::create(500);
        return [=] {
            std::vector<cv::KeyPoint> points;
            cv::Mat descriptors;
            detector->detectAndCompute(image, cv::noArray(), points, descriptors);
        };
    });

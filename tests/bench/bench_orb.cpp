/* Rows of the features room: ORB and matching. */
#include "bench/bench.h"
#include "bench/memory.h"

#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>

#include "features/features.h"
#include "features/orb.h"

using bench::Input;
using bench::Run;

namespace
{

/* From the frame to 1000 described features. */
struct Extractor {
    bench::Pyramid made;
    struct fv_kernels kernels;
    struct fv_features features = {};
    struct fv_orb orb = {};
    std::unique_ptr<bench::Block> block;

    Extractor(const cv::Mat &image, const struct fv_kernels &set) : made(image, 8), kernels(set)
    {
        const struct fovea_features_config config = {1000, 8, 20, 7, 8, FOVEA_FEATURES_FAST};
        block = std::make_unique<bench::Block>([&](struct fv_arena *arena) {
            fv_features_carve(&features, &config, &made.pyramid, arena);
            fv_orb_carve(&orb, 1000, &made.pyramid, arena);
        });
    }
    void run()
    {
        fv_pyramid_build(&made.pyramid, &kernels, &made.frame);
        fv_features_find(&features, &kernels, &made.pyramid, nullptr, 1000);
        describe();
    }
    void describe()
    {
        fv_orb_describe(&orb, &kernels, &made.pyramid, features.corners, features.count);
    }
};

Run orb_opencv(const Input &input)
{
    const cv::Mat image = input.image;
    const cv::Ptr<cv::ORB> orb = cv::ORB::create(1000);
    return [=] {
        std::vector<cv::KeyPoint> points;
        cv::Mat descriptors;
        orb->detectAndCompute(image, cv::noArray(), points, descriptors);
    };
}

cv::Mat random_descriptors(int seed)
{
    cv::Mat all(1000, FV_DESCRIPTOR_BYTES, CV_8U);
    cv::RNG(static_cast<uint64_t>(seed)).fill(all, cv::RNG::UNIFORM, 0, 256);
    return all;
}

/* Those of 1000 features of an image, filled up at random where it has fewer. */
cv::Mat real_descriptors(const cv::Mat &image)
{
    struct fv_kernels kernels;
    fv_kernels_init(&kernels, fv_cpu_best(fv_cpu_detect()));
    Extractor extractor(image, kernels);
    extractor.run();
    cv::Mat all = random_descriptors(3);
    const cv::Mat found(static_cast<int>(extractor.features.count), FV_DESCRIPTOR_BYTES, CV_8U,
                        extractor.orb.descriptors);
    found.copyTo(all.rowRange(0, found.rows));
    return all;
}

Run matching_opencv(const cv::Mat &queries, const cv::Mat &trains)
{
    return [=] {
        std::vector<std::vector<cv::DMatch>> matches;
        cv::BFMatcher(cv::NORM_HAMMING).knnMatch(queries, trains, matches, 2);
    };
}

const bench::Stage detect_and_describe(
    "ORB, detect and describe 1000 on 8 levels", "752x480", "ORB::detectAndCompute",
    [](const Input &input, const struct fv_kernels &kernels) -> Run {
        auto extractor = std::make_shared<Extractor>(input.image, kernels);
        return [=] { extractor->run(); };
    },
    orb_opencv);

const bench::Stage describe(
    "ORB, describe 1000 found corners", "752x480", "ORB::compute",
    [](const Input &input, const struct fv_kernels &kernels) -> Run {
        auto extractor = std::make_shared<Extractor>(input.image, kernels);
        extractor->run();
        return [=] { extractor->describe(); };
    },
    [](const Input &input) -> Run {
        const cv::Mat image = input.image;
        const cv::Ptr<cv::ORB> orb = cv::ORB::create(1000);
        std::vector<cv::KeyPoint> found;
        orb->detect(image, found);
        return [=] {
            std::vector<cv::KeyPoint> points = found;
            cv::Mat descriptors;
            orb->compute(image, points, descriptors);
        };
    });

const bench::Stage matching(
    "Hamming, two nearest of 1000 x 1000", "256 bit", "BFMatcher::knnMatch",
    [](const Input &input, const struct fv_kernels &kernels) -> Run {
        const cv::Mat queries = real_descriptors(input.image),
                      trains = real_descriptors(input.next);
        auto nearest = std::make_shared<std::vector<uint32_t>>(1000),
             second = std::make_shared<std::vector<uint32_t>>(1000);
        return [=] {
            kernels.hamming_two_u8(nearest->data(), second->data(), queries.data, 1000, trains.data,
                                   1000);
        };
    },
    [](const Input &input) {
        return matching_opencv(real_descriptors(input.image), real_descriptors(input.next));
    });

const bench::Peer blur7("blur7_row_u8", "GaussianBlur 7x7", [](const Input &input) -> Run {
    const cv::Mat image = input.image;
    return [=] {
        cv::Mat smooth;
        cv::GaussianBlur(image, smooth, cv::Size(7, 7), 2, 2, cv::BORDER_REFLECT_101);
    };
});

const bench::Peer hamming_two("hamming_two_u8", "BFMatcher::knnMatch", [](const Input &) {
    return matching_opencv(random_descriptors(1), random_descriptors(2));
});

} // namespace

/* FAST corners and scores equal OpenCV's FAST with suppression, on every image of the data folder
 * (or of opencv-doc), over thresholds 5 to 60, with every kernel set of this processor.
 *
 *   test_fast_opencv [FOLDER [LIMIT]]     default: up to 60 images of $FOVEA_DATA; LIMIT 0: all of
 *                                         them */
#include "oracle/images.h"

#include <cstdio>
#include <cstring>
#include <vector>

#include <opencv2/features2d.hpp>
#include <opencv2/imgcodecs.hpp>

#include "features/fast.h"
#include "image/pyramid.h"

namespace
{

struct Corner {
    int x, y, score;
    bool operator==(const Corner &o) const
    {
        return x == o.x && y == o.y && score == o.score;
    }
};

std::vector<Corner> ours(const struct fv_kernels &kernels, const cv::Mat &image, int threshold)
{
    const int stride = (image.cols + FV_LEVEL_SLACK_BYTES + 63) / 64 * 64;
    std::vector<uint8_t> pixels(static_cast<size_t>(stride) * image.rows);
    for (int y = 0; y < image.rows; y++)
        std::memcpy(&pixels[static_cast<size_t>(y) * stride], image.ptr(y), image.cols);

    struct fv_arena arena;
    struct fv_fast_scratch scratch;
    fv_arena_count(&arena);
    fv_fast_carve(&scratch, image.cols, &arena);
    std::vector<uint8_t> memory(arena.used + 64);
    auto base = reinterpret_cast<uintptr_t>(memory.data());
    fv_arena_init(&arena, memory.data() + (64 - base % 64) % 64, memory.size() - 64);
    fv_fast_carve(&scratch, image.cols, &arena);

    std::vector<Corner> corners;
    struct fv_fast fast;
    const struct fv_plane plane = {const_cast<uint8_t *>(pixels.data()), image.cols, image.rows,
                                   stride};
    fv_fast_begin(&fast, &kernels, &plane, FV_FAST_BORDER_MIN_PX, threshold, &scratch);
    while (fv_fast_next(&fast))
        for (int i = 0; i < fast.count; i++)
            corners.push_back({fast.columns[i], fast.y, fast.scores[fast.columns[i]]});
    return corners;
}

std::vector<Corner> theirs(const cv::Mat &image, int threshold)
{
    std::vector<cv::KeyPoint> points;
    std::vector<Corner> corners;
    cv::FAST(image, points, threshold, true, cv::FastFeatureDetector::TYPE_9_16);
    for (const auto &p : points)
        corners.push_back(
            {static_cast<int>(p.pt.x), static_cast<int>(p.pt.y), static_cast<int>(p.response)});
    return corners;
}

bool compare(const char *set, const std::string &name, const cv::Mat &image, int threshold,
             const struct fv_kernels &kernels, const std::vector<Corner> &expected)
{
    const std::vector<Corner> found = ours(kernels, image, threshold);
    if (found == expected) return true;
    std::printf("FAILED %s, threshold %d, kernels %s: OpenCV finds %zu corners, found %zu\n",
                name.c_str(), threshold, set, expected.size(), found.size());
    for (size_t i = 0; i < std::min(found.size(), expected.size()); i++) {
        if (found[i] == expected[i]) continue;
        std::printf("  first difference: OpenCV (%d, %d) score %d, found (%d, %d) score %d\n",
                    expected[i].x, expected[i].y, expected[i].score, found[i].x, found[i].y,
                    found[i].score);
        break;
    }
    return false;
}

} // namespace

int main(int argc, char **argv)
{
    const std::vector<std::string> names = images_of(argc, argv, 60);

    std::vector<std::pair<const char *, struct fv_kernels>> sets;
    for (int set = 0; set < FV_CPU_SET_COUNT; set++) {
        struct fv_kernels kernels;
        fv_kernels_init(&kernels, static_cast<enum fv_cpu_set>(set));
        if (kernels.set == set && set != FV_CPU_C)
            sets.push_back({fv_cpu_set_name(kernels.set), kernels});
    }
    struct fv_kernels plain;
    fv_kernels_init(&plain, FV_CPU_C);

    size_t images = 0, corners = 0;
    for (const auto &name : names) {
        const cv::Mat image = cv::imread(name, cv::IMREAD_GRAYSCALE);
        if (image.empty() || image.cols < 16 || image.rows < 16) continue;
        images++;
        for (int threshold = 5; threshold <= 60; threshold += threshold < 10 ? 1 : 10) {
            const std::vector<Corner> expected = theirs(image, threshold);
            corners += expected.size();
            for (const auto &set : sets)
                if (!compare(set.first, name, image, threshold, set.second, expected)) return 1;
            if (images % 20 == 1 && threshold % 20 == 0 &&
                !compare("c", name, image, threshold, plain, expected))
                return 1;
        }
    }
    /* Noise has more corners than any photograph. */
    cv::RNG random(5);
    cv::Mat noise(97, 131, CV_8U);
    for (int round = 0; round < 20; round++) {
        random.fill(noise, cv::RNG::UNIFORM, 0, round % 2 ? 256 : 40);
        for (int threshold = 5; threshold <= 60; threshold += 5) {
            const std::vector<Corner> expected = theirs(noise, threshold);
            corners += expected.size();
            if (!compare("c", "noise", noise, threshold, plain, expected)) return 1;
            for (const auto &set : sets)
                if (!compare(set.first, "noise", noise, threshold, set.second, expected)) return 1;
        }
    }
    std::printf("%zu images, %zu corners of OpenCV, all equal in place and score\n", images,
                corners);
    return corners > 1000 ? 0 : 1;
}

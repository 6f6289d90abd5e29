/* Robustness of feature methods: photographs are changed by one thing at a time, more and more, and
 * the features of both are compared (tests/oracle/feature_score.h). Writes a table as Markdown and
 * a picture as SVG.
 *
 *   evaluate-features TABLE.md PICTURE.svg IMAGE...     500 features of each image */
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "fovea/extract.h"
#include "oracle/feature_score.h"

namespace
{

constexpr int COUNT = 500, METHODS = FOVEA_FEATURE_METHOD_COUNT;

FeatureSet extract(enum fovea_feature_method method, const cv::Mat &image, bool binary)
{
    struct fovea_extract_config config;
    struct fovea_extract *extractor = nullptr;
    struct fovea_extracted found = {};
    fovea_extract_config_default(&config, method);
    config.count_max = COUNT;
    const size_t bytes = fovea_extract_size(&config, image.cols, image.rows, nullptr);
    const std::unique_ptr<void, void (*)(void *)> memory(
        std::aligned_alloc(64, (bytes + 63) / 64 * 64), std::free);
    fovea_extract_init(&extractor, &config, image.cols, image.rows, memory.get(), bytes, nullptr);
    const struct fovea_image view = {
        image.data,        image.cols,
        image.rows,        static_cast<int32_t>(image.step),
        FOVEA_PIXEL_GREY8, image.step * static_cast<size_t>(image.rows)};
    fovea_extract_run(extractor, &view, nullptr, &found);
    FeatureSet set;
    for (uint32_t i = 0; i < found.count; i++)
        set.points.emplace_back(found.features[i].x_px, found.features[i].y_px);
    set.descriptors =
        cv::Mat(static_cast<int>(found.count), static_cast<int>(found.descriptor_bytes), CV_8U,
                const_cast<uint8_t *>(found.descriptors))
            .clone();
    if (!binary) set.descriptors.convertTo(set.descriptors, CV_32F);
    return set;
}

/* One thing that changes, with its values; `H` takes points of the image to the changed one. */
struct Change {
    std::string name;
    std::vector<double> values;
    std::function<cv::Mat(const cv::Mat &, double, cv::Matx33d &H)> make;
};

cv::Mat warp(const cv::Mat &image, const cv::Matx33d &H)
{
    cv::Mat out;
    cv::warpPerspective(image, out, H, image.size(), cv::INTER_AREA, cv::BORDER_REFLECT);
    return out;
}

/* About the middle of the image. */
cv::Matx33d centred(const cv::Mat &image, const cv::Matx33d &H)
{
    const double x = image.cols / 2., y = image.rows / 2.;
    return cv::Matx33d(1, 0, x, 0, 1, y, 0, 0, 1) * H * cv::Matx33d(1, 0, -x, 0, 1, -y, 0, 0, 1);
}

cv::Mat turned(const cv::Mat &image, double degrees, cv::Matx33d &H)
{
    const double a = degrees * CV_PI / 180, c = std::cos(a), s = std::sin(a);
    H = centred(image, {c, -s, 0, s, c, 0, 0, 0, 1});
    return warp(image, H);
}

cv::Mat scaled(const cv::Mat &image, double times, cv::Matx33d &H)
{
    H = centred(image, {times, 0, 0, 0, times, 0, 0, 0, 1});
    cv::Mat in = image;
    if (times < 1) cv::GaussianBlur(image, in, {}, .5 * std::sqrt(1 / (times * times) - 1));
    return warp(in, H);
}

/* A plane that is turned about its vertical axis, seen by a camera of 1.2 widths. */
cv::Mat tilted(const cv::Mat &image, double degrees, cv::Matx33d &H)
{
    const double a = degrees * CV_PI / 180, f = 1.2 * image.cols;
    H = centred(image, {std::cos(a), 0, 0, 0, 1, 0, std::sin(a) / f, 0, 1});
    return warp(image, H);
}

std::vector<Change> changes()
{
    return {
        {"brightness, times",
         {.25, .5, 1.5, 2, 3},
         [](const cv::Mat &image, double times, cv::Matx33d &) {
             cv::Mat out;
             image.convertTo(out, CV_8U, times);
             return out;
         }},
        {"blur, sigma in pixels",
         {.5, 1, 1.5, 2, 3, 4},
         [](const cv::Mat &image, double sigma, cv::Matx33d &) {
             cv::Mat out;
             cv::GaussianBlur(image, out, {}, sigma);
             return out;
         }},
        {"noise, grey levels",
         {2, 5, 10, 20, 30},
         [](const cv::Mat &image, double sigma, cv::Matx33d &) {
             cv::Mat noise(image.size(), CV_16S), out;
             cv::RNG random(1);
             random.fill(noise, cv::RNG::NORMAL, 0, sigma);
             cv::add(image, noise, out, cv::noArray(), CV_8U);
             return out;
         }},
        {"rotation, degrees", {5, 10, 20, 30, 45, 90, 135, 180}, turned},
        {"scale, times", {.5, .6, .7, .8, .9, 1.2, 1.5, 2}, scaled},
        {"viewpoint, degrees", {10, 20, 30, 40, 50, 60}, tilted},
        {"JPEG, quality",
         {80, 50, 30, 20, 10, 5},
         [](const cv::Mat &image, double quality, cv::Matx33d &) {
             std::vector<uint8_t> bytes;
             cv::imencode(".jpg", image, bytes,
                          {cv::IMWRITE_JPEG_QUALITY, static_cast<int>(quality)});
             return cv::imdecode(bytes, cv::IMREAD_GRAYSCALE);
         }},
    };
}

/* Means over the images: [change][value][method]. */
using Scores = std::vector<std::vector<std::vector<FeatureScore>>>;

Scores evaluate(const std::vector<Change> &list, const std::vector<cv::Mat> &images)
{
    Scores scores;
    for (const auto &change : list)
        scores.emplace_back(change.values.size(), std::vector<FeatureScore>(METHODS));
    for (int m = 0; m < METHODS; m++) {
        const auto method = static_cast<enum fovea_feature_method>(m);
        const bool binary = method != FOVEA_FEATURES_SIFT && method != FOVEA_FEATURES_SURF;
        for (const cv::Mat &image : images) {
            const FeatureSet before = extract(method, image, binary);
            for (size_t c = 0; c < list.size(); c++)
                for (size_t v = 0; v < list[c].values.size(); v++) {
                    cv::Matx33d H = cv::Matx33d::eye();
                    const cv::Mat changed = list[c].make(image, list[c].values[v], H);
                    const FeatureScore s = score(before, extract(method, changed, binary),
                                                 binary ? cv::NORM_HAMMING : cv::NORM_L2, H,
                                                 image.size(), image.size());
                    const auto count = static_cast<double>(images.size());
                    scores[c][v][static_cast<size_t>(m)].repeatability += s.repeatability / count;
                    scores[c][v][static_cast<size_t>(m)].matching += s.matching / count;
                }
        }
    }
    return scores;
}

std::string text(const char *format, double value)
{
    char out[64];
    std::snprintf(out, sizeof out, format, value);
    return out;
}

const char *name_of(int method)
{
    return fovea_feature_method_name(static_cast<enum fovea_feature_method>(method));
}

void write_table(const std::string &path, const std::vector<Change> &list, const Scores &scores,
                 size_t images)
{
    std::ofstream out(path);
    out << "# Robustness of features\n\nMeans over " << images << " photographs, " << COUNT
        << " features of each: matching score, and repeatability after it (features that have one of "
           "their own\nwithin 2.5 pixels in the changed image; mutual nearest neighbours that are "
           "right; both over the features that lie in both images).\nFAST, Harris and Shi-Tomasi "
           "are upright and of one scale, as by default. `make evaluate-features` writes this page.\n\n"
           "![Matching score over each change](features.svg)\n\n| change |";
    for (int m = 0; m < METHODS; m++)
        out << " " << name_of(m) << " |";
    out << "\n| --- |";
    for (int m = 0; m < METHODS; m++)
        out << " ---: |";
    out << "\n";
    for (size_t c = 0; c < list.size(); c++)
        for (size_t v = 0; v < list[c].values.size(); v++) {
            out << "| " << list[c].name << " " << text("%g", list[c].values[v]) << " |";
            for (const FeatureScore &s : scores[c][v])
                out << " " << text("%.2f", s.matching) << ", " << text("%.2f", s.repeatability)
                    << " |";
            out << "\n";
        }
}

/* A panel for each change, a line for each method. */
void write_picture(const std::string &path, const std::vector<Change> &list, const Scores &scores)
{
    static const char *const colours[] = {"#d62728", "#ff7f0e", "#1f77b4",
                                          "#2ca02c", "#9467bd", "#8c564b"};
    constexpr int WIDE = 230, HIGH = 170, LEFT = 34, TOP = 26;
    std::ofstream out(path);
    out << "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"" << 4 * WIDE << "\" height=\""
        << 2 * HIGH << "\" font-family=\"sans-serif\" font-size=\"10\">\n"
        << "<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n";
    for (size_t c = 0; c < list.size(); c++) {
        const int x0 = static_cast<int>(c % 4) * WIDE + LEFT,
                  y0 = static_cast<int>(c / 4) * HIGH + TOP;
        const int width = WIDE - LEFT - 12, height = HIGH - TOP - 22;
        const auto steps = static_cast<double>(list[c].values.size() - 1);
        out << "<text x=\"" << x0 << "\" y=\"" << y0 - 8 << "\" font-weight=\"bold\">"
            << list[c].name << "</text>\n";
        for (int i = 0; i <= 2; i++) {
            const int y = y0 + height - i * height / 2;
            out << "<path d=\"M" << x0 << " " << y << "h" << width
                << "\" stroke=\"#ddd\"/><text x=\"" << x0 - 4 << "\" y=\"" << y + 3
                << "\" text-anchor=\"end\">" << text("%.1f", i * .5) << "</text>\n";
        }
        for (size_t v = 0; v < list[c].values.size(); v++)
            out << "<text x=\"" << x0 + width * static_cast<double>(v) / steps << "\" y=\""
                << y0 + height + 14 << "\" text-anchor=\"middle\">" << text("%g", list[c].values[v])
                << "</text>\n";
        for (size_t m = 0; m < METHODS; m++) {
            out << "<polyline fill=\"none\" stroke-width=\"1.5\" stroke=\"" << colours[m % 6]
                << "\" points=\"";
            for (size_t v = 0; v < list[c].values.size(); v++)
                out << x0 + width * static_cast<double>(v) / steps << ","
                    << y0 + height * (1 - std::min(1., scores[c][v][m].matching)) << " ";
            out << "\"/>\n";
        }
    }
    for (int m = 0; m < METHODS; m++)
        out << "<text x=\"" << 3 * WIDE + LEFT << "\" y=\"" << HIGH + TOP + 16 * m << "\" fill=\""
            << colours[m % 6] << "\" font-weight=\"bold\">" << name_of(m) << "</text>\n";
    out << "<text x=\"" << 3 * WIDE + LEFT << "\" y=\"" << 2 * HIGH - 20 << "\">matching score, "
        << COUNT << " features</text>\n</svg>\n";
}

} // namespace

int main(int argc, char **argv)
{
    std::vector<cv::Mat> images;
    for (int i = 3; i < argc; i++) {
        images.push_back(cv::imread(argv[i], cv::IMREAD_GRAYSCALE));
        if (images.back().empty()) {
            std::fprintf(stderr, "%s: not a picture\n", argv[i]);
            return 2;
        }
    }
    if (images.empty()) {
        std::fprintf(stderr, "usage: evaluate-features TABLE.md PICTURE.svg IMAGE...\n");
        return 2;
    }
    cv::setNumThreads(1);
    const std::vector<Change> list = changes();
    const Scores scores = evaluate(list, images);
    write_table(argv[1], list, scores, images.size());
    write_picture(argv[2], list, scores);
    return 0;
}

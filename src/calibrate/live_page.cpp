#include "calibrate/live_page.h"

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <thread>

#include "calibrate/command.h"
#include "calibrate/html.h"
#include "calibrate/json_text.h"
#include "support/text.h"
#ifdef FV_CALIBRATE_PAGE
#include "web/pages.h"
#endif
extern "C" {
#include "support/picture.h"
#include "support/say.h"
}

namespace calibrate
{
namespace
{

constexpr int PICTURE_WIDTH_MAX = 640;
constexpr int64_t LINGER_NS = 10000000000;

int64_t now_ns()
{
    timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

std::string json_pixels(const std::vector<Pixel> &pixels)
{
    std::string text = "[";
    for (const Pixel &pixel : pixels) {
        if (!seen(pixel)) continue;
        if (text.size() > 1) text += ",";
        text += formatted("[%.1f,%.1f]", pixel[0], pixel[1]);
    }
    return text + "]";
}

std::string png_of(const Thumbnail &picture)
{
    fovea_image image = {};
    image.data = picture.grey.data();
    image.width = picture.width;
    image.height = picture.height;
    image.stride_bytes = picture.width;
    image.format = FOVEA_PIXEL_GREY8;
    image.size_bytes = picture.grey.size();
    unsigned char *png;
    size_t bytes;
    fv_picture_encode(&image, &png, &bytes);
    if (png == nullptr) return "";
    const std::string content((const char *)png, bytes);
    std::free(png);
    return content;
}

#ifdef FV_CALIBRATE_PAGE
bool on_path(void *context, const char *path, fv_web_made *made)
{
    static const char *const types[] = {"application/json", "image/png"};
    std::string type, content;
    if (!((LivePage *)context)->answer(path, type, content) || content.empty()) return false;
    made->type = types[type == types[1]];
    made->data = (uint8_t *)std::malloc(content.size());
    if (made->data == nullptr) return false;
    std::memcpy(made->data, content.data(), content.size());
    made->bytes = content.size();
    return true;
}
#endif

} // namespace

LivePage::~LivePage()
{
#ifdef FV_CALIBRATE_PAGE
    fv_web_pages_close(pages_);
#endif
}

int LivePage::open(const PageOptions &options, int views_max)
{
    int64_t port;
    views_max_ = views_max;
    if (options.port.empty()) {
        if (!options.address.empty() || !options.name.empty() || !options.token.empty() ||
            !options.certificate.empty() || !options.certificate_key.empty())
            return fv_say_wrong("fovea-calibrate camera: found --address, --host, --token or "
                                "--certificate without --page");
        return FV_EXIT_OK;
    }
    if (!fv_text_integer(options.port.c_str(), &port) || port < 0 || port > UINT16_MAX)
        return fv_say_wrong("--page: found '%s', expected a port from 0 to 65535",
                            options.port.c_str());
    if (options.certificate.empty() != options.certificate_key.empty())
        return fv_say_wrong("found one of --certificate and --certificate-key alone, expected "
                            "both");
#ifdef FV_CALIBRATE_PAGE
    fovea_error error;
    fv_web_pages_setup setup = {};
    setup.address = options.address.empty() ? "127.0.0.1" : options.address.c_str();
    setup.port = (uint16_t)port;
    setup.name = options.name.empty() ? nullptr : options.name.c_str();
    setup.token = options.token.empty() ? nullptr : options.token.c_str();
    if (!options.certificate.empty()) {
        setup.certificate = options.certificate.c_str();
        setup.certificate_key = options.certificate_key.c_str();
    }
    setup.index = "/calibrate";
    setup.answer = on_path;
    setup.context = this;
    asked_ns_ = now_ns();
    if (fv_web_pages_open(&setup, &pages_, &error) != FOVEA_OK)
        return fv_say_wrong("%s", error.text);
    return FV_EXIT_OK;
#else
    return fv_say_wrong("--page: this program was built without libwebsockets, expected it to be "
                        "installed (tools/install.sh web)");
#endif
}

void LivePage::frame(const Grey &image, const View &view, const Advice &advice, const Guide &guide)
{
    const Thumbnail picture = thumbnail_of(image, PICTURE_WIDTH_MAX);
    const std::lock_guard<std::mutex> lock(mutex_);
    picture_ = picture;
    frame_++;
    width_ = image.width;
    height_ = image.height;
    corners_ = view.corners;
    text_ = advice.text;
    trouble_ = advice.take ? "" : advice.trouble;
    wanted_ = guide.wanted();
    parts_ = guide.parts();
    views_ = guide.views().size();
    focal_deviation_ = guide.focal_deviation();
    projection_px_ = guide.projection_px();
    taken_.clear();
    for (const View &one : guide.views())
        taken_.insert(taken_.end(), one.corners.begin(), one.corners.end());
}

void LivePage::solving()
{
    const std::lock_guard<std::mutex> lock(mutex_);
    stage_ = "solving";
    text_ = "wait: the camera is solved";
    trouble_.clear();
}

void LivePage::done(const Report &report)
{
    const std::lock_guard<std::mutex> lock(mutex_);
    const Solution &solution = report.solution;
    stage_ = "done";
    verdict_ = grade_name(report.verdict.grade);
    text_ = "done: the verdict is " + verdict_;
    trouble_.clear();
    views_ = report.views.size();
    projection_px_ = report.verdict.uncertainty_seen_px;
    for (const Reason &reason : report.verdict.reasons)
        reasons_.push_back(reason.text);
    if (solution.corners_used == 0) return;
    focal_deviation_ = solution.stdev[0] / solution.camera.fx;
    for (int i = 0; i < 4 + coefficient_count(solution.model); i++)
        parameters_ += formatted("%-3s %12.6g +- %.2g\n", parameter_name(solution.model, i),
                                 parameter(solution.camera, i), solution.stdev[(size_t)i]);
    parameters_ += formatted("error %.3f px RMS", solution.rms_px);
}

void LivePage::linger(const Interruption &interruption)
{
    if (pages_ == nullptr) return;
    std::fflush(stdout);
    fv_say("page: it ends when nobody has looked for %d s", (int)(LINGER_NS / 1000000000));
    {
        const std::lock_guard<std::mutex> lock(mutex_);
        asked_ns_ = std::max(asked_ns_, now_ns() - LINGER_NS / 2);
    }
    for (bool watched = true; watched && !interruption.came();) {
        std::this_thread::sleep_for(std::chrono::milliseconds(100));
        const std::lock_guard<std::mutex> lock(mutex_);
        watched = now_ns() - asked_ns_ < LINGER_NS;
    }
}

std::string LivePage::state_json() const
{
    std::string reasons, parts;
    for (const std::string &reason : reasons_)
        reasons += (reasons.empty() ? "" : ",") + json_string(reason);
    for (const int corners : parts_)
        parts += (parts.empty() ? "" : ",") + std::to_string(corners);
    return "{\"stage\":" + json_string(stage_) + ",\"frame\":" + std::to_string(frame_) +
           ",\"text\":" + json_string(text_) + ",\"trouble\":" + json_string(trouble_) +
           ",\"pictures\":" + std::to_string(views_) + ",\"most\":" + std::to_string(views_max_) +
           ",\"width\":" + std::to_string(width_) + ",\"height\":" + std::to_string(height_) +
           ",\"corners\":" + json_pixels(corners_) + ",\"taken\":" + json_pixels(taken_) +
           ",\"parts\":[" + parts + "],\"part_enough\":" + std::to_string(Guide::PART_CORNERS) +
           ",\"wanted\":{\"column\":" + std::to_string(wanted_.column) +
           ",\"row\":" + std::to_string(wanted_.row) +
           "},\"focal_deviation\":" + json_number(focal_deviation_) +
           ",\"projection_px\":" + json_number(projection_px_) +
           ",\"verdict\":" + json_string(verdict_) + ",\"reasons\":[" + reasons +
           "],\"parameters\":" + json_string(parameters_) + "}";
}

bool LivePage::answer(const std::string &path, std::string &type, std::string &content)
{
    Thumbnail picture;
    {
        const std::lock_guard<std::mutex> lock(mutex_);
        asked_ns_ = now_ns();
        if (path == "/state.json") {
            type = "application/json";
            content = state_json();
            return true;
        }
        if (path != "/picture.png" || picture_.width == 0) return false;
        picture = picture_;
    }
    type = "image/png";
    content = png_of(picture);
    return true;
}

} // namespace calibrate

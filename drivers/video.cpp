// The video plug-in: OpenCV's VideoCapture behind the C interface of recorded/video_plugin.h.
#include <opencv2/core.hpp>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/videoio.hpp>

#include <cstdlib>
#include <exception>
#include <memory>
#include <string>

#include "recorded/video_plugin.h"

struct fv_video {
    cv::VideoCapture capture;
    cv::Mat picture;
    double rate_hz = 0.0;
    int32_t width = 0, height = 0;
    uint64_t position = 0; // frames gone by
    int64_t last_ns = -1;
    bool grabbed = false; // the next frame is, and has not gone by
    std::string path;
};

namespace
{

enum fovea_status open_file(const char *path, fv_video **video, int32_t *width, int32_t *height,
                            double *rate_hz, fovea_error *error)
{
    auto made = std::make_unique<fv_video>();
    made->path = path;
    if (!made->capture.open(path) || !made->capture.read(made->picture) || made->picture.empty())
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%s: found no frame that OpenCV can decode, expected a video", path);
    made->width = made->picture.cols;
    made->height = made->picture.rows;
    made->rate_hz = made->capture.get(cv::CAP_PROP_FPS);
    if (!(made->rate_hz > 0.01 && made->rate_hz < 1000.0)) made->rate_hz = 30.0;
    made->capture.open(path); // from the first frame again
    *width = made->width;
    *height = made->height;
    *rate_hz = made->rate_hz;
    *video = made.release();
    return FOVEA_OK;
}

// The container's time of the frame read last where it goes forward, else the frame number at the
// nominal rate.
int64_t frame_stamp(fv_video *video)
{
    const double position_ms = video->capture.get(cv::CAP_PROP_POS_MSEC);
    int64_t stamp_ns =
        static_cast<int64_t>(static_cast<double>(video->position) * 1e9 / video->rate_hz);
    if (position_ms >= 0.0 && position_ms < 1e12) {
        const int64_t reported_ns = static_cast<int64_t>(position_ms * 1e6);
        if (reported_ns > video->last_ns) stamp_ns = reported_ns;
    }
    if (stamp_ns <= video->last_ns) stamp_ns = video->last_ns + 1;
    video->last_ns = stamp_ns;
    return stamp_ns;
}

void to_grey(const cv::Mat &picture, uint8_t *grey, int32_t stride_bytes)
{
    const int channels = picture.channels();
    for (int y = 0; y < picture.rows; y++) {
        const uint8_t *from = picture.ptr<uint8_t>(y);
        uint8_t *to = grey + static_cast<size_t>(y) * static_cast<size_t>(stride_bytes);
        for (int x = 0; x < picture.cols; x++, from += channels)
            to[x] =
                channels < 3
                    ? from[0]
                    : static_cast<uint8_t>(
                          (3735u * from[0] + 19235u * from[1] + 9798u * from[2] + 16384u) >> 15);
    }
}

bool next_frame(fv_video *video, int64_t *stamp_ns)
{
    if (!video->grabbed && !video->capture.grab()) return false;
    video->grabbed = false;
    *stamp_ns = frame_stamp(video);
    video->position++;
    return true;
}

enum fovea_status read_frame(fv_video *video, uint8_t *grey, int32_t stride_bytes,
                             int64_t *stamp_ns, fovea_error *error)
{
    if (!next_frame(video, stamp_ns)) return FOVEA_END;
    if (!video->capture.retrieve(video->picture) || video->picture.depth() != CV_8U ||
        video->picture.cols != video->width || video->picture.rows != video->height)
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "%s: frame %llu: found no %d x %d picture in it, expected one", video->path.c_str(),
            static_cast<unsigned long long>(video->position - 1), video->width, video->height);
    to_grey(video->picture, grey, stride_bytes);
    return FOVEA_OK;
}

enum fovea_status plugin_open(const char *path, fv_video **video, int32_t *width, int32_t *height,
                              double *rate_hz, fovea_error *error)
try {
    cv::setNumThreads(1);
    cv::utils::logging::setLogLevel(
        cv::utils::logging::LOG_LEVEL_SILENT); /* our own line reports errors */
    setenv("OPENCV_FFMPEG_LOGLEVEL", "-8", 0); /* and FFmpeg's */
    return open_file(path, video, width, height, rate_hz, error);
} catch (const std::exception &problem) {
    return fovea_error_set(error, FOVEA_ERROR_INPUT, "%s: OpenCV cannot open it: %.200s", path,
                           problem.what());
}

enum fovea_status plugin_skip(fv_video *video, int64_t *stamp_ns)
try {
    return next_frame(video, stamp_ns) ? FOVEA_OK : FOVEA_END;
} catch (const std::exception &) {
    return FOVEA_END;
}

int plugin_more(fv_video *video)
try {
    video->grabbed = video->grabbed || video->capture.grab();
    return video->grabbed;
} catch (const std::exception &) {
    return 0;
}

// Containers of odd rates and odd key frames are led astray by a number; the time of the picture
// found says where it is.
enum fovea_status plugin_seek(fv_video *video, uint64_t index, int64_t stamp_ns)
try {
    if (!video->capture.set(cv::CAP_PROP_POS_FRAMES, static_cast<double>(index)) ||
        !video->capture.grab())
        return FOVEA_ERROR_UNSUPPORTED;
    const double position_ms = video->capture.get(cv::CAP_PROP_POS_MSEC);
    if (!(position_ms > 0.0 && position_ms < 1e12) ||
        static_cast<int64_t>(position_ms * 1e6) != stamp_ns)
        return FOVEA_ERROR_UNSUPPORTED;
    video->position = index;
    video->last_ns = stamp_ns - 1;
    video->grabbed = true;
    return FOVEA_OK;
} catch (const std::exception &) {
    return FOVEA_ERROR_UNSUPPORTED;
}

enum fovea_status plugin_read(fv_video *video, uint8_t *grey, int32_t stride_bytes,
                              int64_t *stamp_ns, fovea_error *error)
try {
    return read_frame(video, grey, stride_bytes, stamp_ns, error);
} catch (const std::exception &) {
    return FOVEA_END;
}

void plugin_close(fv_video *video)
{
    delete video;
}

} // namespace

extern "C" {
extern __attribute__((visibility("default"))) const struct fv_video_plugin fovea_video_plugin_2;
const struct fv_video_plugin fovea_video_plugin_2 = {FV_VIDEO_PLUGIN_VERSION,
                                                     plugin_open,
                                                     plugin_skip,
                                                     plugin_more,
                                                     plugin_seek,
                                                     plugin_read,
                                                     plugin_close};
}

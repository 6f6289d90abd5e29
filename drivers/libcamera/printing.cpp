// fovea-libcamera --list: every camera of libcamera on stdout (protocol.h).
#include "printing.h"

#include <cstdint>
#include <cstdio>
#include <memory>
#include <string>

#include <libcamera/control_ids.h>

#include "controls.h"
#include "protocol.h"

namespace
{

using libcamera::Camera;
using libcamera::CameraManager;
using libcamera::StreamRole;

// What would end a line or a field becomes a space.
std::string plain(std::string text)
{
    for (char &letter : text)
        if (static_cast<unsigned char>(letter) < ' ') letter = ' ';
    return text;
}

// The highest and the lowest rate of the format and size that the camera is set up for, as fields;
// empty: it states none. Some pipelines state them only then.
std::string rates(const Camera &camera)
{
    const auto &all = camera.controls();
    const auto found = all.find(&libcamera::controls::FrameDurationLimits);
    if (found == all.end()) return "";
    const libcamera::ControlValue &least = found->second.min(), &most = found->second.max();
    if (least.type() != libcamera::ControlTypeInteger64 || least.isArray() ||
        most.type() != libcamera::ControlTypeInteger64 || most.isArray())
        return "";
    std::string text;
    for (const int64_t duration_us : {least.get<int64_t>(), most.get<int64_t>()}) {
        char number[32];
        if (duration_us <= 0) break;
        std::snprintf(number, sizeof number, "\t%.6g", 1e6 / static_cast<double>(duration_us));
        text += number;
    }
    return text;
}

// The same after the camera, which is acquired, is set up for them; empty: it cannot be.
std::string rates_of(Camera &camera, libcamera::CameraConfiguration &configuration,
                     const libcamera::PixelFormat &pixels, const libcamera::Size &size)
{
    libcamera::StreamConfiguration &stream = configuration.at(0);
    stream.pixelFormat = pixels;
    stream.size = size;
    const bool set_up = configuration.validate() == libcamera::CameraConfiguration::Valid &&
                        camera.configure(&configuration) == 0;
    return set_up ? rates(camera) : "";
}

void list_formats(Camera &camera)
{
    const auto configuration = camera.generateConfiguration({StreamRole::VideoRecording});
    if (!configuration || configuration->empty()) {
        std::printf("trouble\tit takes no video\n");
        return;
    }
    const libcamera::StreamFormats formats = configuration->at(0).formats();
    const bool ours = camera.acquire() == 0; // not while another program uses it
    for (const libcamera::PixelFormat &pixels : formats.pixelformats())
        for (const libcamera::Size &size : formats.sizes(pixels))
            std::printf("format\t%s\t%u\t%u%s\n", plain(pixels.toString()).c_str(), size.width,
                        size.height,
                        (ours ? rates_of(camera, *configuration, pixels, size) : "").c_str());
    if (ours) camera.release();
}

void list_controls(const Camera &camera)
{
    for (const auto &[id, info] : camera.controls())
        std::printf("control\t%s\t%s\t%s\t%s\n", plain(id->name()).c_str(),
                    plain(info.min().toString()).c_str(), plain(info.max().toString()).c_str(),
                    plain(info.def().toString()).c_str());
}

} // namespace

int list_cameras()
{
    CameraManager manager;
    if (manager.start() != 0) return 1;
    {
        for (const std::shared_ptr<Camera> &camera : manager.cameras()) {
            const auto model = camera->properties().get(libcamera::properties::Model);
            std::printf("camera\t%s\t%s\n", plain(camera->id()).c_str(),
                        plain(model.value_or("")).c_str());
            list_formats(*camera);
            list_controls(*camera);
        }
    }
    std::fflush(stdout);
    manager.stop();
    return 0;
}

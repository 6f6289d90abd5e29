// fovea-libcamera --list: every camera of libcamera on stdout (protocol.h).
#include "printing.h"

#include <cstdio>
#include <memory>
#include <string>

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

void list_formats(Camera &camera)
{
    const auto configuration = camera.generateConfiguration({StreamRole::VideoRecording});
    if (!configuration || configuration->empty()) {
        std::printf("trouble\tit takes no video\n");
        return;
    }
    const libcamera::StreamFormats &formats = configuration->at(0).formats();
    for (const libcamera::PixelFormat &pixels : formats.pixelformats())
        for (const libcamera::Size &size : formats.sizes(pixels))
            std::printf("format\t%s\t%u\t%u\n", plain(pixels.toString()).c_str(), size.width,
                        size.height);
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

// The libcamera plug-in: a camera of libcamera behind the live source (live/live.h).
//
// Finding, buffers and frames are here, what is asked of exposure, gain and controls by name in
// libcamera/controls.cpp.
//
// Requests are made at set-up and used again and again. Their completion, on libcamera's thread, only pushes
// a number into a ring and rings the bell of the camera thread. No heap call per frame is ours; libcamera
// makes some for each request.
#include <libcamera/libcamera.h>
#include <libcamera/logging.h>

#include <poll.h>
#include <sys/eventfd.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <memory>
#include <string>
#include <vector>

#include "fovea/status.h"
#include "libcamera/controls.h"
#include "libcamera/plugin.h"

namespace
{

using libcamera::Camera;
using libcamera::CameraConfiguration;
using libcamera::CameraManager;
using libcamera::ControlList;
using libcamera::FrameBuffer;
using libcamera::FrameBufferAllocator;
using libcamera::FrameMetadata;
using libcamera::PixelFormat;
using libcamera::Request;
using libcamera::Stream;
using libcamera::StreamConfiguration;
using libcamera::StreamRole;
namespace controls = libcamera::controls;

using Format = fv_libcamera_format;
#define TABLE_ROW(name, theirs, format) {name, theirs, format},
const Format formats[] = {FV_LIBCAMERA_FORMATS(TABLE_ROW)};

const Format *format_of(const PixelFormat &pixels)
{
    const std::string name = pixels.toString();
    for (const Format &each : formats)
        if (name == each.theirs) return &each;
    return nullptr;
}

// A process has at most one manager; it lives as long as some device does, or until a camera has gone
// (below).
std::shared_ptr<CameraManager> manager()
{
    static std::weak_ptr<CameraManager> existing;
    std::shared_ptr<CameraManager> found = existing.lock();
    if (found) return found;
    found.reset(new CameraManager, [](CameraManager *each) {
        each->stop();
        delete each;
    });
    if (found->start() != 0) return nullptr;
    existing = found;
    return found;
}

struct Mapping {
    void *memory = nullptr;
    size_t bytes = 0;
    size_t offset = 0; // of the first plane
};

// Numbers of completed requests, from libcamera's thread to the camera thread: one writer, one reader, never
// full.
class Completed
{
  public:
    void push(uint32_t number)
    {
        const uint32_t at = head_.load(std::memory_order_relaxed);
        numbers_[at % numbers_.size()] = number;
        head_.store(at + 1, std::memory_order_release);
    }
    bool pop(uint32_t *number)
    {
        const uint32_t at = tail_.load(std::memory_order_relaxed);
        if (at == head_.load(std::memory_order_acquire)) return false;
        *number = numbers_[at % numbers_.size()];
        tail_.store(at + 1, std::memory_order_relaxed);
        return true;
    }
    void clear()
    {
        tail_.store(head_.load());
    }

  private:
    std::array<uint32_t, 4 * FV_LIVE_BUFFERS_MAX> numbers_{};
    std::atomic<uint32_t> head_{0}, tail_{0};
};

class Device
{
  public:
    explicit Device(const fovea_libcamera_options &options) : options_(options)
    {
        bell_ = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    }
    ~Device()
    {
        tear_down();
        camera_.reset();
        if (bell_ >= 0) close(bell_);
    }

    enum fovea_status learn(fovea_libcamera_agreed *agreed, fovea_error *told, fovea_error *error);
    enum fovea_status find(fovea_error *error);
    enum fovea_status find_again(fovea_error *error);
    enum fovea_status set_up(fovea_error *error);
    void tear_down();
    enum fovea_status take(int64_t deadline_ns, int wake_fd, fv_live_buffer *buffer, fovea_error *error);
    enum fovea_status give(uint32_t index, fovea_error *error);

  private:
    enum fovea_status configure(fovea_error *told, fovea_error *error);
    enum fovea_status shape(const StreamConfiguration &stream, fovea_error *error);
    enum fovea_status allocate(fovea_error *error);
    bool map(const FrameBuffer &buffer, Mapping *mapping);
    enum fovea_status failed(const char *what, int reason, fovea_error *error) const;
    void completed(Request *request);
    void disconnected();
    void ring();

    fovea_libcamera_options options_;
    std::string id_, uri_ = "libcamera";
    std::shared_ptr<CameraManager> manager_;
    std::shared_ptr<Camera> camera_;
    std::unique_ptr<CameraConfiguration> configuration_;
    std::unique_ptr<FrameBufferAllocator> allocator_;
    std::vector<std::unique_ptr<Request>> requests_;
    std::array<Mapping, FV_LIVE_BUFFERS_MAX> mappings_{};
    Stream *stream_ = nullptr;
    Completed completed_;
    std::atomic<bool> gone_{false};
    bool there_ = true, missed_ = false; // found when last looked for; gone since the manager was made
    int bell_ = -1;
    bool acquired_ = false, streaming_ = false, known_ = false, luma_only_ = false;
    int32_t width_ = 0, height_ = 0, stride_bytes_ = 0;
    const Format *format_ = nullptr;
};

// ---- finding ---------------------------------------------------------------------------------------------

enum fovea_status Device::failed(const char *what, int reason, fovea_error *error) const
{
    const bool gone = reason == -ENODEV || gone_.load();
    return fovea_error_set(error, gone ? FOVEA_GONE : FOVEA_ERROR_SYSTEM, "%s: %s: %s%s", uri_.c_str(), what,
                           gone ? "the camera is away" : strerror(-reason),
                           reason == -EBUSY ? ": another program is using it" : "");
}

// By its id. A manager of 0.0.3 connects its slot for cameras that come once more with each that comes: what
// it keeps and the time that a plug takes it double with every replug. So there the manager is made anew
// after a camera has gone, unless another device of this process has a part in it. Later versions connect
// once.
enum fovea_status Device::find_again([[maybe_unused]] fovea_error *error)
{
#if !FOVEA_LIBCAMERA_AT_LEAST(0, 5)
    if (missed_ && manager_.use_count() == 1) {
        camera_.reset();
        manager_.reset();
        manager_ = manager();
        if (!manager_)
            return fovea_error_set(error, FOVEA_ERROR_SYSTEM,
                                   "libcamera: its camera manager does not start again");
    }
#endif
    camera_ = manager_->get(id_);
    missed_ = !camera_ && there_;
    there_ = camera_ != nullptr;
    return camera_ ? FOVEA_OK : FOVEA_GONE;
}

enum fovea_status Device::find(fovea_error *error)
{
    if (!manager_) manager_ = manager();
    if (!manager_)
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "libcamera: its camera manager does not start");
    if (known_) return find_again(error);
    const std::vector<std::shared_ptr<Camera>> all = manager_->cameras();
    std::string list;
    for (size_t i = 0; i < all.size(); ++i) {
        if (all[i]->id() == options_.id || std::to_string(i) == options_.id) camera_ = all[i];
        list += (i > 0 ? " " : "") + all[i]->id();
    }
    if (!camera_)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "libcamera:%s: found no such camera, expected one of: %.300s", options_.id,
                               list.empty() ? "(there is none)" : list.c_str());
    id_ = camera_->id();
    uri_ = "libcamera:" + id_;
    return FOVEA_OK;
}

// ---- configuration ---------------------------------------------------------------------------------------

StreamRole role_of(int32_t role)
{
    static const StreamRole roles[] = {StreamRole::VideoRecording, StreamRole::Viewfinder,
                                       StreamRole::StillCapture, StreamRole::Raw};
    return roles[role];
}

void tell(fovea_error *told, const std::string &uri, const char *what, double asked, double given)
{
    if (told == nullptr) return;
    const size_t used = std::strlen(told->text);
    std::snprintf(told->text + used, sizeof told->text - used, "%s%s%s: asked %g, the camera gives %g",
                  used > 0 ? "" : uri.c_str(), used > 0 ? "; " : ": ", what, asked, given);
}

std::string list_formats(const StreamConfiguration &stream)
{
    std::string list;
    for (const PixelFormat &each : stream.formats().pixelformats())
        list += (list.empty() ? "" : " ") + each.toString();
    return list;
}

// The best of the formats that it offers, in the order of our list.
const Format *best_format(const StreamConfiguration &stream)
{
    const Format *best = nullptr;
    for (const PixelFormat &each : stream.formats().pixelformats()) {
        const Format *format = format_of(each);
        if (format != nullptr && (best == nullptr || format < best)) best = format;
    }
    return best != nullptr ? best : format_of(stream.pixelFormat);
}

// Size and format as agreed, or as they were before.
enum fovea_status Device::shape(const StreamConfiguration &stream, fovea_error *error)
{
    const Format *given = format_of(stream.pixelFormat);
    if (given == nullptr || (format_ != nullptr && given != format_))
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT, "%s: format: found %s, expected %s; the camera gives: %.200s",
            uri_.c_str(), stream.pixelFormat.toString().c_str(),
            format_ != nullptr ? format_->theirs : "one that Fovea reads", list_formats(stream).c_str());
    const auto width = static_cast<int32_t>(stream.size.width),
               height = static_cast<int32_t>(stream.size.height);
    if (width < FOVEA_IMAGE_WIDTH_MIN || width > FOVEA_IMAGE_WIDTH_MAX || height < FOVEA_IMAGE_HEIGHT_MIN ||
        height > FOVEA_IMAGE_HEIGHT_MAX)
        return fovea_error_set(error, FOVEA_ERROR_UNSUPPORTED, "%s: found %d x %d pixels, expected %d to %d",
                               uri_.c_str(), width, height, FOVEA_IMAGE_WIDTH_MIN, FOVEA_IMAGE_WIDTH_MAX);
    if (known_ && (width != width_ || height != height_))
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%s: found %d x %d pixels after it came back, expected %d x %d", uri_.c_str(),
                               width, height, width_, height_);
    format_ = given;
    width_ = width;
    height_ = height;
    const int32_t least = fovea_image_stride_min(given->format, width);
    stride_bytes_ = std::max(static_cast<int32_t>(stream.stride), least);
    return FOVEA_OK;
}

enum fovea_status Device::configure(fovea_error *told, fovea_error *error)
{
#if FOVEA_LIBCAMERA_AT_LEAST(0, 1)
    const std::array<StreamRole, 1> roles{role_of(options_.role)};
#else
    const libcamera::StreamRoles roles{role_of(options_.role)};
#endif
    configuration_ = camera_->generateConfiguration(roles);
    if (!configuration_ || configuration_->size() != 1)
        return fovea_error_set(error, FOVEA_ERROR_UNSUPPORTED, "%s: role: this camera does not have it",
                               uri_.c_str());
    StreamConfiguration &stream = configuration_->at(0);
    const Format *wanted = known_                ? format_
                           : options_.format > 0 ? &formats[options_.format - 1]
                                                 : best_format(stream);
    const int32_t asked_width = known_ ? width_ : options_.width,
                  asked_height = known_ ? height_ : options_.height;
    if (wanted != nullptr) stream.pixelFormat = PixelFormat::fromString(wanted->theirs);
    if (asked_width > 0)
        stream.size =
            libcamera::Size(static_cast<unsigned>(asked_width), static_cast<unsigned>(asked_height));
    stream.bufferCount = static_cast<unsigned>(options_.buffers);
    if (configuration_->validate() == CameraConfiguration::Invalid)
        return fovea_error_set(error, FOVEA_ERROR_INPUT, "%s: found no valid configuration for what is asked",
                               uri_.c_str());
    format_ = wanted;
    const enum fovea_status status = shape(stream, error);
    if (status != FOVEA_OK) return status;
    if (asked_width > 0 && asked_width != width_) tell(told, uri_, "width", asked_width, width_);
    if (asked_height > 0 && asked_height != height_) tell(told, uri_, "height", asked_height, height_);
    const int failure = camera_->configure(configuration_.get());
    if (failure != 0) return failed("configuring it", failure, error);
    stream_ = configuration_->at(0).stream();
    return FOVEA_OK;
}

// ---- buffers ---------------------------------------------------------------------------------------------

// All planes of a buffer in one piece where they are; else the first alone.
bool Device::map(const FrameBuffer &buffer, Mapping *mapping)
{
    const auto &planes = buffer.planes(); // a vector, or from 0.7 on a Span
    const auto offset_of = [](const FrameBuffer::Plane &plane) {
        return plane.offset == FrameBuffer::Plane::kInvalidOffset ? size_t{0} : size_t{plane.offset};
    };
    size_t end = offset_of(planes[0]) + planes[0].length;
    luma_only_ = false;
    for (size_t i = 1; i < planes.size(); ++i) {
        if (planes[i].fd.get() == planes[0].fd.get() && offset_of(planes[i]) == end)
            end += planes[i].length;
        else
            luma_only_ = true;
    }
    mapping->bytes = end;
    mapping->memory = mmap(nullptr, end, PROT_READ, MAP_SHARED, planes[0].fd.get(), 0);
    if (mapping->memory == MAP_FAILED) {
        mapping->memory = nullptr;
        return false;
    }
    mapping->offset = offset_of(planes[0]);
    return true;
}

enum fovea_status Device::allocate(fovea_error *error)
{
    allocator_ = std::make_unique<FrameBufferAllocator>(camera_);
    const int count = allocator_->allocate(stream_);
    if (count < 0) return failed("asking for buffers", count, error);
    const auto &buffers = allocator_->buffers(stream_);
    const size_t used = std::min(buffers.size(), static_cast<size_t>(options_.buffers));
    if (used < FV_LIVE_BUFFERS_MIN)
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%s: found %zu buffers, expected at least %d",
                               uri_.c_str(), used, FV_LIVE_BUFFERS_MIN);
    for (size_t i = 0; i < used; ++i) {
        if (!map(*buffers[i], &mappings_[i])) return failed("mapping a buffer", -errno, error);
        std::unique_ptr<Request> request = camera_->createRequest(i);
        if (!request || request->addBuffer(stream_, buffers[i].get()) != 0)
            return failed("making a request", -ENOMEM, error);
        requests_.push_back(std::move(request));
    }
    return FOVEA_OK;
}

// ---- life ------------------------------------------------------------------------------------------------

enum fovea_status Device::learn(fovea_libcamera_agreed *agreed, fovea_error *told, fovea_error *error)
{
    enum fovea_status status = find(error);
    if (status != FOVEA_OK) return status == FOVEA_GONE ? FOVEA_ERROR_INPUT : status;
    const int failure = camera_->acquire();
    if (failure != 0) return failed("taking hold of it", failure, error);
    acquired_ = true;
    ControlList list(camera_->controls());
    status = configure(told, error);
    if (status == FOVEA_OK) status = fv_libcamera_controls(*camera_, options_, uri_.c_str(), &list, error);
    if (status == FOVEA_OK) status = allocate(error);
    if (status == FOVEA_OK) {
        const bool can_time = fv_libcamera_has_control(*camera_, controls::FrameDurationLimits);
        if (options_.rate_hz > 0 && !can_time) tell(told, uri_, "rate", options_.rate_hz, 0);
        agreed->width = width_;
        agreed->height = height_;
        agreed->format = luma_only_ ? FOVEA_PIXEL_GREY8 : format_->format;
        agreed->rate_hz = options_.rate_hz;
        agreed->buffers = static_cast<uint32_t>(requests_.size());
        std::snprintf(agreed->id, sizeof agreed->id, "%s", id_.c_str());
        known_ = true;
    }
    tear_down();
    return status == FOVEA_GONE ? FOVEA_ERROR_SYSTEM : status;
}

enum fovea_status Device::set_up(fovea_error *error)
{
    int failure = camera_->acquire();
    if (failure != 0) return failed("taking hold of it", failure, error);
    acquired_ = true;
    gone_ = false;
    ControlList list(camera_->controls());
    fovea_error refused{};
    enum fovea_status status = configure(nullptr, error);
    if (status == FOVEA_OK) status = allocate(error);
    if (status == FOVEA_OK &&
        fv_libcamera_controls(*camera_, options_, uri_.c_str(), &list, &refused) != FOVEA_OK)
        list.clear();
    if (status == FOVEA_OK) {
        completed_.clear();
        camera_->requestCompleted.connect(this, &Device::completed);
        camera_->disconnected.connect(this, &Device::disconnected);
        failure = camera_->start(&list);
        if (failure != 0) status = failed("starting to stream", failure, error);
        streaming_ = failure == 0;
    }
    for (size_t i = 0; i < requests_.size() && status == FOVEA_OK; ++i) {
        if (i == 0) requests_[i]->controls().merge(list); // some pipelines look only here
        failure = camera_->queueRequest(requests_[i].get());
        if (failure != 0) status = failed("queueing a request", failure, error);
    }
    if (status != FOVEA_OK)
        tear_down();
    else if (refused.text[0] != '\0')
        *error = refused;
    return status;
}

void Device::tear_down()
{
    if (streaming_) camera_->stop();
    streaming_ = false;
    if (gone_.load()) missed_ = true, there_ = false;
    if (camera_) {
        camera_->requestCompleted.disconnect(this);
        camera_->disconnected.disconnect(this);
    }
    requests_.clear();
    for (Mapping &each : mappings_) {
        if (each.memory != nullptr) munmap(each.memory, each.bytes);
        each = Mapping{};
    }
    if (allocator_ && stream_ != nullptr) allocator_->free(stream_);
    allocator_.reset();
    configuration_.reset();
    stream_ = nullptr;
    if (acquired_) camera_->release();
    acquired_ = false;
    camera_.reset(); // one that was unplugged can go
}

// ---- frames ----------------------------------------------------------------------------------------------

void Device::ring()
{
    const uint64_t one = 1;
    if (write(bell_, &one, sizeof one) < 0) return; // full: it rings already
}

// On libcamera's thread.
void Device::completed(Request *request)
{
    if (request->status() == Request::RequestCancelled) return;
    completed_.push(static_cast<uint32_t>(request->cookie()));
    ring();
}

void Device::disconnected()
{
    gone_ = true;
    ring();
}

int64_t left_until(int64_t deadline_ns)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    const int64_t left_ns = deadline_ns - (static_cast<int64_t>(now.tv_sec) * 1000000000 + now.tv_nsec);
    return std::max<int64_t>(left_ns, 0);
}

void read_stamp(Request *request, const FrameMetadata &metadata, fv_order_stamp *stamp)
{
    const auto taken = request->metadata().get(controls::SensorTimestamp);
    const auto exposure_us = request->metadata().get(controls::ExposureTime);
    *stamp = fv_order_stamp{};
    stamp->stamp_ns = taken ? *taken : static_cast<int64_t>(metadata.timestamp);
    stamp->clock_known = false; // libcamera's pipelines differ in it: it is found out
    stamp->meaning = taken ? FOVEA_STAMP_EXPOSURE_START : FOVEA_STAMP_UNKNOWN;
    stamp->exposure_ns = exposure_us ? static_cast<int64_t>(*exposure_us) * 1000 : 0;
    stamp->sequence_known = true;
    stamp->sequence = metadata.sequence;
}

enum fovea_status Device::take(int64_t deadline_ns, int wake_fd, fv_live_buffer *buffer, fovea_error *error)
{
    uint32_t number = 0;
    if (!completed_.pop(&number)) {
        struct pollfd fds[2] = {{wake_fd, POLLIN, 0}, {bell_, POLLIN, 0}};
        const int64_t left_ns = left_until(deadline_ns);
        const struct timespec left = {static_cast<time_t>(left_ns / 1000000000),
                                      static_cast<long>(left_ns % 1000000000)};
        uint64_t rung = 0;
        ppoll(fds, 2, &left, nullptr);
        if (read(bell_, &rung, sizeof rung) < 0) rung = 0;
        if (gone_.load()) return fovea_error_set(error, FOVEA_GONE, "%s: the camera is away", uri_.c_str());
        if (!completed_.pop(&number)) return FOVEA_AGAIN;
    }
    Request *request = requests_[number].get();
    const Mapping &mapping = mappings_[number];
    const FrameMetadata &metadata = request->findBuffer(stream_)->metadata();
    size_t bytes = 0;
    for (const FrameMetadata::Plane &plane : metadata.planes()) {
        bytes += plane.bytesused;
        if (luma_only_) break;
    }
    buffer->index = number;
    buffer->data = static_cast<const uint8_t *>(mapping.memory) + mapping.offset;
    buffer->bytes = std::min(bytes, mapping.bytes - mapping.offset);
    buffer->stride_bytes = stride_bytes_;
    buffer->damaged = metadata.status != FrameMetadata::FrameSuccess;
    read_stamp(request, metadata, &buffer->stamp);
    return FOVEA_OK;
}

enum fovea_status Device::give(uint32_t index, fovea_error *error)
{
    Request *request = requests_[index].get();
    request->reuse(Request::ReuseBuffers);
    const int failure = camera_->queueRequest(request);
    return failure == 0 ? FOVEA_OK : failed("queueing a request", failure, error);
}

// ---- the C side ------------------------------------------------------------------------------------------

// What C++ throws ends here.
template <typename Call> enum fovea_status guarded(fovea_error *error, Call call)
try {
    return call();
} catch (const std::exception &problem) {
    return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "libcamera: %.200s", problem.what());
}

Device *device_of(void *device)
{
    return static_cast<Device *>(device);
}

enum fovea_status plugin_open(const fovea_libcamera_options *options, void **out,
                              fovea_libcamera_agreed *agreed, fovea_error *told, fovea_error *error)
{
    return guarded(error, [&] {
        if (std::getenv("LIBCAMERA_LOG_LEVELS") == nullptr)
            libcamera::logSetTarget(libcamera::LoggingTargetNone);
        libcamera::logSetLevel("*", "FATAL"); // we tell errors
        auto device = std::make_unique<Device>(*options);
        const enum fovea_status status = device->learn(agreed, told, error);
        if (status == FOVEA_OK) *out = device.release();
        return status;
    });
}

enum fovea_status plugin_find(void *device, fovea_error *error)
{
    return guarded(error, [&] { return device_of(device)->find(error); });
}

enum fovea_status plugin_set_up(void *device, fovea_error *error)
{
    return guarded(error, [&] { return device_of(device)->set_up(error); });
}

void plugin_tear_down(void *device)
{
    guarded(nullptr, [&] { return device_of(device)->tear_down(), FOVEA_OK; });
}

enum fovea_status plugin_take(void *device, int64_t deadline_ns, int wake_fd, fv_live_buffer *buffer,
                              fovea_error *error)
{
    return guarded(error, [&] { return device_of(device)->take(deadline_ns, wake_fd, buffer, error); });
}

enum fovea_status plugin_give(void *device, uint32_t index, fovea_error *error)
{
    return guarded(error, [&] { return device_of(device)->give(index, error); });
}

void plugin_close(void *device)
{
    guarded(nullptr, [&] { return delete device_of(device), FOVEA_OK; });
}

} // namespace

extern "C" {
extern __attribute__((visibility("default"))) const struct fovea_libcamera_plugin fovea_libcamera_plugin_2;
const struct fovea_libcamera_plugin fovea_libcamera_plugin_2 = {
    FOVEA_LIBCAMERA_PLUGIN_VERSION,
    plugin_open,
    {plugin_find, plugin_set_up, plugin_tear_down, plugin_take, plugin_give, plugin_close, nullptr}};
}

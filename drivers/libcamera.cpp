// A camera of libcamera: finding, buffers and frames (libcamera/device.h). It runs in the process
// that keeps libcamera; libcamera/main.cpp is its main program, libcamera/protocol.h says why it is
// one and what it says to the runtime.
//
// Requests are made at set-up and used again and again. Their completion, on libcamera's thread,
// only pushes a number into a ring and rings a bell. No heap call per frame is ours; libcamera
// makes some for each request.
#include "libcamera/device.h"

#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>

#include "libcamera/controls.h"

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

} // namespace

Device::Device() : bell_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK))
{
}

Device::~Device()
{
    tear_down();
    camera_.reset();
    if (manager_) manager_->stop();
    if (bell_ >= 0) close(bell_);
}

// ---- finding ------------------------------------------------------------------------------------

enum fovea_status Device::failed(const char *what, int reason, fovea_error *error) const
{
    const bool gone = reason == -ENODEV || gone_.load();
    return fovea_error_set(error, gone ? FOVEA_GONE : FOVEA_ERROR_SYSTEM, "%s: %s: %s%s",
                           uri_.c_str(), what, gone ? "the camera is away" : strerror(-reason),
                           reason == -EBUSY ? ": another program is using it" : "");
}

enum fovea_status Device::find(fovea_error *error)
{
    if (!manager_) {
        auto made = std::make_unique<CameraManager>();
        if (made->start() != 0)
            return fovea_error_set(error, FOVEA_ERROR_SYSTEM,
                                   "libcamera: its camera manager does not start");
        manager_ = std::move(made);
    }
    if (known_) {
        camera_ = manager_->get(id_);
        return camera_ ? FOVEA_OK : FOVEA_GONE;
    }
    const std::vector<std::shared_ptr<Camera>> all = manager_->cameras();
    std::string list;
    for (size_t i = 0; i < all.size(); i++) {
        if (all[i]->id() == options_.id || std::to_string(i) == options_.id) camera_ = all[i];
        list += (i > 0 ? " " : "") + all[i]->id();
    }
    if (!camera_)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "libcamera:%s: found no such camera, expected one of: %.300s",
                               options_.id, list.empty() ? "(there is none)" : list.c_str());
    id_ = camera_->id();
    uri_ = "libcamera:" + id_;
    return FOVEA_OK;
}

// ---- configuration ------------------------------------------------------------------------------

namespace
{

StreamRole role_of(int32_t role)
{
    static const StreamRole roles[] = {StreamRole::VideoRecording, StreamRole::Viewfinder,
                                       StreamRole::StillCapture, StreamRole::Raw};
    return roles[role];
}

void notice_difference(fovea_error *notice, const std::string &uri, const char *what, double asked,
                       double given)
{
    if (notice == nullptr) return;
    const size_t used = std::strlen(notice->text);
    std::snprintf(notice->text + used, sizeof notice->text - used,
                  "%s%s%s: asked %g, the camera gives %g", used > 0 ? "" : uri.c_str(),
                  used > 0 ? "; " : ": ", what, asked, given);
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

} // namespace

// Size and format as agreed, or as they were before.
enum fovea_status Device::shape(const StreamConfiguration &stream, fovea_error *error)
{
    const Format *given = format_of(stream.pixelFormat);
    if (given == nullptr || (format_ != nullptr && given != format_))
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%s: format: found %s, expected %s; the camera gives: %.200s",
                               uri_.c_str(), stream.pixelFormat.toString().c_str(),
                               format_ != nullptr ? format_->theirs : "one that Fovea reads",
                               list_formats(stream).c_str());
    const auto width = static_cast<int32_t>(stream.size.width),
               height = static_cast<int32_t>(stream.size.height);
    if (width < FOVEA_IMAGE_WIDTH_MIN || width > FOVEA_IMAGE_WIDTH_MAX ||
        height < FOVEA_IMAGE_HEIGHT_MIN || height > FOVEA_IMAGE_HEIGHT_MAX)
        return fovea_error_set(error, FOVEA_ERROR_UNSUPPORTED,
                               "%s: found %d x %d pixels, expected %d to %d", uri_.c_str(), width,
                               height, FOVEA_IMAGE_WIDTH_MIN, FOVEA_IMAGE_WIDTH_MAX);
    if (known_ && (width != width_ || height != height_))
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%s: found %d x %d pixels after it came back, expected %d x %d",
                               uri_.c_str(), width, height, width_, height_);
    format_ = given;
    width_ = width;
    height_ = height;
    const int32_t least = fovea_image_stride_min(given->format, width);
    stride_bytes_ = std::max(static_cast<int32_t>(stream.stride), least);
    return FOVEA_OK;
}

enum fovea_status Device::configure(fovea_error *notice, fovea_error *error)
{
#if FV_LIBCAMERA_AT_LEAST(0, 1)
    const std::array<StreamRole, 1> roles{role_of(options_.role)};
#else
    const libcamera::StreamRoles roles{role_of(options_.role)};
#endif
    configuration_ = camera_->generateConfiguration(roles);
    if (!configuration_ || configuration_->size() != 1)
        return fovea_error_set(error, FOVEA_ERROR_UNSUPPORTED,
                               "%s: role: this camera does not have it", uri_.c_str());
    StreamConfiguration &stream = configuration_->at(0);
    const Format *wanted = known_                ? format_
                           : options_.format > 0 ? &formats[options_.format - 1]
                                                 : best_format(stream);
    const int32_t asked_width = known_ ? width_ : options_.width,
                  asked_height = known_ ? height_ : options_.height;
    if (wanted != nullptr) stream.pixelFormat = PixelFormat::fromString(wanted->theirs);
    if (asked_width > 0)
        stream.size = libcamera::Size(static_cast<unsigned>(asked_width),
                                      static_cast<unsigned>(asked_height));
    stream.bufferCount = static_cast<unsigned>(options_.buffers);
    if (configuration_->validate() == CameraConfiguration::Invalid)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%s: found no valid configuration for what is asked", uri_.c_str());
    format_ = wanted;
    const enum fovea_status status = shape(stream, error);
    if (status != FOVEA_OK) return status;
    if (asked_width > 0 && asked_width != width_)
        notice_difference(notice, uri_, "width", asked_width, width_);
    if (asked_height > 0 && asked_height != height_)
        notice_difference(notice, uri_, "height", asked_height, height_);
    const int failure = camera_->configure(configuration_.get());
    if (failure != 0) return failed("configuring it", failure, error);
    stream_ = configuration_->at(0).stream();
    return FOVEA_OK;
}

// ---- buffers ------------------------------------------------------------------------------------

// All planes of a buffer in one piece where they are; else the first alone.
void Device::survey(const FrameBuffer &buffer, fv_libcamera_buffer *size)
{
    const auto &planes = buffer.planes(); // a vector, or from 0.7 on a Span
    const auto offset_of = [](const FrameBuffer::Plane &plane) {
        return plane.offset == FrameBuffer::Plane::kInvalidOffset ? size_t{0}
                                                                  : size_t{plane.offset};
    };
    size_t end = offset_of(planes[0]) + planes[0].length;
    luma_only_ = false;
    for (size_t i = 1; i < planes.size(); i++) {
        if (planes[i].fd.get() == planes[0].fd.get() && offset_of(planes[i]) == end)
            end += planes[i].length;
        else
            luma_only_ = true;
    }
    size->bytes = end;
    size->offset = offset_of(planes[0]);
}

enum fovea_status Device::allocate(fovea_error *error)
{
    allocator_ = std::make_unique<FrameBufferAllocator>(camera_);
    const int count = allocator_->allocate(stream_);
    if (count < 0) return failed("asking for buffers", count, error);
    const auto &buffers = allocator_->buffers(stream_);
    const size_t used = std::min(buffers.size(), static_cast<size_t>(options_.buffers));
    if (used < FV_LIVE_BUFFERS_MIN)
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM,
                               "%s: found %zu buffers, expected at least %d", uri_.c_str(), used,
                               FV_LIVE_BUFFERS_MIN);
    for (size_t i = 0; i < used; i++) {
        survey(*buffers[i], &sizes_[i]);
        std::unique_ptr<Request> request = camera_->createRequest(i);
        if (!request || request->addBuffer(stream_, buffers[i].get()) != 0)
            return failed("making a request", -ENOMEM, error);
        requests_.push_back(std::move(request));
    }
    return FOVEA_OK;
}

// ---- life ---------------------------------------------------------------------------------------

enum fovea_status Device::learn(const fv_libcamera_options &options, fv_libcamera_agreed *agreed,
                                fovea_error *notice, fovea_error *error)
{
    options_ = options;
    enum fovea_status status = find(error);
    if (status != FOVEA_OK) return status;
    const int failure = camera_->acquire();
    if (failure != 0) return failed("taking hold of it", failure, error);
    acquired_ = true;
    ControlList list(camera_->controls());
    status = configure(notice, error);
    if (status == FOVEA_OK)
        status = fv_libcamera_controls(*camera_, options_, uri_.c_str(), &list, error);
    if (status == FOVEA_OK) status = allocate(error);
    if (status == FOVEA_OK) {
        const bool can_time = fv_libcamera_has_control(*camera_, controls::FrameDurationLimits);
        if (options_.rate_hz > 0 && !can_time)
            notice_difference(notice, uri_, "rate", options_.rate_hz, 0);
        agreed->width = width_;
        agreed->height = height_;
        agreed->row = static_cast<int32_t>(format_ - formats);
        agreed->format = luma_only_ ? FOVEA_PIXEL_GREY8 : format_->format;
        agreed->rate_hz = options_.rate_hz;
        agreed->buffers = static_cast<uint32_t>(requests_.size());
        std::snprintf(agreed->id, sizeof agreed->id, "%s", id_.c_str());
        known_ = true;
    }
    tear_down();
    return status == FOVEA_GONE ? FOVEA_ERROR_SYSTEM : status;
}

void Device::know(const fv_libcamera_options &options, const fv_libcamera_agreed &agreed)
{
    options_ = options;
    id_ = agreed.id;
    uri_ = "libcamera:" + id_;
    width_ = agreed.width;
    height_ = agreed.height;
    format_ = &formats[agreed.row];
    known_ = true;
}

enum fovea_status Device::stream_on(fovea_error *error)
{
    ControlList list(camera_->controls());
    changed_.clear();
    fovea_error refused{};
    if (fv_libcamera_controls(*camera_, options_, uri_.c_str(), &list, &refused) != FOVEA_OK)
        list.clear();
    completed_.clear();
    camera_->requestCompleted.connect(this, &Device::completed);
    camera_->disconnected.connect(this, &Device::disconnected);
    int failure = camera_->start(&list);
    if (failure != 0) return failed("starting to stream", failure, error);
    streaming_ = true;
    requests_[0]->controls().merge(list); // some pipelines look only here
    for (const std::unique_ptr<Request> &request : requests_) {
        failure = camera_->queueRequest(request.get());
        if (failure != 0) return failed("queueing a request", failure, error);
    }
    *error = refused; // a camera that came back and now refuses a control is still better than none
    return FOVEA_OK;
}

enum fovea_status Device::set_up(fv_libcamera_event *answer, int descriptors[FV_LIVE_BUFFERS_MAX])
{
    fovea_error *error = &answer->error;
    if (!camera_) return fovea_error_set(error, FOVEA_GONE, "%s: the camera is away", uri_.c_str());
    const int failure = camera_->acquire();
    if (failure != 0) return failed("taking hold of it", failure, error);
    acquired_ = true;
    gone_ = false;
    enum fovea_status status = configure(nullptr, error);
    if (status == FOVEA_OK) status = allocate(error);
    if (status == FOVEA_OK) status = stream_on(error);
    if (status != FOVEA_OK) {
        tear_down();
        return status;
    }
    answer->buffer_count = static_cast<uint32_t>(requests_.size());
    answer->stride_bytes = stride_bytes_;
    for (size_t i = 0; i < requests_.size(); i++) {
        answer->buffers[i] = sizes_[i];
        descriptors[i] = allocator_->buffers(stream_)[i]->planes()[0].fd.get();
    }
    return FOVEA_OK;
}

void Device::tear_down()
{
    if (streaming_) camera_->stop();
    streaming_ = false;
    if (camera_) {
        camera_->requestCompleted.disconnect(this);
        camera_->disconnected.disconnect(this);
    }
    requests_.clear();
    if (allocator_ && stream_ != nullptr) allocator_->free(stream_);
    allocator_.reset();
    configuration_.reset();
    stream_ = nullptr;
    if (acquired_) camera_->release();
    acquired_ = false;
}

// ---- frames -------------------------------------------------------------------------------------

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

namespace
{

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

} // namespace

enum fovea_status Device::take(fv_libcamera_frame *frame, fovea_error *error)
{
    uint32_t number = 0;
    uint64_t rung = 0;
    if (read(bell_, &rung, sizeof rung) < 0) rung = 0;
    if (!completed_.pop(&number))
        return gone_.load()
                   ? fovea_error_set(error, FOVEA_GONE, "%s: the camera is away", uri_.c_str())
                   : FOVEA_AGAIN;
    Request *request = requests_[number].get();
    const FrameMetadata &metadata = request->findBuffer(stream_)->metadata();
    size_t bytes = 0;
    for (const FrameMetadata::Plane &plane : metadata.planes()) {
        bytes += plane.bytesused;
        if (luma_only_) break;
    }
    frame->index = number;
    frame->bytes = std::min<uint64_t>(bytes, sizes_[number].bytes - sizes_[number].offset);
    frame->damaged = metadata.status != FrameMetadata::FrameSuccess;
    read_stamp(request, metadata, &frame->stamp);
    return FOVEA_OK;
}

enum fovea_status Device::give(uint32_t index, fovea_error *error)
{
    if (!streaming_ || index >= requests_.size())
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT, "%s: found no buffer %u", uri_.c_str(),
                               index);
    Request *request = requests_[index].get();
    request->reuse(Request::ReuseBuffers);
    request->controls().merge(changed_);
    changed_.clear();
    const int failure = camera_->queueRequest(request);
    return failure == 0 ? FOVEA_OK : failed("queueing a request", failure, error);
}

enum fovea_status Device::control(const fv_libcamera_options &options, fovea_error *error)
{
    if (!camera_) return fovea_error_set(error, FOVEA_GONE, "%s: the camera is away", uri_.c_str());
    ControlList list(camera_->controls());
    const enum fovea_status status =
        fv_libcamera_controls(*camera_, options, uri_.c_str(), &list, error);
    if (status != FOVEA_OK) return status;
    options_ = options;
    if (streaming_) changed_ = list;
    return FOVEA_OK;
}

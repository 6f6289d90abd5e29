// A camera of libcamera, inside the process that keeps libcamera (protocol.h): found, configured,
// streaming, its frames. What is asked of exposure, gain and controls by name is in controls.cpp.
// C++; one thread calls, libcamera's own only completes requests.
#ifndef FOVEA_LIBCAMERA_DEVICE_H
#define FOVEA_LIBCAMERA_DEVICE_H

#include <libcamera/libcamera.h>

#include <array>
#include <atomic>
#include <memory>
#include <string>
#include <vector>

#include "fovea/status.h"
#include "protocol.h"

// Numbers of completed requests, from libcamera's thread to ours: one writer, one reader, never
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
    Device();
    ~Device();
    Device(const Device &) = delete;
    Device &operator=(const Device &) = delete;

    // The requests of protocol.h.
    enum fovea_status learn(const fv_libcamera_options &options, fv_libcamera_agreed *agreed,
                            fovea_error *notice, fovea_error *error);
    void know(const fv_libcamera_options &options, const fv_libcamera_agreed &agreed);
    enum fovea_status find(fovea_error *error);
    // `notice` may hold a line on success too. `descriptors` stay the camera's.
    enum fovea_status set_up(fv_libcamera_event *answer, int descriptors[FV_LIVE_BUFFERS_MAX]);
    enum fovea_status give(uint32_t index, fovea_error *error);
    enum fovea_status control(const fv_libcamera_options &options, fovea_error *error);

    // Readable when a frame has come or the camera has gone.
    int bell() const
    {
        return bell_;
    }
    // FOVEA_OK; FOVEA_AGAIN: no more at present; FOVEA_GONE.
    enum fovea_status take(fv_libcamera_frame *frame, fovea_error *error);

  private:
    enum fovea_status configure(fovea_error *notice, fovea_error *error);
    enum fovea_status shape(const libcamera::StreamConfiguration &stream, fovea_error *error);
    enum fovea_status allocate(fovea_error *error);
    enum fovea_status stream_on(fovea_error *error);
    void tear_down();
    void survey(const libcamera::FrameBuffer &buffer, fv_libcamera_buffer *size);
    enum fovea_status failed(const char *what, int reason, fovea_error *error) const;
    void completed(libcamera::Request *request);
    void disconnected();
    void ring();

    fv_libcamera_options options_{};
    std::string id_, uri_ = "libcamera";
    std::unique_ptr<libcamera::CameraManager> manager_;
    std::shared_ptr<libcamera::Camera> camera_;
    std::unique_ptr<libcamera::CameraConfiguration> configuration_;
    std::unique_ptr<libcamera::FrameBufferAllocator> allocator_;
    std::vector<std::unique_ptr<libcamera::Request>> requests_;
    std::array<fv_libcamera_buffer, FV_LIVE_BUFFERS_MAX> sizes_{};
    libcamera::Stream *stream_ = nullptr;
    Completed completed_;
    std::atomic<bool> gone_{false};
    libcamera::ControlList changed_; // for the next request
    int bell_ = -1;
    bool acquired_ = false, streaming_ = false, known_ = false, luma_only_ = false;
    int32_t width_ = 0, height_ = 0, stride_bytes_ = 0;
    const fv_libcamera_format *format_ = nullptr;
};

#endif

// build/fovea-libcamera: the process that keeps libcamera. Started by client.c with one end of a
// socket as descriptor FV_LIBCAMERA_SOCKET; answers requests and sends frames (protocol.h) until
// the other end closes.
#include <libcamera/libcamera.h>
#include <libcamera/logging.h>

#include <poll.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <thread>

#include "device.h"
#include "printing.h"

namespace
{

// Other end closed: there is nobody to tell.
[[noreturn]] void leave()
{
    _exit(0);
}

void send_event(fv_libcamera_event *event, const int *descriptors = nullptr)
{
    alignas(cmsghdr) char space[CMSG_SPACE(sizeof(int) * FV_LIVE_BUFFERS_MAX)] = {};
    struct iovec piece = {event, fv_libcamera_event_bytes(event->kind)};
    struct msghdr message = {};
    message.msg_iov = &piece;
    message.msg_iovlen = 1;
    event->version = FV_LIBCAMERA_VERSION;
    if (descriptors != nullptr && event->buffer_count > 0) {
        const size_t bytes = sizeof(int) * event->buffer_count;
        message.msg_control = space;
        message.msg_controllen = CMSG_SPACE(bytes);
        cmsghdr *header = CMSG_FIRSTHDR(&message);
        header->cmsg_level = SOL_SOCKET;
        header->cmsg_type = SCM_RIGHTS;
        header->cmsg_len = CMSG_LEN(bytes);
        std::memcpy(CMSG_DATA(header), descriptors, bytes);
    }
    if (sendmsg(FV_LIBCAMERA_SOCKET, &message, MSG_NOSIGNAL) < 0) leave();
}

// What C++ throws becomes an error.
template <typename Call> enum fovea_status guarded(fovea_error *error, Call call)
try {
    return call();
} catch (const std::exception &problem) {
    return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "libcamera: %.200s", problem.what());
}

class Process
{
  public:
    // False: the other end closed.
    bool serve();

  private:
    void answer(const fv_libcamera_request &request);
    void send_frames();
    void broken(enum fovea_status status, const fovea_error &error);

    Device device_;
    bool streams_ = false;
    fv_libcamera_request request_{};
};

void Process::broken(enum fovea_status status, const fovea_error &error)
{
    fv_libcamera_event event{};
    event.kind = FV_LIBCAMERA_BROKEN;
    event.error = error;
    event.error.status = status;
    streams_ = false;
    send_event(&event);
}

void Process::answer(const fv_libcamera_request &request)
{
    fv_libcamera_event event{};
    fovea_error *error = &event.error;
    int descriptors[FV_LIVE_BUFFERS_MAX];
    event.kind = FV_LIBCAMERA_ANSWER;
    const enum fovea_status status = guarded(error, [&] {
        switch (request.call) {
        case FV_LIBCAMERA_LEARN:
            return device_.learn(request.options, &event.agreed, &event.notice, error);
        case FV_LIBCAMERA_FIND:
            return device_.find(error);
        case FV_LIBCAMERA_SET_UP:
            return device_.set_up(&event, descriptors);
        case FV_LIBCAMERA_CONTROL:
            return device_.control(request.options, error);
        default:
            return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                                   "libcamera: found an unknown request");
        }
    });
    error->status = status;
    if (status != FOVEA_OK) event.buffer_count = 0;
    if (request.call == FV_LIBCAMERA_SET_UP) streams_ = status == FOVEA_OK;
    send_event(&event, descriptors);
}

void Process::send_frames()
{
    fovea_error error{};
    enum fovea_status status = FOVEA_OK;
    while (streams_ && status == FOVEA_OK) {
        fv_libcamera_event event{};
        event.kind = FV_LIBCAMERA_FRAME;
        status = guarded(&error, [&] { return device_.take(&event.frame, &error); });
        if (status == FOVEA_OK) send_event(&event);
    }
    if (streams_ && status != FOVEA_AGAIN) broken(status, error);
}

bool Process::serve()
{
    struct pollfd fds[2] = {{FV_LIBCAMERA_SOCKET, POLLIN, 0},
                            {streams_ ? device_.bell() : -1, POLLIN, 0}};
    if (poll(fds, 2, -1) < 0) return true;
    if (fds[1].revents != 0) send_frames();
    if (fds[0].revents == 0) return true;
    const ssize_t bytes = recv(FV_LIBCAMERA_SOCKET, &request_, sizeof request_, 0);
    if (bytes <= 0) return false;
    fovea_error error{};
    if (request_.version != FV_LIBCAMERA_VERSION ||
        static_cast<size_t>(bytes) != fv_libcamera_request_bytes(request_.call)) {
        broken(FOVEA_ERROR_UNSUPPORTED, error);
    } else if (request_.call == FV_LIBCAMERA_KNOW) {
        device_.know(request_.options, request_.agreed);
    } else if (request_.call == FV_LIBCAMERA_GIVE) {
        if (!streams_) return true;
        const enum fovea_status status =
            guarded(&error, [&] { return device_.give(request_.index, &error); });
        if (status != FOVEA_OK) broken(status, error);
    } else {
        answer(request_);
    }
    return true;
}

// libcamera may hang when the runtime has gone: this outlives it by two seconds at most.
void watch()
{
    struct pollfd other_end = {FV_LIBCAMERA_SOCKET, 0, 0};
    while (poll(&other_end, 1, -1) <= 0) {
    }
    sleep(2);
    leave();
}

} // namespace

int main(int argc, char **argv)
{
    if (std::getenv("LIBCAMERA_LOG_LEVELS") == nullptr)
        libcamera::logSetTarget(libcamera::LoggingTargetNone);
    libcamera::logSetLevel("*", "FATAL"); // the runtime prints errors
    if (argc == 2 && std::strcmp(argv[1], FV_LIBCAMERA_LIST) == 0) return list_cameras();
    const struct rlimit none = {0, 0};
    struct pollfd other_end = {FV_LIBCAMERA_SOCKET, 0, 0};
    if (poll(&other_end, 1, 0) != 0) {
        std::fprintf(stderr,
                     "fovea-libcamera: started by fovea for sources libcamera:ID, not by hand\n");
        return 2;
    }
    setrlimit(RLIMIT_CORE, &none); // writing one would hold up recovery
    std::thread(watch).detach();
    Process process;
    while (process.serve()) {
    }
    return 0;
}

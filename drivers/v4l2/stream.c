/* Memory-mapped streaming. */
#include <errno.h>
#include <string.h>

#include "../clock.h"
#include "v4l2.h"

static const char *advice(int reason)
{
    switch (reason) {
    case EBUSY:
        return ": another program is using it";
    case EACCES:
        return ": is the user in the group video?";
    case ENOSPC:
        return ": no room on the bus: a lower rate or size, MJPG, or another port may fit";
    case ENOMEM:
        return ": fewer buffers or smaller pictures may fit";
    default:
        return "";
    }
}

enum fovea_status fv_v4l2_failed(const struct fv_v4l2_device *device, const char *what, int reason,
                                 struct fovea_error *error)
{
    const bool gone = reason == ENODEV || reason == ENOENT || reason == ENXIO;
    return fovea_error_set(error, gone ? FOVEA_GONE : FOVEA_ERROR_SYSTEM, "%s: %s: %s%s",
                           device->uri, what, gone ? "the camera is away" : strerror(reason),
                           gone ? "" : advice(reason));
}

/* A buffer's description; `plane` is what it needs where buffers have planes. */
static struct v4l2_buffer describe(const struct fv_v4l2_device *device, uint32_t index,
                                   struct v4l2_plane *plane)
{
    struct v4l2_buffer buffer = {
        .index = index, .type = fv_v4l2_type(device), .memory = V4L2_MEMORY_MMAP};
    if (device->planes) {
        memset(plane, 0, VIDEO_MAX_PLANES * sizeof *plane);
        buffer.m.planes = plane;
        buffer.length = VIDEO_MAX_PLANES;
    }
    return buffer;
}

static bool map_buffer(struct fv_v4l2_device *device, uint32_t index)
{
    struct v4l2_plane planes[VIDEO_MAX_PLANES];
    struct v4l2_buffer buffer = describe(device, index, planes);
    struct fv_v4l2_buffer_map *map = &device->maps[index];
    if (fv_v4l2_system->ioctl(device->fd, VIDIOC_QUERYBUF, &buffer) != 0) return false;
    map->bytes = device->planes ? planes[0].length : buffer.length;
    map->memory = fv_v4l2_system->map(device->fd, map->bytes,
                                      device->planes ? planes[0].m.mem_offset : buffer.m.offset);
    return map->memory != NULL;
}

/* Source changes (another size, no signal) are reported by events where the driver has them. */
static void subscribe(struct fv_v4l2_device *device)
{
    struct v4l2_event_subscription changes = {.type = V4L2_EVENT_SOURCE_CHANGE};
    device->events = fv_v4l2_system->ioctl(device->fd, VIDIOC_SUBSCRIBE_EVENT, &changes) == 0;
}

static enum fovea_status ask_for_buffers(struct fv_v4l2_device *device, struct fovea_error *error)
{
    struct v4l2_requestbuffers request = {.count = (uint32_t)device->options.buffers,
                                          .type = fv_v4l2_type(device),
                                          .memory = V4L2_MEMORY_MMAP};
    if (fv_v4l2_system->ioctl(device->fd, VIDIOC_REQBUFS, &request) != 0)
        return fv_v4l2_failed(device, "asking for buffers", errno, error);
    if (request.count < FV_LIVE_BUFFERS_MIN)
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM,
                               "%s: found %u buffers, expected at least %d", device->uri,
                               request.count, FV_LIVE_BUFFERS_MIN);
    const uint32_t most = (uint32_t)device->options.buffers; /* a driver may insist on more */
    device->buffer_count = request.count < most ? request.count : most;
    return FOVEA_OK;
}

enum fovea_status fv_v4l2_stream_on(struct fv_v4l2_device *device, struct fovea_error *error)
{
    int type = (int)fv_v4l2_type(device);
    device->queued = 0;
    enum fovea_status status = ask_for_buffers(device, error);
    for (uint32_t i = 0; i < device->buffer_count && status == FOVEA_OK; i++) {
        if (!map_buffer(device, i))
            status = fv_v4l2_failed(device, "mapping a buffer", errno, error);
        if (status == FOVEA_OK) status = fv_v4l2_give(device, i, error);
    }
    if (status != FOVEA_OK) return status;
    subscribe(device);
    if (fv_v4l2_system->ioctl(device->fd, VIDIOC_STREAMON, &type) != 0)
        return fv_v4l2_failed(device, "starting to stream", errno, error);
    device->streaming = true;
    return FOVEA_OK;
}

void fv_v4l2_stream_off(struct fv_v4l2_device *device)
{
    int type = (int)fv_v4l2_type(device);
    struct v4l2_requestbuffers none = {.type = fv_v4l2_type(device), .memory = V4L2_MEMORY_MMAP};
    /* Where the camera is away these fail, and that is fine: closing the node frees the rest. */
    if (device->streaming) (void)fv_v4l2_system->ioctl(device->fd, VIDIOC_STREAMOFF, &type);
    device->streaming = false;
    for (uint32_t i = 0; i < FV_LIVE_BUFFERS_MAX; i++) {
        if (device->maps[i].memory != NULL)
            fv_v4l2_system->unmap(device->maps[i].memory, device->maps[i].bytes);
        device->maps[i] = (struct fv_v4l2_buffer_map){NULL, 0};
    }
    if (device->buffer_count > 0) (void)fv_v4l2_system->ioctl(device->fd, VIDIOC_REQBUFS, &none);
    device->buffer_count = 0;
}

enum fovea_status fv_v4l2_give(void *to, uint32_t index, struct fovea_error *error)
{
    struct fv_v4l2_device *device = to;
    struct v4l2_plane planes[VIDEO_MAX_PLANES];
    struct v4l2_buffer buffer = describe(device, index, planes);
    if (fv_v4l2_system->ioctl(device->fd, VIDIOC_QBUF, &buffer) != 0)
        return fv_v4l2_failed(device, "giving back a buffer", errno, error);
    device->queued++;
    return FOVEA_OK;
}

/* ---- frames ---------------------------------------------------------------------------------- */

static void read_stamp(const struct fv_v4l2_device *device, const struct v4l2_buffer *from,
                       struct fv_order_stamp *stamp)
{
    const bool monotonic =
        (from->flags & V4L2_BUF_FLAG_TIMESTAMP_MASK) == V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
    const bool start =
        (from->flags & V4L2_BUF_FLAG_TSTAMP_SRC_MASK) == V4L2_BUF_FLAG_TSTAMP_SRC_SOE;
    /* Unsigned: a driver may state anything. */
    const uint64_t stamp_ns =
        (uint64_t)from->timestamp.tv_sec * 1000000000u + (uint64_t)from->timestamp.tv_usec * 1000u;
    *stamp = (struct fv_order_stamp){
        .stamp_ns = (int64_t)stamp_ns,
        .clock_known = monotonic,
        .clock = FOVEA_CLOCK_MONOTONIC,
        .meaning = !monotonic ? FOVEA_STAMP_UNKNOWN
                   : start    ? FOVEA_STAMP_EXPOSURE_START
                              : FOVEA_STAMP_EXPOSURE_END,
        .exposure_ns = device->exposure_ns,
        .sequence_known = true,
        .sequence = from->sequence,
    };
}

static enum fovea_status dequeue(struct fv_v4l2_device *device, struct fv_live_buffer *out,
                                 struct fovea_error *error)
{
    struct v4l2_plane planes[VIDEO_MAX_PLANES];
    struct v4l2_buffer buffer = describe(device, 0, planes);
    if (fv_v4l2_system->ioctl(device->fd, VIDIOC_DQBUF, &buffer) != 0)
        return errno == EAGAIN ? FOVEA_AGAIN
                               : fv_v4l2_failed(device, "taking a frame", errno, error);
    if (buffer.index >= device->buffer_count)
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM,
                               "%s: found buffer %u, expected less than %u", device->uri,
                               buffer.index, device->buffer_count);
    device->queued--;
    const struct fv_v4l2_buffer_map *map = &device->maps[buffer.index];
    const size_t skipped = device->planes ? planes[0].data_offset : 0;
    const size_t used = device->planes ? planes[0].bytesused : buffer.bytesused;
    const bool fits = used <= map->bytes && skipped <= used;
    *out = (struct fv_live_buffer){
        .index = buffer.index,
        .data = (const uint8_t *)map->memory + (fits ? skipped : 0),
        .bytes = fits ? used - skipped : 0,
        .stride_bytes = device->agreed.stride_bytes,
        .damaged = (buffer.flags & V4L2_BUF_FLAG_ERROR) != 0,
    };
    read_stamp(device, &buffer, &out->stamp);
    return FOVEA_OK;
}

static int64_t left_until(int64_t deadline_ns)
{
    const int64_t left_ns = deadline_ns - fv_clock_ns(CLOCK_MONOTONIC);
    return left_ns > 0 ? left_ns : 0;
}

/* An error or a change that poll reported: what DQBUF says is the reason. */
static enum fovea_status explain(struct fv_v4l2_device *device, short events,
                                 struct fv_live_buffer *buffer, struct fovea_error *error)
{
    struct v4l2_capability capability;
    if ((events & POLLPRI) != 0) {
        struct v4l2_event event = {0};
        if (fv_v4l2_system->ioctl(device->fd, VIDIOC_DQEVENT, &event) == 0 &&
            event.type == V4L2_EVENT_SOURCE_CHANGE)
            return fovea_error_set(
                error, FOVEA_ERROR_SYSTEM,
                "%s: the driver says that its source has changed: it is set up again", device->uri);
    }
    enum fovea_status status = dequeue(device, buffer, error);
    if (status != FOVEA_AGAIN || (events & (POLLERR | POLLHUP | POLLNVAL)) == 0) return status;
    if (fv_v4l2_system->ioctl(device->fd, VIDIOC_QUERYCAP, &capability) != 0)
        return fv_v4l2_failed(device, "waiting for a frame", errno, error);
    return fovea_error_set(error, FOVEA_ERROR_SYSTEM,
                           "%s: waiting for a frame: the driver reports an error", device->uri);
}

enum fovea_status fv_v4l2_take(void *from, int64_t deadline_ns, int wake_fd,
                               struct fv_live_buffer *buffer, struct fovea_error *error)
{
    struct fv_v4l2_device *device = from;
    struct pollfd fds[2] = {
        {.fd = wake_fd, .events = POLLIN},
        {.fd = device->fd, .events = (short)(POLLIN | (device->events ? POLLPRI : 0))}};
    /* With no buffer queued, poll would report an error. */
    const nfds_t count = device->queued > 0 ? 2 : 1;
    const int ready = fv_v4l2_system->poll(fds, count, left_until(deadline_ns));
    if (ready < 0 && errno != EINTR)
        return fv_v4l2_failed(device, "waiting for a frame", errno, error);
    if (ready <= 0 || count < 2 || fds[1].revents == 0) return FOVEA_AGAIN;
    if (fds[1].revents == POLLIN) return dequeue(device, buffer, error);
    return explain(device, fds[1].revents, buffer, error);
}

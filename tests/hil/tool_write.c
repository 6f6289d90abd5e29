/* hil-tool write DEVICE FORMAT WIDTH HEIGHT FILE RATE COUNT [mmap]
 * Frames of FILE, over and over, COUNT of them (0: until killed), into a video output; with write() or
 * through mapped buffers. */
#include "tool.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <linux/videodev2.h>

enum { BUFFERS = 4 };

static void call(int fd, unsigned long request, void *argument, const char *what)
{
    if (ioctl(fd, request, argument) != 0) tool_fail("%s: %s", what, strerror(errno));
}

static void map_buffers(int fd, void *maps[BUFFERS])
{
    struct v4l2_requestbuffers request = {
        .count = BUFFERS, .type = V4L2_BUF_TYPE_VIDEO_OUTPUT, .memory = V4L2_MEMORY_MMAP};
    call(fd, VIDIOC_REQBUFS, &request, "REQBUFS");
    for (unsigned i = 0; i < BUFFERS; ++i) {
        struct v4l2_buffer buffer = {
            .index = i, .type = V4L2_BUF_TYPE_VIDEO_OUTPUT, .memory = V4L2_MEMORY_MMAP};
        call(fd, VIDIOC_QUERYBUF, &buffer, "QUERYBUF");
        maps[i] = mmap(NULL, buffer.length, PROT_READ | PROT_WRITE, MAP_SHARED, fd, buffer.m.offset);
        if (maps[i] == MAP_FAILED) tool_fail("mmap: %s", strerror(errno));
    }
}

static void put_mapped(int fd, void *maps[BUFFERS], long number, const uint8_t *frame, size_t bytes)
{
    int type = V4L2_BUF_TYPE_VIDEO_OUTPUT;
    struct v4l2_buffer buffer = {
        .index = (unsigned)number, .type = V4L2_BUF_TYPE_VIDEO_OUTPUT, .memory = V4L2_MEMORY_MMAP};
    if (number >= BUFFERS) call(fd, VIDIOC_DQBUF, &buffer, "DQBUF");
    memcpy(maps[buffer.index], frame, bytes);
    buffer.bytesused = (unsigned)bytes;
    buffer.field = V4L2_FIELD_NONE;
    call(fd, VIDIOC_QBUF, &buffer, "QBUF");
    if (number == 0) call(fd, VIDIOC_STREAMON, &type, "STREAMON");
}

/* v4l2loopback refuses a writer for some time after the last one died. */
static int open_output(const char *device, const struct v4l2_format *wanted)
{
    for (int tries = 0; tries < 100; ++tries) {
        struct v4l2_format format = *wanted;
        const int fd = open(device, O_RDWR | O_CLOEXEC);
        if (fd < 0) tool_fail("%s: %s", device, strerror(errno));
        if (ioctl(fd, VIDIOC_S_FMT, &format) == 0) return fd;
        close(fd);
        tool_sleep_until(tool_now_ns() + 100000000);
    }
    tool_fail("%s: S_FMT: %s", device, strerror(errno));
}

int tool_write(int argc, char **argv)
{
    if (argc < 8) tool_fail("usage: write DEVICE FORMAT WIDTH HEIGHT FILE RATE COUNT [mmap]");
    const struct tool_format *shape = tool_format(argv[2]);
    const int width = atoi(argv[3]), height = atoi(argv[4]);
    const double rate_hz = atof(argv[6]);
    const long count = atol(argv[7]);
    const size_t bytes = tool_frame_bytes(shape, width, height);
    struct tool_frames frames;
    void *maps[BUFFERS];
    tool_frames_read(&frames, argv[5], bytes);
    struct v4l2_format format = {.type = V4L2_BUF_TYPE_VIDEO_OUTPUT};
    format.fmt.pix = (struct v4l2_pix_format){.width = (unsigned)width,
                                              .height = (unsigned)height,
                                              .pixelformat = shape->fourcc,
                                              .field = V4L2_FIELD_NONE,
                                              .bytesperline = (unsigned)(bytes / (size_t)height),
                                              .sizeimage = (unsigned)bytes};
    const int fd = open_output(argv[1], &format);
    struct v4l2_streamparm rate = {.type = V4L2_BUF_TYPE_VIDEO_OUTPUT};
    rate.parm.output.timeperframe = (struct v4l2_fract){1000, (unsigned)(rate_hz * 1000)};
    (void)ioctl(fd, VIDIOC_S_PARM, &rate); /* not all have it */
    if (argc > 8) map_buffers(fd, maps);
    int64_t at_ns = tool_now_ns();
    for (long k = 0; count == 0 || k < count; ++k) {
        const uint8_t *frame = frames.data + frames.at[(size_t)k % frames.count];
        if (argc > 8)
            put_mapped(fd, maps, k, frame, bytes);
        else if (write(fd, frame, bytes) != (ssize_t)bytes)
            tool_fail("write: %s", strerror(errno));
        at_ns += (int64_t)(1e9 / rate_hz);
        tool_sleep_until(at_ns);
    }
    return close(fd);
}

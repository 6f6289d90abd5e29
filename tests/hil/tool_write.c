/* hil-tool write DEVICE FORMAT WIDTH HEIGHT FILE RATE COUNT [OPTION...]
 * Frames of FILE, over and over, COUNT of them (0: until killed), into a video output.
 *
 *   mmap=N      through N mapped buffers, not by write(); with more of them than FILE has frames,
 *               the output always has frames waiting
 *   after=FILE  a frame goes out when FILE has grown by one since the last, or after ten seconds,
 *              whatever RATE says; not while mapped buffers are filled for the first time */
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

enum { BUFFERS_MAX = 32 };

static struct output {
    int fd;
    long buffers; /* 0: by write() */
    void *maps[BUFFERS_MAX];
    struct tool_pace pace;
} output;

static void call(int fd, unsigned long request, void *argument, const char *what)
{
    if (ioctl(fd, request, argument) != 0) tool_fail("%s: %s", what, strerror(errno));
}

static void map_buffers(void)
{
    struct v4l2_requestbuffers request = {.count = (unsigned)output.buffers,
                                          .type = V4L2_BUF_TYPE_VIDEO_OUTPUT,
                                          .memory = V4L2_MEMORY_MMAP};
    const int fd = output.fd;
    call(fd, VIDIOC_REQBUFS, &request, "REQBUFS");
    output.buffers = request.count < BUFFERS_MAX ? request.count : BUFFERS_MAX;
    for (unsigned i = 0; i < output.buffers; i++) {
        struct v4l2_buffer buffer = {
            .index = i, .type = V4L2_BUF_TYPE_VIDEO_OUTPUT, .memory = V4L2_MEMORY_MMAP};
        call(fd, VIDIOC_QUERYBUF, &buffer, "QUERYBUF");
        output.maps[i] =
            mmap(NULL, buffer.length, PROT_READ | PROT_WRITE, MAP_SHARED, fd, buffer.m.offset);
        if (output.maps[i] == MAP_FAILED) tool_fail("mmap: %s", strerror(errno));
    }
}

/* Streaming begins when all buffers are filled. */
static void put_mapped(long number, const uint8_t *frame, size_t bytes)
{
    const int fd = output.fd;
    int type = V4L2_BUF_TYPE_VIDEO_OUTPUT;
    struct v4l2_buffer buffer = {
        .index = (unsigned)number, .type = V4L2_BUF_TYPE_VIDEO_OUTPUT, .memory = V4L2_MEMORY_MMAP};
    if (number >= output.buffers) call(fd, VIDIOC_DQBUF, &buffer, "DQBUF");
    memcpy(output.maps[buffer.index], frame, bytes);
    buffer.timestamp = (struct timeval){0, 0}; /* the driver's, not that of the frame before */
    buffer.bytesused = (unsigned)bytes;
    buffer.field = V4L2_FIELD_NONE;
    call(fd, VIDIOC_QBUF, &buffer, "QBUF");
    if (number == output.buffers - 1) call(fd, VIDIOC_STREAMON, &type, "STREAMON");
}

/* v4l2loopback refuses a writer for some time after the last one died. */
static int open_output(const char *device, const struct v4l2_format *wanted)
{
    for (int tries = 0; tries < 100; tries++) {
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
    if (argc < 8) tool_fail("usage: write DEVICE FORMAT WIDTH HEIGHT FILE RATE COUNT [OPTION...]");
    const struct tool_format *shape = tool_format(argv[2]);
    const int width = atoi(argv[3]), height = atoi(argv[4]);
    const double rate_hz = atof(argv[6]);
    const long count = atol(argv[7]);
    const size_t bytes = tool_frame_bytes(shape, width, height);
    struct tool_frames frames;
    for (int i = 8; i < argc; i++) {
        if (strncmp(argv[i], "mmap=", 5) == 0) output.buffers = atol(argv[i] + 5);
        if (strncmp(argv[i], "after=", 6) == 0) output.pace.file = argv[i] + 6;
    }
    tool_frames_read(&frames, argv[5], bytes);
    struct v4l2_format format = {.type = V4L2_BUF_TYPE_VIDEO_OUTPUT};
    format.fmt.pix = (struct v4l2_pix_format){.width = (unsigned)width,
                                              .height = (unsigned)height,
                                              .pixelformat = shape->fourcc,
                                              .field = V4L2_FIELD_NONE,
                                              .sizeimage = (unsigned)bytes};
    const int fd = output.fd = open_output(argv[1], &format);
    struct v4l2_streamparm rate = {.type = V4L2_BUF_TYPE_VIDEO_OUTPUT};
    rate.parm.output.timeperframe = (struct v4l2_fract){1000, (unsigned)(rate_hz * 1000)};
    (void)ioctl(fd, VIDIOC_S_PARM, &rate); /* not all have it */
    if (output.buffers > 0) map_buffers();
    int64_t at_ns = tool_now_ns();
    for (long k = 0; count == 0 || k < count; k++) {
        const uint8_t *frame = frames.data + frames.at[(size_t)k % frames.count];
        while ((k == 0 || k >= output.buffers) && !tool_pace_ready(&output.pace))
            tool_sleep_until(tool_now_ns() + 10000000);
        if (output.buffers > 0)
            put_mapped(k, frame, bytes);
        else if (write(fd, frame, bytes) != (ssize_t)bytes)
            tool_fail("write: %s", strerror(errno));
        if (k + 1 == (output.buffers > 0 ? output.buffers : 1)) printf("streaming\n");
        if (k < output.buffers || output.pace.file != NULL) continue;
        at_ns += (int64_t)(1e9 / rate_hz);
        tool_sleep_until(at_ns);
    }
    return close(fd);
}

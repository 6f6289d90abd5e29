#include "tool.h"

#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include <linux/videodev2.h>

static const struct tool_format formats[] = {
    {"GREY", V4L2_PIX_FMT_GREY, 2, "Y800"},   {"Y10", V4L2_PIX_FMT_Y10, 4, "Y10 "},
    {"Y12", V4L2_PIX_FMT_Y12, 4, "Y12 "},     {"Y16", V4L2_PIX_FMT_Y16, 4, "Y16 "},
    {"YUYV", V4L2_PIX_FMT_YUYV, 4, "YUY2"},   {"UYVY", V4L2_PIX_FMT_UYVY, 4, "UYVY"},
    {"NV12", V4L2_PIX_FMT_NV12, 3, "NV12"},   {"YU12", V4L2_PIX_FMT_YUV420, 3, "I420"},
    {"RGGB", V4L2_PIX_FMT_SRGGB8, 2, "RGGB"}, {"BGGR", V4L2_PIX_FMT_SBGGR8, 2, "BA81"},
    {"GRBG", V4L2_PIX_FMT_SGRBG8, 2, "GRBG"}, {"GBRG", V4L2_PIX_FMT_SGBRG8, 2, "GBRG"},
    {"MJPG", V4L2_PIX_FMT_MJPEG, 0, NULL},
};

const struct tool_format *tool_format(const char *name)
{
    for (size_t i = 0; i < sizeof formats / sizeof formats[0]; i++)
        if (strcmp(formats[i].name, name) == 0) return &formats[i];
    tool_fail("unknown format '%s'", name);
}

size_t tool_frame_bytes(const struct tool_format *format, int width, int height)
{
    return (size_t)width * (size_t)height * (size_t)format->half_bytes / 2;
}

int64_t tool_now_ns(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

/* Recordings that pace have frames of 320 x 240 pixels; a step without a frame records far less. */
enum { FRAME_BYTES_MIN = 60000 };

bool tool_pace_ready(struct tool_pace *pace)
{
    struct stat now = {.st_size = 0};
    if (pace->file == NULL) return true;
    if (stat(pace->file, &now) != 0) now.st_size = 0;
    if (now.st_size < pace->bytes) pace->bytes = 0; /* another recording */
    const int64_t waited_ns = tool_now_ns() - pace->since_ns;
    if (now.st_size < pace->bytes + FRAME_BYTES_MIN && waited_ns < 10000000000) return false;
    pace->bytes = now.st_size;
    pace->since_ns = tool_now_ns();
    return true;
}

void tool_pace_on(const char *file)
{
    static off_t bytes;
    bytes += FRAME_BYTES_MIN;
    const int fd = open(file, O_WRONLY | O_CREAT | O_CLOEXEC, 0600);
    if (fd < 0 || ftruncate(fd, bytes) != 0) tool_fail("%s: %s", file, strerror(errno));
    close(fd);
}

void tool_sleep_until(int64_t at_ns)
{
    const struct timespec at = {.tv_sec = at_ns / 1000000000, .tv_nsec = at_ns % 1000000000};
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, NULL) == EINTR) {
    }
}

void tool_fail(const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    fprintf(stderr, "hil-tool: ");
    vfprintf(stderr, format, arguments);
    fprintf(stderr, "\n");
    va_end(arguments);
    exit(1);
}

/* The end of the picture that begins at `at`: behind FF D9, which entropy-coded data cannot hold.
 */
static size_t jpeg_end(const uint8_t *data, size_t at, size_t bytes)
{
    for (size_t i = at + 2; i + 1 < bytes; i++)
        if (data[i] == 0xff && data[i + 1] == 0xd9) return i + 2;
    return bytes;
}

void tool_frames_read(struct tool_frames *frames, const char *path, size_t frame_bytes)
{
    FILE *file = fopen(path, "rb");
    if (file == NULL || fseek(file, 0, SEEK_END) != 0) tool_fail("%s: %s", path, strerror(errno));
    frames->bytes = (size_t)ftell(file);
    rewind(file);
    frames->data = malloc(frames->bytes + 1);
    const size_t most = 4096;
    frames->at = calloc(most, sizeof *frames->at);
    frames->length = calloc(most, sizeof *frames->length);
    if (frames->data == NULL || fread(frames->data, 1, frames->bytes, file) != frames->bytes)
        tool_fail("%s: cannot be read", path);
    fclose(file);
    frames->count = 0;
    for (size_t at = 0; at < frames->bytes && frames->count < most; frames->count++) {
        frames->at[frames->count] = at;
        frames->length[frames->count] =
            frame_bytes > 0 ? frame_bytes : jpeg_end(frames->data, at, frames->bytes) - at;
        at += frames->length[frames->count];
        if (at > frames->bytes) break; /* a piece of a frame at the end */
    }
    if (frames->count == 0) tool_fail("%s: found no frame", path);
}

int main(int argc, char **argv)
{
    static const struct {
        const char *name;
        int (*run)(int argc, char **argv);
    } commands[] = {{"make", tool_make}, {"write", tool_write},   {"usb", tool_usb},
                    {"read", tool_read}, {"direct", tool_direct}, {"states", tool_states}};
    setvbuf(stdout, NULL, _IOLBF, 0);
    for (size_t i = 0; argc > 1 && i < sizeof commands / sizeof commands[0]; i++)
        if (strcmp(commands[i].name, argv[1]) == 0) return commands[i].run(argc - 1, argv + 1);
    tool_fail("usage: hil-tool make|write|usb|read|direct|states ...");
}

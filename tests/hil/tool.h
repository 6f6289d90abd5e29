/* The program that the tests on kernel drivers run inside the virtual machine: build/hil-tool
 * COMMAND. One file per command; what they share is here. */
#ifndef FOVEA_TESTS_HIL_TOOL_H
#define FOVEA_TESTS_HIL_TOOL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* A format of the tests by its four letters. */
struct tool_format {
    const char *name;
    uint32_t fourcc; /* of V4L2 */
    int half_bytes; /* of a pixel, all planes, in half bytes per pixel: 2 is one byte; 0: compressed
                     */
    const char *guid4; /* first four bytes of the GUID in USB descriptors; NULL: none */
};
const struct tool_format *tool_format(const char *name);
size_t tool_frame_bytes(const struct tool_format *format, int width, int height);

/* Frames in a file: raw ones end to end, JPEG pictures by their markers. Fails the program when it
 * cannot be read. */
struct tool_frames {
    uint8_t *data;
    size_t count, bytes;
    size_t *at, *length; /* per frame */
};
void tool_frames_read(struct tool_frames *frames, const char *path, size_t frame_bytes);

/* Frames given no faster than they are recorded, so that a slow machine loses none. */
struct tool_pace {
    const char *file; /* that grows with each; NULL: no pace is kept */
    int64_t bytes, since_ns;
};
/* Whether the file has grown by a frame since this last said yes, or ten seconds have passed. */
bool tool_pace_ready(struct tool_pace *pace);
/* Make such a file grow by one frame more. */
void tool_pace_on(const char *file);

int64_t tool_now_ns(void);
void tool_sleep_until(int64_t at_ns);
_Noreturn void tool_fail(const char *format, ...) __attribute__((format(printf, 1, 2)));

int tool_make(int argc, char **argv);  /* test frames into a file */
int tool_write(int argc, char **argv); /* frames of a file into an output device */
int tool_usb(int argc, char **argv);   /* a USB camera in user space */
int tool_read(int argc,
              char **argv); /* frames of a source, held against those of a file; unplugging */
int tool_direct(int argc,
                char **argv); /* a recording with its frames replaced by those of another source */
int tool_states(int argc, char **argv); /* what a recording says of the camera */

#endif

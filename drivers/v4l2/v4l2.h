/* The V4L2 driver, inside: what its files share. Options are in drivers/README.md. */
#ifndef FOVEA_V4L2_V4L2_H
#define FOVEA_V4L2_V4L2_H

#include <linux/videodev2.h>

#include "../live/live.h"
#include "system.h"

enum { FV_V4L2_CONTROL_VALUES_MAX = 16, FV_V4L2_WORD_BYTES = 64 };

/* ---- options (options.c) --------------------------------------------------------------------- */

/* A control by its name, as v4l2-ctl writes it ("exposure_time_absolute"), and the value as given.
 */
struct fv_v4l2_control_value {
    char name[FV_V4L2_WORD_BYTES], value[FV_V4L2_WORD_BYTES];
};

struct fv_v4l2_options {
    char path[FV_V4L2_PATH_BYTES]; /* of the device node, or a link to it */
    int32_t width, height;         /* 0: as the camera is set */
    double rate_hz;                /* 0: likewise */
    int32_t format;                /* row of fv_v4l2_format_names, whose first is "any" */
    int32_t shift;                 /* Y16: significant bits are the word >> shift, 8 of them kept */
    double exposure_ms;            /* 0: as the camera is set */
    double gain;                   /* negative: as the camera is set */
    bool auto_exposure, auto_gain;
    bool auto_exposure_given, auto_gain_given;
    double readout_ms; /* negative: not given */
    int32_t buffers;
    int32_t split; /* cameras that share a picture side by side: 1 or 2 */
    uint32_t control_value_count;
    struct fv_v4l2_control_value control_values[FV_V4L2_CONTROL_VALUES_MAX];
};

/* Parse what follows "v4l2:" in the URI. Init-only. */
enum fovea_status fv_v4l2_options_parse(const char *address, struct fv_v4l2_options *options,
                                        struct fovea_error *error);

/* ---- formats (formats.c) --------------------------------------------------------------------- */

struct fv_v4l2_format {
    const char *name; /* in options */
    uint32_t fourcc;
    enum fovea_pixel_format format;
};

/* In the order of preference when none is asked for. */
extern const struct fv_v4l2_format fv_v4l2_formats[];
/* "any" and the names of fv_v4l2_formats, ended by NULL. */
extern const char *const fv_v4l2_format_names[];

const struct fv_v4l2_format *fv_v4l2_format_by_fourcc(uint32_t fourcc);
/* "YUYV"; characters that cannot be shown become '?'. Returns `text`. */
const char *fv_v4l2_fourcc(uint32_t fourcc, char text[5]);

/* ---- the device ------------------------------------------------------------------------------ */

/* Which camera it is, apart from the node it is found under. */
struct fv_v4l2_identity {
    char driver[16], card[32], bus_info[32];
    /* from sysfs; empty where not known, serial also where not unique */
    char name[64], index[16], serial[64];
};

/* What was agreed on with the driver. */
struct fv_v4l2_agreed {
    int32_t width, height, stride_bytes;
    const struct fv_v4l2_format *format;
    double rate_hz; /* 0: not known */
};

struct fv_v4l2_buffer_map {
    void *memory;
    size_t bytes;
};

/* Automatic gain by the driver (auto_gain.c). */
struct fv_v4l2_auto_gain {
    uint32_t id; /* of the control that it moves; 0: it is off */
    int32_t minimum, maximum, step, value;
    uint32_t frames; /* since the last look */
};

/* How exposure or gain were before they were first changed. */
struct fv_v4l2_before {
    bool known, has_mode, has_value;
    int32_t mode, value; /* of the automatism's control, and of the number's */
};

struct fv_v4l2_device {
    struct fv_v4l2_options options; /* in force: those asked for, and what was changed since */
    struct fv_v4l2_options asked;   /* by the address */
    struct fv_v4l2_before before[FOVEA_SOURCE_CONTROL_COUNT];
    char uri[FV_V4L2_PATH_BYTES + 8]; /* "v4l2:PATH", begins every line */
    char node[FV_V4L2_PATH_BYTES];
    struct fv_v4l2_identity identity;
    bool known; /* identity and agreed hold */
    struct fv_v4l2_agreed agreed;
    int64_t exposure_ns; /* 0: not known */
    struct fv_v4l2_auto_gain gain;

    int fd; /* -1: closed */
    bool planes, streaming, events;
    uint32_t buffer_count, queued;
    struct fv_v4l2_buffer_map maps[FV_LIVE_BUFFERS_MAX];
};

/* find.c: the node under which the camera is now, into device->node. As fv_live_ops.find. */
enum fovea_status fv_v4l2_find(struct fv_v4l2_device *device, struct fovea_error *error);
/* Which camera is behind an open node. False: errno says why not. */
bool fv_v4l2_identify(int fd, const char *node, struct fv_v4l2_identity *identity);
/* Forget a serial number that another camera of this host has too. Init-only. */
void fv_v4l2_identity_settle(struct fv_v4l2_identity *identity, const char *node);

/* negotiate.c: size, format and rate, on an open node; `notice` (or NULL) gets a line where they
 * are not as asked. Once the device is known, anything else than before is refused. */
enum fovea_status fv_v4l2_negotiate(struct fv_v4l2_device *device, struct fovea_error *notice,
                                    struct fovea_error *error);
/* Add to `notice` (or NULL) that something is not as asked. */
void fv_v4l2_notice(struct fovea_error *notice, const struct fv_v4l2_device *device,
                    const char *what, double asked, double given);

/* controls.c: "Exposure Time, Absolute" becomes "exposure_time_absolute", as v4l2-ctl does. */
void fv_v4l2_option_name(const char *name, char out[32]);

/* controls.c: exposure, gain and controls by name, each checked against the driver's range, on an
 * open node. `notice` (or NULL) gets a line where a value, read back, differs by over 1 % from what
 * was asked for. Sets device->exposure_ns. */
enum fovea_status fv_v4l2_controls_set(struct fv_v4l2_device *device, struct fovea_error *notice,
                                       struct fovea_error *error);

/* controls.c: as fovea_source_ops.control, on an open node. Sets device->exposure_ns. */
enum fovea_status fv_v4l2_control(struct fv_v4l2_device *device, enum fovea_source_control control,
                                  double value, struct fovea_error *error);

/* auto_gain.c: for a camera that has a gain, described by `info`, but does not move it itself.
 * `begin` with every set-up; `seen` with every good frame, on the camera thread. */
enum fovea_status fv_v4l2_auto_gain_begin(struct fv_v4l2_device *device,
                                          const struct v4l2_query_ext_ctrl *info,
                                          struct fovea_error *error);
void fv_v4l2_auto_gain_seen(struct fv_v4l2_device *device, const struct fovea_image *image);
/* Mean grey level [0, 255] over a grid, of any raw format that V4L2 cameras give. */
int fv_v4l2_brightness(const struct fovea_image *image);

/* stream.c: buffers and streaming on an open, negotiated node. */
enum fovea_status fv_v4l2_stream_on(struct fv_v4l2_device *device, struct fovea_error *error);
void fv_v4l2_stream_off(struct fv_v4l2_device *device);
enum fovea_status fv_v4l2_take(void *device, int64_t deadline_ns, int wake_fd,
                               struct fv_live_buffer *buffer, struct fovea_error *error);
enum fovea_status fv_v4l2_give(void *device, uint32_t index, struct fovea_error *error);

/* The error of a failed call: FOVEA_GONE where errno means unplugged, else FOVEA_ERROR_SYSTEM with
 * advice. */
enum fovea_status fv_v4l2_failed(const struct fv_v4l2_device *device, const char *what, int reason,
                                 struct fovea_error *error);

static inline uint32_t fv_v4l2_type(const struct fv_v4l2_device *device)
{
    return device->planes ? V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE : V4L2_BUF_TYPE_VIDEO_CAPTURE;
}

#endif

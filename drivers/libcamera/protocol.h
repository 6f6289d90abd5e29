/* What the program and the process that keeps libcamera (build/fovea-libcamera, built where
 * libcamera-dev is installed) say to each other.
 *
 * libcamera is a process of its own because it may end: 0.0.3 aborts when a camera is unplugged at
 * the wrong moment ("Trying to complete a request when stopped"), and its pipelines crash, hang and
 * leak in others. Here all of that is one more fault of a camera: drivers/live/recovery.h gets over
 * it, and the runtime's own process keeps its memory to itself.
 *
 * Both hold one end of a socket that keeps messages apart. Frames do not travel: the descriptors of
 * their buffers come once, with the answer to SET_UP, and are mapped by the program; from then on
 * an index says which buffer is filled and which is free again.
 *
 *   program                 process
 *   LEARN options      ->             find the camera, configure it once, let it go again
 *                      <-   ANSWER    status; what was agreed on; a line where not all is as asked
 *   KNOW options,agreed ->            the same camera again, in a new process; no answer
 *   FIND               ->
 *                      <-   ANSWER    FOVEA_OK: it is there. FOVEA_GONE
 *   SET_UP             ->
 *                      <-   ANSWER    status; buffers, their descriptors beside it
 *                      <-   FRAME     a buffer is filled
 *   GIVE index         ->             it is free again
 *   CONTROL options    ->             exposure and gain become these, also of a camera that does
 *                                     not stream; FRAMEs may come before the answer
 *                      <-   ANSWER    status; on an error they stay as they were
 *                      <-   BROKEN    streaming is over: FOVEA_GONE when unplugged, or negative
 *
 * A process serves one SET_UP: when streaming is over, for whatever reason, the program ends it and
 * starts another. The process ends when its socket does. Both come from one build, which the
 * version makes sure of.
 *
 * With FV_LIBCAMERA_LIST as its only argument the process has no socket: it prints the cameras on
 * stdout and ends. Fields are between tabs, lines below a camera are its own:
 *   camera   ID  MODEL
 *   format   libcamera's name  WIDTH  HEIGHT [highest rate in Hz [lowest]]
 *   control  NAME  MINIMUM  MAXIMUM  DEFAULT
 *   trouble  why nothing more is known
 */
#ifndef FOVEA_LIBCAMERA_PROTOCOL_H
#define FOVEA_LIBCAMERA_PROTOCOL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "../live/live.h"

#ifdef __cplusplus
extern "C" {
#endif

#define FV_LIBCAMERA_PROGRAM "fovea-libcamera"
#define FV_LIBCAMERA_LIST "--list"
enum {
    FV_LIBCAMERA_VERSION = 4,
    FV_LIBCAMERA_SOCKET = 3, /* the process's descriptor */
    FV_LIBCAMERA_CONTROL_VALUES_MAX = 16,
    FV_LIBCAMERA_ID_BYTES = 200
};

enum fv_libcamera_role {
    FV_LIBCAMERA_ROLE_VIDEO = 0,
    FV_LIBCAMERA_ROLE_VIEWFINDER,
    FV_LIBCAMERA_ROLE_STILL,
    FV_LIBCAMERA_ROLE_RAW
};

/* A control by libcamera's name for it ("Brightness"), and the value as given. */
struct fv_libcamera_control_value {
    char name[64], value[64];
};

struct fv_libcamera_options {
    char id[FV_LIBCAMERA_ID_BYTES]; /* a camera's id, or its place in libcamera's list */
    int32_t role;
    int32_t format;        /* row of FV_LIBCAMERA_FORMATS plus 1; 0: as the role has it */
    int32_t width, height; /* 0: as the role has it */
    double rate_hz;        /* 0: likewise; a frame duration */
    double exposure_ms;    /* 0: automatic or as it is */
    double gain;           /* negative: likewise */
    bool auto_exposure, auto_exposure_given, auto_gain, auto_gain_given;
    double readout_ms; /* negative: not given */
    int32_t buffers;
    uint32_t control_value_count;
    struct fv_libcamera_control_value control_values[FV_LIBCAMERA_CONTROL_VALUES_MAX];
};

/* What was agreed on. */
struct fv_libcamera_agreed {
    int32_t width, height;
    int32_t row;                    /* of FV_LIBCAMERA_FORMATS: the camera's */
    enum fovea_pixel_format format; /* of the frames as they are handed on */
    double rate_hz;                 /* 0: not known */
    uint32_t buffers;
    char id[FV_LIBCAMERA_ID_BYTES];
};

enum fv_libcamera_call {
    FV_LIBCAMERA_LEARN = 1,
    FV_LIBCAMERA_KNOW,
    FV_LIBCAMERA_FIND,
    FV_LIBCAMERA_SET_UP,
    FV_LIBCAMERA_GIVE,
    FV_LIBCAMERA_CONTROL
};

/* From the program. GIVE, FIND and SET_UP end before `options`. */
struct fv_libcamera_request {
    uint32_t version, call, index;
    struct fv_libcamera_options options;
    struct fv_libcamera_agreed agreed; /* KNOW */
};

/* One buffer: `bytes` of its descriptor are to be mapped, the picture begins at `offset`. */
struct fv_libcamera_buffer {
    uint64_t bytes, offset;
};

/* A filled buffer: struct fv_live_buffer without addresses. */
struct fv_libcamera_frame {
    uint32_t index;
    bool damaged;
    uint64_t bytes;
    struct fv_order_stamp stamp;
};

enum fv_libcamera_event_kind { FV_LIBCAMERA_ANSWER = 1, FV_LIBCAMERA_FRAME, FV_LIBCAMERA_BROKEN };

/* To the program. FRAME ends before `error`. */
struct fv_libcamera_event {
    uint32_t version, kind;
    struct fv_libcamera_frame frame;
    /* error.status is the status of the answer; its text may be set on success too */
    struct fovea_error error, notice;
    struct fv_libcamera_agreed agreed; /* of LEARN */
    uint32_t buffer_count;             /* of SET_UP */
    int32_t stride_bytes;
    struct fv_libcamera_buffer buffers[FV_LIVE_BUFFERS_MAX];
};

/* Of a message as it travels. */
static inline size_t fv_libcamera_request_bytes(uint32_t call)
{
    const bool whole =
        call == FV_LIBCAMERA_LEARN || call == FV_LIBCAMERA_KNOW || call == FV_LIBCAMERA_CONTROL;
    return whole ? sizeof(struct fv_libcamera_request)
                 : offsetof(struct fv_libcamera_request, options);
}

static inline size_t fv_libcamera_event_bytes(uint32_t kind)
{
    return kind == FV_LIBCAMERA_FRAME ? offsetof(struct fv_libcamera_event, error)
                                      : sizeof(struct fv_libcamera_event);
}

/* libcamera's names of formats, by the four letters that V4L2 has for them. */
struct fv_libcamera_format {
    const char *name, *theirs;
    enum fovea_pixel_format format;
};
#define FV_LIBCAMERA_FORMATS(ROW)                                                                  \
    ROW("GREY", "R8", FOVEA_PIXEL_GREY8)                                                           \
    ROW("NV12", "NV12", FOVEA_PIXEL_NV12)                                                          \
    ROW("YU12", "YUV420", FOVEA_PIXEL_YU12)                                                        \
    ROW("YUYV", "YUYV", FOVEA_PIXEL_YUYV)                                                          \
    ROW("UYVY", "UYVY", FOVEA_PIXEL_UYVY)                                                          \
    ROW("Y10", "R10", FOVEA_PIXEL_Y10)                                                             \
    ROW("Y12", "R12", FOVEA_PIXEL_Y12)                                                             \
    ROW("RGGB", "SRGGB8", FOVEA_PIXEL_BAYER_RGGB8)                                                 \
    ROW("BGGR", "SBGGR8", FOVEA_PIXEL_BAYER_BGGR8)                                                 \
    ROW("GRBG", "SGRBG8", FOVEA_PIXEL_BAYER_GRBG8)                                                 \
    ROW("GBRG", "SGBRG8", FOVEA_PIXEL_BAYER_GBRG8)                                                 \
    ROW("MJPG", "MJPEG", FOVEA_PIXEL_MJPEG)                                                        \
    ROW("RGB3", "BGR888",                                                                          \
        FOVEA_PIXEL_RGB24) /* libcamera names the words of 24 bits, not the bytes */               \
    ROW("BGR3", "RGB888", FOVEA_PIXEL_BGR24)

#ifdef __cplusplus
}
#endif
#endif

/* What the program and its libcamera plug-in (drivers/libcamera.cpp, built where libcamera-dev is installed)
 * say to each other. The plug-in is a device behind the live source (drivers/live/live.h). Plain C; no
 * exceptions cross. */
#ifndef FOVEA_LIBCAMERA_PLUGIN_H
#define FOVEA_LIBCAMERA_PLUGIN_H

#include <stdbool.h>
#include <stdint.h>

#include "../live/live.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { FOVEA_LIBCAMERA_PLUGIN_VERSION = 2, FOVEA_LIBCAMERA_WISHES_MAX = 16, FOVEA_LIBCAMERA_ID_BYTES = 200 };
#define FOVEA_LIBCAMERA_PLUGIN_FILE "fovea-libcamera.so"
#define FOVEA_LIBCAMERA_PLUGIN_SYMBOL "fovea_libcamera_plugin_2"

enum fovea_libcamera_role { FOVEA_ROLE_VIDEO = 0, FOVEA_ROLE_VIEWFINDER, FOVEA_ROLE_STILL, FOVEA_ROLE_RAW };

/* A control by libcamera's name for it ("Brightness"), and the value as given. */
struct fovea_libcamera_wish {
    char name[64], value[64];
};

struct fovea_libcamera_options {
    char id[FOVEA_LIBCAMERA_ID_BYTES]; /* a camera's id, or its place in libcamera's list */
    int32_t role;
    int32_t format;        /* row of FV_LIBCAMERA_FORMATS plus 1; 0: as the role has it */
    int32_t width, height; /* 0: as the role has it */
    double rate_hz;        /* 0: likewise; a frame duration */
    double exposure_ms;    /* 0: automatic or as it is */
    double gain;           /* negative: likewise */
    bool auto_exposure, auto_exposure_given, auto_gain, auto_gain_given;
    double readout_ms; /* negative: not given */
    int32_t buffers;
    uint32_t wish_count;
    struct fovea_libcamera_wish wishes[FOVEA_LIBCAMERA_WISHES_MAX];
};

/* What was agreed on. */
struct fovea_libcamera_agreed {
    int32_t width, height;
    enum fovea_pixel_format format; /* of the frames as they are handed on */
    double rate_hz;                 /* 0: not known */
    uint32_t buffers;
    char id[FOVEA_LIBCAMERA_ID_BYTES];
};

struct fovea_libcamera_plugin {
    int version;
    /* Find the camera, configure it once and let it go again. `told` gets a line where not all is as asked.
     * Init-only. */
    enum fovea_status (*open)(const struct fovea_libcamera_options *options, void **device,
                              struct fovea_libcamera_agreed *agreed, struct fovea_error *told,
                              struct fovea_error *error);
    struct fv_live_ops device; /* its `close` ends what `open` began */
};

/* libcamera's names of formats, by the four letters that V4L2 has for them. */
struct fv_libcamera_format {
    const char *name, *theirs;
    enum fovea_pixel_format format;
};
#define FV_LIBCAMERA_FORMATS(ROW)                                                                            \
    ROW("GREY", "R8", FOVEA_PIXEL_GREY8)                                                                     \
    ROW("NV12", "NV12", FOVEA_PIXEL_NV12)                                                                    \
    ROW("YU12", "YUV420", FOVEA_PIXEL_YU12)                                                                  \
    ROW("YUYV", "YUYV", FOVEA_PIXEL_YUYV)                                                                    \
    ROW("UYVY", "UYVY", FOVEA_PIXEL_UYVY)                                                                    \
    ROW("Y10", "R10", FOVEA_PIXEL_Y10)                                                                       \
    ROW("Y12", "R12", FOVEA_PIXEL_Y12)                                                                       \
    ROW("RGGB", "SRGGB8", FOVEA_PIXEL_BAYER_RGGB8)                                                           \
    ROW("BGGR", "SBGGR8", FOVEA_PIXEL_BAYER_BGGR8)                                                           \
    ROW("GRBG", "SGRBG8", FOVEA_PIXEL_BAYER_GRBG8)                                                           \
    ROW("GBRG", "SGBRG8", FOVEA_PIXEL_BAYER_GBRG8)                                                           \
    ROW("MJPG", "MJPEG", FOVEA_PIXEL_MJPEG)                                                                  \
    ROW("RGB3", "BGR888", FOVEA_PIXEL_RGB24) /* libcamera names the words of 24 bits, not the bytes */       \
    ROW("BGR3", "RGB888", FOVEA_PIXEL_BGR24)

#ifdef __cplusplus
}
#endif
#endif

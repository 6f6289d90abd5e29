/* What the program and its video plug-in (drivers/video.cpp, built where OpenCV's videoio is) say
 * to each other. The plug-in is a shared object of its own so that OpenCV is loaded only when a
 * video is asked for. Plain C; no exceptions cross. */
#ifndef FOVEA_RECORDED_VIDEO_PLUGIN_H
#define FOVEA_RECORDED_VIDEO_PLUGIN_H

#include <stdint.h>

#include "fovea/status.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { FV_VIDEO_PLUGIN_VERSION = 2 };
#define FV_VIDEO_PLUGIN_FILE "fovea-video.so"
#define FV_VIDEO_PLUGIN_SYMBOL "fovea_video_plugin_2"

struct fv_video;

struct fv_video_plugin {
    int version;
    enum fovea_status (*open)(const char *path, struct fv_video **video, int32_t *width,
                              int32_t *height, double *rate_hz, struct fovea_error *error);
    /* Go past one frame without decoding it to pixels. FOVEA_END after the last. */
    enum fovea_status (*skip)(struct fv_video *video, int64_t *stamp_ns);
    /* Whether there is a next frame. */
    int (*more)(struct fv_video *video);
    /* Make frame `index`, of that stamp when read in order, the next one. FOVEA_ERROR_UNSUPPORTED:
     * what the file's index led to is not known to be it; then only closing is of use. */
    enum fovea_status (*seek)(struct fv_video *video, uint64_t index, int64_t stamp_ns);
    /* The next frame as grey levels, by the formula of decode.h. FOVEA_ERROR_INPUT: it is damaged,
     * the next may not be. */
    enum fovea_status (*read)(struct fv_video *video, uint8_t *grey, int32_t stride_bytes,
                              int64_t *stamp_ns, struct fovea_error *error);
    void (*close)(struct fv_video *video);
};

#ifdef __cplusplus
}
#endif
#endif

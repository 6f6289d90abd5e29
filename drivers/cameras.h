/* The cameras of this host, as `fovea cameras` lists them: what a URI of a source can name. No
 * frame is taken; a camera that another program uses is listed too. Cameras of libcamera are set up
 * for a moment, each format and size in turn, since only then their rates are known: those of a
 * camera in use are not. Init-only. */
#ifndef FOVEA_DRIVERS_CAMERAS_H
#define FOVEA_DRIVERS_CAMERAS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "fovea/status.h"

enum {
    FV_CAMERAS_MAX = 16,
    FV_CAMERA_MODES_MAX = 256,
    FV_CAMERA_CONTROLS_MAX = 96,
    FV_CAMERA_RATES_MAX = 12,
    FV_CAMERA_NAME_BYTES = 256
};

/* A size in one format. */
struct fv_camera_mode {
    char format[16]; /* as the option `format` of the URI has it where `read`, else the driver's */
    bool read;       /* Fovea reads it */
    int32_t rank;    /* among those that are read: 0 is taken first when none is asked for */
    int32_t width, height;         /* 0: not stated */
    int32_t width_max, height_max; /* larger where every size up to this one is possible */
    uint32_t rate_count;
    double rates_hz[FV_CAMERA_RATES_MAX]; /* highest first */
    bool any_rate;                        /* every one between the two that are stated */
};

/* A control by the name that the option `control.NAME` of the URI takes. */
struct fv_camera_control {
    char name[64];
    bool has_range, has_value;
    double minimum, maximum, step, standard, value;
    char menu[160]; /* words of a menu between commas; "" where there is none */
};

struct fv_camera {
    const char *driver;              /* "v4l2", "libcamera": the scheme of its URI */
    char model[128];                 /* for people */
    char name[FV_CAMERA_NAME_BYTES]; /* stays the same when cameras come and go, where possible */
    char node[FV_CAMERA_NAME_BYTES]; /* v4l2: where it is now */
    char place[64];                  /* v4l2: driver and bus */
    char trouble[160];               /* why nothing more is known; "" otherwise */
    char uri[2 * FV_CAMERA_NAME_BYTES]; /* ready for --source */
    uint32_t mode_count, control_count;
    struct fv_camera_mode modes[FV_CAMERA_MODES_MAX];
    struct fv_camera_control controls[FV_CAMERA_CONTROLS_MAX];
};

/* Append what is found to `cameras`, at most `capacity` of them in all. */
void fv_cameras_v4l2(struct fv_camera *cameras, size_t capacity, size_t *count);
/* FOVEA_ERROR_UNSUPPORTED: Fovea was built without libcamera; FOVEA_ERROR_SYSTEM: its process
 * failed. */
enum fovea_status fv_cameras_libcamera(struct fv_camera *cameras, size_t capacity, size_t *count,
                                       struct fovea_error *error);

/* The camera's URI, with the size, format and rate of the mode that suits odometry best: among
 * those that Fovea reads, at 25 Hz or more where there is such a one, nearest to 640 x 480. */
void fv_camera_make_uri(struct fv_camera *camera);

#endif

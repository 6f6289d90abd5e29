// What is asked of exposure, gain, rate and controls by name, held against the ranges that a camera
// states. C++, inside the plug-in.
//
// Versions: Debian 12 has 0.0.3; a Raspberry Pi 5 needs 0.5 or later. What differs for us stands
// behind FV_LIBCAMERA_AT_LEAST: the roles' type, and (from 0.5 on) separate modes of exposure
// time and gain in place of AeEnable alone.
#ifndef FOVEA_LIBCAMERA_CONTROLS_H
#define FOVEA_LIBCAMERA_CONTROLS_H

#include <libcamera/libcamera.h>

#include "protocol.h"

#define FV_LIBCAMERA_AT_LEAST(major, minor)                                                        \
    (LIBCAMERA_VERSION_MAJOR > (major) ||                                                          \
     (LIBCAMERA_VERSION_MAJOR == (major) && LIBCAMERA_VERSION_MINOR >= (minor)))

// Into `list`, which begins empty and is partly filled on error. `uri` begins the line of an error.
// Init-only.
enum fovea_status fv_libcamera_controls(const libcamera::Camera &camera,
                                        const fv_libcamera_options &options, const char *uri,
                                        libcamera::ControlList *list, fovea_error *error);

bool fv_libcamera_has_control(const libcamera::Camera &camera, const libcamera::ControlId &id);

#endif

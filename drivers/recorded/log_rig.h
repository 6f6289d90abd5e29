/* The rig of a recording of ours, from its first message: the cameras' calibrations and places, the
 * inertial sensor. */
#ifndef FOVEA_RECORDED_LOG_RIG_H
#define FOVEA_RECORDED_LOG_RIG_H

#include "fovea/rig.h"
#include "fovea/status.h"
#include "support/lcmlog.h"

/* Read it from an event that holds a fovea.recording_t. `name` (the file) and the byte stand in
 * errors. FOVEA_AGAIN: the message holds no rig, or is of another type. FOVEA_ERROR_UNSUPPORTED:
 * of another format. FOVEA_ERROR_INPUT: damaged. `rig` is written on FOVEA_OK alone. Init-only. */
enum fovea_status fv_log_rig(const char *name, const struct fv_lcmlog_event *event,
                             struct fovea_rig *rig, struct fovea_error *error);

#endif

/* The calibration that a recording of ours carries in its first message. */
#ifndef FOVEA_RECORDED_LOG_CALIBRATION_H
#define FOVEA_RECORDED_LOG_CALIBRATION_H

#include "support/calibration.h"
#include "support/log.h"

/* Find the part "calibration" of an event that holds a fovea.recording_t and read it. Every length
 * is held against the event. FOVEA_AGAIN: there is none. FOVEA_ERROR_INPUT: `error` names the file
 * `name` and the byte. */
enum fovea_status fv_log_calibration(const char *name, const struct fovea_log_event *event,
                                     struct fovea_calibration *calibration,
                                     struct fovea_error *error);

#endif

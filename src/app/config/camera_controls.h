/* The keys that tell the cameras something (camera_exposure_ms, camera_gain), and the controls of
 * the source that they stand for (fovea_source_ops.control). */
#ifndef FOVEA_APP_CONFIG_CAMERA_CONTROLS_H
#define FOVEA_APP_CONFIG_CAMERA_CONTROLS_H

#include "app/config/settings.h"
#include "fovea/source.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Whether `key` is such a key; then its control. */
bool fv_camera_control(const struct fv_settings_key *key, enum fovea_source_control *control);

/* Its value in `settings`. */
double fv_camera_control_value(const struct fv_settings *settings,
                               enum fovea_source_control control);

/* Tell an open source, not started, what `settings` hold, where that is not the default. What a
 * recording cannot take, and a value of parameters.file that the camera refuses, is left out in a
 * line. FOVEA_ERROR_INPUT: the camera refuses it; `error` names where the key was set. */
enum fovea_status fv_camera_controls_set(const struct fv_settings *settings,
                                         const struct fovea_source_ops *ops,
                                         struct fovea_source *source, struct fovea_error *error);

#ifdef __cplusplus
}
#endif
#endif

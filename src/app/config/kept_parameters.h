/* The file of live parameters that were changed with `keep` (key parameters.file): YAML, a line for
 * each, read at the start after the configuration. It is the program's own: whole and in order, or
 * as it was before. Init-only, or on a thread that may wait for the disk. */
#ifndef FOVEA_APP_CONFIG_KEPT_PARAMETERS_H
#define FOVEA_APP_CONFIG_KEPT_PARAMETERS_H

#include "app/config/settings.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Read the file that settings->parameters_file names over `settings`; nothing where there is none.
 * FOVEA_ERROR_INPUT: `error` names file, line and key; `settings` is as it was. */
enum fovea_status fv_kept_parameters_read(struct fv_settings *settings, struct fovea_error *error);

/* Put one value among those of the file at `path`, by its replacement. FOVEA_ERROR_INPUT: the file
 * or the value is wrong; FOVEA_ERROR_SYSTEM: it cannot be written. The file is then as it was. */
enum fovea_status fv_kept_parameters_put(const char *path, const struct fv_settings_key *key,
                                         const char *value, struct fovea_error *error);

#ifdef __cplusplus
}
#endif
#endif

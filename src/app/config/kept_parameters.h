/* The file of settings that a run keeps (key parameters.file): live parameters that were changed
 * with `keep`, and what was restored from a backup. YAML, a line for each key, and where a
 * calibration was restored a line "---" and that. Read at the start after the configuration. It is
 * the program's own: whole and in order, or as it was before. Init-only, or on a thread that may
 * wait for the disk. */
#ifndef FOVEA_APP_CONFIG_KEPT_PARAMETERS_H
#define FOVEA_APP_CONFIG_KEPT_PARAMETERS_H

#include "app/config/settings.h"
#include "support/calibration.h"

enum { FV_KEPT_BYTES_MAX = 32767 }; /* of the file */

#ifdef __cplusplus
extern "C" {
#endif

/* Read the file that settings->parameters_file names over `settings`; nothing where there is none.
 * What is in it must go with the rest. FOVEA_ERROR_INPUT: `error` names file, line and key;
 * `settings` is as it was. */
enum fovea_status fv_kept_parameters_read(struct fv_settings *settings, struct fovea_error *error);

/* The calibration in that file, which stands for the one that `camera` names in a file. `*found`
 * false: there is none, or an option names the camera's. FOVEA_ERROR_INPUT: it is damaged. */
enum fovea_status fv_kept_calibration_read(const struct fv_settings *settings,
                                           struct fv_calibration *calibration, bool *found,
                                           struct fovea_error *error);

/* Read such a file's text over `settings`, which then has lines for the keys in it alone; keys of
 * the host are refused. `*calibration`: where it begins in `text`; NULL: none. FOVEA_ERROR_INPUT:
 * `settings` is partly changed. */
enum fovea_status fv_kept_parameters_parse(struct fv_settings *settings, const char *name,
                                           const char *text, const char **calibration,
                                           struct fovea_error *error);

/* The keys that the file at `path` holds, as lines of `kept`, with their values, and the text of
 * the calibration, "" for none, of malloc; none where it cannot be read. NULL: no memory. */
char *fv_kept_parameters_list(struct fv_settings *kept, const char *path);

/* Write the keys of `kept` that have a line and the calibration, where it is not "", in place of
 * the file at `path`. On an error it is as it was: FOVEA_ERROR_INPUT, it would be too large to be
 * read; FOVEA_ERROR_SYSTEM, it cannot be written. */
enum fovea_status fv_kept_parameters_write(const struct fv_settings *kept, const char *calibration,
                                           const char *path, struct fovea_error *error);

#ifdef __cplusplus
}
#endif
#endif

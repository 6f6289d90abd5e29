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
 * What is in it must go with the rest. FOVEA_ERROR_INPUT: `error` names file, line and key;
 * `settings` is as it was. */
enum fovea_status fv_kept_parameters_read(struct fv_settings *settings, struct fovea_error *error);

/* The keys that the file at `path` holds, as lines of `kept`, with their values; none where it
 * cannot be read. */
void fv_kept_parameters_list(struct fv_settings *kept, const char *path);

/* Write the keys of `kept` that have a line, in place of the file at `path`. FOVEA_ERROR_SYSTEM: it
 * cannot be written, and is as it was. */
enum fovea_status fv_kept_parameters_write(const struct fv_settings *kept, const char *path,
                                           struct fovea_error *error);

#ifdef __cplusplus
}
#endif
#endif

/* What a command writes must not be what it reads: opening the one for writing would destroy the other.
 * Init-only. */
#ifndef FOVEA_APP_FILES_H
#define FOVEA_APP_FILES_H

#include "fovea/status.h"

struct fv_file {
    const char *option; /* as the user named it, for example "--record" */
    const char *path;   /* NULL or "": none */
};

/* FOVEA_ERROR_INPUT when one of `written` is the same file as another of them or as one of `read`, by
 * whatever path; both lists end with a row whose option is NULL. Devices and pipes may be shared. */
enum fovea_status fv_files_apart(const struct fv_file *written, const struct fv_file *read,
                                 struct fovea_error *error);

#endif

/* What a command writes must not be what it reads: opening the one for writing would destroy the
 * other. And what an earlier one wrote stays until it is known that all can be written. Init-only.
 */
#ifndef FOVEA_APP_FILES_H
#define FOVEA_APP_FILES_H

#include "fovea/status.h"

struct fv_file {
    const char *option; /* as the user named it, for example "--record" */
    const char *path;   /* NULL or "": none */
};

/* FOVEA_ERROR_INPUT when one of `written` is the same file as another of them or as one of `read`,
 * by whatever path; both lists end with a row whose option is NULL. Devices and pipes may be
 * shared. */
enum fovea_status fv_files_apart(const struct fv_file *written, const struct fv_file *read,
                                 struct fovea_error *error);

/* FOVEA_ERROR_INPUT when one of `written` cannot be written; `blame` is then its option. Nothing is
 * changed: no file is made, none is cut. Pipes and devices are not looked at, since opening them
 * may already mean something to whoever is at their other end. */
enum fovea_status fv_files_writable(const struct fv_file *written, const char **blame,
                                    struct fovea_error *error);

#endif

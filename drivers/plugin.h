/* Plug-ins: shared objects and programs beside the program, loaded or started only when they are
 * asked for. Init-only. */
#ifndef FOVEA_DRIVERS_PLUGIN_H
#define FOVEA_DRIVERS_PLUGIN_H

#include <stdbool.h>

#include "fovea/status.h"

enum { FV_PLUGIN_PATH_BYTES = 4096 + 64, FV_PLUGIN_PLACES = 3 };

struct fv_plugin_name {
    const char *scheme; /* begins error lines */
    const char *file, *package;
    const char *symbol; /* of a shared object, as is the version */
    int version;
};

/* Where a file may be: in the folder that $FOVEA_PLUGINS names (place 0), beside the program, in
 * ../lib/fovea of it. False: it is not in this place. */
bool fv_plugin_path(const char *file, int place, char path[FV_PLUGIN_PATH_BYTES]);

/* Whether only root and the user of this process can change what `path` leads to: the file, every
 * folder on the way to it, and every folder that holds a link on the way are owned by one of them
 * and writable by nobody else. A sticky folder such as /tmp may be writable by all, since in it
 * nobody replaces what others own. `path` then names the file itself, without links: this is what
 * to open, since a link could lead elsewhere by then. */
enum fovea_status fv_plugin_trusted(char path[FV_PLUGIN_PATH_BYTES], struct fovea_error *error);

/* The line that says so, and `why` where that is not empty. Returns FOVEA_ERROR_UNSUPPORTED. */
enum fovea_status fv_plugin_missing(const struct fv_plugin_name *name, const char *why,
                                    struct fovea_error *error);

/* The address of the table of a shared object, which begins with an int: its version. It stays
 * loaded: threads of what it brings along may outlive a dlclose. FOVEA_ERROR_UNSUPPORTED: there is
 * none, it is of another version, or others than root and the user can change it. */
enum fovea_status fv_plugin_load(const struct fv_plugin_name *name, const void **table,
                                 struct fovea_error *error);

#endif

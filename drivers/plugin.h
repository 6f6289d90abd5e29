/* Plug-ins: shared objects beside the program, loaded only when they are asked for. Init-only. */
#ifndef FOVEA_DRIVERS_PLUGIN_H
#define FOVEA_DRIVERS_PLUGIN_H

#include "fovea/status.h"

struct fv_plugin_name {
    const char *scheme; /* begins error lines */
    const char *file, *symbol, *package;
    int version;
};

/* The address of the plug-in's table, which begins with an int: its version. Looked for in the folder that
 * $FOVEA_PLUGINS names, beside the program, and in ../lib/fovea of it. It stays loaded: threads of what it
 * brings along may outlive a dlclose. FOVEA_ERROR_UNSUPPORTED: there is none, or it is of another version. */
enum fovea_status fv_plugin_load(const struct fv_plugin_name *name, const void **table,
                                 struct fovea_error *error);

#endif

#include "plugin.h"

#include <dlfcn.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { PATH_BYTES = 4096 };

static bool program_folder(char folder[PATH_BYTES])
{
    const ssize_t length = readlink("/proc/self/exe", folder, PATH_BYTES - 1);
    if (length <= 0) return false;
    folder[length] = '\0';
    char *slash = strrchr(folder, '/');
    if (slash == NULL) return false;
    *slash = '\0';
    return true;
}

bool fv_plugin_path(const char *file, int place, char path[FV_PLUGIN_PATH_BYTES])
{
    char folder[PATH_BYTES];
    const char *wanted = getenv("FOVEA_PLUGINS");
    if (place == 0 ? wanted == NULL : !program_folder(folder)) return false;
    snprintf(path, FV_PLUGIN_PATH_BYTES, "%s%s/%s", place == 0 ? wanted : folder,
             place == 2 ? "/../lib/fovea" : "", file);
    return access(path, F_OK) == 0;
}

enum fovea_status fv_plugin_missing(const struct fv_plugin_name *name, const char *why,
                                    struct fovea_error *error)
{
    return fovea_error_set(
        error, FOVEA_ERROR_UNSUPPORTED,
        "%s: found no plug-in %s beside the program%s%s, expected one (install %s and build again)",
        name->scheme, name->file, why[0] != '\0' ? ": " : "", why, name->package);
}

enum fovea_status fv_plugin_load(const struct fv_plugin_name *name, const void **table,
                                 struct fovea_error *error)
{
    char path[FV_PLUGIN_PATH_BYTES], why[256] = "";
    void *library = NULL;
    for (int place = 0; place < FV_PLUGIN_PLACES && library == NULL; ++place) {
        if (!fv_plugin_path(name->file, place, path)) continue;
        library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
        if (library == NULL) snprintf(why, sizeof why, "%s", dlerror());
    }
    if (library == NULL) return fv_plugin_missing(name, why, error);
    const int *version = dlsym(library, name->symbol);
    if (version == NULL || *version != name->version)
        return fovea_error_set(error, FOVEA_ERROR_UNSUPPORTED,
                               "%s: found version %d of the plug-in, expected %d", path,
                               version == NULL ? 0 : *version, name->version);
    *table = version;
    return FOVEA_OK;
}

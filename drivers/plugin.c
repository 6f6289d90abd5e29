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

enum fovea_status fv_plugin_load(const struct fv_plugin_name *name, const void **table,
                                 struct fovea_error *error)
{
    char folder[PATH_BYTES], path[PATH_BYTES + 64], why[256] = "";
    const char *wanted = getenv("FOVEA_PLUGINS");
    const bool known = program_folder(folder);
    void *library = NULL;
    for (int place = 0; place < 3 && library == NULL; ++place) {
        if (place == 0 ? wanted == NULL : !known) continue;
        snprintf(path, sizeof path, "%s%s/%s", place == 0 ? wanted : folder,
                 place == 2 ? "/../lib/fovea" : "", name->file);
        if (access(path, F_OK) != 0) continue;
        library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
        if (library == NULL) snprintf(why, sizeof why, "%s", dlerror());
    }
    if (library == NULL)
        return fovea_error_set(
            error, FOVEA_ERROR_UNSUPPORTED,
            "%s: found no plug-in %s beside the program%s%s, expected one (install %s and build "
            "again)",
            name->scheme, name->file, why[0] != '\0' ? ": " : "", why, name->package);
    const int *version = dlsym(library, name->symbol);
    if (version == NULL || *version != name->version)
        return fovea_error_set(error, FOVEA_ERROR_UNSUPPORTED,
                               "%s: found version %d of the plug-in, expected %d", path,
                               version == NULL ? 0 : *version, name->version);
    *table = version;
    return FOVEA_OK;
}

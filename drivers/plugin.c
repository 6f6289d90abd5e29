#include "plugin.h"

#include <dlfcn.h>
#include <errno.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
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

static enum fovea_status unreadable(const char *path, struct fovea_error *error)
{
    return fovea_error_set(error, FOVEA_ERROR_UNSUPPORTED, "%.300s: cannot be looked at: %s", path,
                           strerror(errno));
}

static enum fovea_status trusted(const char *path, struct fovea_error *error)
{
    struct stat about;
    if (stat(path, &about) != 0) return unreadable(path, error);
    if (about.st_uid != 0 && about.st_uid != geteuid())
        return fovea_error_set(
            error, FOVEA_ERROR_UNSUPPORTED,
            "%.300s: found the owner %u, expected root or the user %u for what is loaded", path,
            (unsigned)about.st_uid, (unsigned)geteuid());
    const bool sticky = S_ISDIR(about.st_mode) && (about.st_mode & S_ISVTX) != 0;
    if ((about.st_mode & (S_IWGRP | S_IWOTH)) == 0 || sticky) return FOVEA_OK;
    return fovea_error_set(
        error, FOVEA_ERROR_UNSUPPORTED,
        "%.300s: found mode %03o, writable by others, expected that only its owner writes it "
        "(chmod go-w)",
        path, (unsigned)about.st_mode & 0777);
}

/* The folders on the way to `path` as it is written: in each there may be a link. */
static enum fovea_status way_trusted(const char *path, struct fovea_error *error)
{
    char way[FV_PLUGIN_PATH_BYTES];
    enum fovea_status status = trusted(path[0] == '/' ? "/" : ".", error);
    for (const char *slash = strchr(path + 1, '/'); slash != NULL && status == FOVEA_OK;
         slash = strchr(slash + 1, '/')) {
        snprintf(way, sizeof way, "%.*s", (int)(slash - path), path);
        status = trusted(way, error);
    }
    return status;
}

enum fovea_status fv_plugin_trusted(char path[FV_PLUGIN_PATH_BYTES], struct fovea_error *error)
{
    char whole[FV_PLUGIN_PATH_BYTES];
    enum fovea_status status = way_trusted(path, error);
    if (status != FOVEA_OK) return status;
    char *real = realpath(path, NULL); /* may be longer than there is room */
    const bool fits = real != NULL && strlen(real) < sizeof whole;
    if (fits) strcpy(whole, real);
    free(real);
    if (!fits) return unreadable(path, error);
    strcpy(path, whole);
    status = trusted(whole, error);
    while (status == FOVEA_OK && strcmp(whole, "/") != 0) {
        char *slash = strrchr(whole, '/');
        slash[slash == whole] = '\0';
        status = trusted(whole, error);
    }
    return status;
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
    for (int place = 0; place < FV_PLUGIN_PLACES && library == NULL; place++) {
        if (!fv_plugin_path(name->file, place, path)) continue;
        if (fv_plugin_trusted(path, error) != FOVEA_OK) return FOVEA_ERROR_UNSUPPORTED;
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

#include "app/files.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static const char *name_of(const char *path)
{
    const char *slash = strrchr(path, '/');
    return slash != NULL ? slash + 1 : path;
}

static bool folder_of(const char *path, struct stat *about)
{
    char folder[PATH_MAX];
    const int length = (int)(name_of(path) - path);
    return length < PATH_MAX - 1 && snprintf(folder, sizeof folder, "%.*s.", length, path) > 0 &&
           stat(folder, about) == 0;
}

static bool same(const char *one, const char *other)
{
    struct stat a, b;
    if (one == NULL || other == NULL || *one == '\0' || *other == '\0') return false;
    if (stat(one, &a) == 0) {
        return S_ISREG(a.st_mode) && stat(other, &b) == 0 && a.st_dev == b.st_dev &&
               a.st_ino == b.st_ino;
    }
    /* Neither is there yet: one name in one folder. 'none' is no file. */
    if (strcmp(one, "none") == 0 || strcmp(name_of(one), name_of(other)) != 0) return false;
    if (strcmp(one, other) == 0) return true;
    return folder_of(one, &a) && folder_of(other, &b) && a.st_dev == b.st_dev &&
           a.st_ino == b.st_ino;
}

static enum fovea_status apart(const struct fv_file *written, const struct fv_file *others,
                               struct fovea_error *error)
{
    for (; others->option != NULL; others++) {
        if (same(written->path, others->path))
            return fovea_error_set(error, FOVEA_ERROR_INPUT,
                                   "%s: found %.300s, the file of %s, expected another file",
                                   written->option, written->path, others->option);
    }
    return FOVEA_OK;
}

enum fovea_status fv_files_apart(const struct fv_file *written, const struct fv_file *read,
                                 struct fovea_error *error)
{
    for (; written->option != NULL; written++) {
        enum fovea_status status = apart(written, read, error);
        if (status == FOVEA_OK) status = apart(written, written + 1, error);
        if (status != FOVEA_OK) return status;
    }
    return FOVEA_OK;
}

/* 0, or why not. */
static int write_try(const char *path)
{
    struct stat about;
    if (stat(path, &about) == 0 && !S_ISREG(about.st_mode))
        return S_ISDIR(about.st_mode) ? EISDIR : 0;
    const int made = open(path, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644);
    if (made >= 0) {
        close(made);
        unlink(path);
        return 0;
    }
    if (errno != EEXIST) return errno;
    char target[PATH_MAX];
    const bool dangling = access(path, F_OK) != 0; /* a link whose file would be made */
    const int there = open(path, O_WRONLY | O_CREAT | O_CLOEXEC, 0644);
    if (there < 0) return errno;
    close(there);
    if (dangling && realpath(path, target) != NULL) unlink(target);
    return 0;
}

enum fovea_status fv_files_writable(const struct fv_file *written, const char **blame,
                                    struct fovea_error *error)
{
    for (; written->option != NULL; written++) {
        if (written->path == NULL || written->path[0] == '\0') continue;
        const int why = write_try(written->path);
        if (why == 0) continue;
        *blame = written->option;
        return fovea_error_set(error, FOVEA_ERROR_INPUT, "%.300s: cannot be written: %s",
                               written->path, strerror(why));
    }
    return FOVEA_OK;
}

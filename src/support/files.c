#include "support/files.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "support/output.h"

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

static bool same_inode(const struct stat *a, const struct stat *b)
{
    return a->st_dev == b->st_dev && a->st_ino == b->st_ino;
}

bool fv_files_same(const char *one, const char *other, bool follow)
{
    struct stat a, b;
    const int flags = follow ? 0 : AT_SYMLINK_NOFOLLOW;
    return fstatat(AT_FDCWD, one, &a, flags) == 0 && fstatat(AT_FDCWD, other, &b, flags) == 0 &&
           same_inode(&a, &b);
}

static bool given(const char *path)
{
    return path != NULL && *path != '\0';
}

static bool ends_in_slash(const char *path)
{
    return path[strlen(path) - 1] == '/';
}

static bool same(const char *one, const char *other)
{
    struct stat a, b;
    if (!given(one) || !given(other)) return false;
    if (stat(one, &a) == 0)
        return (S_ISREG(a.st_mode) || S_ISDIR(a.st_mode)) && stat(other, &b) == 0 &&
               same_inode(&a, &b);
    /* Neither is there yet: one name in one folder. 'none' is no file. */
    if (strcmp(one, "none") == 0 || strcmp(name_of(one), name_of(other)) != 0) return false;
    if (strcmp(one, other) == 0) return true;
    return folder_of(one, &a) && folder_of(other, &b) && same_inode(&a, &b);
}

/* The same file, or the temporary name of what is written. */
static bool meets(const char *written, const char *other)
{
    char part[FV_OUTPUT_PART_BYTES];
    if (same(written, other)) return true;
    return given(written) && snprintf(part, sizeof part, "%s.part", written) < (int)sizeof part &&
           same(part, other);
}

static enum fovea_status refuse(const struct fv_file *written, const char *option,
                                struct fovea_error *error)
{
    return fovea_error_set(error, FOVEA_ERROR_INPUT,
                           "%s: found %.300s, the file of %s, expected another file",
                           written->option, written->path, option);
}

static enum fovea_status apart(const struct fv_file *written, const struct fv_file *others,
                               struct fovea_error *error)
{
    for (; others->option != NULL; others++)
        if (meets(written->path, others->path)) return refuse(written, others->option, error);
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

/* ---- what a source reads --------------------------------------------------------------------- */

static struct fv_files_identity identify(bool found, const struct stat *about)
{
    const bool there = found && (S_ISREG(about->st_mode) || S_ISDIR(about->st_mode));
    return (struct fv_files_identity){there, about->st_dev, about->st_ino};
}

void fv_files_watch(struct fv_files_watch *watch, const struct fv_file *written, const char *option,
                    struct fovea_error *error)
{
    *watch = (struct fv_files_watch){.written = written, .option = option, .error = error};
    for (int i = 0; i < FV_FILES_WATCHED_MAX && written[i].option != NULL; i++) {
        char part[FV_OUTPUT_PART_BYTES];
        struct stat about = {0};
        if (!given(written[i].path)) continue;
        watch->file[i] = identify(stat(written[i].path, &about) == 0, &about);
        watch->folder[i] = identify(folder_of(written[i].path, &about), &about);
        if (snprintf(part, sizeof part, "%s.part", written[i].path) < (int)sizeof part)
            watch->part[i] = identify(stat(part, &about) == 0, &about);
    }
}

static bool is(const struct fv_files_identity *known, const struct stat *about)
{
    return known->there && known->device == about->st_dev && known->inode == about->st_ino;
}

/* What is to be read later and is not there yet, by its name and folder. */
static bool takes_place(const char *written, const struct fv_files_identity *folder,
                        const char *path)
{
    struct stat parent;
    const size_t length = strlen(name_of(path));
    const char *name = name_of(written);
    return strncmp(name, name_of(path), length) == 0 &&
           (name[length] == '\0' || strcmp(name + length, ".part") == 0) &&
           folder_of(path, &parent) && is(folder, &parent);
}

void fv_files_visit(void *context, const char *path)
{
    struct fv_files_watch *watch = context;
    struct stat about;
    if (watch->status != FOVEA_OK) return;
    const bool there = stat(path, &about) == 0, folder = there && S_ISDIR(about.st_mode);
    for (int i = 0; i < FV_FILES_WATCHED_MAX && watch->written[i].option != NULL; i++) {
        const struct fv_file *file = &watch->written[i];
        if (!given(file->path)) continue;
        struct stat parent;
        if (ends_in_slash(file->path) && folder_of(path, &parent) && is(&watch->folder[i], &parent))
            watch->status = fovea_error_set(
                watch->error, FOVEA_ERROR_INPUT,
                "%s: found %.200s, the folder of a file that %s reads, expected another folder",
                file->option, file->path, watch->option);
        else if (folder && is(&watch->folder[i], &about))
            watch->status = fovea_error_set(
                watch->error, FOVEA_ERROR_INPUT,
                "%s: found %.200s in %.200s, a folder that %s reads, expected another folder",
                file->option, file->path, path, watch->option);
        else if (there ? is(&watch->file[i], &about) || is(&watch->part[i], &about)
                       : takes_place(file->path, &watch->folder[i], path))
            watch->status = refuse(file, watch->option, watch->error);
        if (watch->status != FOVEA_OK) return;
    }
}

/* ---- whether it can be written --------------------------------------------------------------- */

static enum fovea_status folder_writable(const char *path, struct fovea_error *error)
{
    struct stat about;
    char parent[PATH_MAX];
    size_t length = strlen(path);
    int why = 0;
    while (length > 1 && path[length - 1] == '/')
        length--;
    if (stat(path, &about) == 0) {
        if (access(path, W_OK | X_OK) != 0) why = errno;
    } else if (errno != ENOENT || length >= sizeof parent) {
        why = errno != ENOENT ? errno : ENAMETOOLONG;
    } else { /* it will be made */
        snprintf(parent, sizeof parent, "%.*s", (int)length, path);
        snprintf(parent, sizeof parent, "%.*s.", (int)(name_of(parent) - parent), path);
        if (access(parent, W_OK | X_OK) != 0) why = errno;
    }
    return why == 0 ? FOVEA_OK
                    : fovea_error_set(error, FOVEA_ERROR_INPUT, "%.300s: cannot be written: %s",
                                      path, strerror(why));
}

enum fovea_status fv_files_writable(const struct fv_file *written, const char **blame,
                                    struct fovea_error *error)
{
    for (; written->option != NULL; written++) {
        struct fv_output output;
        if (!given(written->path)) continue;
        if (ends_in_slash(written->path)) {
            if (folder_writable(written->path, error) == FOVEA_OK) continue;
            *blame = written->option;
            return FOVEA_ERROR_INPUT;
        }
        const enum fovea_status status =
            fv_output_open(&output, written->path, FV_OUTPUT_WHOLE, error);
        fv_output_discard(&output);
        if (status == FOVEA_OK) continue;
        *blame = written->option;
        return status;
    }
    return FOVEA_OK;
}

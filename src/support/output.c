#include "support/output.h"

#include <errno.h>
#include <fcntl.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <unistd.h>

enum { CLAIMS_MAX = 100 }; /* lost races for one name */

static bool lock(int file)
{
    /* A file system without locks is no reason not to write. */
    return flock(file, LOCK_EX | LOCK_NB) == 0 || errno != EWOULDBLOCK;
}

/* Whether `path` itself, not what a link leads to, is the open file. */
static bool names(const char *path, int file)
{
    struct stat there, open_file;
    return lstat(path, &there) == 0 && fstat(file, &open_file) == 0 &&
           there.st_dev == open_file.st_dev && there.st_ino == open_file.st_ino;
}

/* ---- the temporary name ---------------------------------------------------------------------- */

/* Make room at `part`: 0, or why not. EBUSY: a program that lives writes it. */
static int clear_part(const char *part)
{
    struct stat there;
    if (lstat(part, &there) != 0) return errno == ENOENT ? 0 : errno;
    if (S_ISDIR(there.st_mode)) return EISDIR;
    if (!S_ISREG(there.st_mode)) return unlink(part) == 0 || errno == ENOENT ? 0 : errno;
    const int file = open(part, O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
    if (file < 0) return errno == ENOENT || errno == ELOOP ? 0 : errno;
    int why = lock(file) ? 0 : EBUSY;
    if (why == 0 && names(part, file) && unlink(part) != 0 && errno != ENOENT) why = errno;
    close(file);
    return why;
}

/* Create `part` and lock it: the file, or -1 and errno. Between creating and locking, another
 * program may take the file for one that was left; then it is created again. */
static int claim(const char *part, mode_t mode)
{
    for (int i = 0; i < CLAIMS_MAX; i++) {
        const int file = open(part, O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, mode);
        if (file >= 0) {
            if (lock(file) && names(part, file)) return file;
            close(file);
            continue;
        }
        if (errno != EEXIST) return -1;
        const int why = clear_part(part);
        errno = why;
        if (why != 0) return -1;
    }
    errno = EBUSY;
    return -1;
}

/* Whether some program holds the lock of the file at `path`. A file that cannot be opened is not
 * locked. */
static bool is_locked(const char *path)
{
    const int file = open(path, O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
    if (file < 0) return false;
    const bool locked = !lock(file);
    close(file);
    return locked;
}

/* ---- what is no file of its own -------------------------------------------------------------- */

/* The number in "/dev/stdout", "/dev/fd/N" and the like; -1: none of them. */
static int stream_number(const char *path)
{
    static const char *const folders[] = {"/dev/fd/", "/proc/self/fd/"};
    if (strcmp(path, "/dev/stdout") == 0) return STDOUT_FILENO;
    if (strcmp(path, "/dev/stderr") == 0) return STDERR_FILENO;
    for (size_t i = 0; i < sizeof folders / sizeof folders[0]; i++) {
        const size_t length = strlen(folders[i]);
        char *end;
        if (strncmp(path, folders[i], length) != 0 || path[length] < '0' || path[length] > '9')
            continue;
        const long number = strtol(path + length, &end, 10);
        if (*end == '\0' && number < 1 << 20) return (int)number;
    }
    return -1;
}

/* What loses or refuses all that is written to it: /dev/null and /dev/full. */
static bool is_sink(const struct stat *about)
{
    return S_ISCHR(about->st_mode) && major(about->st_rdev) == 1 &&
           (minor(about->st_rdev) == 3 || minor(about->st_rdev) == 7);
}

/* True: `*why` is 0 and the output is open, or says why it is not. */
static bool open_unnamed(struct fv_output *output, const char *path, int *why)
{
    struct stat about;
    const int number = stream_number(path);
    if (number < 0 && (stat(path, &about) != 0 || S_ISREG(about.st_mode))) return false;
    *why = 0;
    if (number >= 0)
        output->file = fcntl(number, F_DUPFD_CLOEXEC, 3);
    else if (is_sink(&about))
        output->file = open(path, O_WRONLY | O_CLOEXEC | O_NOCTTY);
    else
        *why = S_ISDIR(about.st_mode) ? EISDIR : ENODEV;
    if (*why == 0 && output->file < 0) *why = errno;
    return true;
}

/* ---- open and close -------------------------------------------------------------------------- */

static enum fovea_status refuse(const char *path, int why, struct fovea_error *error)
{
    if (why == EBUSY)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%.300s: found another program that writes it, expected none", path);
    if (why == ENODEV)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%.300s: cannot be written: found a device or pipe, expected a file",
                               path);
    if (why == ELOOP)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%.300s: cannot be written: found a link, expected a file", path);
    return fovea_error_set(error, FOVEA_ERROR_INPUT, "%.300s: cannot be written: %s", path,
                           strerror(why));
}

static int open_named(struct fv_output *output, enum fv_output_kind kind)
{
    struct stat there;
    const bool replaces = lstat(output->path, &there) == 0 && S_ISREG(there.st_mode);
    output->file = claim(output->part, replaces ? 0600 : 0644);
    if (output->file < 0) return errno;
    output->named = true;
    if (replaces && fchmod(output->file, there.st_mode & 0777) != 0) return errno;
    if (is_locked(output->path)) return EBUSY;
    return kind == FV_OUTPUT_WHOLE ? 0 : fv_output_place(output);
}

/* Whoever makes a new file of this name locks its temporary name first and looks at this one then;
 * here it is the other way round, so that one of the two is refused. */
static int open_end(struct fv_output *output)
{
    struct stat about;
    output->file = open(output->path,
                        O_WRONLY | O_CREAT | O_NOFOLLOW | O_NONBLOCK | O_NOCTTY | O_CLOEXEC, 0644);
    if (output->file < 0) return errno;
    output->named = output->placed = true;
    if (fstat(output->file, &about) != 0 || !S_ISREG(about.st_mode)) return ENODEV;
    if (!lock(output->file) || !names(output->path, output->file) || is_locked(output->part))
        return EBUSY;
    return lseek(output->file, 0, SEEK_END) < 0 ? errno : 0;
}

/* True: it is no file of its own, or has no proper name; `*why` is 0 when it is open. */
static bool begin(struct fv_output *output, const char *path, int *why)
{
    *output = FV_OUTPUT_CLOSED;
    *why = ENAMETOOLONG;
    if (strlen(path) >= sizeof output->path) return true;
    strcpy(output->path, path);
    snprintf(output->part, sizeof output->part, "%s.part", path);
    return open_unnamed(output, path, why);
}

static enum fovea_status begun(struct fv_output *output, const char *path, int why,
                               struct fovea_error *error)
{
    if (why == 0) return FOVEA_OK;
    fv_output_discard(output);
    errno = why;
    return refuse(path, why, error);
}

enum fovea_status fv_output_open(struct fv_output *output, const char *path,
                                 enum fv_output_kind kind, struct fovea_error *error)
{
    int why;
    if (!begin(output, path, &why)) why = open_named(output, kind);
    return begun(output, path, why, error);
}

enum fovea_status fv_output_append(struct fv_output *output, const char *path,
                                   struct fovea_error *error)
{
    int why;
    if (!begin(output, path, &why)) why = open_end(output);
    return begun(output, path, why, error);
}

int fv_output_place(struct fv_output *output)
{
    if (!output->named || output->placed) return 0;
    if (!names(output->part, output->file)) return ENOENT;
    if (rename(output->part, output->path) != 0) return errno;
    output->placed = true;
    return 0;
}

int fv_output_create(struct fv_output *output, const char *path)
{
    *output = FV_OUTPUT_CLOSED;
    if (strlen(path) >= sizeof output->path) return ENAMETOOLONG;
    strcpy(output->path, path);
    output->file = open(path, O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0644);
    if (output->file < 0) return errno;
    output->named = output->placed = true;
    return lock(output->file) ? 0 : EBUSY;
}

int fv_output_rename(struct fv_output *output, const char *path)
{
    if (strlen(path) >= sizeof output->path) return ENAMETOOLONG;
    if (!fv_output_there(output)) return ENOENT;
    /* Where the file system has no exclusive rename, as some network ones, the name was free when
     * it was chosen. */
    if (renameat2(AT_FDCWD, output->path, AT_FDCWD, path, RENAME_NOREPLACE) != 0 &&
        (errno != EINVAL || rename(output->path, path) != 0))
        return errno;
    strcpy(output->path, path);
    return 0;
}

FILE *fv_output_stream(struct fv_output *output)
{
    if (output->stream == NULL) output->stream = fdopen(output->file, "w");
    return output->stream;
}

/* Sync the folder that `path` is in, so that a power cut does not undo a rename. */
static bool sync_folder(const char *path)
{
    char folder[FV_OUTPUT_PATH_BYTES];
    const char *slash = strrchr(path, '/');
    snprintf(folder, sizeof folder, "%.*s", slash == NULL ? 1 : (int)(slash - path) + 1,
             slash == NULL ? "." : path);
    const int file = open(folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (file < 0) return false;
    const bool synced = fsync(file) == 0 || errno == EINVAL;
    close(file);
    return synced;
}

/* Buffered bytes and the disk's; 0, or why not. */
static int flush(struct fv_output *output)
{
    if (output->stream != NULL) {
        errno = EIO; /* where an earlier write failed, its reason is gone */
        if (fflush(output->stream) != 0 || ferror(output->stream) != 0) return errno;
    }
    if (!output->named) return 0;
    return fsync(output->file) == 0 || errno == EINVAL ? 0 : errno;
}

static int close_file(struct fv_output *output)
{
    const int failed = output->stream != NULL ? fclose(output->stream) : close(output->file);
    const int why = failed != 0 ? errno : 0;
    output->stream = NULL;
    output->file = -1;
    return why;
}

enum fovea_status fv_output_close(struct fv_output *output, struct fovea_error *error)
{
    if (output->file < 0) return FOVEA_OK;
    int why = flush(output);
    if (why == 0) why = fv_output_place(output);
    const bool synced = !output->placed || sync_folder(output->path);
    const bool left = output->named && !output->placed && names(output->part, output->file);
    if (left) unlink(output->part);
    const int closed = close_file(output);
    if (why == 0) why = closed;
    errno = why;
    if (why != 0)
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%.300s: cannot be written: %s",
                               output->path, strerror(why));
    if (!synced)
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM,
                               "%.300s: is written, but its folder cannot be synced", output->path);
    return FOVEA_OK;
}

void fv_output_discard(struct fv_output *output)
{
    if (output->file < 0) return;
    if (output->named && !output->placed && names(output->part, output->file)) unlink(output->part);
    close_file(output);
}

bool fv_output_there(const struct fv_output *output)
{
    return output->file < 0 || !output->named ||
           names(output->placed ? output->path : output->part, output->file);
}

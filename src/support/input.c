#include "support/input.h"

#include <errno.h>
#include <fcntl.h>
#include <stdbool.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static const char *kind_of(mode_t mode)
{
    return S_ISDIR(mode)    ? "a directory"
           : S_ISFIFO(mode) ? "a pipe"
           : S_ISSOCK(mode) ? "a socket"
                            : "a device";
}

static enum fovea_status unopened(int why, struct fovea_error *reason)
{
    return fovea_error_set(reason, why == ENOENT || why == ENOTDIR ? FOVEA_GONE : FOVEA_ERROR_INPUT,
                           "cannot be opened: %s", strerror(why));
}

static enum fovea_status check(const struct stat *about, int64_t bytes_max,
                               struct fovea_error *reason)
{
    if (!S_ISREG(about->st_mode))
        return fovea_error_set(reason, FOVEA_ERROR_INPUT, "found %s, expected a file",
                               kind_of(about->st_mode));
    if (about->st_size > bytes_max)
        return fovea_error_set(reason, FOVEA_ERROR_INPUT, "found %lld bytes, expected at most %lld",
                               (long long)about->st_size, (long long)bytes_max);
    return FOVEA_OK;
}

enum fovea_status fv_input_check(const char *path, int64_t bytes_max, struct fovea_error *reason)
{
    struct stat about;
    return stat(path, &about) == 0 ? check(&about, bytes_max, reason) : unopened(errno, reason);
}

/* A device is not even opened, since that may already do something. Between the look at the name
 * and the opening another file may take its place: O_NONBLOCK, and a second look. A file that
 * another program holds a lease on is refused with O_NONBLOCK; it is waited for. */
int fv_input_open(const char *path, int64_t bytes_max, int64_t *bytes, struct fovea_error *reason)
{
    struct stat about;
    if (fv_input_check(path, bytes_max, reason) != FOVEA_OK) return -1;
    int file = open(path, O_RDONLY | O_CLOEXEC | O_NOCTTY | O_NONBLOCK);
    if (file < 0 && errno == EWOULDBLOCK) file = open(path, O_RDONLY | O_CLOEXEC | O_NOCTTY);
    if (file < 0) {
        unopened(errno, reason);
        return -1;
    }
    if (fstat(file, &about) != 0) {
        unopened(errno, reason);
    } else if (check(&about, bytes_max, reason) == FOVEA_OK) {
        if (bytes != NULL) *bytes = about.st_size;
        return file;
    }
    close(file);
    return -1;
}

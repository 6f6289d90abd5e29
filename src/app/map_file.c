#include "app/map_file.h"

#include <errno.h>
#include <fcntl.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "fovea/text.h"

enum { PATH_BYTES = 1100, MAP_BYTES_MAX = 1 << 28 };

static bool write_all(int file, const uint8_t *data, size_t bytes)
{
    while (bytes > 0) {
        const ssize_t written = write(file, data, bytes);
        if (written < 0 && errno == EINTR) continue;
        if (written <= 0) return false;
        data += written;
        bytes -= (size_t)written;
    }
    return true;
}

/* The folder's entry must reach the disk too, or the rename may be lost with the power. */
static bool sync_folder(const char *path)
{
    char folder[PATH_BYTES];
    const char *slash = strrchr(path, '/');
    snprintf(folder, sizeof folder, "%.*s", slash == NULL ? 1 : (int)(slash - path) + 1,
             slash == NULL ? "." : path);
    const int file = open(folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (file < 0) return false;
    const bool synced = fsync(file) == 0;
    close(file);
    return synced;
}

enum fovea_status fv_map_file_probe(const char *path, struct fovea_error *error)
{
    char part[PATH_BYTES];
    struct stat there;
    if (snprintf(part, sizeof part, "%s.part", path) >= (int)sizeof part)
        return fovea_error_set(error, FOVEA_ERROR_INPUT, "%.100s...: the map's name is too long",
                               path);
    /* The rename would take a device's place. */
    if (stat(path, &there) == 0 && !S_ISREG(there.st_mode))
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%.200s: found %s, expected a file for the map", path,
                               S_ISDIR(there.st_mode) ? "a directory" : "a device or pipe");
    const bool left = access(part, F_OK) == 0;
    const int file = open(part, O_WRONLY | O_CREAT | O_CLOEXEC, 0644);
    if (file < 0)
        return fovea_error_set(error, FOVEA_ERROR_INPUT, "%.200s: the map cannot be written: %s",
                               path, strerror(errno));
    close(file);
    if (!left) unlink(part);
    return FOVEA_OK;
}

enum fovea_status fv_map_file_write(const char *path, const uint8_t *data, size_t bytes,
                                    struct fovea_error *error)
{
    char part[PATH_BYTES];
    if (snprintf(part, sizeof part, "%s.part", path) >= (int)sizeof part)
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%.100s...: the map's name is too long",
                               path);
    const int file = open(part, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
    bool fine = file >= 0 && write_all(file, data, bytes) && fsync(file) == 0;
    int reason = errno;
    if (file >= 0 && close(file) != 0 && fine) {
        fine = false;
        reason = errno;
    }
    if (fine && rename(part, path) != 0) {
        fine = false;
        reason = errno;
    }
    if (!fine) {
        if (file >= 0) unlink(part);
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%.200s: the map cannot be written: %s",
                               path, strerror(reason));
    }
    if (!sync_folder(path))
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM,
                               "%.200s: the map is written, but its folder cannot be synced: %s",
                               path, strerror(errno));
    return FOVEA_OK;
}

enum fovea_status fv_map_file_read(const char *path, uint8_t **data, size_t *bytes,
                                   struct fovea_error *error)
{
    char *text;
    const enum fovea_status status = fovea_text_read(path, MAP_BYTES_MAX, &text, bytes, error);
    if (status == FOVEA_OK) *data = (uint8_t *)text;
    return status;
}

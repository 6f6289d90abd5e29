#include "app/config/map_file.h"

#include <errno.h>
#include <fcntl.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "base/hash.h"
#include "map/archive.h"
#include "support/files.h"
#include "support/input.h"
#include "support/output.h"
#include "support/stall.h"
#include "support/text.h"

enum { WAIT_TRIES = 200 /* of 10 ms */, PIECE_BYTES = 256 << 10 };

/* Synced piece by piece, so that on a slow card, too, it is seen that the writing goes on: after a
 * signal a run waits for a map as long as there is progress (stall.h). */
static bool write_all(int file, const uint8_t *data, size_t bytes)
{
    while (bytes > 0) {
        const ssize_t written = write(file, data, bytes < PIECE_BYTES ? bytes : PIECE_BYTES);
        if (written < 0 && errno == EINTR) continue;
        if (written <= 0) return false;
        if (fdatasync(file) != 0 && errno != EINVAL && errno != EROFS) return false;
        fv_stall_move(-1);
        data += written;
        bytes -= (size_t)written;
    }
    return true;
}

/* Another program's save takes as long as the disk; both shall be done. */
static enum fovea_status open_when_free(struct fv_output *output, const char *path,
                                        struct fovea_error *error)
{
    for (int i = 0; i < WAIT_TRIES; i++) {
        if (fv_output_open(output, path, FV_OUTPUT_WHOLE, error) == FOVEA_OK) return FOVEA_OK;
        if (errno != EBUSY) break;
        nanosleep(&(struct timespec){.tv_nsec = 10000000}, NULL);
    }
    return FOVEA_ERROR_SYSTEM;
}

enum fovea_status fv_map_file_probe(const char *path, struct fovea_error *error)
{
    struct stat there;
    struct fv_output output;
    /* A map is written whole beside its place: no device can take it. */
    if (stat(path, &there) == 0 && !S_ISREG(there.st_mode))
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%.200s: found %s, expected a file for the map", path,
                               S_ISDIR(there.st_mode) ? "a directory" : "a device or pipe");
    enum fovea_status status = open_when_free(&output, path, error);
    fv_output_discard(&output);
    if (status != FOVEA_OK) return FOVEA_ERROR_INPUT;
    /* No save makes a temporary file of this number, so that another run's is not met. */
    char longest[FV_OUTPUT_PATH_BYTES + sizeof FV_MAP_FILE_SMALL + 2];
    snprintf(longest, sizeof longest, "%s" FV_MAP_FILE_SMALL ".%d", path, FV_MAP_FILE_KEEP_MAX - 1);
    status = open_when_free(&output, longest, error);
    fv_output_discard(&output);
    return status == FOVEA_OK ? FOVEA_OK : FOVEA_ERROR_INPUT;
}

/* ---- keeping older ones ---------------------------------------------------------------------- */

static bool older_name(char name[FV_OUTPUT_PART_BYTES], const char *path, uint32_t number)
{
    return snprintf(name, FV_OUTPUT_PART_BYTES, "%s.%u", path, (unsigned)number) <
           (int)FV_OUTPUT_PART_BYTES;
}

/* Make PATH.1 another name of what is at PATH, which stays there; 0, or why not. */
static int link_first(const char *path, const char *first)
{
    char part[FV_OUTPUT_PART_BYTES + 8];
    snprintf(part, sizeof part, "%s.part", first);
    if (unlink(part) != 0 && errno != ENOENT) return errno;
    if (link(path, part) == 0) return rename(part, first) == 0 ? 0 : errno;
    /* No hard links here, as on FAT: for an instant there is none at PATH, but one at PATH.1. */
    if (errno != EPERM && errno != EOPNOTSUPP && errno != EMLINK) return errno;
    return rename(path, first) == 0 ? 0 : errno;
}

/* Move the older maps up to the first free number, and link the present one as PATH.1. */
static int keep_older(const char *path, uint32_t keep)
{
    char from[FV_OUTPUT_PART_BYTES], to[FV_OUTPUT_PART_BYTES];
    struct stat there;
    if (keep < 2 || lstat(path, &there) != 0 || !S_ISREG(there.st_mode)) return 0;
    if (!older_name(to, path, 1)) return ENAMETOOLONG;
    if (fv_files_same(path, to, false)) return 0; /* a save that died after this */
    uint32_t free_number = 1;
    while (free_number < keep - 1 && older_name(to, path, free_number) && lstat(to, &there) == 0)
        free_number++;
    for (uint32_t i = free_number; i > 1; i--) {
        if (!older_name(from, path, i - 1) || !older_name(to, path, i)) return ENAMETOOLONG;
        if (rename(from, to) != 0 && errno != ENOENT) return errno;
    }
    (void)older_name(to, path, 1);
    return link_first(path, to);
}

/* Feed `bytes` of the file to the hash, piece by piece: no buffer of its size is there. */
static bool hash_file(int file, uint64_t bytes, uint64_t *hash)
{
    uint8_t piece[16 << 10];
    while (bytes > 0) {
        const ssize_t got = read(file, piece, bytes < sizeof piece ? bytes : sizeof piece);
        if (got < 0 && errno == EINTR) continue;
        if (got <= 0) return false;
        *hash = fv_hash(*hash, piece, (size_t)got);
        fv_stall_move(-1);
        bytes -= (uint64_t)got;
    }
    return true;
}

/* Whether the open file is a map, as long as its header states and with the checksum at its end. */
static bool is_whole(int file, struct fv_archive_outline *outline)
{
    uint8_t header[FV_ARCHIVE_HEADER_BYTES], end[FV_ARCHIVE_CHECKSUM_BYTES];
    struct stat there;
    uint64_t bytes, hash = FV_HASH_START, stated = 0;
    if (fstat(file, &there) != 0 || !S_ISREG(there.st_mode) ||
        read(file, header, sizeof header) != (ssize_t)sizeof header ||
        (bytes = (uint64_t)there.st_size) < sizeof header + sizeof end ||
        !fv_archive_outline(header, bytes, outline))
        return false;
    hash = fv_hash(hash, header, sizeof header);
    if (!hash_file(file, bytes - sizeof header - sizeof end, &hash) ||
        read(file, end, sizeof end) != (ssize_t)sizeof end)
        return false;
    for (int i = 0; i < FV_ARCHIVE_CHECKSUM_BYTES; i++)
        stated |= (uint64_t)end[i] << (8 * i);
    return stated == hash;
}

/* Of the map at PATH; false: there is none that can be read. */
static bool outline_at(const char *path, struct fv_archive_outline *outline)
{
    const int file = open(path, O_RDONLY | O_NONBLOCK | O_NOFOLLOW | O_CLOEXEC);
    if (file < 0) return false;
    const bool whole = is_whole(file, outline);
    close(file);
    return whole;
}

/* So much less than the map that is there that it does not take its place. */
static bool holds_less(const struct fv_archive_outline *map, const struct fv_archive_outline *there)
{
    return 2 * (uint64_t)map->landmarks < there->landmarks || (there->has_grid && !map->has_grid);
}

static enum fovea_status save_at(struct fv_output *output, uint32_t keep, const uint8_t *data,
                                 size_t bytes, struct fovea_error *error)
{
    int why = write_all(output->file, data, bytes) && fsync(output->file) == 0 ? 0 : errno;
    if (why == 0) why = keep_older(output->path, keep);
    if (why == 0) return fv_output_close(output, error);
    fv_output_discard(output);
    return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%.200s: the map cannot be written: %s",
                           output->path, strerror(why));
}

enum fovea_status fv_map_file_save(const char *path, const struct fv_map_file_rules *rules,
                                   const uint8_t *data, size_t bytes,
                                   struct fv_map_file_saved *saved, struct fovea_error *error)
{
    char small[FV_OUTPUT_PATH_BYTES];
    struct fv_output output;
    *saved = (struct fv_map_file_saved){0};
    if (open_when_free(&output, path, error) != FOVEA_OK) return FOVEA_ERROR_SYSTEM;
    /* From here on nobody else saves there. */
    saved->beside = !rules->overwrite && bytes >= FV_ARCHIVE_HEADER_BYTES &&
                    fv_archive_outline(data, bytes, &saved->map) &&
                    outline_at(path, &saved->there) && holds_less(&saved->map, &saved->there);
    if (!saved->beside) return save_at(&output, rules->keep, data, bytes, error);
    fv_output_discard(&output);
    if (snprintf(small, sizeof small, "%s" FV_MAP_FILE_SMALL, path) >= (int)sizeof small)
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%.100s...: the path is too long", path);
    if (open_when_free(&output, small, error) != FOVEA_OK) return FOVEA_ERROR_SYSTEM;
    return save_at(&output, rules->keep, data, bytes, error);
}

/* ---- reading --------------------------------------------------------------------------------- */

enum fovea_status fv_map_file_read(const char *path, uint8_t **data, size_t *bytes,
                                   struct fovea_error *error)
{
    char *text;
    const enum fovea_status status =
        fv_text_read(path, FV_INPUT_MAP_BYTES_MAX, &text, bytes, error);
    if (status == FOVEA_OK) *data = (uint8_t *)text;
    return status;
}

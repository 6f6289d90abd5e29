#include "app/record/recording_file.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdio.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "support/say.h"

enum { DIGITS_MIN = 6, DIGITS_MAX = 18, LOCK_TRIES = 300, NAMES_TRIES = 100 };

static const char open_end[] = ".open.lcm", closed_end[] = ".lcm";

bool fv_recording_file_numbered(const char *path)
{
    const size_t length = strlen(path);
    return length > 0 && path[length - 1] == '/';
}

/* ---- names ----------------------------------------------------------------------------------- */

bool fv_recording_name_read(const char *name, struct fv_recording_name *read)
{
    static const char form[] = "-dddddddd?dddddd?"; /* d: digit; ?: T, then Z */
    const size_t digits = strspn(name, "0123456789");
    if (digits < DIGITS_MIN || digits > DIGITS_MAX) return false;
    read->number = 0;
    for (size_t i = 0; i < digits; i++)
        read->number = 10 * read->number + (uint64_t)(name[i] - '0');
    const char *at = name + digits;
    for (size_t i = 0; form[i] != '\0'; i++, at++) {
        const bool fits = form[i] == 'd'   ? *at >= '0' && *at <= '9'
                          : form[i] == '?' ? *at == (i == 9 ? 'T' : 'Z')
                                           : *at == form[i];
        if (!fits) return false;
    }
    read->open = strcmp(at, open_end) == 0;
    return read->open || strcmp(at, closed_end) == 0;
}

/* ---- the folder ------------------------------------------------------------------------------ */

/* The oldest recording of a kind, and how many there are; those that are being written do not
 * count. */
struct oldest {
    uint64_t count, number;
    char name[NAME_MAX + 1];
};

static bool is_written(int folder, const char *name)
{
    const int file = openat(folder, name, O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
    if (file < 0) return true; /* not ours to judge */
    const bool locked = flock(file, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK;
    close(file);
    return locked;
}

/* Look through the folder: the highest number, and the oldest that ended in order (0) or did not
 * (1). `oldest` may be NULL. `spared` counts and is never the oldest; NULL: none. */
static int look(int folder, const char *spared, uint64_t *highest, struct oldest oldest[2])
{
    const int again = openat(folder, ".", O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    DIR *list = again >= 0 ? fdopendir(again) : NULL;
    if (list == NULL) return errno;
    *highest = 0;
    for (const struct dirent *entry; (entry = readdir(list)) != NULL;) {
        struct fv_recording_name read;
        struct stat about;
        if (!fv_recording_name_read(entry->d_name, &read)) continue;
        if (read.number > *highest) *highest = read.number;
        if (oldest == NULL || fstatat(folder, entry->d_name, &about, AT_SYMLINK_NOFOLLOW) != 0 ||
            !S_ISREG(about.st_mode) || (read.open && is_written(folder, entry->d_name)))
            continue;
        struct oldest *kind = &oldest[read.open];
        kind->count++;
        if (spared != NULL && strcmp(entry->d_name, spared) == 0) continue;
        if (kind->name[0] != '\0' && read.number >= kind->number) continue;
        kind->number = read.number;
        snprintf(kind->name, sizeof kind->name, "%s", entry->d_name);
    }
    closedir(list);
    return 0;
}

/* Open the folder and lock it against other runs: -1 and errno when it is not possible. */
static int lock_folder(const char *path)
{
    const int folder = open(path, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    for (int i = 0; folder >= 0 && flock(folder, LOCK_EX | LOCK_NB) != 0; i++) {
        if (errno != EWOULDBLOCK) return folder; /* a file system without locks */
        if (i == LOCK_TRIES) {
            close(folder);
            errno = EBUSY;
            return -1;
        }
        nanosleep(&(struct timespec){.tv_nsec = 10000000}, NULL);
    }
    return folder;
}

/* With the folder locked, so that two runs do not count the same files. */
static void remove_beyond(int folder, const char *path, const char *spared, uint32_t keep)
{
    while (keep > 0) {
        uint64_t highest = 0;
        struct oldest oldest[2] = {{0}, {0}};
        if (look(folder, spared, &highest, oldest) != 0) return;
        const int kind = oldest[0].count > keep ? 0 : 1;
        if (oldest[kind].count <= keep || oldest[kind].name[0] == '\0') return;
        if (unlinkat(folder, oldest[kind].name, 0) == 0) continue;
        fv_say("%s%s: cannot be removed: %s", path, oldest[kind].name, strerror(errno));
        return;
    }
}

/* ---- open and close -------------------------------------------------------------------------- */

static int create_next(struct fv_recording_file *file, int folder, const char *path)
{
    char name[FV_OUTPUT_PATH_BYTES];
    uint64_t highest = 0;
    int why = look(folder, NULL, &highest, NULL);
    for (int i = 1; why == 0 && i <= NAMES_TRIES; i++) {
        char when[32];
        struct tm utc;
        const time_t now = time(NULL);
        if (gmtime_r(&now, &utc) == NULL || utc.tm_year + 1900 > 9999 ||
            strftime(when, sizeof when, "%Y%m%dT%H%M%SZ", &utc) == 0)
            snprintf(when, sizeof when, "00000000T000000Z");
        if (snprintf(name, sizeof name, "%s%06" PRIu64 "-%s%s", path, highest + (uint64_t)i, when,
                     open_end) >= (int)sizeof name)
            return ENAMETOOLONG;
        why = fv_output_create(&file->output, name);
        if (why != EEXIST) break;
        why = i < NAMES_TRIES ? 0 : EEXIST;
    }
    if (why == 0 && fsync(folder) != 0 && errno != EINVAL) why = errno;
    return why;
}

static enum fovea_status open_numbered(struct fv_recording_file *file, const char *path,
                                       struct fovea_error *error)
{
    if (mkdir(path, 0777) != 0 && errno != EEXIST)
        return fovea_error_set(error, FOVEA_ERROR_INPUT, "%.300s: the folder cannot be made: %s",
                               path, strerror(errno));
    const int folder = lock_folder(path);
    int why = folder < 0 ? errno : create_next(file, folder, path);
    if (why == 0) remove_beyond(folder, path, NULL, file->keep);
    if (folder >= 0) close(folder);
    if (why == 0) return FOVEA_OK;
    fv_output_discard(&file->output);
    return fovea_error_set(error, FOVEA_ERROR_INPUT, "%.300s: cannot be written: %s", path,
                           strerror(why));
}

enum fovea_status fv_recording_file_open(struct fv_recording_file *file, const char *path,
                                         uint32_t keep, struct fovea_error *error)
{
    file->output = FV_OUTPUT_CLOSED;
    file->numbered = fv_recording_file_numbered(path);
    file->keep = keep;
    if (file->numbered) return open_numbered(file, path, error);
    return fv_output_open(&file->output, path, FV_OUTPUT_STREAM, error);
}

/* "NAME.open.lcm" becomes "NAME.lcm", and older ones go. */
static int give_final_name(struct fv_recording_file *file)
{
    char folder_path[FV_OUTPUT_PATH_BYTES], name[FV_OUTPUT_PATH_BYTES];
    const char *path = file->output.path;
    const size_t stem = strlen(path) - (sizeof open_end - 1);
    snprintf(folder_path, sizeof folder_path, "%.*s", (int)(strrchr(path, '/') - path) + 1, path);
    snprintf(name, sizeof name, "%.*s%s", (int)stem, path, closed_end);
    const int folder = lock_folder(folder_path);
    const int why = fv_output_rename(&file->output, name);
    if (folder < 0) return why; /* what is too much, the next run removes */
    if (why == 0 && fsync(folder) == 0)
        remove_beyond(folder, folder_path, strrchr(name, '/') + 1, file->keep);
    close(folder);
    return why;
}

enum fovea_status fv_recording_file_close(struct fv_recording_file *file,
                                          enum fv_recording_holds holds, struct fovea_error *error)
{
    struct fv_output *output = &file->output;
    if (output->file < 0) return FOVEA_OK;
    int why = fsync(output->file) == 0 || errno == EINVAL || errno == EROFS ? 0 : errno;
    if (why == 0 && !fv_output_there(output)) why = ENOENT;
    if (why == 0 && file->numbered && holds == FV_RECORDING_ALL) why = give_final_name(file);
    if (why == 0 && file->numbered && holds == FV_RECORDING_NONE && unlink(output->path) != 0)
        why = errno;
    if (why == 0) return fv_output_close(output, error);
    fv_output_discard(output);
    return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%s",
                           why == ENOENT ? "it was deleted or moved" : strerrordesc_np(why));
}

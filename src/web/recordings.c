#include "web/recordings.h"

#include <dirent.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "support/folder.h"

enum {
    ENTRIES_MAX = 100000,
    ROW_BYTES = FV_WEB_RECORDING_NAME_BYTES + 96 /* of JSON */
};

struct recording {
    char name[FV_WEB_RECORDING_NAME_BYTES];
    uint64_t bytes;
    int64_t utime;
};

static bool is_name(const char *name)
{
    static const char plain[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789._-";
    const size_t length = strlen(name);
    return length > 4 && length < FV_WEB_RECORDING_NAME_BYTES && name[0] != '.' &&
           strspn(name, plain) == length && strcmp(name + length - 4, ".lcm") == 0;
}

int fv_web_recording_open(const char *folder, const char *name, uint64_t *bytes)
{
    struct stat there;
    if (folder == NULL || !is_name(name)) return -1;
    const int open_folder = open(folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (open_folder < 0) return -1;
    const int file = fv_folder_open_file(open_folder, name, &there);
    close(open_folder);
    *bytes = file >= 0 ? (uint64_t)there.st_size : 0;
    return file;
}

static int newest_first(const void *a, const void *b)
{
    const struct recording *x = a, *y = b;
    if (x->utime != y->utime) return x->utime < y->utime ? 1 : -1;
    return strcmp(y->name, x->name);
}

static struct recording *oldest_of(struct recording all[FV_WEB_RECORDINGS_MAX])
{
    struct recording *oldest = all;
    for (size_t i = 1; i < FV_WEB_RECORDINGS_MAX; i++)
        if (newest_first(&all[i], oldest) > 0) oldest = &all[i];
    return oldest;
}

/* Up to FV_WEB_RECORDINGS_MAX of them; one that comes then takes the place of the oldest. */
static size_t list(DIR *folder, struct recording *all)
{
    size_t count = 0;
    for (int i = 0; i < ENTRIES_MAX; i++) {
        struct stat there;
        const struct dirent *entry = readdir(folder);
        if (entry == NULL) break;
        if (!is_name(entry->d_name) ||
            fstatat(dirfd(folder), entry->d_name, &there, AT_SYMLINK_NOFOLLOW) != 0 ||
            !S_ISREG(there.st_mode))
            continue;
        struct recording found = {.bytes = (uint64_t)there.st_size,
                                  .utime = there.st_mtim.tv_sec * INT64_C(1000000) +
                                           there.st_mtim.tv_nsec / 1000};
        memcpy(found.name, entry->d_name, strlen(entry->d_name) + 1);
        if (count < FV_WEB_RECORDINGS_MAX) {
            all[count++] = found;
            continue;
        }
        struct recording *oldest = oldest_of(all);
        if (newest_first(&found, oldest) < 0) *oldest = found;
    }
    qsort(all, count, sizeof *all, newest_first);
    return count;
}

char *fv_web_recordings_json(const char *folder)
{
    if (folder == NULL) return strdup("null\n");
    char *json = malloc(FV_WEB_RECORDINGS_MAX * ROW_BYTES + 8), *at = json;
    struct recording *all = calloc(FV_WEB_RECORDINGS_MAX, sizeof *all);
    DIR *open_folder = all != NULL ? opendir(folder) : NULL;
    const size_t count = open_folder != NULL ? list(open_folder, all) : 0;
    if (open_folder != NULL) closedir(open_folder);
    if (json == NULL || all == NULL) {
        free(json);
        free(all);
        return NULL;
    }
    *at++ = '[';
    for (size_t i = 0; i < count; i++)
        at += snprintf(at, ROW_BYTES,
                       "%s{\"name\":\"%s\",\"bytes\":%" PRIu64 ",\"utime\":%" PRId64 "}",
                       i > 0 ? "," : "", all[i].name, all[i].bytes, all[i].utime);
    strcpy(at, "]\n");
    free(all);
    return json;
}

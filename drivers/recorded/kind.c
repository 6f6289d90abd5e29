#include "kind.h"

#include <dirent.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>
#include <unistd.h>

#include "listing.h"
#include "support/input.h"

static bool holds(const char *folder, const char *name)
{
    char path[FV_PATH_BYTES];
    return fv_path_join(path, folder, name, NULL) == FOVEA_OK && fv_path_exists(path);
}

/* An event begins with these bytes. */
static bool is_log(const char *path)
{
    static const uint8_t mark[4] = {0xED, 0xA1, 0xDA, 0x01};
    uint8_t first[4];
    const int file = fv_input_open(path, FV_INPUT_ANY_BYTES, NULL, NULL);
    if (file < 0) return false;
    const bool log =
        read(file, first, sizeof first) == sizeof first && memcmp(first, mark, sizeof mark) == 0;
    close(file);
    return log;
}

/* Of a folder, one of its first files is looked for that `images` would play. */
static bool has_images(const char *path)
{
    enum { LOOKED_AT = 1000 };
    static const char *const endings[] = {".png", ".jpg", ".jpeg", ".bmp"};
    DIR *folder = opendir(path);
    bool found = false;
    const struct dirent *entry;
    for (int i = 0; folder != NULL && !found && i < LOOKED_AT; i++) {
        if ((entry = readdir(folder)) == NULL) break;
        const char *ending = strrchr(entry->d_name, '.');
        for (size_t k = 0; ending != NULL && k < sizeof endings / sizeof endings[0]; k++)
            found = found || strcasecmp(ending, endings[k]) == 0;
    }
    if (folder != NULL) closedir(folder);
    return found;
}

/* The name of the source that plays it: "euroc", "tum", "kitti", "lcmlog", "images"; NULL: none is
 * known. */
static const char *kind_of(const char *path)
{
    if (holds(path, "mav0/cam0/data.csv") || holds(path, "cam0/data.csv")) return "euroc";
    if (holds(path, "rgb.txt")) return "tum";
    if (holds(path, "times.txt") && (holds(path, "image_0") || holds(path, "image_2")))
        return "kitti";
    if (is_log(path)) return "lcmlog";
    return has_images(path) ? "images" : NULL;
}

enum fovea_status fv_kind_hint(const char *name, const char *path, enum fovea_status status,
                               struct fovea_error *error)
{
    const char *kind = status == FOVEA_OK || error == NULL ? NULL : kind_of(path);
    if (kind == NULL || strcmp(kind, name) == 0) return status;
    const size_t used = strlen(error->text);
    snprintf(error->text + used, sizeof error->text - used, "; this looks like %s:%.200s", kind,
             path);
    return status;
}

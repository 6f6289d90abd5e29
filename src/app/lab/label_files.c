#include "app/lab/label_files.h"

#include <dirent.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "support/files.h"

static const char mask_ending[] = ".mask.png";

static bool ends(const char *name, size_t length, const char *ending)
{
    const size_t bytes = strlen(ending);
    return length > bytes && memcmp(name + length - bytes, ending, bytes) == 0;
}

static bool holds_masks(const char *folder)
{
    DIR *open = opendir(folder);
    bool found = false;
    if (open == NULL) return false;
    for (const struct dirent *entry; !found && (entry = readdir(open)) != NULL;)
        found = ends(entry->d_name, strlen(entry->d_name), mask_ending);
    closedir(open);
    return found;
}

/* The name of a picture without its folder and ending. */
struct stem {
    const char *name;
    size_t folder, length; /* bytes of the folder with its '/'; of the name */
};

static struct stem stem_of(const char *picture)
{
    const char *slash = strrchr(picture, '/'), *name = slash == NULL ? picture : slash + 1,
               *dot = strrchr(name, '.');
    return (struct stem){.name = name,
                         .folder = (size_t)(name - picture),
                         .length = dot == NULL ? strlen(name) : (size_t)(dot - name)};
}

/* NAME.cam1 and so on. */
static bool is_of_further_camera(const struct stem *stem)
{
    const char *last = stem->name + stem->length - 1;
    return stem->length > 5 && *last >= '1' && *last <= '9' && memcmp(last - 4, ".cam", 4) == 0;
}

/* `folder` without or with a '/' at its end, the name and an ending; NULL: out of memory. */
static char *path_of(const char *folder, size_t bytes, const struct stem *stem, const char *ending)
{
    const bool bare = bytes > 0 && folder[bytes - 1] != '/';
    char *path = malloc(bytes + 1 + stem->length + strlen(ending) + 1);
    if (path == NULL) return NULL;
    memcpy(path, folder, bytes);
    if (bare) path[bytes] = '/';
    memcpy(path + bytes + bare, stem->name, stem->length);
    memcpy(path + bytes + bare + stem->length, ending, strlen(ending) + 1);
    return path;
}

/* Whether the picture lies beside another label picture than that of the folder. */
static enum fovea_status check_beside(const char *picture, const struct stem *stem,
                                      const char *label, struct fovea_error *error)
{
    char *own = path_of(picture, stem->folder, stem, mask_ending);
    if (own == NULL) return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "out of memory");
    const bool differs = access(own, F_OK) == 0 && !fv_files_same(own, label, true);
    free(own);
    return differs ? fovea_error_set(error, FOVEA_ERROR_INPUT,
                                     "%.250s: found its labels beside it and others in %.250s, "
                                     "expected --evaluate with the picture's own folder",
                                     picture, label)
                   : FOVEA_OK;
}

static enum fovea_status take(struct fv_label_files *files, const char *folder, bool masks,
                              char *picture, struct fovea_error *error)
{
    const struct stem stem = stem_of(picture);
    if (ends(stem.name, strlen(stem.name), mask_ending)) {
        files->masks++;
        return FOVEA_OK;
    }
    char *label = path_of(folder, strlen(folder), &stem, masks ? mask_ending : ".png");
    if (label == NULL) return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "out of memory");
    const bool is_itself = fv_files_same(label, picture, true);
    if (is_of_further_camera(&stem) && (is_itself || access(label, F_OK) != 0)) {
        files->others++;
        free(label);
        return FOVEA_OK;
    }
    files->pictures[files->count] = picture;
    files->labels[files->count++] = label;
    if (is_itself)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%.300s: found no label picture but the picture itself, expected a "
                               "folder that has one of class numbers",
                               picture);
    return masks ? check_beside(picture, &stem, label, error) : FOVEA_OK;
}

static int compare(const void *a, const void *b)
{
    return strcmp(**(char **const *)a, **(char **const *)b);
}

/* No two pictures have one label picture. */
static enum fovea_status check_apart(const struct fv_label_files *files, struct fovea_error *error)
{
    char ***order = malloc((size_t)files->count * sizeof *order);
    enum fovea_status status = FOVEA_OK;
    if (order == NULL) return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "out of memory");
    for (int i = 0; i < files->count; i++)
        order[i] = &files->labels[i];
    qsort(order, (size_t)files->count, sizeof *order, compare);
    for (int i = 1; i < files->count && status == FOVEA_OK; i++)
        if (strcmp(*order[i - 1], *order[i]) == 0)
            status =
                fovea_error_set(error, FOVEA_ERROR_INPUT,
                                "%.200s: found %.200s and %.200s, expected one picture of its name",
                                *order[i], files->pictures[order[i - 1] - files->labels],
                                files->pictures[order[i] - files->labels]);
    free(order);
    return status;
}

enum fovea_status fv_label_files_find(struct fv_label_files *files, const char *folder,
                                      char *const *pictures, int count, struct fovea_error *error)
{
    const bool masks = holds_masks(folder);
    enum fovea_status status = FOVEA_OK;
    files->pictures = calloc((size_t)count, sizeof *files->pictures);
    files->labels = calloc((size_t)count, sizeof *files->labels);
    if (files->pictures == NULL || files->labels == NULL)
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "out of memory");
    for (int i = 0; i < count && status == FOVEA_OK; i++)
        status = take(files, folder, masks, pictures[i], error);
    if (status != FOVEA_OK) return status;
    if (files->count == 0)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%.300s: found label pictures and pictures of further cameras only, "
                               "expected pictures with labels in %.300s",
                               pictures[0], folder);
    return check_apart(files, error);
}

void fv_label_files_free(struct fv_label_files *files)
{
    for (int i = 0; i < files->count; i++)
        free(files->labels[i]);
    free(files->pictures);
    free(files->labels);
}

/* Loose images: a pattern, a folder or one file, in natural order (img2 before img10), 30 per
 * second. A camera.yaml beside the first of them is their calibration. */
#include <glob.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "kind.h"
#include "listing.h"
#include "player.h"

enum { RATE_HZ = 30 };

/* Runs of digits compare as numbers; equal so far, plain bytes decide. */
static int natural_order(const void *left, const void *right)
{
    const char *first = *(const char *const *)left, *second = *(const char *const *)right;
    const unsigned char *a = (const unsigned char *)first, *b = (const unsigned char *)second;
    while (*a != '\0' && *b != '\0') {
        const size_t zeros_a = strspn((const char *)a, "0"), zeros_b = strspn((const char *)b, "0");
        const size_t digits_a = strspn((const char *)a + zeros_a, "0123456789");
        const size_t digits_b = strspn((const char *)b + zeros_b, "0123456789");
        if (zeros_a + digits_a > 0 && zeros_b + digits_b > 0) {
            if (digits_a != digits_b) return digits_a < digits_b ? -1 : 1;
            const int order = memcmp(a + zeros_a, b + zeros_b, digits_a);
            if (order != 0) return order;
            a += zeros_a + digits_a;
            b += zeros_b + digits_b;
        } else if (*a != *b) {
            return *a < *b ? -1 : 1;
        } else {
            ++a;
            ++b;
        }
    }
    if (*a != *b) return *a < *b ? -1 : 1;
    return strcmp(first, second);
}

static bool is_folder(const char *path)
{
    struct stat about;
    return stat(path, &about) == 0 && S_ISDIR(about.st_mode);
}

/* A name as a pattern that it alone fits. */
static enum fovea_status escape(const char *name, char pattern[FV_PATH_BYTES],
                                struct fovea_error *error)
{
    size_t used = 0;
    for (; *name != '\0' && used + 2 < FV_PATH_BYTES; name++) {
        if (strchr("*?[]\\", *name) != NULL) pattern[used++] = '\\';
        pattern[used++] = *name;
    }
    pattern[used] = '\0';
    if (*name == '\0') return FOVEA_OK;
    return fovea_error_set(error, FOVEA_ERROR_INPUT,
                           "%.64s...: found a path of more than %d bytes, expected less", pattern,
                           FV_PATH_BYTES - 2);
}

/* The file or folder of that name, else the files that fit the pattern; of a folder, its PNG,
 * JPEG and BMP files. */
static enum fovea_status find_files(const char *address, glob_t *found, struct fovea_error *error)
{
    static const char *const endings[] = {"*.png", "*.jpg", "*.jpeg", "*.bmp",
                                          "*.PNG", "*.JPG", "*.JPEG", "*.BMP"};
    char name[FV_PATH_BYTES], pattern[FV_PATH_BYTES];
    int result = GLOB_NOMATCH;
    memset(found, 0, sizeof *found);
    const bool there = fv_path_exists(address);
    enum fovea_status status = there ? escape(address, name, error) : FOVEA_OK;
    if (status != FOVEA_OK) return status;
    if (there && is_folder(address)) {
        for (size_t i = 0; i < sizeof endings / sizeof endings[0]; i++) {
            status = fv_path_join(pattern, name, endings[i], error);
            if (status != FOVEA_OK) return status;
            const int more = glob(
                pattern, GLOB_NOSORT | (found->gl_pathv != NULL ? GLOB_APPEND : 0), NULL, found);
            if (more != GLOB_NOMATCH) result = more;
        }
    } else {
        result = glob(there ? name : address, GLOB_NOSORT | (there ? 0 : GLOB_TILDE), NULL, found);
    }
    if (result == 0) return FOVEA_OK;
    if (result == GLOB_NOMATCH)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%s: found no file, expected PNG, JPEG or BMP images", address);
    return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%s: the files cannot be listed", address);
}

static enum fovea_status add_files(struct fv_listing *listing, const glob_t *found,
                                   struct fovea_error *error)
{
    enum fovea_status status = FOVEA_OK;
    for (size_t i = 0; i < found->gl_pathc && status == FOVEA_OK; i++)
        status =
            fv_listing_add(listing, (int64_t)(i * 1000000000 / RATE_HZ), found->gl_pathv[i], error);
    return status;
}

static enum fovea_status find_calibration(struct fv_listing *listing, const char *first,
                                          const struct fovea_source_selection *selection,
                                          struct fovea_source_info *info, struct fovea_error *error)
{
    char folder[FV_PATH_BYTES], path[FV_PATH_BYTES];
    const char *slash = strrchr(first, '/');
    const size_t length = slash == NULL ? 0 : (size_t)(slash - first) + 1;
    if (length >= sizeof folder) return FOVEA_OK;
    memcpy(folder, first, length);
    folder[length] = '\0';
    const enum fovea_status status = fv_path_join(path, folder, "camera.yaml", error);
    if (status != FOVEA_OK) return status;
    fv_listing_reads(listing, path);
    return fv_info_set_calibration(info, path, selection, NULL, NULL, error);
}

static enum fovea_status open_files(const char *address,
                                    const struct fovea_source_selection *selection,
                                    struct fovea_source **source, struct fovea_error *error)
{
    struct fovea_source_info info = {.rate_hz = 0.0};
    glob_t found;
    if (address[0] == '\0')
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "images: found nothing, expected a pattern, a folder or a file");
    enum fovea_status status = find_files(address, &found, error);
    struct fv_listing *listing = NULL;
    if (status == FOVEA_OK) {
        qsort(found.gl_pathv, found.gl_pathc, sizeof found.gl_pathv[0], natural_order);
        listing = fv_listing_new("");
        status = listing == NULL
                     ? fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%s: out of memory", address)
                     : add_files(listing, &found, error);
    }
    if (status == FOVEA_OK)
        status = find_calibration(listing, found.gl_pathv[0], selection, &info, error);
    if (status == FOVEA_OK && is_folder(address)) fv_listing_reads(listing, address);
    globfree(&found);
    if (status != FOVEA_OK) {
        fv_listing_free(listing);
        return status;
    }
    info.rate_hz = RATE_HZ;
    return fv_listing_open(listing, address, selection, &info, source, error);
}

static enum fovea_status open_images(const char *address,
                                     const struct fovea_source_selection *selection,
                                     struct fovea_source **source, struct fovea_error *error)
{
    return fv_kind_hint("images", address, open_files(address, selection, source, error), error);
}

const struct fovea_source_ops fv_source_images =
    FV_PLAYER_OPS("images", "GLOB  images by pattern or folder, 30 per second", open_images);

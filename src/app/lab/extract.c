#include "app/lab/extract.h"

#include <inttypes.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app/config/mask.h"
#include "support/aligned.h"
#include "support/picture.h"

/* A name out of `count`; false: `names` gets all of them, for the message. */
static bool find_name(const char *text, const char *(*name_of)(int), int count, int *found,
                      char *names, size_t size)
{
    for (*found = 0; *found < count; ++*found)
        if (strcmp(text, name_of(*found)) == 0) return true;
    size_t used = 0;
    for (int i = 0; i < count && used < size; i++)
        used += (size_t)snprintf(names + used, size - used, "%s%s",
                                 i == 0           ? ""
                                 : i == count - 1 ? " or "
                                                  : ", ",
                                 name_of(i));
    return false;
}

static const char *method_name(int method)
{
    return fovea_feature_method_name((enum fovea_feature_method)method);
}

static const char *descriptor_name(int descriptor)
{
    return fovea_descriptor_name((enum fovea_descriptor)descriptor);
}

enum fovea_status fv_extract_config(const char *method, const char *descriptor, uint64_t max,
                                    struct fovea_extract_config *config, struct fovea_error *error)
{
    int found = FOVEA_FEATURES_ORB;
    char names[128] = "";
    if (method != NULL &&
        !find_name(method, method_name, FOVEA_FEATURE_METHOD_COUNT, &found, names, sizeof names))
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT, "--method: found '%.100s', expected %s",
                               method, names);
    fovea_extract_config_default(config, (enum fovea_feature_method)found);
    if (max < 1 || max > FOVEA_EXTRACT_COUNT_MAX)
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                               "--max: found %" PRIu64 ", expected 1 to %d", max,
                               FOVEA_EXTRACT_COUNT_MAX);
    config->count_max = (uint32_t)max;
    if (descriptor == NULL) return FOVEA_OK;
    if (!find_name(descriptor, descriptor_name, FOVEA_DESCRIPTOR_COUNT, &found, names,
                   sizeof names))
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                               "--descriptor: found '%.100s', expected %s", descriptor, names);
    config->descriptor = (enum fovea_descriptor)found;
    /* Whether the method has it. */
    struct fovea_error wrong;
    return fovea_extract_size(config, FOVEA_IMAGE_WIDTH_MIN, FOVEA_IMAGE_HEIGHT_MIN, &wrong) > 0
               ? FOVEA_OK
               : fovea_error_set(error, wrong.status, "--%s", wrong.text);
}

static enum fovea_status make_mask(const struct fovea_image *image,
                                   const struct fv_extract_ignore *ignore, struct fv_plane *mask,
                                   struct fovea_error *error)
{
    const bool fixed = ignore->mask_path != NULL;
    *mask = (struct fv_plane){NULL, image->width, image->height, image->width};
    if (fixed) {
        const enum fovea_status status =
            fv_mask_read(ignore->mask_path, image->width, image->height, &mask->pixels, error);
        if (status != FOVEA_OK) return status;
    } else if (ignore->box_count > 0) {
        mask->pixels = malloc((size_t)image->width * (size_t)image->height);
        if (mask->pixels == NULL)
            return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "out of memory");
    }
    if (mask->pixels != NULL)
        fv_mask_compose(mask, fixed ? mask : NULL, ignore->boxes, ignore->box_count);
    return FOVEA_OK;
}

/* Find the features of extract->image. */
static enum fovea_status find(struct fv_extract *extract, const struct fv_plane *mask,
                              struct fovea_error *error)
{
    const struct fovea_image *image = &extract->image;
    struct fovea_extract *extractor;
    const size_t bytes = fovea_extract_size(&extract->config, image->width, image->height, error);
    if (bytes == 0) return FOVEA_ERROR_ARGUMENT;
    extract->memory = fv_aligned_new(bytes);
    if (extract->memory == NULL)
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "out of memory: %zu bytes", bytes);
    const enum fovea_status status = fovea_extract_init(
        &extractor, &extract->config, image->width, image->height, extract->memory, bytes, error);
    if (status != FOVEA_OK) return status;
    const struct fovea_image hidden = {
        mask->pixels, image->width,      image->height,
        mask->stride, FOVEA_PIXEL_GREY8, (size_t)mask->stride * (size_t)image->height};
    if (fovea_extract_run(extractor, image, mask->pixels != NULL ? &hidden : NULL,
                          &extract->found) != FOVEA_OK)
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                               "features are refused of a picture of %d x %d pixels", image->width,
                               image->height);
    return FOVEA_OK;
}

static enum fovea_status run(const struct fv_extract_ignore *ignore, struct fv_extract *extract,
                             struct fovea_error *error)
{
    struct fv_plane mask = {0};
    enum fovea_status status = FOVEA_OK;
    if (ignore != NULL) status = make_mask(&extract->image, ignore, &mask, error);
    if (status == FOVEA_OK) status = find(extract, &mask, error);
    free(mask.pixels);
    return status;
}

enum fovea_status fv_extract(const char *path, const struct fv_extract_ignore *ignore,
                             const struct fovea_extract_config *config, struct fv_extract *extract,
                             struct fovea_error *error)
{
    *extract = (struct fv_extract){.config = *config};
    const enum fovea_status status = fv_picture_read(path, &extract->image, error);
    return status == FOVEA_OK ? run(ignore, extract, error) : status;
}

enum fovea_status fv_extract_image(const struct fovea_image *image,
                                   const struct fv_extract_ignore *ignore,
                                   const struct fovea_extract_config *config,
                                   struct fv_extract *extract, struct fovea_error *error)
{
    *extract = (struct fv_extract){.config = *config};
    uint8_t *pixels = malloc(image->size_bytes);
    if (pixels == NULL) return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "out of memory");
    memcpy(pixels, image->data, image->size_bytes);
    extract->image = *image;
    extract->image.data = pixels;
    return run(ignore, extract, error);
}

void fv_extract_free(struct fv_extract *extract)
{
    free((void *)(uintptr_t)extract->image.data);
    free(extract->memory);
    *extract = (struct fv_extract){0};
}

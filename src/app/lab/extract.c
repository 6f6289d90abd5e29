#include "app/lab/extract.h"

#include <inttypes.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "support/aligned.h"
#include "app/config/mask.h"
#include "support/picture.h"
#include "fovea/fovea.h"

enum fovea_status fv_extract_config(uint64_t max, struct fovea_features_config *config,
                                    struct fovea_error *error)
{
    static struct fovea_config defaults;
    if (max < FOVEA_FEATURES_MIN || max > FOVEA_FEATURES_MAX)
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                               "--max: found %" PRIu64 ", expected %d to %d", max,
                               FOVEA_FEATURES_MIN, FOVEA_FEATURES_MAX);
    fovea_config_default(&defaults);
    *config = defaults.features;
    config->count_max = (uint32_t)max;
    config->per_cell =
        FV_SPREAD_KEPT; /* the strongest: pictures are to be matched, not a motion tied down */
    return FOVEA_OK;
}

static void carve(struct fv_extract *extract, const struct fovea_features_config *config,
                  struct fv_arena *arena)
{
    fv_pyramid_carve(&extract->pyramid, extract->image.width, extract->image.height,
                     config->pyramid_levels, arena);
    fv_features_carve(&extract->features, config, &extract->pyramid, arena);
    fv_orb_carve(&extract->orb, config->count_max, &extract->pyramid, arena);
}

static enum fovea_status take_memory(struct fv_extract *extract,
                                     const struct fovea_features_config *config,
                                     struct fovea_error *error)
{
    struct fv_arena arena;
    fv_arena_count(&arena);
    carve(extract, config, &arena);
    const size_t bytes = arena.used;
    extract->memory = fv_aligned_new(bytes);
    if (extract->memory == NULL)
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "out of memory: %zu bytes", bytes);
    fv_arena_init(&arena, extract->memory, bytes);
    carve(extract, config, &arena);
    return FOVEA_OK;
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

/* The stages over extract->image. */
static enum fovea_status run(const struct fv_extract_ignore *ignore,
                             const struct fovea_features_config *config, struct fv_extract *extract,
                             struct fovea_error *error)
{
    enum fv_cpu_set cpu;
    struct fv_plane mask = {0};
    enum fovea_status status = fv_cpu_from_environment(&cpu, error);
    if (status == FOVEA_OK && ignore != NULL)
        status = make_mask(&extract->image, ignore, &mask, error);
    if (status == FOVEA_OK) status = take_memory(extract, config, error);
    if (status == FOVEA_OK) {
        fv_kernels_init(&extract->kernels, cpu);
        fv_pyramid_build(&extract->pyramid, &extract->kernels, &extract->image);
        const uint32_t count =
            fv_features_find(&extract->features, &extract->kernels, &extract->pyramid,
                             mask.pixels != NULL ? &mask : NULL, config->count_max);
        fv_orb_describe(&extract->orb, &extract->kernels, &extract->pyramid,
                        extract->features.corners, count);
    }
    free(mask.pixels);
    return status;
}

enum fovea_status fv_extract(const char *path, const struct fv_extract_ignore *ignore,
                             const struct fovea_features_config *config, struct fv_extract *extract,
                             struct fovea_error *error)
{
    memset(extract, 0, sizeof *extract);
    const enum fovea_status status = fv_picture_read(path, &extract->image, error);
    return status == FOVEA_OK ? run(ignore, config, extract, error) : status;
}

enum fovea_status fv_extract_image(const struct fovea_image *image,
                                   const struct fv_extract_ignore *ignore,
                                   const struct fovea_features_config *config,
                                   struct fv_extract *extract, struct fovea_error *error)
{
    memset(extract, 0, sizeof *extract);
    uint8_t *pixels = malloc(image->size_bytes);
    if (pixels == NULL) return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "out of memory");
    memcpy(pixels, image->data, image->size_bytes);
    extract->image = *image;
    extract->image.data = pixels;
    return run(ignore, config, extract, error);
}

void fv_extract_free(struct fv_extract *extract)
{
    free((void *)(uintptr_t)extract->image.data);
    free(extract->memory);
    memset(extract, 0, sizeof *extract);
}

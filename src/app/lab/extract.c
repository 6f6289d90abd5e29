#include "app/lab/extract.h"

#include <inttypes.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app/config/mask.h"
#include "support/aligned.h"
#include "support/picture.h"

static const char *method_name(int method)
{
    return fovea_feature_method_name((enum fovea_feature_method)method);
}

static const char *descriptor_name(int descriptor)
{
    return fovea_descriptor_name((enum fovea_descriptor)descriptor);
}

enum {
    FAST = 1 << FOVEA_FEATURES_FAST,
    ORB = 1 << FOVEA_FEATURES_ORB,
    HARRIS = 1 << FOVEA_FEATURES_HARRIS,
    SHI_TOMASI = 1 << FOVEA_FEATURES_SHI_TOMASI,
    SIFT = 1 << FOVEA_FEATURES_SIFT,
    SURF = 1 << FOVEA_FEATURES_SURF
};

#define ROW(...) FV_MEMBER_ROW(struct fovea_extract_config, __VA_ARGS__)

static const struct fv_member_option table[] = {
    ROW("upright", NULL, SET_1, upright, ORB | SIFT | SURF,
        "--method orb, sift or surf: others are upright unless --oriented",
        "leave orientations out (orb, sift, surf)"),
    ROW("oriented", NULL, SET_0, upright, FAST | HARRIS | SHI_TOMASI,
        "--method fast, harris or shi_tomasi: others are oriented unless --upright",
        "give corners orientations (fast, harris, shi_tomasi)"),
    ROW("levels", "N", WHOLE, levels, ORB | SIFT | SURF, "--method orb, sift or surf",
        "levels of the pyramid (orb), or octaves at most (sift, surf): 1 to 8 (default)"),
    ROW("threshold", "LEVELS", WHOLE, threshold, FAST | ORB, "--method fast or orb",
        "least contrast of corners in grey levels (orb, fast; 2 to 100, default 20)"),
    ROW("contrast", "LEVELS", FLOAT, contrast, SIFT, "--method sift",
        "least difference of Gaussians in grey levels (sift; .1 to 50, default 3.4)"),
    ROW("edge-ratio", "R", FLOAT, edge_ratio, SIFT, "--method sift",
        "largest ratio of the two curvatures, high on edges (sift; 1 to 100, default 10)"),
    ROW("hessian", "N", FLOAT, hessian, SURF, "--method surf",
        "least determinant of the Hessian (surf; 0 to 10000, default 1)"),
    ROW("no-doubling", NULL, SET_0, doubled, SIFT | SURF, "--method sift or surf",
        "start with the picture at its own size: fewer and coarser features in less time (sift, "
        "surf)"),
    ROW("harris-k", "K", FLOAT, harris_k, HARRIS, "--method harris",
        "k of det - k trace^2 (harris; 0 to .25, default .04)"),
    ROW("quality", "Q", FLOAT, quality, HARRIS | SHI_TOMASI | SURF,
        "--method harris, shi_tomasi or surf",
        "least strength, of the strongest (harris, shi_tomasi; default .01) or of the variance of "
        "the grey levels (surf; default .004), 0 to 1"),
    ROW("distance", "PIXELS", FLOAT, distance_px, HARRIS | SHI_TOMASI,
        "--method harris or shi_tomasi",
        "spread corners: of two that are nearer only the stronger counts (harris, shi_tomasi; 0 to "
        "256, default 0)"),
    {0},
};

void fv_extract_offer(struct fv_extract_request *request, uint64_t max, struct fv_option *options)
{
    *request = (struct fv_extract_request){.max = max, .members.table = table};
    const struct fv_option own[] = {
        {"method", "NAME", FV_OPTION_TEXT, &request->method,
         "orb (default): FAST corners on a pyramid; fast, harris, shi_tomasi: corners of the picture "
         "itself; sift, surf"},
        {"descriptor", "NAME", FV_OPTION_TEXT, &request->descriptor,
         "binary (default of corners) or patch (9x9 pixels) of corners; float of sift and surf"},
        {"max", "N", FV_OPTION_COUNT, &request->max,
         max == 500 ? "most features to find (default 500)"
                    : "most features to find in each picture (default 1000)"},
        {0},
    };
    fv_member_options_join(options, own);
    fv_member_options_offer(&request->members, options);
}

enum fovea_status fv_extract_config(const struct fv_extract_request *request,
                                    struct fovea_extract_config *config, struct fovea_error *error)
{
    int method = FOVEA_FEATURES_ORB;
    enum fovea_status status = fv_choice_read("method", request->method, method_name,
                                              FOVEA_FEATURE_METHOD_COUNT, &method, error);
    if (status != FOVEA_OK) return status;
    fovea_extract_config_default(config, (enum fovea_feature_method)method);
    if (request->max < 1 || request->max > FOVEA_EXTRACT_COUNT_MAX)
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                               "--max: found %" PRIu64 ", expected 1 to %d", request->max,
                               FOVEA_EXTRACT_COUNT_MAX);
    config->count_max = (uint32_t)request->max;
    int descriptor = (int)config->descriptor;
    status = fv_choice_read("descriptor", request->descriptor, descriptor_name,
                            FOVEA_DESCRIPTOR_COUNT, &descriptor, error);
    config->descriptor = (enum fovea_descriptor)descriptor;
    if (status == FOVEA_OK)
        status = fv_member_options_read(&request->members, 1u << method, config, error);
    if (status != FOVEA_OK) return status;
    /* Whether the method has the descriptor, and values are in their ranges. */
    if (fovea_extract_size(config, FOVEA_IMAGE_WIDTH_MIN, FOVEA_IMAGE_HEIGHT_MIN, error) > 0)
        return FOVEA_OK;
    const struct fovea_error wrong = *error;
    if (strncmp(wrong.text, "method:", 7) == 0 || strncmp(wrong.text, "descriptor:", 11) == 0)
        fovea_error_set(error, wrong.status, "--%s", wrong.text);
    fv_member_options_name(&request->members, error);
    return FOVEA_ERROR_ARGUMENT;
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

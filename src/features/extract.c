/* Local features by any method, in memory of the caller (fovea/extract.h). */
#include "fovea/extract.h"

#include <stdbool.h>

#include "base/arena.h"
#include "features/fast.h"
#include "features/harris.h"
#include "features/orb.h"
#include "features/patch.h"
#include "features/ranked.h"
#include "features/refine.h"
#include "features/sift.h"
#include "features/strongest.h"
#ifndef FV_WITHOUT_SURF
#include "features/surf.h"
#endif
#include "kernels/kernels.h"

enum {
    BORDER_PX = FV_ORB_MARGIN_PX,
    PATCH_PX = 31, /* what ORB's descriptor looks at */
    THRESHOLD = 20,
    /* Where FAST has less than this part of count_max, in blurred or dark images, it is filled up
     * with corners of the lower threshold. */
    FAST_LEAST_PART = 32,
    FAST_THRESHOLD_LOW = 7
};

/* Corners on a pyramid, or on the image as its level 0. */
struct corners {
    struct fv_pyramid pyramid;
    struct fv_ranked ranked; /* of ORB */
    struct fv_fast_scratch fast;
    struct fv_strongest strongest; /* of FAST */
    struct fv_harris harris;
    struct fv_corner *places; /* of FAST, Harris and Shi-Tomasi, on level 0 */
    struct fv_orb orb;
    struct fovea_local_feature *list;
    uint8_t *patches;
};

struct fovea_extract {
    struct fv_kernels kernels;
    struct fovea_extract_config config;
    int32_t width, height;
    union {
        struct corners corners;
        struct fv_sift sift;
#ifndef FV_WITHOUT_SURF
        struct fv_surf surf;
#endif
    } with;
};

struct method {
    const char *name;
    enum fovea_descriptor own;
    bool others;  /* descriptors that are not its own: binary or patch */
    bool upright; /* by default */
    void (*carve)(struct fovea_extract *extract, struct fv_arena *arena); /* NULL: not built */
    void (*run)(struct fovea_extract *extract, const struct fovea_image *image,
                const struct fv_plane *mask, struct fovea_extracted *found);
};

static void carve_descriptors(struct fovea_extract *extract, struct fv_arena *arena)
{
    struct corners *corners = &extract->with.corners;
    const uint32_t count = extract->config.count_max;
    fv_orb_carve(&corners->orb, count, &corners->pyramid, arena);
    corners->orb.upright = extract->config.upright != 0;
    corners->list = fv_arena_take(arena, count, sizeof *corners->list);
    if (extract->config.descriptor == FOVEA_DESCRIPTOR_PATCH)
        corners->patches = fv_arena_take(arena, count, FV_PATCH_BYTES);
}

/* Orientations and descriptors of the features in corners->list. */
static void describe(struct fovea_extract *extract, const struct fv_corner *places, uint32_t count,
                     struct fovea_extracted *found)
{
    struct corners *corners = &extract->with.corners;
    const bool patches = extract->config.descriptor == FOVEA_DESCRIPTOR_PATCH;
    fv_orb_describe(&corners->orb, &extract->kernels, &corners->pyramid, places, count);
    for (uint32_t i = 0; i < count; i++) {
        corners->list[i].angle_rad = corners->orb.angle_rad[i];
        if (patches)
            fv_patch_describe(&corners->pyramid.level[places[i].level], places[i].x, places[i].y,
                              corners->patches + (size_t)i * FV_PATCH_BYTES);
    }
    *found = (struct fovea_extracted){
        .count = count,
        .features = corners->list,
        .descriptors = patches ? corners->patches : corners->orb.descriptors,
        .descriptor_bytes = patches ? FV_PATCH_BYTES : FV_DESCRIPTOR_BYTES,
    };
}

static void orb_carve(struct fovea_extract *extract, struct fv_arena *arena)
{
    struct corners *corners = &extract->with.corners;
    const struct fovea_extract_config *config = &extract->config;
    fv_pyramid_carve(&corners->pyramid, extract->width, extract->height, config->levels, arena);
    fv_ranked_carve(&corners->ranked, config->count_max, config->threshold, &corners->pyramid,
                    BORDER_PX, arena);
    carve_descriptors(extract, arena);
}

static void orb_run(struct fovea_extract *extract, const struct fovea_image *image,
                    const struct fv_plane *mask, struct fovea_extracted *found)
{
    struct corners *corners = &extract->with.corners;
    const struct fv_ranked *ranked = &corners->ranked;
    fv_pyramid_build(&corners->pyramid, &extract->kernels, image);
    const uint32_t count =
        fv_ranked_find(&corners->ranked, &extract->kernels, &corners->pyramid, mask);
    for (uint32_t i = 0; i < count; i++) {
        const uint8_t level = ranked->corners[i].level;
        corners->list[i] = (struct fovea_local_feature){
            .x_px = ranked->places[i].x_px,
            .y_px = ranked->places[i].y_px,
            .size_px = PATCH_PX * fv_pyramid_scale(level),
            .response = ranked->responses[i],
            .level = level,
        };
    }
    describe(extract, ranked->corners, count, found);
}

static void carve_one_level(struct fovea_extract *extract, struct fv_arena *arena)
{
    struct corners *corners = &extract->with.corners;
    fv_pyramid_carve(&corners->pyramid, extract->width, extract->height, 1, arena);
    corners->places = fv_arena_take(arena, extract->config.count_max, sizeof *corners->places);
    carve_descriptors(extract, arena);
}

static void fast_carve(struct fovea_extract *extract, struct fv_arena *arena)
{
    struct corners *corners = &extract->with.corners;
    fv_fast_carve(&corners->fast, extract->width, arena);
    fv_strongest_carve(&corners->strongest, extract->config.count_max, arena);
    carve_one_level(extract, arena);
}

static void fast_scan(struct corners *corners, const struct fv_kernels *kernels, uint32_t threshold,
                      const struct fv_plane *mask)
{
    struct fv_fast scan;
    fv_fast_begin(&scan, kernels, &corners->pyramid.level[0], BORDER_PX, (int32_t)threshold,
                  &corners->fast);
    fv_strongest_begin(&corners->strongest);
    while (fv_fast_next(&scan))
        for (int32_t i = 0; i < scan.count; i++) {
            const int32_t x = scan.columns[i];
            if (mask->pixels != NULL && fv_plane_row(mask, scan.y)[x] == 0) continue;
            fv_strongest_offer(&corners->strongest, scan.scores[x], x, scan.y);
        }
    fv_strongest_sort(&corners->strongest);
}

static void fast_search(struct fovea_extract *extract, const struct fv_plane *mask)
{
    struct corners *corners = &extract->with.corners;
    const struct fovea_extract_config *config = &extract->config;
    const uint32_t least = config->count_max / FAST_LEAST_PART;
    fast_scan(corners, &extract->kernels, config->threshold, mask);
    if (corners->strongest.count >= least || config->threshold <= FAST_THRESHOLD_LOW) return;
    /* A lower threshold adds corners and changes none. */
    fast_scan(corners, &extract->kernels, FAST_THRESHOLD_LOW, mask);
    if (corners->strongest.count > least) corners->strongest.count = least;
}

static void fast_run(struct fovea_extract *extract, const struct fovea_image *image,
                     const struct fv_plane *mask, struct fovea_extracted *found)
{
    struct corners *corners = &extract->with.corners;
    fv_pyramid_build(&corners->pyramid, &extract->kernels, image);
    fast_search(extract, mask);
    for (uint32_t i = 0; i < corners->strongest.count; i++) {
        const int32_t x = fv_strongest_x(&corners->strongest, i);
        const int32_t y = fv_strongest_y(&corners->strongest, i);
        corners->places[i] = (struct fv_corner){.x = (uint16_t)x, .y = (uint16_t)y};
        corners->list[i] = (struct fovea_local_feature){
            .x_px = (float)x,
            .y_px = (float)y,
            .size_px = PATCH_PX,
            .response = (float)fv_strongest_response(&corners->strongest, i),
        };
    }
    describe(extract, corners->places, corners->strongest.count, found);
}

static void harris_carve(struct fovea_extract *extract, struct fv_arena *arena)
{
    fv_harris_carve(&extract->with.corners.harris, &extract->config, extract->width,
                    extract->height, BORDER_PX, arena);
    carve_one_level(extract, arena);
}

static void harris_run(struct fovea_extract *extract, const struct fovea_image *image,
                       const struct fv_plane *mask, struct fovea_extracted *found)
{
    struct corners *corners = &extract->with.corners;
    fv_pyramid_build(&corners->pyramid, &extract->kernels, image);
    const uint32_t count =
        fv_harris_find(&corners->harris, &extract->kernels, &corners->pyramid.level[0], mask);
    for (uint32_t i = 0; i < count; i++) {
        const struct fv_harris_corner *corner = &corners->harris.corners[i];
        corners->places[i] = (struct fv_corner){.x = corner->x, .y = corner->y};
        corners->list[i] = (struct fovea_local_feature){
            .x_px = corner->x_px,
            .y_px = corner->y_px,
            .size_px = PATCH_PX,
            .response = corner->response,
        };
    }
    describe(extract, corners->places, count, found);
}

static void sift_carve(struct fovea_extract *extract, struct fv_arena *arena)
{
    fv_sift_carve(&extract->with.sift, &extract->config, extract->width, extract->height, arena);
}

static void sift_run(struct fovea_extract *extract, const struct fovea_image *image,
                     const struct fv_plane *mask, struct fovea_extracted *found)
{
    struct fv_sift *sift = &extract->with.sift;
    const struct fv_plane plane =
        fv_plane_of(image->data, image->width, image->height, image->stride_bytes);
    const uint32_t count = fv_sift_run(sift, &extract->kernels, &plane, mask);
    *found = (struct fovea_extracted){count, sift->features, sift->descriptors, FV_SIFT_BYTES};
}

#ifndef FV_WITHOUT_SURF
static void surf_carve(struct fovea_extract *extract, struct fv_arena *arena)
{
    fv_surf_carve(&extract->with.surf, &extract->config, extract->width, extract->height, arena);
}

static void surf_run(struct fovea_extract *extract, const struct fovea_image *image,
                     const struct fv_plane *mask, struct fovea_extracted *found)
{
    struct fv_surf *surf = &extract->with.surf;
    const struct fv_plane plane =
        fv_plane_of(image->data, image->width, image->height, image->stride_bytes);
    const uint32_t count = fv_surf_run(surf, &extract->kernels, &plane, mask);
    *found = (struct fovea_extracted){count, surf->features, surf->descriptors, FV_SURF_BYTES};
}
#else
#define surf_carve NULL
#define surf_run NULL
#endif

static const struct method methods[FOVEA_FEATURE_METHOD_COUNT] = {
    [FOVEA_FEATURES_FAST] = {"fast", FOVEA_DESCRIPTOR_BINARY, true, true, fast_carve, fast_run},
    [FOVEA_FEATURES_ORB] = {"orb", FOVEA_DESCRIPTOR_BINARY, true, false, orb_carve, orb_run},
    [FOVEA_FEATURES_HARRIS] = {"harris", FOVEA_DESCRIPTOR_BINARY, true, true, harris_carve,
                               harris_run},
    [FOVEA_FEATURES_SHI_TOMASI] = {"shi_tomasi", FOVEA_DESCRIPTOR_BINARY, true, true, harris_carve,
                                   harris_run},
    [FOVEA_FEATURES_SIFT] = {"sift", FOVEA_DESCRIPTOR_FLOAT, false, false, sift_carve, sift_run},
    [FOVEA_FEATURES_SURF] = {"surf", FOVEA_DESCRIPTOR_FLOAT, false, false, surf_carve, surf_run},
};

static const char *const descriptors[FOVEA_DESCRIPTOR_COUNT] = {
    [FOVEA_DESCRIPTOR_BINARY] = "binary",
    [FOVEA_DESCRIPTOR_PATCH] = "patch",
    [FOVEA_DESCRIPTOR_FLOAT] = "float",
};

const char *fovea_feature_method_name(enum fovea_feature_method method)
{
    return (unsigned)method < FOVEA_FEATURE_METHOD_COUNT ? methods[method].name : "unknown";
}

const char *fovea_descriptor_name(enum fovea_descriptor descriptor)
{
    return (unsigned)descriptor < FOVEA_DESCRIPTOR_COUNT ? descriptors[descriptor] : "unknown";
}

void fovea_extract_config_default(struct fovea_extract_config *config,
                                  enum fovea_feature_method method)
{
    *config = (struct fovea_extract_config){
        .method = method,
        .descriptor = (unsigned)method < FOVEA_FEATURE_METHOD_COUNT ? methods[method].own
                                                                    : FOVEA_DESCRIPTOR_BINARY,
        .count_max = 500,
        .levels = FOVEA_PYRAMID_LEVELS_MAX,
        .threshold = THRESHOLD,
        .contrast = 3.4f,
        .edge_ratio = 10,
        .hessian = 1,
        .doubled = 1,
        .harris_k = .04f,
        .quality = method == FOVEA_FEATURES_SURF ? .004f : .01f,
        .upright = (unsigned)method < FOVEA_FEATURE_METHOD_COUNT && methods[method].upright,
    };
}

static enum fovea_status check(const struct fovea_extract_config *config, int32_t width,
                               int32_t height, struct fovea_error *error)
{
    const struct {
        const char *name;
        double value, low, high;
    } ranges[] = {
        {"method", config->method, 0, FOVEA_FEATURE_METHOD_COUNT - 1},
        {"descriptor", config->descriptor, 0, FOVEA_DESCRIPTOR_COUNT - 1},
        {"count_max", config->count_max, 1, FOVEA_EXTRACT_COUNT_MAX},
        {"levels", config->levels, 1, FOVEA_PYRAMID_LEVELS_MAX},
        {"threshold", config->threshold, 2, 100},
        {"contrast", (double)config->contrast, .1f, 50},
        {"edge_ratio", (double)config->edge_ratio, 1, 100},
        {"hessian", (double)config->hessian, 0, 10000},
        {"doubled", config->doubled, 0, 1},
        {"upright", config->upright, 0, 1},
        {"harris_k", (double)config->harris_k, 0, .25},
        {"quality", (double)config->quality, 0, 1},
        {"distance_px", (double)config->distance_px, 0, 256},
        {"width", width, FOVEA_IMAGE_WIDTH_MIN, FOVEA_IMAGE_WIDTH_MAX},
        {"height", height, FOVEA_IMAGE_HEIGHT_MIN, FOVEA_IMAGE_HEIGHT_MAX},
    };
    for (size_t i = 0; i < sizeof ranges / sizeof ranges[0]; i++)
        if (!(ranges[i].value >= ranges[i].low && ranges[i].value <= ranges[i].high))
            return fovea_error_set(error, FOVEA_ERROR_ARGUMENT, "%s: found %g, expected %g to %g",
                                   ranges[i].name, ranges[i].value, ranges[i].low, ranges[i].high);
    const struct method *method = &methods[config->method];
    if (method->carve == NULL)
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                               "method: found %s, which this build leaves out (make SURF=yes)",
                               method->name);
    if (config->descriptor == method->own ||
        (method->others && config->descriptor != FOVEA_DESCRIPTOR_FLOAT))
        return FOVEA_OK;
    return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                           "descriptor: found %s, expected %s%s for %s",
                           descriptors[config->descriptor], descriptors[method->own],
                           method->others ? " or patch" : "", method->name);
}

static struct fovea_extract *carve(const struct fovea_extract_config *config, int32_t width,
                                   int32_t height, struct fv_arena *arena)
{
    struct fovea_extract counted = {0};
    struct fovea_extract *made = fv_arena_take(arena, 1, sizeof *made);
    struct fovea_extract *extract = made == NULL ? &counted : made;
    extract->config = *config;
    extract->width = width;
    extract->height = height;
    methods[config->method].carve(extract, arena);
    return made;
}

size_t fovea_extract_size(const struct fovea_extract_config *config, int32_t width, int32_t height,
                          struct fovea_error *error)
{
    struct fv_arena arena;
    if (check(config, width, height, error) != FOVEA_OK) return 0;
    fv_arena_count(&arena);
    carve(config, width, height, &arena);
    return arena.used;
}

enum fovea_status fovea_extract_init(struct fovea_extract **extract,
                                     const struct fovea_extract_config *config, int32_t width,
                                     int32_t height, void *memory, size_t bytes,
                                     struct fovea_error *error)
{
    enum fv_cpu_set set;
    enum fovea_status status = check(config, width, height, error);
    if (status == FOVEA_OK) status = fv_cpu_from_environment(&set, error);
    if (status != FOVEA_OK) return status;
    const size_t needed = fovea_extract_size(config, width, height, error);
    status = fv_arena_check_block(memory, bytes, needed, error);
    if (status != FOVEA_OK) return status;
    struct fv_arena arena;
    fv_arena_init(&arena, memory, bytes);
    *extract = carve(config, width, height, &arena);
    fv_kernels_init(&(*extract)->kernels, set);
    return FOVEA_OK;
}

static bool fits(const struct fovea_extract *extract, const struct fovea_image *image)
{
    return fovea_image_check(image) == FOVEA_OK && image->format == FOVEA_PIXEL_GREY8 &&
           image->width == extract->width && image->height == extract->height;
}

enum fovea_status fovea_extract_run(struct fovea_extract *extract, const struct fovea_image *image,
                                    const struct fovea_image *mask, struct fovea_extracted *found)
{
    if (!fits(extract, image) || (mask != NULL && !fits(extract, mask)))
        return FOVEA_ERROR_ARGUMENT;
    struct fv_plane hidden = {0};
    if (mask != NULL)
        hidden = fv_plane_of(mask->data, mask->width, mask->height, mask->stride_bytes);
    methods[extract->config.method].run(extract, image, &hidden, found);
    return FOVEA_OK;
}

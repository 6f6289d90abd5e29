#include "image/preprocess.h"

#include <string.h>

#include "base/elementary.h"

static const char *const names[FOVEA_OPERATION_COUNT] = {
    [FOVEA_OPERATION_DENOISE] = "denoise",
    [FOVEA_OPERATION_NORMALIZE] = "normalize",
    [FOVEA_OPERATION_SHARPEN] = "sharpen",
    [FOVEA_OPERATION_HISTOGRAM_EQUALIZATION] = "histogram_equalization",
    [FOVEA_OPERATION_CONTRAST_ENHANCEMENT] = "contrast_enhancement",
    [FOVEA_OPERATION_GAMMA] = "gamma",
    [FOVEA_OPERATION_WHITE_BALANCE] = "white_balance",
};

const char *fovea_operation_name(enum fovea_operation operation)
{
    return (unsigned)operation < FOVEA_OPERATION_COUNT ? names[operation] : "unknown";
}

void fovea_preprocess_config_default(struct fovea_preprocess_config *config)
{
    *config = (struct fovea_preprocess_config){.denoise_size = 3,
                                               .denoise_sigma_grey = 25,
                                               .normalize_high = 255,
                                               .normalize_mean = 128,
                                               .normalize_deviation = 50,
                                               .sharpen_amount = 1.5,
                                               .sharpen_size = 5,
                                               .contrast_limit = 2,
                                               .contrast_tiles = 8,
                                               .gamma = 1};
}

static bool uses(const struct fovea_preprocess_config *config, enum fovea_operation operation)
{
    for (uint32_t i = 0; i < config->operations.count; i++)
        if (config->operations.items[i] == operation) return true;
    return false;
}

bool fv_preprocess_balances(const struct fovea_preprocess_config *config)
{
    return uses(config, FOVEA_OPERATION_WHITE_BALANCE);
}

void fv_preprocess_grey(const struct fovea_preprocess_config *config,
                        struct fovea_preprocess_config *grey)
{
    *grey = *config;
    grey->operations = (struct fovea_operation_list){0};
    for (uint32_t i = 0; i < config->operations.count; i++)
        if (config->operations.items[i] != FOVEA_OPERATION_WHITE_BALANCE)
            grey->operations.items[grey->operations.count++] = config->operations.items[i];
}

static enum fovea_status check_range(const char *name, double value, double low, double high,
                                     struct fovea_error *error)
{
    if (value >= low && value <= high) return FOVEA_OK;
    return fovea_error_set(error, FOVEA_ERROR_ARGUMENT, "%s: found %g, expected %g to %g", name,
                           value, low, high);
}

static enum fovea_status check_size(const char *name, uint32_t size, struct fovea_error *error)
{
    if (size == 3 || size == 5 || size == 7) return FOVEA_OK;
    return fovea_error_set(error, FOVEA_ERROR_ARGUMENT, "%s: found %u, expected 3, 5 or 7", name,
                           size);
}

static enum fovea_status check_parameters(const struct fovea_preprocess_config *config,
                                          struct fovea_error *error)
{
    const struct {
        const char *name;
        double value, low, high;
    } ranges[] = {
        {"operations", config->operations.count, 0, FOVEA_OPERATIONS_MAX},
        {"denoise_method", config->denoise_method, 0, FOVEA_DENOISE_BILATERAL},
        {"denoise_sigma_px", config->denoise_sigma_px, 0, 20},
        {"denoise_sigma_grey", config->denoise_sigma_grey, 1, 255},
        {"normalize_method", config->normalize_method, 0, FOVEA_NORMALIZE_DEVIATION},
        {"normalize_low", config->normalize_low, 0, 254},
        {"normalize_high", config->normalize_high, config->normalize_low + 1.0, 255},
        {"normalize_mean", config->normalize_mean, 0, 255},
        {"normalize_deviation", config->normalize_deviation, 1, 128},
        {"sharpen_amount", config->sharpen_amount, 1, 8},
        {"sharpen_sigma_px", config->sharpen_sigma_px, 0, 20},
        {"contrast_limit", config->contrast_limit, 0, 1000},
        {"contrast_tiles", config->contrast_tiles, 1, FOVEA_TILES_MAX},
        {"gamma", config->gamma, .1, 10},
    };
    for (size_t i = 0; i < sizeof ranges / sizeof ranges[0]; i++)
        if (check_range(ranges[i].name, ranges[i].value, ranges[i].low, ranges[i].high, error) !=
            FOVEA_OK)
            return FOVEA_ERROR_ARGUMENT;
    return FOVEA_OK;
}

/* Whether every parameter is in its range; `error` names the first that is not. Init-only. */
static enum fovea_status check_config(const struct fovea_preprocess_config *config,
                                      struct fovea_error *error)
{
    enum fovea_status status = check_parameters(config, error);
    if (status == FOVEA_OK) status = check_size("denoise_size", config->denoise_size, error);
    if (status == FOVEA_OK) status = check_size("sharpen_size", config->sharpen_size, error);
    for (uint32_t i = 0; status == FOVEA_OK && i < config->operations.count; i++)
        status = check_range("operations", config->operations.items[i], 0,
                             FOVEA_OPERATION_COUNT - 1, error);
    if (status == FOVEA_OK && fv_preprocess_balances(config))
        status = fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                                 "operations: found white_balance, expected operations on grey "
                                 "images: fovea_white_balance takes colours");
    return status;
}

void fv_preprocess_carve(struct fv_preprocess *chain, const struct fovea_preprocess_config *config,
                         int32_t width, int32_t height, struct fv_arena *arena)
{
    chain->config = *config;
    chain->width = width;
    chain->height = height;
    if (config->operations.count == 0) return;
    fv_filters_carve(&chain->filters, width, arena);
    chain->bilateral = fv_arena_take_raw(arena, 3, sizeof *chain->bilateral);
    chain->counts = fv_arena_take_raw(arena, 4, sizeof *chain->counts);
    chain->gamma = fv_arena_take_raw(arena, 256, 1);
    if (!uses(config, FOVEA_OPERATION_CONTRAST_ENHANCEMENT)) return;
    fv_contrast_carve(&chain->contrast, width, height, (int32_t)config->contrast_tiles,
                      config->contrast_limit, arena);
}

void fv_preprocess_prepare(struct fv_preprocess *chain)
{
    const struct fovea_preprocess_config *config = &chain->config;
    const double sigma_px = config->denoise_sigma_px;
    if (config->operations.count == 0) return;
    fv_gauss_make(&chain->denoise, config->denoise_size, sigma_px);
    fv_gauss_make(&chain->sharpen, config->sharpen_size, config->sharpen_sigma_px);
    fv_bilateral_make(chain->bilateral, sigma_px > 0 ? sigma_px : 2, config->denoise_sigma_grey);
    fv_table_gamma(chain->gamma, config->gamma);
    if (uses(config, FOVEA_OPERATION_CONTRAST_ENHANCEMENT))
        fv_contrast_prepare(&chain->contrast, chain->width);
}

void fv_preprocess_set(struct fv_preprocess *chain, const struct fovea_preprocess_config *config)
{
    chain->config = *config;
    if (uses(config, FOVEA_OPERATION_CONTRAST_ENHANCEMENT))
        fv_contrast_set_limit(&chain->contrast, config->contrast_limit);
    fv_preprocess_prepare(chain);
}

static void denoise(struct fv_preprocess *chain, const struct fv_kernels *kernels,
                    const struct fv_plane *in, const struct fv_plane *out)
{
    if (chain->config.denoise_method == FOVEA_DENOISE_MEDIAN)
        fv_median_run(&chain->filters, kernels, in, out);
    else if (chain->config.denoise_method == FOVEA_DENOISE_BILATERAL)
        fv_bilateral_run(&chain->filters, (const uint16_t(*)[256])chain->bilateral, kernels, in,
                         out);
    else
        fv_gauss_run(&chain->filters, &chain->denoise, kernels, in, out);
}

static void normalize(struct fv_preprocess *chain, const struct fv_kernels *kernels,
                      const struct fv_plane *in, const struct fv_plane *out)
{
    const struct fovea_preprocess_config *config = &chain->config;
    uint8_t table[256];
    struct fv_line line;
    if (config->normalize_method == FOVEA_NORMALIZE_RANGE) {
        line = fv_table_range(table, kernels, in, (int32_t)config->normalize_low,
                              (int32_t)config->normalize_high);
    } else {
        fv_histogram_count(chain->counts, kernels, in);
        line = fv_table_deviation(table, (const uint32_t(*)[256])chain->counts,
                                  config->normalize_mean, config->normalize_deviation);
    }
    fv_line_run(&line, table, kernels, in, out);
}

static void equalize(struct fv_preprocess *chain, const struct fv_kernels *kernels,
                     const struct fv_plane *in, const struct fv_plane *out)
{
    uint8_t table[256];
    fv_histogram_count(chain->counts, kernels, in);
    fv_table_equalize(table, (const uint32_t(*)[256])chain->counts);
    fv_table_run(table, kernels, in, out);
}

static void run_one(struct fv_preprocess *chain, enum fovea_operation operation,
                    const struct fv_kernels *kernels, const struct fv_plane *in,
                    const struct fv_plane *out)
{
    switch (operation) {
    case FOVEA_OPERATION_DENOISE:
        denoise(chain, kernels, in, out);
        break;
    case FOVEA_OPERATION_NORMALIZE:
        normalize(chain, kernels, in, out);
        break;
    case FOVEA_OPERATION_SHARPEN:
        fv_sharpen_run(&chain->filters, &chain->sharpen,
                       (int32_t)(chain->config.sharpen_amount * 256 + .5), kernels, in, out);
        break;
    case FOVEA_OPERATION_HISTOGRAM_EQUALIZATION:
        equalize(chain, kernels, in, out);
        break;
    case FOVEA_OPERATION_CONTRAST_ENHANCEMENT:
        fv_contrast_run(&chain->contrast, kernels, in, out);
        break;
    case FOVEA_OPERATION_GAMMA:
        fv_table_run(chain->gamma, kernels, in, out);
        break;
    case FOVEA_OPERATION_WHITE_BALANCE:
    case FOVEA_OPERATION_COUNT:
        break;
    }
}

void fv_preprocess_run(struct fv_preprocess *chain, const struct fv_kernels *kernels,
                       const struct fv_plane *in, const struct fv_plane *out)
{
    if (chain->config.operations.count == 0 && in->pixels != out->pixels)
        for (int32_t y = 0; y < in->height; y++)
            memcpy(fv_plane_row(out, y), fv_plane_row(in, y), (size_t)in->width);
    for (uint32_t i = 0; i < chain->config.operations.count; i++)
        run_one(chain, chain->config.operations.items[i], kernels, i == 0 ? in : out, out);
}

/* The chain of the public functions: with its kernels, at the start of the caller's memory. */
struct fovea_preprocess {
    struct fv_kernels kernels;
    struct fv_preprocess chain;
};

static struct fovea_preprocess *carve(const struct fovea_preprocess_config *config, int32_t width,
                                      int32_t height, struct fv_arena *arena)
{
    struct fovea_preprocess counted = {0};
    struct fovea_preprocess *made = fv_arena_take(arena, 1, sizeof *made);
    fv_preprocess_carve(made == NULL ? &counted.chain : &made->chain, config, width, height, arena);
    return made;
}

static enum fovea_status check_all(const struct fovea_preprocess_config *config, int32_t width,
                                   int32_t height, struct fovea_error *error)
{
    enum fovea_status status = check_config(config, error);
    if (status == FOVEA_OK)
        status = check_range("width", width, FOVEA_IMAGE_WIDTH_MIN, FOVEA_IMAGE_WIDTH_MAX, error);
    if (status == FOVEA_OK)
        status =
            check_range("height", height, FOVEA_IMAGE_HEIGHT_MIN, FOVEA_IMAGE_HEIGHT_MAX, error);
    return status;
}

size_t fovea_preprocess_size(const struct fovea_preprocess_config *config, int32_t width,
                             int32_t height, struct fovea_error *error)
{
    struct fv_arena arena;
    if (check_all(config, width, height, error) != FOVEA_OK) return 0;
    fv_arena_count(&arena);
    carve(config, width, height, &arena);
    return arena.used;
}

enum fovea_status fovea_preprocess_init(struct fovea_preprocess **chain,
                                        const struct fovea_preprocess_config *config, int32_t width,
                                        int32_t height, void *memory, size_t bytes,
                                        struct fovea_error *error)
{
    struct fv_arena arena;
    enum fv_cpu_set set;
    const size_t needed = fovea_preprocess_size(config, width, height, error);
    if (needed == 0) return FOVEA_ERROR_ARGUMENT;
    enum fovea_status status = fv_arena_check_block(memory, bytes, needed, error);
    if (status == FOVEA_OK) status = fv_cpu_from_environment(&set, error);
    if (status != FOVEA_OK) return status;
    fv_arena_init(&arena, memory, bytes);
    struct fovea_preprocess *made = carve(config, width, height, &arena);
    fv_kernels_init(&made->kernels, set);
    fv_preprocess_prepare(&made->chain);
    *chain = made;
    return FOVEA_OK;
}

enum fovea_status fovea_preprocess_run(struct fovea_preprocess *chain,
                                       const struct fovea_image *image, uint8_t *out,
                                       int32_t out_stride_bytes)
{
    const enum fovea_status status = fovea_image_check(image);
    if (status != FOVEA_OK) return status;
    if (image->format != FOVEA_PIXEL_GREY8 || image->width != chain->chain.width ||
        image->height != chain->chain.height || out_stride_bytes < image->width ||
        (image->data == out && image->stride_bytes != out_stride_bytes))
        return FOVEA_ERROR_ARGUMENT;
    const struct fv_plane in = fv_plane_of(image->data, image->width, image->height,
                                           image->stride_bytes),
                          to = {out, image->width, image->height, out_stride_bytes};
    fv_preprocess_run(&chain->chain, &chain->kernels, &in, &to);
    return FOVEA_OK;
}

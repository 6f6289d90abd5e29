/* fovea image: a picture after the operations of a preprocessing chain. */
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app/lab/commands.h"
#include "app/lab/member_options.h"
#include "fovea/preprocess.h"
#include "image/preprocess.h"
#include "nn/pixel.h"
#include "support/aligned.h"
#include "support/decode.h"
#include "support/files.h"
#include "support/picture.h"
#include "support/say.h"

/* What options depend on: operations, and the methods of two of them. */
enum {
    GAUSSIAN = 1,
    MEDIAN = 2,
    BILATERAL = 4,
    RANGE = 8,
    DEVIATION = 16,
    SHARPEN = 32,
    CONTRAST = 64,
    GAMMA = 128,
    DENOISE = GAUSSIAN | MEDIAN | BILATERAL,
    NORMALIZE = RANGE | DEVIATION
};

#define ROW(...) FV_MEMBER_ROW(struct fovea_preprocess_config, __VA_ARGS__)

static const struct fv_member_option table[] = {
    ROW("size", "PIXELS", WHOLE, denoise_size, GAUSSIAN,
        "denoise in --operations, by --denoise gaussian",
        "width of the Gaussian of denoise: 3 (default), 5 or 7"),
    ROW("sigma", "PIXELS", REAL, denoise_sigma_px, GAUSSIAN | BILATERAL,
        "denoise in --operations, by --denoise gaussian or bilateral",
        "standard deviation of denoise's Gaussian or bilateral filter (default by its size)"),
    ROW("sigma-grey", "LEVELS", REAL, denoise_sigma_grey, BILATERAL,
        "denoise in --operations, by --denoise bilateral",
        "standard deviation of the bilateral filter in grey levels, 1 to 255 (default 25)"),
    ROW("low", "LEVEL", WHOLE, normalize_low, RANGE,
        "normalize in --operations, by --normalize range",
        "grey of the darkest pixel after normalize (range), 0 (default) to 254"),
    ROW("high", "LEVEL", WHOLE, normalize_high, RANGE,
        "normalize in --operations, by --normalize range",
        "grey of the brightest pixel after normalize (range), 1 to 255 (default)"),
    ROW("mean", "LEVEL", REAL, normalize_mean, DEVIATION,
        "normalize in --operations, by --normalize deviation",
        "mean after normalize (deviation), 0 to 255 (default 128)"),
    ROW("deviation", "LEVELS", REAL, normalize_deviation, DEVIATION,
        "normalize in --operations, by --normalize deviation",
        "standard deviation after normalize (deviation), 1 to 128 (default 50)"),
    ROW("amount", "A", REAL, sharpen_amount, SHARPEN, "sharpen in --operations",
        "strength of sharpen: A x + (1 - A) Gaussian(x), 1 to 8 (default 1.5)"),
    ROW("sharpen-size", "PIXELS", WHOLE, sharpen_size, SHARPEN, "sharpen in --operations",
        "width of the Gaussian of sharpen: 3, 5 (default) or 7"),
    ROW("sharpen-sigma", "PIXELS", REAL, sharpen_sigma_px, SHARPEN, "sharpen in --operations",
        "its standard deviation (default by its size)"),
    ROW("limit", "SLOPE", REAL, contrast_limit, CONTRAST, "contrast_enhancement in --operations",
        "largest slope of contrast_enhancement, 0 to 1000 (default 2; 0: no limit)"),
    ROW("tiles", "N", WHOLE, contrast_tiles, CONTRAST, "contrast_enhancement in --operations",
        "tiles of contrast_enhancement, across and down, 1 to 16 (default 8)"),
    ROW("gamma", "G", REAL, gamma, GAMMA, "gamma in --operations",
        "exponent of gamma, 0.1 to 10; below 1 brightens (default 1)"),
    {0},
};

/* What the command line says, before it is read. */
struct request {
    const char *operations, *denoise, *normalize;
    struct fv_member_options members;
};

static const char *operation_name(int operation)
{
    return fovea_operation_name((enum fovea_operation)operation);
}

static enum fovea_status read_operations(const char *text, struct fovea_preprocess_config *config,
                                         struct fovea_error *error)
{
    struct fovea_operation_list *list = &config->operations;
    while (text != NULL) {
        char word[64];
        int operation = 0;
        const size_t length = strcspn(text, ",");
        snprintf(word, sizeof word, "%.*s", (int)(length < 60 ? length : 60), text);
        const enum fovea_status status = fv_choice_read("operations", word, operation_name,
                                                        FOVEA_OPERATION_COUNT, &operation, error);
        if (status != FOVEA_OK) return status;
        if (list->count == FOVEA_OPERATIONS_MAX)
            return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                                   "--operations: found more than %d names, expected %d at most",
                                   FOVEA_OPERATIONS_MAX, FOVEA_OPERATIONS_MAX);
        list->items[list->count++] = (enum fovea_operation)operation;
        text = text[length] == ',' ? text + length + 1 : NULL;
    }
    return FOVEA_OK;
}

static const char *denoise_name(int method)
{
    static const char *const names[] = {"gaussian", "median", "bilateral"};
    return names[method];
}

static const char *normalize_name(int method)
{
    static const char *const names[] = {"range", "deviation"};
    return names[method];
}

/* Bits of the operations of a list, with the methods that are set. */
static uint32_t choices_of(const struct fovea_preprocess_config *config)
{
    const uint32_t bits[FOVEA_OPERATION_COUNT] = {
        [FOVEA_OPERATION_DENOISE] = 1u * GAUSSIAN << config->denoise_method,
        [FOVEA_OPERATION_NORMALIZE] = 1u * RANGE << config->normalize_method,
        [FOVEA_OPERATION_SHARPEN] = SHARPEN,
        [FOVEA_OPERATION_CONTRAST_ENHANCEMENT] = CONTRAST,
        [FOVEA_OPERATION_GAMMA] = GAMMA,
    };
    uint32_t choices = 0;
    for (uint32_t i = 0; i < config->operations.count; i++)
        choices |= bits[config->operations.items[i]];
    return choices;
}

static enum fovea_status without_effect(const char *option, const char *operation,
                                        struct fovea_error *error)
{
    return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                           "--%s: found it without effect, expected %s in --operations", option,
                           operation);
}

static enum fovea_status read_config(const struct request *request,
                                     struct fovea_preprocess_config *config,
                                     struct fovea_error *error)
{
    int denoise = 0, normalize = 0;
    fovea_preprocess_config_default(config);
    enum fovea_status status = read_operations(request->operations, config, error);
    if (status == FOVEA_OK)
        status = fv_choice_read("denoise", request->denoise, denoise_name, 3, &denoise, error);
    if (status == FOVEA_OK)
        status =
            fv_choice_read("normalize", request->normalize, normalize_name, 2, &normalize, error);
    if (status != FOVEA_OK) return status;
    config->denoise_method = (enum fovea_denoise_method)denoise;
    config->normalize_method = (enum fovea_normalize_method)normalize;
    const uint32_t choices = choices_of(config);
    if (request->denoise != NULL && (choices & DENOISE) == 0)
        return without_effect("denoise", "denoise", error);
    if (request->normalize != NULL && (choices & NORMALIZE) == 0)
        return without_effect("normalize", "normalize", error);
    return fv_member_options_read(&request->members, choices, config, error);
}

/* Run a chain of grey levels on an image in place. */
static enum fovea_status apply(const struct fovea_preprocess_config *config,
                               const struct fovea_image *image, struct fovea_error *error)
{
    struct fovea_preprocess *chain = NULL;
    const size_t bytes = fovea_preprocess_size(config, image->width, image->height, error);
    if (bytes == 0) return FOVEA_ERROR_ARGUMENT;
    void *memory = fv_aligned_new(bytes);
    if (memory == NULL)
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "out of memory: %zu bytes", bytes);
    enum fovea_status status =
        fovea_preprocess_init(&chain, config, image->width, image->height, memory, bytes, error);
    if (status == FOVEA_OK) {
        status = fovea_preprocess_run(chain, image, (uint8_t *)(uintptr_t)image->data,
                                      image->stride_bytes);
        if (status != FOVEA_OK)
            fovea_error_set(error, status, "the chain refuses a picture of %d x %d pixels",
                            image->width, image->height);
    }
    free(memory);
    return status;
}

/* Of a picture in colours: its brightness before and after a chain of grey levels, of which each
 * is width x height bytes. */
static enum fovea_status relight(const struct fovea_preprocess_config *grey,
                                 const struct fovea_image *image, uint8_t *planes,
                                 struct fovea_error *error)
{
    const size_t bytes = (size_t)image->width * (size_t)image->height;
    const struct fovea_image before = {planes,       image->width,      image->height,
                                       image->width, FOVEA_PIXEL_GREY8, bytes};
    struct fovea_image after = before;
    after.data = planes + bytes;
    for (int32_t y = 0; y < image->height; y++)
        fv_decode_rgb_row(image->data + (size_t)y * (size_t)image->stride_bytes,
                          planes + (size_t)y * (size_t)image->width, image->width);
    memcpy(planes + bytes, planes, bytes);
    const enum fovea_status status = apply(grey, &after, error);
    if (status == FOVEA_OK)
        fv_pixel_relight(image, (uint8_t *)(uintptr_t)image->data, &before, &after);
    return status;
}

/* The operations between two white balances change the brightness, as networks see it in the loop
 * (nn/pixel.h). */
static enum fovea_status run_in_colour(const struct fovea_preprocess_config *config,
                                       const struct fovea_image *image, struct fovea_error *error)
{
    const struct fovea_operation_list *list = &config->operations;
    struct fovea_preprocess_config grey = *config;
    uint8_t *planes = malloc(2 * (size_t)image->width * (size_t)image->height);
    if (planes == NULL) return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "out of memory");
    enum fovea_status status = FOVEA_OK;
    for (uint32_t i = 0; i < list->count && status == FOVEA_OK;) {
        grey.operations.count = 0;
        for (; i < list->count && list->items[i] != FOVEA_OPERATION_WHITE_BALANCE; i++)
            grey.operations.items[grey.operations.count++] = list->items[i];
        if (grey.operations.count > 0) status = relight(&grey, image, planes, error);
        if (i < list->count && status == FOVEA_OK) {
            i++;
            status =
                fovea_white_balance(image, (uint8_t *)(uintptr_t)image->data, image->stride_bytes);
        }
    }
    free(planes);
    return status;
}

static enum fovea_status run(const struct fovea_preprocess_config *config, const char *in,
                             const char *out, struct fovea_error *error)
{
    struct fovea_image image = {0};
    const bool colour = fv_preprocess_balances(config);
    enum fovea_status status =
        colour ? fv_picture_read_coloured(in, &image, error) : fv_picture_read(in, &image, error);
    if (status == FOVEA_OK)
        status = colour ? run_in_colour(config, &image, error) : apply(config, &image, error);
    if (status == FOVEA_OK) status = fv_picture_write(out, &image, error);
    free((void *)(uintptr_t)image.data);
    return status;
}

int fv_command_image(int argc, char **argv)
{
    struct request request = {.members.table = table};
    struct fv_option options[FV_OPTIONS_MAX + 1] = {
        {"operations", "LIST", FV_OPTION_TEXT, &request.operations,
         "operations in their order, with commas between: denoise, normalize, sharpen, "
         "histogram_equalization, contrast_enhancement, gamma, white_balance; with white_balance "
         "the colours are kept"},
        {"denoise", "METHOD", FV_OPTION_TEXT, &request.denoise,
         "gaussian (default), median or bilateral"},
        {"normalize", "METHOD", FV_OPTION_TEXT, &request.normalize,
         "range (default: 0 to 255) or deviation (mean 128, standard deviation 50)"},
    };
    int first;
    fv_member_options_offer(&request.members, options);
    const enum fv_options_result result =
        fv_options_parse(options, "IN OUT", 2, 2, argc, argv, &first);
    if (result != FV_OPTIONS_READ) return result == FV_OPTIONS_HELP ? FV_EXIT_OK : FV_EXIT_WRONG;
    if (request.operations == NULL)
        return fv_say_wrong("--operations: found none, expected a list like denoise,sharpen");
    struct fovea_error error;
    struct fovea_preprocess_config config;
    const struct fv_file written[] = {{"OUT", argv[first + 1]}, {0}},
                         read[] = {{"IN", argv[first]}, {0}};
    enum fovea_status status = fv_files_apart(written, read, &error);
    if (status == FOVEA_OK) status = fv_picture_check_name("OUT", argv[first + 1], &error);
    if (status == FOVEA_OK) status = read_config(&request, &config, &error);
    if (status == FOVEA_OK) status = run(&config, argv[first], argv[first + 1], &error);
    if (status == FOVEA_OK) return FV_EXIT_OK;
    fv_member_options_name(&request.members, &error);
    return status == FOVEA_ERROR_SYSTEM ? fv_say_failed("%s", error.text)
                                        : fv_say_wrong("%s", error.text);
}

/* fovea image: a picture after the operations of a preprocessing chain. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app/lab/commands.h"
#include "app/config/options.h"
#include "fovea/preprocess.h"
#include "support/aligned.h"
#include "support/colour.h"
#include "support/files.h"
#include "support/picture.h"
#include "support/say.h"
#include "support/text.h"

/* What the command line says, before it is read. */
struct request {
    const char *operations, *denoise, *size, *sigma, *sigma_grey, *normalize, *amount, *limit,
        *tiles, *gamma;
    bool white_balance;
};

static enum fovea_status read_real(const char *name, const char *text, double *value,
                                   struct fovea_error *error)
{
    double number;
    if (text == NULL) return FOVEA_OK;
    if (!fv_text_number(text, &number) || number < -1e6 || number > 1e6)
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                               "--%s: found '%.100s', expected a number", name, text);
    *value = number;
    return FOVEA_OK;
}

static enum fovea_status read_count(const char *name, const char *text, uint32_t *value,
                                    struct fovea_error *error)
{
    int64_t number;
    if (text == NULL) return FOVEA_OK;
    if (!fv_text_integer(text, &number) || number < 0 || number > 1000)
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                               "--%s: found '%.100s', expected a whole number", name, text);
    *value = (uint32_t)number;
    return FOVEA_OK;
}

/* The index of `text` in a list of names that NULL ends. */
static enum fovea_status read_choice(const char *name, const char *text, const char *const *choices,
                                     uint32_t *value, struct fovea_error *error)
{
    if (text == NULL) return FOVEA_OK;
    for (uint32_t i = 0; choices[i] != NULL; i++)
        if (strcmp(text, choices[i]) == 0) {
            *value = i;
            return FOVEA_OK;
        }
    char expected[128] = "";
    for (int i = 0; choices[i] != NULL; i++)
        snprintf(expected + strlen(expected), sizeof expected - strlen(expected), "%s%s",
                 i == 0 ? "" : " or ", choices[i]);
    return fovea_error_set(error, FOVEA_ERROR_ARGUMENT, "--%s: found '%.100s', expected %s", name,
                           text, expected);
}

static enum fovea_status read_operation(const char *word, struct fovea_preprocess_config *config,
                                        struct fovea_error *error)
{
    for (int i = 0; i < FOVEA_OPERATION_COUNT; i++)
        if (strcmp(word, fovea_operation_name((enum fovea_operation)i)) == 0) {
            if (config->operations.count == FOVEA_OPERATIONS_MAX)
                return fovea_error_set(
                    error, FOVEA_ERROR_ARGUMENT,
                    "--operations: found more than %d names, expected %d at most",
                    FOVEA_OPERATIONS_MAX, FOVEA_OPERATIONS_MAX);
            config->operations.items[config->operations.count++] = (enum fovea_operation)i;
            return FOVEA_OK;
        }
    return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                           "--operations: found '%.100s', expected denoise, normalize, sharpen, "
                           "histogram_equalization, contrast_enhancement or gamma",
                           word);
}

static enum fovea_status read_operations(const char *text, struct fovea_preprocess_config *config,
                                         struct fovea_error *error)
{
    while (text != NULL) {
        char word[64];
        const size_t length = strcspn(text, ",");
        snprintf(word, sizeof word, "%.*s", (int)(length < 60 ? length : 60), text);
        const enum fovea_status status = read_operation(word, config, error);
        if (status != FOVEA_OK) return status;
        text = text[length] == ',' ? text + length + 1 : NULL;
    }
    return FOVEA_OK;
}

static enum fovea_status read_config(const struct request *request,
                                     struct fovea_preprocess_config *config,
                                     struct fovea_error *error)
{
    static const char *const denoise[] = {"gaussian", "median", "bilateral", NULL};
    static const char *const normalize[] = {"range", "deviation", NULL};
    uint32_t denoise_method = 0, normalize_method = 0;
    fovea_preprocess_config_default(config);
    enum fovea_status status = read_operations(request->operations, config, error);
    if (status == FOVEA_OK)
        status = read_choice("denoise", request->denoise, denoise, &denoise_method, error);
    if (status == FOVEA_OK)
        status = read_choice("normalize", request->normalize, normalize, &normalize_method, error);
    if (status == FOVEA_OK)
        status = read_count("size", request->size, &config->denoise_size, error);
    if (status == FOVEA_OK)
        status = read_real("sigma", request->sigma, &config->denoise_sigma_px, error);
    if (status == FOVEA_OK)
        status = read_real("sigma-grey", request->sigma_grey, &config->denoise_sigma_grey, error);
    if (status == FOVEA_OK)
        status = read_real("amount", request->amount, &config->sharpen_amount, error);
    if (status == FOVEA_OK)
        status = read_real("limit", request->limit, &config->contrast_limit, error);
    if (status == FOVEA_OK)
        status = read_count("tiles", request->tiles, &config->contrast_tiles, error);
    if (status == FOVEA_OK) status = read_real("gamma", request->gamma, &config->gamma, error);
    config->denoise_method = (enum fovea_denoise_method)denoise_method;
    config->normalize_method = (enum fovea_normalize_method)normalize_method;
    return status;
}

/* The chain names a wrong parameter; here it is that of an option. */
static void name_option(struct fovea_error *error)
{
    static const char *const options[][2] = {
        {"denoise_sigma_px", "sigma"},
        {"denoise_sigma_grey", "sigma-grey"},
        {"denoise_size", "size"},
        {"sharpen_amount", "amount"},
        {"contrast_limit", "limit"},
        {"contrast_tiles", "tiles"},
        {"gamma", "gamma"},
    };
    for (size_t i = 0; i < sizeof options / sizeof options[0]; i++) {
        const size_t length = strlen(options[i][0]);
        if (strncmp(error->text, options[i][0], length) != 0 || error->text[length] != ':')
            continue;
        const struct fovea_error chain = *error;
        fovea_error_set(error, FOVEA_ERROR_ARGUMENT, "--%s%s", options[i][1], chain.text + length);
        return;
    }
}

/* Run the chain on an image in place. */
static enum fovea_status apply(const struct fovea_preprocess_config *config,
                               const struct fovea_image *image, struct fovea_error *error)
{
    struct fovea_preprocess *chain = NULL;
    const size_t bytes = fovea_preprocess_size(config, image->width, image->height, error);
    if (bytes == 0) {
        name_option(error);
        return FOVEA_ERROR_ARGUMENT;
    }
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

static enum fovea_status run_chain(const struct fovea_preprocess_config *config, const char *in,
                                   const char *out, struct fovea_error *error)
{
    struct fovea_image image = {0};
    enum fovea_status status = fv_picture_read(in, &image, error);
    if (status == FOVEA_OK) status = apply(config, &image, error);
    if (status == FOVEA_OK) status = fv_picture_write(out, &image, error);
    free((void *)(uintptr_t)image.data);
    return status;
}

static enum fovea_status balance(const char *in, const char *out, struct fovea_error *error)
{
    struct fovea_image image = {0};
    enum fovea_status status = fv_colour_read(in, &image, error);
    if (status == FOVEA_OK) {
        status = fovea_white_balance(&image, (uint8_t *)(uintptr_t)image.data, image.stride_bytes);
        if (status != FOVEA_OK)
            fovea_error_set(error, status, "%.300s: found %d x %d pixels, expected %d to %d", in,
                            image.width, image.height, FOVEA_IMAGE_WIDTH_MIN,
                            FOVEA_IMAGE_WIDTH_MAX);
    }
    if (status == FOVEA_OK) status = fv_picture_write(out, &image, error);
    free((void *)(uintptr_t)image.data);
    return status;
}

int fv_command_image(int argc, char **argv)
{
    struct request request = {0};
    const struct fv_option options[] = {
        {"operations", "LIST", FV_OPTION_TEXT, &request.operations,
         "operations in their order, with commas between: denoise, normalize, sharpen, "
         "histogram_equalization, contrast_enhancement, gamma"},
        {"denoise", "METHOD", FV_OPTION_TEXT, &request.denoise,
         "gaussian (default), median or bilateral"},
        {"size", "PIXELS", FV_OPTION_TEXT, &request.size,
         "width of the Gaussian of denoise: 3 (default), 5 or 7"},
        {"sigma", "PIXELS", FV_OPTION_TEXT, &request.sigma,
         "standard deviation of denoise's Gaussian or bilateral filter (default by its size)"},
        {"sigma-grey", "LEVELS", FV_OPTION_TEXT, &request.sigma_grey,
         "standard deviation of the bilateral filter in grey levels, 1 to 255 (default 25)"},
        {"normalize", "METHOD", FV_OPTION_TEXT, &request.normalize,
         "range (default: 0 to 255) or deviation (mean 128, standard deviation 50)"},
        {"amount", "A", FV_OPTION_TEXT, &request.amount,
         "strength of sharpen: A x + (1 - A) Gaussian(x), 1 to 8 (default 1.5)"},
        {"limit", "SLOPE", FV_OPTION_TEXT, &request.limit,
         "largest slope of contrast_enhancement, 0 to 1000 (default 2; 0: no limit)"},
        {"tiles", "N", FV_OPTION_TEXT, &request.tiles,
         "tiles of contrast_enhancement, across and down, 1 to 16 (default 8)"},
        {"gamma", "G", FV_OPTION_TEXT, &request.gamma,
         "exponent of gamma, 0.1 to 10; below 1 brightens (default 1)"},
        {"white-balance", NULL, FV_OPTION_FLAG, &request.white_balance,
         "balance the colours instead, so that the mean of the picture is grey"},
        {0},
    };
    int first;
    const enum fv_options_result result =
        fv_options_parse(options, "IN OUT", 2, 2, argc, argv, &first);
    if (result != FV_OPTIONS_READ) return result == FV_OPTIONS_HELP ? FV_EXIT_OK : FV_EXIT_WRONG;
    if ((request.operations != NULL) == request.white_balance)
        return fv_say_wrong("image: expected either --operations LIST or --white-balance");
    struct fovea_error error;
    struct fovea_preprocess_config config;
    const struct fv_file written[] = {{"OUT", argv[first + 1]}, {0}},
                         read[] = {{"IN", argv[first]}, {0}};
    enum fovea_status status = fv_files_apart(written, read, &error);
    if (status == FOVEA_OK) status = read_config(&request, &config, &error);
    if (status == FOVEA_OK)
        status = request.white_balance ? balance(argv[first], argv[first + 1], &error)
                                       : run_chain(&config, argv[first], argv[first + 1], &error);
    if (status == FOVEA_OK) return FV_EXIT_OK;
    return status == FOVEA_ERROR_SYSTEM ? fv_say_failed("%s", error.text)
                                        : fv_say_wrong("%s", error.text);
}

/* fovea edges: the edges of a picture. */
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app/lab/commands.h"
#include "app/config/options.h"
#include "fovea/edges.h"
#include "support/aligned.h"
#include "support/files.h"
#include "support/picture.h"
#include "support/say.h"
#include "support/text.h"

/* What the command line says, before it is read. */
struct request {
    const char *method, *norm, *low, *high;
};

static enum fovea_status read_number(const char *name, const char *text, double *value,
                                     struct fovea_error *error)
{
    double number;
    if (text == NULL) return FOVEA_OK;
    if (!fv_text_number(text, &number) || number < -1e6 || number > 1e6)
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                               "--%s: found '%.100s', expected a number from 0 to 32767", name,
                               text);
    *value = number;
    return FOVEA_OK;
}

static enum fovea_status read_config(const struct request *request,
                                     struct fovea_edges_config *config, struct fovea_error *error)
{
    fovea_edges_config_default(config);
    int method = 0;
    while (request->method != NULL && method < FOVEA_EDGE_METHOD_COUNT &&
           strcmp(request->method, fovea_edge_method_name((enum fovea_edge_method)method)) != 0)
        method++;
    if (method == FOVEA_EDGE_METHOD_COUNT)
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                               "--method: found '%.100s', expected canny, sobel, scharr or "
                               "laplacian",
                               request->method);
    const bool squares = request->norm != NULL && strcmp(request->norm, "l2") == 0;
    if (request->norm != NULL && !squares && strcmp(request->norm, "l1") != 0)
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                               "--norm: found '%.100s', expected l1 or l2", request->norm);
    config->method = (enum fovea_edge_method)method;
    config->norm = squares ? FOVEA_GRADIENT_L2 : FOVEA_GRADIENT_L1;
    enum fovea_status status = read_number("low", request->low, &config->low, error);
    if (status == FOVEA_OK) status = read_number("high", request->high, &config->high, error);
    return status;
}

/* White where a bit is set, black elsewhere; prints how many are white. */
static void draw(const struct fovea_image *image, const uint8_t *bits, int32_t stride)
{
    int64_t count = 0;
    for (int32_t y = 0; y < image->height; y++) {
        uint8_t *row = (uint8_t *)(uintptr_t)image->data + (int64_t)y * image->stride_bytes;
        for (int32_t x = 0; x < image->width; x++) {
            const int edge = bits[(int64_t)y * stride + x / 8] >> (7 - x % 8) & 1;
            row[x] = edge ? 255 : 0;
            count += edge;
        }
    }
    printf("%lld edge pixels in %d x %d\n", (long long)count, image->width, image->height);
}

/* Mark the edges of an image in white, in its own pixels. */
static enum fovea_status mark(const struct fovea_edges_config *config,
                              const struct fovea_image *image, struct fovea_error *error)
{
    struct fovea_edges *edges = NULL;
    struct fovea_error wrong;
    const size_t bytes = fovea_edges_size(config, image->width, image->height, &wrong);
    if (bytes == 0) return fovea_error_set(error, wrong.status, "--%s", wrong.text);
    const int32_t stride = (image->width + 7) / 8;
    const size_t bitmap = (size_t)stride * (size_t)image->height;
    uint8_t *memory = fv_aligned_new(bytes + bitmap); /* the bitmap follows the detector */
    if (memory == NULL)
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "out of memory: %zu bytes",
                               bytes + bitmap);
    enum fovea_status status =
        fovea_edges_init(&edges, config, image->width, image->height, memory, bytes, error);
    if (status == FOVEA_OK) {
        status = fovea_edges_run(edges, image, memory + bytes, stride);
        if (status == FOVEA_OK)
            draw(image, memory + bytes, stride);
        else
            fovea_error_set(error, status, "the detector refuses a picture of %d x %d pixels",
                            image->width, image->height);
    }
    free(memory);
    return status;
}

int fv_command_edges(int argc, char **argv)
{
    struct request request = {0};
    const struct fv_option options[] = {
        {"method", "NAME", FV_OPTION_TEXT, &request.method,
         "canny (default), or sobel, scharr or laplacian with one threshold"},
        {"low", "N", FV_OPTION_TEXT, &request.low,
         "canny: gradient above which a pixel connected to an edge is an edge pixel (default 50)"},
        {"high", "N", FV_OPTION_TEXT, &request.high,
         "gradient above which a pixel is an edge pixel (default 150)"},
        {"norm", "NAME", FV_OPTION_TEXT, &request.norm, "of the gradient: l1 (default) or l2"},
        {0},
    };
    int first;
    const enum fv_options_result result =
        fv_options_parse(options, "IN OUT", 2, 2, argc, argv, &first);
    if (result != FV_OPTIONS_READ) return result == FV_OPTIONS_HELP ? FV_EXIT_OK : FV_EXIT_WRONG;
    struct fovea_error error;
    struct fovea_edges_config config;
    struct fovea_image image = {0};
    const struct fv_file written[] = {{"OUT", argv[first + 1]}, {0}},
                         read[] = {{"IN", argv[first]}, {0}};
    enum fovea_status status = fv_files_apart(written, read, &error);
    if (status == FOVEA_OK) status = read_config(&request, &config, &error);
    if (status == FOVEA_OK) status = fv_picture_read(argv[first], &image, &error);
    if (status == FOVEA_OK) status = mark(&config, &image, &error);
    if (status == FOVEA_OK) status = fv_picture_write(argv[first + 1], &image, &error);
    free((void *)(uintptr_t)image.data);
    if (status == FOVEA_OK) return FV_EXIT_OK;
    return status == FOVEA_ERROR_SYSTEM ? fv_say_failed("%s", error.text)
                                        : fv_say_wrong("%s", error.text);
}

/* fovea edges: the edges of a picture. */
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>

#include "app/lab/commands.h"
#include "app/lab/member_options.h"
#include "fovea/edges.h"
#include "support/aligned.h"
#include "support/files.h"
#include "support/picture.h"
#include "support/say.h"

enum { CANNY = 1 << FOVEA_EDGES_CANNY, LAPLACIAN = 1 << FOVEA_EDGES_LAPLACIAN, ANY = 15 };

#define ROW(...) FV_MEMBER_ROW(struct fovea_edges_config, __VA_ARGS__)

static const struct fv_member_option table[] = {
    ROW("low", "N", REAL, low, CANNY, "--method canny",
        "canny: gradient above which a pixel connected to an edge is an edge pixel (default 50)"),
    ROW("high", "N", REAL, high, ANY, "",
        "gradient above which a pixel is an edge pixel (default 150)"),
    ROW("laplacian-size", "N", WHOLE, laplacian_size, LAPLACIAN, "--method laplacian",
        "laplacian: 1 (default: four neighbours) or 3 (those at the corners)"),
    {0},
};

/* What the command line says, before it is read. */
struct request {
    const char *method, *norm;
    struct fv_member_options members;
};

static const char *method_name(int method)
{
    return fovea_edge_method_name((enum fovea_edge_method)method);
}

static const char *norm_name(int norm)
{
    return norm == FOVEA_GRADIENT_L1 ? "l1" : "l2";
}

static enum fovea_status read_config(const struct request *request,
                                     struct fovea_edges_config *config, struct fovea_error *error)
{
    int method = FOVEA_EDGES_CANNY, norm = FOVEA_GRADIENT_L1;
    fovea_edges_config_default(config);
    enum fovea_status status = fv_choice_read("method", request->method, method_name,
                                              FOVEA_EDGE_METHOD_COUNT, &method, error);
    if (status == FOVEA_OK)
        status = fv_choice_read("norm", request->norm, norm_name, 2, &norm, error);
    if (status != FOVEA_OK) return status;
    if (request->norm != NULL && method == FOVEA_EDGES_LAPLACIAN)
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                               "--norm: found it without effect, expected --method canny, sobel or "
                               "scharr");
    config->method = (enum fovea_edge_method)method;
    config->norm = (enum fovea_gradient_norm)norm;
    return fv_member_options_read(&request->members, 1u << method, config, error);
}

/* White where a bit is set, black elsewhere; returns how many are white. */
static int64_t draw(const struct fovea_image *image, const uint8_t *bits, int32_t stride)
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
    return count;
}

/* Mark the edges of an image in white, in its own pixels. */
static enum fovea_status mark(const struct fovea_edges_config *config,
                              const struct fovea_image *image, int64_t *count,
                              struct fovea_error *error)
{
    struct fovea_edges *edges = NULL;
    const size_t bytes = fovea_edges_size(config, image->width, image->height, error);
    if (bytes == 0) return FOVEA_ERROR_ARGUMENT;
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
            *count = draw(image, memory + bytes, stride);
        else
            fovea_error_set(error, status, "the detector refuses a picture of %d x %d pixels",
                            image->width, image->height);
    }
    free(memory);
    return status;
}

int fv_command_edges(int argc, char **argv)
{
    struct request request = {.members.table = table};
    struct fv_option options[FV_OPTIONS_MAX + 1] = {
        {"method", "NAME", FV_OPTION_TEXT, &request.method,
         "canny (default), or sobel, scharr or laplacian with one threshold"},
        {"norm", "NAME", FV_OPTION_TEXT, &request.norm,
         "of the gradient: l1 (default) or l2 (the Laplacian has none)"},
    };
    int first;
    fv_member_options_offer(&request.members, options);
    const enum fv_options_result result =
        fv_options_parse(options, "IN OUT", 2, 2, argc, argv, &first);
    if (result != FV_OPTIONS_READ) return result == FV_OPTIONS_HELP ? FV_EXIT_OK : FV_EXIT_WRONG;
    struct fovea_error error;
    struct fovea_edges_config config;
    struct fovea_image image = {0};
    int64_t count = 0;
    const struct fv_file written[] = {{"OUT", argv[first + 1]}, {0}},
                         read[] = {{"IN", argv[first]}, {0}};
    enum fovea_status status = fv_files_apart(written, read, &error);
    if (status == FOVEA_OK) status = fv_picture_check_name("OUT", argv[first + 1], &error);
    if (status == FOVEA_OK) status = read_config(&request, &config, &error);
    if (status == FOVEA_OK) status = fv_picture_read(argv[first], &image, &error);
    if (status == FOVEA_OK) status = mark(&config, &image, &count, &error);
    if (status == FOVEA_OK) status = fv_picture_write(argv[first + 1], &image, &error);
    if (status == FOVEA_OK)
        printf("%lld edge pixels in %d x %d\n", (long long)count, image.width, image.height);
    free((void *)(uintptr_t)image.data);
    if (status == FOVEA_OK) return FV_EXIT_OK;
    fv_member_options_name(&request.members, &error);
    return status == FOVEA_ERROR_SYSTEM ? fv_say_failed("%s", error.text)
                                        : fv_say_wrong("%s", error.text);
}

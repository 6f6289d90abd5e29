/* Edges by derivatives, non-maximum suppression and hysteresis (fovea/edges.h). */
#include "image/edges.h"

#include <string.h>

#include "base/elementary.h"

enum { PAD = 16 }; /* elements before the first magnitude of a row; as many follow the last */

static const char *const names[FOVEA_EDGE_METHOD_COUNT] = {
    [FOVEA_EDGES_CANNY] = "canny",
    [FOVEA_EDGES_SOBEL] = "sobel",
    [FOVEA_EDGES_SCHARR] = "scharr",
    [FOVEA_EDGES_LAPLACIAN] = "laplacian",
};

const char *fovea_edge_method_name(enum fovea_edge_method method)
{
    return (unsigned)method < FOVEA_EDGE_METHOD_COUNT ? names[method] : "unknown";
}

void fovea_edges_config_default(struct fovea_edges_config *config)
{
    *config = (struct fovea_edges_config){.low = 50, .high = 150, .laplacian_size = 1};
}

static enum fovea_status check(const struct fovea_edges_config *config, int32_t width,
                               int32_t height, struct fovea_error *error)
{
    const struct {
        const char *name;
        double value, low, high;
    } ranges[] = {
        {"method", config->method, 0, FOVEA_EDGE_METHOD_COUNT - 1},
        {"norm", config->norm, 0, FOVEA_GRADIENT_L2},
        {"high", config->high, 0, 32767},
        {"low", config->low, 0, 32767},
        {"width", width, FOVEA_IMAGE_WIDTH_MIN, FOVEA_IMAGE_WIDTH_MAX},
        {"height", height, FOVEA_IMAGE_HEIGHT_MIN, FOVEA_IMAGE_HEIGHT_MAX},
    };
    for (size_t i = 0; i < sizeof ranges / sizeof ranges[0]; i++)
        if (!(ranges[i].value >= ranges[i].low && ranges[i].value <= ranges[i].high))
            return fovea_error_set(error, FOVEA_ERROR_ARGUMENT, "%s: found %g, expected %g to %g",
                                   ranges[i].name, ranges[i].value, ranges[i].low, ranges[i].high);
    if (config->method == FOVEA_EDGES_CANNY && config->low > config->high)
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                               "low: found %g, expected at most high, which is %g", config->low,
                               config->high);
    if (config->laplacian_size != 1 && config->laplacian_size != 3)
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                               "laplacian_size: found %u, expected 1 or 3", config->laplacian_size);
    return FOVEA_OK;
}

/* The largest whole magnitude that is not above a threshold: of squares with L2. */
static int32_t whole(double threshold, bool squared)
{
    return (int32_t)fv_floor(squared ? threshold * threshold : threshold);
}

/* Whether magnitudes are sums of squares. */
static bool squares(const struct fovea_edges_config *config)
{
    return config->norm == FOVEA_GRADIENT_L2 && config->method != FOVEA_EDGES_LAPLACIAN;
}

void fv_edges_set(struct fv_edges *edges, double low, double high)
{
    edges->config.low = low;
    edges->config.high = high;
    edges->low = whole(low, squares(&edges->config));
    edges->high = whole(high, squares(&edges->config));
}

void fv_edges_carve(struct fv_edges *edges, const struct fovea_edges_config *config, int32_t width,
                    int32_t height, struct fv_arena *arena)
{
    edges->config = *config;
    edges->width = width;
    edges->height = height;
    fv_edges_set(edges, config->low, config->high);
    for (int i = 0; i < 3; i++) {
        int32_t *row = fv_arena_take(arena, (size_t)width + 2 * PAD, sizeof *row);
        edges->magnitude[i] = row == NULL ? NULL : row + PAD;
        edges->dx[i] = fv_arena_take(arena, (size_t)width, sizeof *edges->dx[i]);
        edges->dy[i] = fv_arena_take(arena, (size_t)width, sizeof *edges->dy[i]);
    }
    fv_hysteresis_carve(&edges->hysteresis, width, height, arena);
}

/* The rows above, at and below y; beyond the image those reflected, or the edge repeated. */
static void rows_at(const struct fv_plane *plane, int32_t y, bool repeat, const uint8_t *rows[3])
{
    const int32_t last = plane->height - 1;
    const int32_t above = y > 0 ? y - 1 : repeat ? 0 : 1;
    const int32_t below = y < last ? y + 1 : repeat ? last : last - 1;
    rows[0] = fv_plane_row(plane, above);
    rows[1] = fv_plane_row(plane, y);
    rows[2] = fv_plane_row(plane, below);
}

/* One row of derivatives; dx or dy may be NULL. */
static void differentiate(const struct fv_edges *edges, const struct fv_kernels *kernels,
                          const struct fv_plane *plane, int32_t y, bool repeat, int16_t *dx,
                          int16_t *dy)
{
    const bool scharr = edges->config.method == FOVEA_EDGES_SCHARR;
    const int32_t side = scharr ? 3 : 1, centre = scharr ? 10 : 2;
    const uint8_t *rows[3];
    rows_at(plane, y, repeat, rows);
    if (edges->config.method == FOVEA_EDGES_LAPLACIAN) {
        kernels->laplacian_row_s16(dx, rows, plane->width, edges->config.laplacian_size == 3);
        return; /* dy, where there is one, stays 0 */
    }
    if (dx != NULL) kernels->derivative_x_row_s16(dx, rows, plane->width, side, centre, repeat);
    if (dy != NULL) kernels->derivative_y_row_s16(dy, rows, plane->width, side, centre, repeat);
}

/* Derivatives and magnitudes of row y, in the ring of rows. */
static void measure_row(const struct fv_edges *edges, const struct fv_kernels *kernels,
                        const struct fv_plane *plane, int32_t y)
{
    const bool canny = edges->config.method == FOVEA_EDGES_CANNY;
    differentiate(edges, kernels, plane, y, canny, edges->dx[y % 3], edges->dy[y % 3]);
    kernels->magnitude_row_s32(edges->magnitude[y % 3], edges->dx[y % 3], edges->dy[y % 3],
                               plane->width, squares(&edges->config));
}

static void clear_row(const struct fv_edges *edges, int32_t y)
{
    memset(edges->magnitude[y % 3], 0, (size_t)edges->width * sizeof(int32_t));
}

/* Row y of Canny's weak pixels and edges. Beyond the image magnitudes are 0. */
static void thin_row(const struct fv_edges *edges, const struct fv_kernels *kernels,
                     const struct fv_plane *plane, int32_t y)
{
    if (y == 0) {
        clear_row(edges, 2); /* above row 0 */
        measure_row(edges, kernels, plane, 0);
    }
    if (y + 1 < plane->height)
        measure_row(edges, kernels, plane, y + 1);
    else
        clear_row(edges, y + 1);
    const int32_t *const rows[3] = {edges->magnitude[(y + 2) % 3], edges->magnitude[y % 3],
                                    edges->magnitude[(y + 1) % 3]};
    kernels->thin_row_s32(fv_hysteresis_weak(&edges->hysteresis, y),
                          fv_hysteresis_edges(&edges->hysteresis, y), rows, edges->dx[y % 3],
                          edges->dy[y % 3], plane->width, edges->low, edges->high);
}

static void mark_row(const struct fv_edges *edges, const struct fv_kernels *kernels,
                     const struct fv_plane *plane, int32_t y)
{
    uint64_t *words = fv_hysteresis_edges(&edges->hysteresis, y);
    measure_row(edges, kernels, plane, y);
    memset(words, 0, (size_t)(plane->width + 63) / 64 * sizeof *words);
    for (int32_t x = 0; x < plane->width; x++)
        words[x / 64] |= (uint64_t)(edges->magnitude[y % 3][x] > edges->high) << (63 - x % 64);
}

void fv_edges_begin(const struct fv_edges *edges, struct fv_edges_state *state)
{
    *state = (struct fv_edges_state){.row = 0};
    fv_hysteresis_begin(&edges->hysteresis, &state->hysteresis);
}

bool fv_edges_advance(const struct fv_edges *edges, struct fv_edges_state *state,
                      const struct fv_kernels *kernels, const struct fv_plane *plane,
                      int32_t pixels)
{
    enum { PIXELS_OF_A_WORD = 8 }; /* a visited word takes the time of so many pixels */
    const bool canny = edges->config.method == FOVEA_EDGES_CANNY;
    for (; pixels > 0 && state->row < plane->height; pixels -= plane->width, state->row++) {
        if (canny)
            thin_row(edges, kernels, plane, state->row);
        else
            mark_row(edges, kernels, plane, state->row);
    }
    if (state->row < plane->height || (canny && pixels <= 0)) return false;
    return !canny || fv_hysteresis_advance(&edges->hysteresis, &state->hysteresis,
                                           (pixels + PIXELS_OF_A_WORD - 1) / PIXELS_OF_A_WORD);
}

void fv_edges_pack(const struct fv_edges *edges, int32_t y, uint8_t *row)
{
    const uint64_t *words = fv_hysteresis_edges(&edges->hysteresis, y);
    for (int32_t i = 0; i < (edges->width + 7) / 8; i++)
        row[i] = (uint8_t)(words[i / 8] >> (56 - i % 8 * 8));
}

/* The detector of the public functions: with its kernels, at the start of the caller's memory. */
struct fovea_edges {
    struct fv_kernels kernels;
    struct fv_edges edges;
};

static struct fovea_edges *carve(const struct fovea_edges_config *config, int32_t width,
                                 int32_t height, struct fv_arena *arena)
{
    struct fovea_edges counted = {0};
    struct fovea_edges *made = fv_arena_take(arena, 1, sizeof *made);
    fv_edges_carve(made == NULL ? &counted.edges : &made->edges, config, width, height, arena);
    return made;
}

size_t fovea_edges_size(const struct fovea_edges_config *config, int32_t width, int32_t height,
                        struct fovea_error *error)
{
    struct fv_arena arena;
    if (check(config, width, height, error) != FOVEA_OK) return 0;
    fv_arena_count(&arena);
    carve(config, width, height, &arena);
    return arena.used;
}

enum fovea_status fovea_edges_init(struct fovea_edges **edges,
                                   const struct fovea_edges_config *config, int32_t width,
                                   int32_t height, void *memory, size_t bytes,
                                   struct fovea_error *error)
{
    struct fv_arena arena;
    enum fv_cpu_set set;
    const size_t needed = fovea_edges_size(config, width, height, error);
    if (needed == 0) return FOVEA_ERROR_ARGUMENT;
    enum fovea_status status = fv_arena_check_block(memory, bytes, needed, error);
    if (status == FOVEA_OK) status = fv_cpu_from_environment(&set, error);
    if (status != FOVEA_OK) return status;
    fv_arena_init(&arena, memory, bytes);
    struct fovea_edges *made = carve(config, width, height, &arena);
    fv_kernels_init(&made->kernels, set);
    *edges = made;
    return FOVEA_OK;
}

static bool fits(const struct fovea_edges *edges, const struct fovea_image *image)
{
    return fovea_image_check(image) == FOVEA_OK && image->format == FOVEA_PIXEL_GREY8 &&
           image->width == edges->edges.width && image->height == edges->edges.height;
}

enum fovea_status fovea_edges_run(struct fovea_edges *edges, const struct fovea_image *image,
                                  uint8_t *bits, int32_t stride_bytes)
{
    struct fv_edges_state state;
    if (!fits(edges, image) || stride_bytes < (image->width + 7) / 8) return FOVEA_ERROR_ARGUMENT;
    const struct fv_plane plane =
        fv_plane_of(image->data, image->width, image->height, image->stride_bytes);
    fv_edges_begin(&edges->edges, &state);
    while (!fv_edges_advance(&edges->edges, &state, &edges->kernels, &plane, INT32_MAX / 2)) {
    }
    for (int32_t y = 0; y < image->height; y++)
        fv_edges_pack(&edges->edges, y, bits + (int64_t)y * stride_bytes);
    return FOVEA_OK;
}

enum fovea_status fovea_edges_gradient(struct fovea_edges *edges, const struct fovea_image *image,
                                       int16_t *dx, int16_t *dy, int32_t stride)
{
    const bool laplacian = edges->edges.config.method == FOVEA_EDGES_LAPLACIAN;
    if (!fits(edges, image) || stride < image->width || (laplacian && (dx == NULL || dy != NULL)))
        return FOVEA_ERROR_ARGUMENT;
    const struct fv_plane plane =
        fv_plane_of(image->data, image->width, image->height, image->stride_bytes);
    for (int32_t y = 0; y < image->height; y++)
        differentiate(&edges->edges, &edges->kernels, &plane, y, false,
                      dx == NULL ? NULL : dx + (int64_t)y * stride,
                      dy == NULL ? NULL : dy + (int64_t)y * stride);
    return FOVEA_OK;
}

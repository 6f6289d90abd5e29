/* Edges: derivatives of grey images, and bitmaps of edges.
 *
 * Works on memory of the caller:
 *
 *     size_t bytes = fovea_edges_size(&config, width, height, &error);
 *     fovea_edges_init(&edges, &config, width, height, memory, bytes, &error);
 *     fovea_edges_run(edges, &image, bits, (width + 7) / 8);
 *
 * Canny's detector (PAMI 1986): Sobel derivatives with repeated image borders, non-maximum
 * suppression along four directions, and hysteresis: a pixel whose gradient is above `low` is an
 * edge if a chain of such pixels, each one of the eight neighbours of the next, connects it with
 * one above `high`.
 *
 * Results are integer, equal on every kernel set, compiler and architecture, and equal to OpenCV
 * 4.6 to the bit. */
#ifndef FOVEA_EDGES_H
#define FOVEA_EDGES_H

#include <stddef.h>
#include <stdint.h>

#include "fovea/image.h"
#include "fovea/status.h"

#ifdef __cplusplus
extern "C" {
#endif

enum fovea_edge_method {
    FOVEA_EDGES_CANNY = 0,
    FOVEA_EDGES_SOBEL = 1,     /* derivatives weighted 1 2 1 across */
    FOVEA_EDGES_SCHARR = 2,    /* 3 10 3 */
    FOVEA_EDGES_LAPLACIAN = 3, /* sum of second derivatives */
    FOVEA_EDGE_METHOD_COUNT
};

enum fovea_gradient_norm {
    FOVEA_GRADIENT_L1 = 0, /* |dx| + |dy| */
    FOVEA_GRADIENT_L2 = 1  /* square root of dx dx + dy dy */
};

struct fovea_edges_config {
    enum fovea_edge_method method; /* default FOVEA_EDGES_CANNY */
    /* default FOVEA_GRADIENT_L1; of the Laplacian there is one value */
    enum fovea_gradient_norm norm;
    /* [0, 32767], default 50, in units of the method's derivatives. Canny: at most `high`; other
     * methods ignore it. */
    double low;
    double high; /* [0, 32767], default 150. Methods other than Canny mark the pixels above it. */
    /* 1 or 3 of [1, 3], default 1: 0 1 0, 1 -4 1, 0 1 0; 3: 2 0 2, 0 -8 0, 2 0 2 */
    uint32_t laplacian_size;
};

/* A detector in the caller's memory. */
struct fovea_edges;

/* Set the method to Canny and every parameter to its default. Any thread. */
void fovea_edges_config_default(struct fovea_edges_config *config);

/* Name as in configurations and messages ("canny", ...); "unknown" out of range. Any thread. */
const char *fovea_edge_method_name(enum fovea_edge_method method);

/* Bytes that a detector for images of width x height (within FOVEA_IMAGE_*) needs. 0 when a
 * parameter is out of its range: `error` names it. Init-only. */
size_t fovea_edges_size(const struct fovea_edges_config *config, int32_t width, int32_t height,
                        struct fovea_error *error);

/* Build a detector in `memory`, 64-byte aligned, which stays the caller's and must outlive it.
 * Errors: FOVEA_ERROR_ARGUMENT (a parameter, or the environment's FOVEA_CPU), FOVEA_ERROR_MEMORY
 * (size or alignment). Init-only. */
enum fovea_status fovea_edges_init(struct fovea_edges **edges,
                                   const struct fovea_edges_config *config, int32_t width,
                                   int32_t height, void *memory, size_t bytes,
                                   struct fovea_error *error);

/* Mark the edges of a grey8 image of its size. `bits` gets `height` rows, `stride_bytes` apart, at
 * least (width + 7) / 8: the leftmost pixel is the highest bit, 1 is an edge, bits past the width
 * are 0, as in fovea.edges_t. FOVEA_ERROR_ARGUMENT: the image or the stride does not fit, and
 * nothing is written. Real-time safe: time is at most proportional to the pixels, whatever the
 * image. One thread per detector. */
enum fovea_status fovea_edges_run(struct fovea_edges *edges, const struct fovea_image *image,
                                  uint8_t *bits, int32_t stride_bytes);

/* Derivatives by the method of the detector (Canny: Sobel), image borders reflected without
 * repeating the edge, in 16 bits without scaling or limits. `dx` and `dy` get `height` rows of
 * `width` values, `stride` values apart; either may be NULL. The Laplacian goes to `dx`, and `dy`
 * must be NULL. Errors, time and threads as above. */
enum fovea_status fovea_edges_gradient(struct fovea_edges *edges, const struct fovea_image *image,
                                       int16_t *dx, int16_t *dy, int32_t stride);

#ifdef __cplusplus
}
#endif
#endif

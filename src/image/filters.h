/* Filters of grey planes by neighbourhoods, tables and tiles: the operations of image/preprocess.h.
 *
 * `in` and `out` have the same size and are the same plane or do not overlap: rows that are still
 * needed are kept before they are overwritten. All are real-time safe; time is proportional to the
 * pixels. */
#ifndef FOVEA_IMAGE_FILTERS_H
#define FOVEA_IMAGE_FILTERS_H

#include <stdint.h>

#include "base/arena.h"
#include "fovea/preprocess.h"
#include "image/plane.h"
#include "kernels/kernels.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { FV_FILTER_RADIUS_MAX = 3 };

struct fv_filters {
    uint8_t *kept; /* rows before they are overwritten: FV_FILTER_RADIUS_MAX + 1 of them */
    uint8_t *row;  /* one result */
    uint16_t *scratch;
    int32_t row_bytes; /* from one kept row to the next */
};

struct fv_gauss {
    int32_t radius;
    uint16_t weights[FV_FILTER_RADIUS_MAX + 1]; /* from the centre outwards, sum over all 256 */
};

void fv_filters_carve(struct fv_filters *filters, int32_t width, struct fv_arena *arena);

/* Weights of a Gaussian of `size` pixels, 3, 5 or 7, in 1/256: the exact ones, each rounded with
 * the error of those before it, from the outside inwards, and the rest in the centre. sigma_px 0:
 * those of binomial kind that OpenCV takes for small sizes. Init-only. */
void fv_gauss_make(struct fv_gauss *gauss, uint32_t size, double sigma_px);

void fv_gauss_run(const struct fv_filters *filters, const struct fv_gauss *gauss,
                  const struct fv_kernels *kernels, const struct fv_plane *in,
                  const struct fv_plane *out);

/* a x + (1 - a) Gaussian(x), a in 1/256. */
void fv_sharpen_run(const struct fv_filters *filters, const struct fv_gauss *gauss,
                    int32_t amount_q8, const struct fv_kernels *kernels, const struct fv_plane *in,
                    const struct fv_plane *out);

void fv_median_run(const struct fv_filters *filters, const struct fv_kernels *kernels,
                   const struct fv_plane *in, const struct fv_plane *out);

/* Weights of the bilateral filter by class of distance and difference in grey. Init-only. */
void fv_bilateral_make(uint16_t weights[3][256], double sigma_px, double sigma_grey);

void fv_bilateral_run(const struct fv_filters *filters, const uint16_t weights[3][256],
                      const struct fv_kernels *kernels, const struct fv_plane *in,
                      const struct fv_plane *out);

/* How often each grey level occurs: the sum over the four tables. */
void fv_histogram_count(uint32_t counts[4][256], const struct fv_kernels *kernels,
                        const struct fv_plane *plane);

void fv_table_run(const uint8_t table[256], const struct fv_kernels *kernels,
                  const struct fv_plane *in, const struct fv_plane *out);

/* The same for the table of a line, factor x grey + offset, computed where that is faster and gives
 * the table. */
struct fv_line {
    float factor, offset;
};
void fv_line_run(const struct fv_line *line, const uint8_t table[256],
                 const struct fv_kernels *kernels, const struct fv_plane *in,
                 const struct fv_plane *out);

/* The nearest grey level, the even one of two; limited to [0, 255]. */
uint8_t fv_table_nearest(double grey);

/* Tables of the operations that look at the whole plane first. */
void fv_table_equalize(uint8_t table[256], const uint32_t counts[4][256]);
struct fv_line fv_table_range(uint8_t table[256], const struct fv_kernels *kernels,
                              const struct fv_plane *plane, int32_t low, int32_t high);
struct fv_line fv_table_deviation(uint8_t table[256], const uint32_t counts[4][256], double mean,
                                  double deviation);
void fv_table_gamma(uint8_t table[256], double gamma);

/* Contrast-limited adaptive histogram equalization in tiles x tiles tiles. */
struct fv_contrast {
    int32_t tiles, tile_width, tile_height;
    int32_t clip;             /* most pixels of one level in a tile; 0: no limit */
    uint8_t (*tables)[256];   /* of the tiles, row by row */
    uint16_t (*blended)[256]; /* of one row of pixels: a table per tile across */
    uint16_t *weights;        /* of the right one of two tiles, per pixel */
    uint32_t (*counts)[256];  /* four tables */
    /* between the centres of tiles i - 1 and i lie the columns before ends[i] */
    int32_t ends[FOVEA_TILES_MAX + 1];
};

void fv_contrast_carve(struct fv_contrast *contrast, int32_t width, int32_t height, int32_t tiles,
                       double limit, struct fv_arena *arena);
/* Change the limit. Real-time safe. */
void fv_contrast_set_limit(struct fv_contrast *contrast, double limit);
void fv_contrast_prepare(struct fv_contrast *contrast, int32_t width);
void fv_contrast_run(struct fv_contrast *contrast, const struct fv_kernels *kernels,
                     const struct fv_plane *in, const struct fv_plane *out);

#ifdef __cplusplus
}
#endif
#endif

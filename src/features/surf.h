/* SURF: features that are maxima of the determinant of the Hessian in position and scale, with
 * orientations and descriptors of 64 values (Bay, Ess, Tuytelaars and Van Gool, "Speeded-up robust
 * features (SURF)", Computer Vision and Image Understanding 110, 2008).
 *
 * Second derivatives are sums over boxes of an integral image: four octaves of four filters, with
 * sides of 9 15 21 27, 15 27 39 51, 27 51 75 99 and 51 99 147 195 pixels, on every second, second,
 * fourth and eighth pixel. A filter of side L stands for a Gaussian of sigma 1.2 L / 9. The
 * determinant Dxx Dyy - (0.9 Dxy)^2, each D divided by L^2, must be greater than `hessian`, than
 * the part `quality` of the variance of grey levels, and than its 26 neighbours; the strongest are
 * refined by a quadratic through these, and described.
 * Orientation: the sum of Haar responses of side 6 sigma in a circle of 6 sigma, weighted by a
 * Gaussian of 3 sigma, over the sector of 60 degrees in which it is longest. Descriptor: sums of
 * dx, |dx|, dy and |dy| of Haar responses of side 2 sigma in 4 x 4 squares of 5 sigma, sampled
 * every sigma, turned by the orientation, of unit length.
 *
 * Where this differs from the paper:
 * - It starts with the image at twice its size (`doubled`; the paper says this, too).
 * - The image is smoothed by a Gaussian of FV_SURF_SMOOTH pixels of that, which makes small boxes
 *   answer alike in every direction and removes noise. Sums are of 1/128 grey level, so that dark
 *   images keep their features. It also allows every second pixel in the first octave.
 * - Features are ranked by their determinant times sigma^-0.8. Without that half of the strongest
 *   stand for 5 pixels and more, which survive blur, but not a change of viewpoint.
 * - The variance of grey levels says which determinants are weak: blur hardly changes it, and with
 *   brightness both change alike. A number of grey levels alone, which would keep the weak out of
 *   blurred images, leaves dark ones none.
 * - Boxes of Haar responses have sides of any length: the integral image is bilinear between
 *   pixels, in 1/256 pixel.
 * - A sample adds to the squares around it by its distance from their middles, so that it may move
 *   a little; samples reach half a square further, and are weighted by a Gaussian of 6 sigma.
 * - Haar responses of the orientation are of 6 in place of 4 sigma, weighted by 3 in place of 2.5.
 *
 * The smoothing, the rank and the orientation were chosen on 12 photographs of COCO, CamVid and
 * EuRoC that were blurred, made noisy and dark, seen from the side, zoomed and turned by hand (264
 * pairs; 300 features for 800 x 640 pixels, fewer for smaller images). Matching scores there, and
 * over them all:
 *
 *                                   blur defocus noise  dark  view  zoom  turn   all
 *     none, rank by 0.8^octave      .177   .206  .683  .903  .521  .477  .383  .479
 *     1 pixel                       .214   .248  .714  .905  .523  .484  .424  .502
 *     2 pixels                      .322   .372  .763  .921  .520  .495  .516  .559
 *     3, sigma^-0.8                 .392   .448  .780  .931  .515  .481  .596  .592
 *     2, sigma^-0.8                 .264   .307  .729  .908  .544  .514  .511  .540
 *     and Haar responses of 6 sigma .273   .314  .744  .920  .551  .514  .510  .547
 *
 * The least part of the variance, .004, keeps the dark (.911) and gives blur .307 with 700
 * features, where 10 grey levels squared in its place give .894 and .296, and 3 give .904 and .281.
 * Viewpoint is best with 2 pixels. Without gain there: 0.65, 1 in place of 0.81; larger windows;
 * other powers and signs of the descriptor's values; windows by the sigma of filter and smoothing
 * together (view .529). Shares of the features by octave (8:4:2:1) help
 * blur and cost viewpoint .024; a least determinant relative to the strongest leaves fewer.
 * Integers, and floating point in a fixed order without libm: equal bits everywhere. */
#ifndef FOVEA_FEATURES_SURF_H
#define FOVEA_FEATURES_SURF_H

#include <stdbool.h>
#include <stdint.h>

#include "base/arena.h"
#include "features/scale_space.h"
#include "features/strongest.h"
#include "fovea/extract.h"
#include "image/plane.h"

enum {
    FV_SURF_BYTES = 64,
    FV_SURF_OCTAVES = 4,
    FV_SURF_LAYERS = 4,      /* filters of an octave; maxima lie in the two between */
    FV_SURF_CIRCLE = 13,     /* samples of the orientation across and down */
    FV_SURF_SAMPLES = 24,    /* of the descriptor */
    FV_SURF_LIGHT_ROWS = 32, /* more than twice FV_SCALE_RADIUS_MAX */
    FV_SURF_SMOOTH_ROWS = 2
};

#define FV_SURF_SMOOTH 2. /* sigma, in pixels of the image, or of its double */

/* A maximum, refined; in pixels of the image, or of its double. */
struct fv_surf_point {
    double x, y, sigma;
    float response;
    uint32_t octave;
};

/* Constant weights of samples. */
struct fv_surf_tables {
    float circle[FV_SURF_CIRCLE * FV_SURF_CIRCLE]; /* 0 outside */
    float window[FV_SURF_SAMPLES * FV_SURF_SAMPLES];
    int32_t square[FV_SURF_SAMPLES]; /* the first of two squares that a sample adds to, from 1 */
    float second[FV_SURF_SAMPLES];   /* weight of the other */
};

struct fv_surf {
    int32_t width, height; /* of the image, or of its double */
    int32_t stride;        /* elements of a row of the integral image */
    uint32_t count_max, octaves;
    float hessian, quality;
    bool upright, doubled;
    struct fv_scale_gauss gauss; /* the smoothing, in pixels of the image */
    int32_t row_stride;          /* elements of the rows in work */
    uint16_t *light;             /* FV_SURF_LIGHT_ROWS rows of the image in 1/128 grey level */
    uint16_t *smooth;            /* FV_SURF_SMOOTH_ROWS of it smoothed */
    uint16_t *scratch;
    /* (height + 1) x (width + 1) sums of all above and to the left in 1/128 grey level, mod 2^32 */
    uint32_t *integral;
    uint32_t *sums; /* scratch of one row of a filter */
    float *rows;    /* determinants: FV_SURF_LAYERS x 3 rows */
    struct fv_strongest strongest;
    struct fv_surf_tables *tables;
    struct fovea_local_feature *features; /* count_max */
    uint8_t *descriptors;                 /* count_max x FV_SURF_BYTES */
};

/* Take memory. Fills sizes, tables and addresses only. Init-only. */
void fv_surf_carve(struct fv_surf *surf, const struct fovea_extract_config *config, int32_t width,
                   int32_t height, struct fv_arena *arena);

/* Find and describe; no feature where `mask` (its pixels may be NULL) is 0. Returns how many.
 * Real-time safe: time is at most proportional to the pixels times the logarithm of count_max, and
 * to count_max. */
uint32_t fv_surf_run(struct fv_surf *surf, const struct fv_kernels *kernels,
                     const struct fv_plane *image, const struct fv_plane *mask);

/* Take memory of, and fill, surf->integral: the image smoothed, and doubled where `doubled`. */
void fv_surf_carve_integral(struct fv_surf *surf, struct fv_arena *arena);
void fv_surf_integrate(struct fv_surf *surf, const struct fv_kernels *kernels,
                       const struct fv_plane *image);

void fv_surf_tables_fill(struct fv_surf_tables *tables);
/* Orientation of a point, (-pi, pi]. */
float fv_surf_orient(const struct fv_surf *surf, const struct fv_surf_point *point);
/* Values times 256, plus 128: differences of descriptors are those of the values. */
void fv_surf_describe(const struct fv_surf *surf, const struct fv_surf_point *point,
                      float angle_rad, uint8_t descriptor[FV_SURF_BYTES]);

#endif

/* SURF: features that are maxima of the determinant of the Hessian in position and scale, with
 * orientations and descriptors of 64 values (Bay, Ess, Tuytelaars and Van Gool, "Speeded-up robust
 * features (SURF)", Computer Vision and Image Understanding 110, 2008).
 *
 * Second derivatives are sums over boxes of an integral image: four octaves of four filters, with
 * sides of 9 15 21 27, 15 27 39 51, 27 51 75 99 and 51 99 147 195 pixels, on every pixel, every
 * second, fourth and eighth. A filter of side L stands for a Gaussian of sigma 1.2 L / 9. The
 * determinant Dxx Dyy - (0.9 Dxy)^2, each D divided by L^2, must be greater than `hessian` and than
 * its 26 neighbours; the strongest are refined by a quadratic through these, and described.
 * Orientation: the sum of Haar responses of side 4 sigma in a circle of 6 sigma, weighted by a
 * Gaussian of 2.5 sigma, over the sector of 60 degrees in which it is longest. Descriptor: sums of
 * dx, |dx|, dy and |dy| of Haar responses of side 2 sigma in 4 x 4 squares of 5 sigma, sampled
 * every sigma, turned by the orientation, of unit length.
 *
 * Where this differs from the paper, with matching scores on graf, bikes and boat (1000 features,
 * mean of 15 pairs; on graf alone) from .234 (.111) to .258 (.171):
 * - Boxes of Haar responses have sides of any length: the integral image is bilinear between
 *   pixels, in 1/256 pixel.
 * - A sample adds to the squares around it by its distance from their middles, so that it may move
 *   a little; samples reach half a square further, and are weighted by a Gaussian of 6 sigma: .264
 *   (.129).
 * - It starts with the image at twice its size (`doubled`; the paper tells of this too): .248
 * (.151).
 * - Of octave o the determinant counts 0.8^o. Else half of the strongest stand for 5 pixels and
 *   more, which survive blur, but not a change of viewpoint: .247 (.175); 1 and .7: .262 (.159) and
 *   .236 (.183).
 * - `hessian` keeps weak fine features out of blurred images. 60 in place of 30 gives .294 and,
 *   with 500 features, no pair more than .032 below mahotas' repeatability (.073), but leaves dark
 *   pictures none: at a quarter of the brightness two of three have no feature then.
 * Integers, and floating point in a fixed order without libm: equal bits everywhere. */
#ifndef FOVEA_FEATURES_SURF_H
#define FOVEA_FEATURES_SURF_H

#include <stdbool.h>
#include <stdint.h>

#include "base/arena.h"
#include "features/strongest.h"
#include "fovea/extract.h"
#include "image/plane.h"

enum {
    FV_SURF_BYTES = 64,
    FV_SURF_OCTAVES = 4,
    FV_SURF_LAYERS = 4,  /* filters of an octave; maxima lie in the two between */
    FV_SURF_CIRCLE = 13, /* samples of the orientation across and down */
    FV_SURF_SAMPLES = 24 /* of the descriptor */
};

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
    uint32_t count_max;
    float hessian;
    bool upright, doubled;
    uint8_t *line;      /* a row of the double */
    uint32_t *integral; /* (height + 1) x (width + 1) sums of all above and to the left, mod 2^32 */
    uint32_t *sums[3];  /* scratch of one row of a filter */
    float *rows;        /* determinants: FV_SURF_LAYERS x 3 rows */
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
uint32_t fv_surf_run(struct fv_surf *surf, const struct fv_plane *image,
                     const struct fv_plane *mask);

void fv_surf_tables_fill(struct fv_surf_tables *tables);
/* Orientation of a point, (-pi, pi]. */
float fv_surf_orient(const struct fv_surf *surf, const struct fv_surf_point *point);
/* Values times 256, plus 128: differences of descriptors are those of the values. */
void fv_surf_describe(const struct fv_surf *surf, const struct fv_surf_point *point,
                      float angle_rad, uint8_t descriptor[FV_SURF_BYTES]);

#endif

/* The directions in which SIFT descriptors of photographs vary most (their principal components,
 * after Ke and Sukthankar, "PCA-SIFT", CVPR 2004), in whole numbers. They are orthogonal but for
 * rounding, so that distances along them bound distances from below for any descriptors; that they
 * are these makes bounds near (features/bounded.h). tools/learn_sift_basis.py learns them. */
#ifndef FOVEA_FEATURES_SIFT_BASIS_H
#define FOVEA_FEATURES_SIFT_BASIS_H

#include <stdint.h>

enum {
    FV_SIFT_BASIS_ROWS = 28,
    FV_SIFT_BASIS_BYTES = 128,
    FV_SIFT_BASIS_SHIFT = 6, /* coefficients are sums, divided by 2 to this and rounded */
    /* With B the table over 2^6: |B x|^2 is at most this times |x|^2, for each x, by the largest
     * sum of a row's magnitudes in B B^T. */
    FV_SIFT_BASIS_SQUARE = 130,
    FV_SIFT_BASIS_SUM = 8192 /* of the magnitudes of a row, at most */
};

extern const int16_t fv_sift_basis[FV_SIFT_BASIS_ROWS][FV_SIFT_BASIS_BYTES];

#endif

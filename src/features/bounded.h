/* The two nearest of many descriptors of bytes, by Euclidean distance: exact, and mostly without
 * computing it.
 *
 * A Walsh-Hadamard transform keeps distances up to a factor, so that the distance in some of its
 * coefficients bounds the whole one from below. So do coefficients in an orthogonal basis that was
 * learnt from SIFT descriptors, and fewer do. Those that vary most are rounded to 7 bits, and the
 * error of rounding is counted for each descriptor: |a - b| >= step |a' - b'| - error_a - error_b.
 * Only descriptors whose bound is below the second nearest found so far are compared in full. A
 * query that fails the ratio test needs still fewer: those whose bound is below the nearest that
 * would pass. (Bounds by orthogonal transforms: Hel-Or and Hel-Or, "Real-time pattern matching
 * using projection kernels", 2005.) */
#ifndef FOVEA_FEATURES_BOUNDED_H
#define FOVEA_FEATURES_BOUNDED_H

#include <stdbool.h>
#include <stdint.h>

#include "base/arena.h"
#include "kernels/kernels.h"

enum { FV_BOUNDED_SIZE_MAX = 128, FV_BOUNDED_VALUES_MAX = 40 };

struct fv_bounded_set {
    const uint8_t *descriptors; /* the caller's */
    uint32_t count;
    int32_t error_max; /* of those for which a bound holds */
    int8_t *queries;
    int32_t *square; /* of the values' length */
    int32_t *error;  /* in coefficients, rounded up; below 0: no bound holds, compare with all */
    uint8_t *trains;
    int16_t *half;       /* of the square; INT16_MAX: no bound holds, or behind the last */
    uint16_t *unbounded; /* those without a bound: clipped, or too long */
    uint32_t unbounded_count;
};

enum fv_bounded_by { FV_BOUNDED_BY_WALSH, FV_BOUNDED_BY_SIFT };

struct fv_bounded {
    uint32_t bytes;
    enum fv_bounded_by by;
    int32_t size, values; /* coefficients, and how many of them the bound takes */
    int32_t square;       /* of the length of coefficients, over that of the descriptor, at most */
    int32_t rounding;     /* of coefficients, in all */
    int32_t step;
    int32_t chosen[FV_BOUNDED_VALUES_MAX], mean[FV_BOUNDED_VALUES_MAX];
    struct fv_bounded_set sets[2];
    int16_t *rows;
    uint16_t *indices;
    int32_t *distances;
};

/* Take memory for two sets of `count_max` descriptors of `bytes` [1, 128]; BY_SIFT: 128. Init-only.
 */
void fv_bounded_carve(struct fv_bounded *bounded, uint32_t count_max, uint32_t bytes,
                      enum fv_bounded_by by, struct fv_arena *arena);

/* Prepare two sets, which stay where they are until the searches are done. counts: 1 to count_max.
 * False: the coefficients are too large for 16 bits, as those of noise between 0 and 255 may be.
 * Real-time safe. */
bool fv_bounded_pack(struct fv_bounded *bounded, const uint8_t *const descriptors[2],
                     const uint32_t counts[2]);

/* For each of set 0 its nearest of set 1: squared distance, index (the lowest of equal ones) and
 * the distance of the second nearest, FV_SQUARES_NONE where there is none. With ratio < 1 only
 * those with distance < ratio second, distances not squared, or without a second need be right;
 * others have both the same, and any index. Real-time safe. */
void fv_bounded_two(const struct fv_bounded *bounded, const struct fv_kernels *kernels, float ratio,
                    int32_t *distance, int32_t *second, uint32_t *index);

/* index[k]: the nearest of set 0, the lowest of equal ones, to which[k] of set 1, where one of set
 * 0 is known to be within the squared distance most[k]. Real-time safe. */
void fv_bounded_back(const struct fv_bounded *bounded, const struct fv_kernels *kernels,
                     const uint32_t *which, const int32_t *most, uint32_t count, uint32_t *index);

#endif

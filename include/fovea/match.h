/* Matching: which features of two images belong together, and the geometry that they agree on.
 *
 * Works on memory of the caller, on descriptors of fovea/extract.h or of any origin:
 *
 *     size_t bytes = fovea_match_size(&config, &error);
 *     fovea_match_init(&match, &config, memory, bytes, &error);
 *     fovea_match_run(match, &a, &b, &matched);
 *
 * The search is exact: every descriptor of a is compared with every one of b. Of equally near ones
 * the one with the lower index counts as the nearest. Geometry is sampled (MSAC) with a generator
 * of fixed seed, so results are equal on every kernel set, compiler and architecture. */
#ifndef FOVEA_MATCH_H
#define FOVEA_MATCH_H

#include <stddef.h>
#include <stdint.h>

#include "fovea/extract.h"
#include "fovea/status.h"

#ifdef __cplusplus
extern "C" {
#endif

enum fovea_match_geometry {
    FOVEA_MATCH_ANY = 0,        /* matches are not verified */
    FOVEA_MATCH_HOMOGRAPHY = 1, /* b ~ H a: a plane, or a camera that only turns */
    FOVEA_MATCH_ESSENTIAL =
        2, /* b^T E a = 0 in the plane at depth 1: a rigid scene, known camera */
    FOVEA_MATCH_FUNDAMENTAL = 3, /* b^T F a = 0 in pixels: a rigid scene, unknown cameras; a plane
                                  * alone does not determine it */
    FOVEA_MATCH_GEOMETRY_COUNT
};

struct fovea_match_config {
    enum fovea_descriptor descriptor; /* default binary; says how descriptors are compared */
    uint32_t descriptor_bytes;        /* default 32: BINARY 32, PATCH 81, FLOAT [1, 128] */
    uint32_t count_max;               /* [1, 20000], default 1000: features of an image */
    /* [0.001, 1], default 0.8: kept when the nearest is nearer than this times the second nearest
     * (Lowe, IJCV 2004); 1: not tested */
    float ratio;
    uint32_t cross_check; /* 0, or 1 (default): a must be the nearest of its b as well */
    enum fovea_match_geometry geometry; /* default ANY */
    float threshold_px;                 /* [0.1, 50], default 3: residuals of inliers, in image b */
    uint32_t samples_max; /* [1, 100000], default 2000: bounds the time of the geometry */
    float focal_px;       /* [1, 100000], default 500: of both images (essential) */
    float centre_px[2];   /* [-100000, 100000], default 0 0: principal point (essential) */
};

struct fovea_match {
    uint32_t a, b;          /* indices of the features */
    float distance, second; /* of the nearest and the second; infinite where there is no second */
    uint32_t inlier;        /* 1: it agrees with the geometry; ANY: 1 */
};

/* In the matcher's memory, valid until the next run. */
struct fovea_matched {
    uint32_t count, inlier_count;
    const struct fovea_match *matches; /* in order of a */
    /* Of `model`: as asked for; or HOMOGRAPHY in place of ESSENTIAL, where the camera only turned
     * or did not move as far as the matches show, and in place of FUNDAMENTAL there and where they
     * show one plane: such matches agree with many essential or fundamental matrices, and determine
     * none. Its inliers are those within 1.77 threshold_px (geometry/two_views.h) */
    enum fovea_match_geometry geometry;
    /* Row by row: the homography in pixels, its last element 1 where that is not 0; the essential
     * matrix; or the fundamental matrix in pixels, its Frobenius norm 1. All 0 with ANY, where
     * every match counts as an inlier; otherwise all 0: none was found, and there are no inliers */
    double model[9];
};

/* A matcher in the caller's memory. */
struct fovea_matcher;

/* Every parameter at its default, for descriptors of a kind. Any thread. */
void fovea_match_config_default(struct fovea_match_config *config,
                                enum fovea_descriptor descriptor);

/* Name as in configurations ("any", "homography", "essential", "fundamental"); "unknown" out of
 * range. Any thread. */
const char *fovea_match_geometry_name(enum fovea_match_geometry geometry);

/* Bytes that a matcher needs. 0 when a parameter is out of its range: `error` names it. Init-only.
 */
size_t fovea_match_size(const struct fovea_match_config *config, struct fovea_error *error);

/* Build a matcher in `memory`, 64-byte aligned, which stays the caller's and must outlive it.
 * Errors: FOVEA_ERROR_ARGUMENT (a parameter, or the environment's FOVEA_CPU), FOVEA_ERROR_MEMORY
 * (size or alignment). Init-only. */
enum fovea_status fovea_match_init(struct fovea_matcher **matcher,
                                   const struct fovea_match_config *config, void *memory,
                                   size_t bytes, struct fovea_error *error);

/* Match. Binary descriptors are 8-byte aligned. FOVEA_ERROR_ARGUMENT: more than count_max features,
 * or descriptors of another length, and `matched` is untouched. Real-time safe: time is at most
 * proportional to the product of both counts, twice with the cross check, and to samples_max times
 * the number of matches. `features` is not read with ANY; otherwise it must be set. One
 * thread per matcher. */
enum fovea_status fovea_match_run(struct fovea_matcher *matcher, const struct fovea_extracted *a,
                                  const struct fovea_extracted *b, struct fovea_matched *matched);

#ifdef __cplusplus
}
#endif
#endif

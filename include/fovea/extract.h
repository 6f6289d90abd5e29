/* Extraction: local features of a grey image with their descriptors, by one of several methods.
 *
 * Works on memory of the caller:
 *
 *     size_t bytes = fovea_extract_size(&config, width, height, &error);
 *     fovea_extract_init(&extract, &config, width, height, memory, bytes, &error);
 *     fovea_extract_run(extract, &image, NULL, &found);
 *
 * Results are equal on every kernel set, compiler and architecture.
 *
 * Sources: ORB: Rublee, Rabaud, Konolige and Bradski, "ORB: an efficient alternative to SIFT or
 * SURF", ICCV 2011; FAST: Rosten and Drummond, "Machine learning for high-speed corner detection",
 * ECCV 2006; Harris: Harris and Stephens, "A combined corner and edge detector", 1988; Shi and
 * Tomasi, "Good features to track", CVPR 1994; SIFT: Lowe, "Distinctive image features from
 * scale-invariant keypoints", IJCV 2004. */
#ifndef FOVEA_EXTRACT_H
#define FOVEA_EXTRACT_H

#include <stddef.h>
#include <stdint.h>

#include "fovea/features.h"
#include "fovea/image.h"
#include "fovea/status.h"

#ifdef __cplusplus
extern "C" {
#endif

enum fovea_descriptor {
    FOVEA_DESCRIPTOR_BINARY = 0, /* 32 bytes: 256 bits, compared by Hamming distance */
    /* 81 bytes: 9 x 9 pixels around the feature on its level, shifted and scaled to mean 128 and
     * standard deviation 32; compared by Euclidean distance */
    FOVEA_DESCRIPTOR_PATCH = 1,
    /* Compared by Euclidean distance. SIFT: 128 bytes, real values of the unit vector times 512,
     * rounded and limited to 255, as in Lowe's program. SURF: 64 bytes, real values times 256 plus
     * 128, rounded and limited to [0, 255] */
    FOVEA_DESCRIPTOR_FLOAT = 2,
    FOVEA_DESCRIPTOR_COUNT
};

enum { FOVEA_EXTRACT_COUNT_MAX = 20000 };

struct fovea_extract_config {
    /* FAST, HARRIS and SHI_TOMASI find corners of the image itself, ORB on every level of a pyramid
     * and with orientations */
    enum fovea_feature_method method;
    /* default: the method's own. SIFT and SURF have FLOAT alone, the others BINARY (their own) or
     * PATCH */
    enum fovea_descriptor descriptor;
    uint32_t count_max; /* [1, 20000], default 500: the strongest are kept */
    /* 1: orientations are 0, and descriptors distinguish features better between images that are
     * not rotated against each other. Default 0 for ORB, SIFT and SURF, 1 for the others */
    uint32_t upright;
    /* [1, 8], default 8: of the pyramid (ORB). Each is due a part of count_max, falling by 5/6 from
     * level to level; what one lacks is not made up for on others. Octaves at most (SIFT; SURF has
     * up to 4) */
    uint32_t levels;
    /* [2, 100] grey levels, default 20: of corners (ORB, FAST). Where FAST finds less than
     * count_max / 32 of them, corners of 7 fill up to that number. */
    uint32_t threshold;
    /* [0.1, 50] grey levels, default 3.4: least difference of Gaussians (SIFT) */
    float contrast;
    /* [1, 100], default 10: largest ratio of the two curvatures, which is high on edges (SIFT) */
    float edge_ratio;
    /* [0, 10000], default 1 (grey levels)^2: least determinant of the Hessian, of derivatives by
     * the scale of their filter (SURF) */
    float hessian;
    /* 0, or 1 (default): SIFT and SURF start with the image at twice its size, which gives more and
     * finer features for four times the memory and about three times the time */
    uint32_t doubled;
    float harris_k; /* [0, 0.25], default 0.04 (Harris) */
    /* [0, 1]: least response as a fraction of the largest of the image (Harris, Shi and Tomasi;
     * default 0.01), or of the variance of its grey levels (SURF, default 0.004) */
    float quality;
    /* [0, 256] pixels, default 0: of two corners that are nearer only the stronger counts; the
     * strongest 4 x count_max are looked at (Harris, Shi and Tomasi) */
    float distance_px;
};

/* A feature, positions with the centre of the first pixel at 0. */
struct fovea_local_feature {
    float x_px, y_px; /* in the image */
    float size_px;    /* diameter of what it stands for: SIFT, SURF 2 sigma; others the patch */
    float angle_rad;  /* clockwise in the image from +x, (-pi, pi]; 0 where the method has none */
    /* Strength, in the method's unit: FAST score; grey levels (SIFT; of a further orientation times
     * the square of its share of the highest peak), squared (SURF); grey levels per pixel to the
     * fourth (Harris, ORB) or second power (Shi and Tomasi) */
    float response;
    uint32_t level; /* of the pyramid, or octave; 0 the finest */
};

/* What was found: in the caller's memory block, valid until the next run. */
struct fovea_extracted {
    uint32_t count;
    const struct fovea_local_feature
        *features;              /* strongest first; ORB: coarse levels first, so of each level;
                                 * SURF: an octave counts 0.8 of the one before */
    const uint8_t *descriptors; /* count x descriptor_bytes */
    uint32_t descriptor_bytes;
};

/* An extractor in the caller's memory. */
struct fovea_extract;

/* A method with its own descriptor, every parameter at its default. Any thread. */
void fovea_extract_config_default(struct fovea_extract_config *config,
                                  enum fovea_feature_method method);

/* Names as in configurations ("orb", "shi_tomasi", ...; "binary", "patch", "float"); "unknown" out
 * of range. Any thread. */
const char *fovea_feature_method_name(enum fovea_feature_method method);
const char *fovea_descriptor_name(enum fovea_descriptor descriptor);

/* Bytes that an extractor for images of width x height (within FOVEA_IMAGE_*) needs. 0 when a
 * parameter is out of its range: `error` names it. Init-only. */
size_t fovea_extract_size(const struct fovea_extract_config *config, int32_t width, int32_t height,
                          struct fovea_error *error);

/* Build an extractor in `memory`, 64-byte aligned, which stays the caller's and must outlive it.
 * Errors: FOVEA_ERROR_ARGUMENT (a parameter, or the environment's FOVEA_CPU), FOVEA_ERROR_MEMORY
 * (size or alignment). Init-only. */
enum fovea_status fovea_extract_init(struct fovea_extract **extract,
                                     const struct fovea_extract_config *config, int32_t width,
                                     int32_t height, void *memory, size_t bytes,
                                     struct fovea_error *error);

/* Find and describe the features of a grey8 image of its size. `mask`, when not NULL, is a grey8
 * image of the same size: no feature where it is 0. FOVEA_ERROR_ARGUMENT: an image does not fit,
 * and `found` is untouched. Real-time safe: time is at most proportional to the pixels times the
 * logarithm of count_max, and to count_max.
 * One thread per extractor. */
enum fovea_status fovea_extract_run(struct fovea_extract *extract, const struct fovea_image *image,
                                    const struct fovea_image *mask, struct fovea_extracted *found);

#ifdef __cplusplus
}
#endif
#endif

/* SIFT: features that are extremes of differences of Gaussians in position and scale, with
 * orientations and descriptors (Lowe, "Distinctive image features from scale-invariant keypoints",
 * IJCV 2004).
 *
 * An extreme is refined by a quadratic through its 27 neighbours (at most 5 steps from pixel to
 * pixel), and left out when the difference there is below `contrast` or its two curvatures' ratio
 * above `edge_ratio`. The strongest are kept. Orientations are the peaks of a histogram of 36
 * directions that reach 0.8 of the highest; each makes a feature of its own. The highest has the
 * strength of the extreme, each other one that times the square of its share of the highest: of N
 * features more lie at places of their own. With 300 features of 12 photographs that are changed in
 * 11 ways by hand, seen from the side, zoomed, blurred, noisy and dark, repeatability is .516 and
 * the matching score .387; with the strength itself .499 and .382, .8 of it .519 and .387, .6 of it
 * .531 and .387, only the highest .537 and .380; of 132 pairs 6, 13, 11, 15 and 20 are more than
 * .04 below OpenCV's. Of 12 others: .513 and .388 in place of .500 and .383. Strengths times
 * sigma^.5, sigma^1 and sigma^-.5: .517, .501 and .369, 35, 48 and 104 pairs.
 *
 * Orientations and descriptors are made from a square grid of samples of the nearest level, 0.6 and
 * 0.75 sigma apart, the descriptor's turned by the orientation, as Lowe describes it (others visit
 * every pixel): the cost of a feature does not depend on its size, and all weights are constants.
 * Floating point in a fixed order without libm: equal bits everywhere. */
#ifndef FOVEA_FEATURES_SIFT_H
#define FOVEA_FEATURES_SIFT_H

#include "features/scale_space.h"
#include "fovea/extract.h"

enum {
    FV_SIFT_BYTES = 128,
    FV_SIFT_CELLS = 4,     /* of the descriptor across and down */
    FV_SIFT_DIRECTIONS = 8 /* of a cell */
};

/* An extreme, in pixels of its octave. */
struct fv_sift_extreme {
    float x, y, layer; /* refined */
    float response;    /* |difference of Gaussians| in grey levels */
    uint16_t at_x, at_y;
    uint8_t octave, at_layer; /* the level that it is nearest to: [1, 3] */
};

struct fv_sift_tables;

enum { FV_SIFT_ORIENTATIONS_MAX = 4 };

struct fv_sift_orientation {
    float angle_rad, share; /* of the highest peak of the histogram */
};

/* A further orientation of an extreme, until it is its turn. */
struct fv_sift_pending {
    float strength, angle_rad;
    uint32_t extreme;
};

struct fv_sift {
    struct fv_scale_space space;
    uint32_t count_max, room; /* of extremes: more than count_max, as some are found twice */
    uint32_t extreme_count;
    float contrast, edge_ratio;
    bool upright;                     /* one feature of each extreme, with orientation 0 */
    struct fv_sift_extreme *extremes; /* a heap, the weakest first, while they are searched */
    struct fv_sift_pending *pending;  /* a heap, the strongest first */
    uint32_t pending_count;
    uint16_t *marks;
    int16_t *peaks; /* scratch */
    struct fv_sift_tables *tables;
    struct fovea_local_feature *features; /* count_max */
    uint8_t *descriptors;                 /* count_max x FV_SIFT_BYTES */
};

/* Take memory. Fills sizes, tables and addresses only. Init-only. */
void fv_sift_carve(struct fv_sift *sift, const struct fovea_extract_config *config, int32_t width,
                   int32_t height, struct fv_arena *arena);

/* Find and describe; no feature where `mask` (its pixels may be NULL) is 0. Returns how many.
 * Real-time safe: time is at most proportional to the pixels, and to count_max. */
uint32_t fv_sift_run(struct fv_sift *sift, const struct fv_kernels *kernels,
                     const struct fv_plane *image, const struct fv_plane *mask);

/* Tables of constant weights. */
size_t fv_sift_tables_bytes(void);
void fv_sift_tables_fill(struct fv_sift_tables *tables);
/* Orientations of an extreme, the highest peak first; returns how many. */
uint32_t fv_sift_orient(const struct fv_sift *sift, const struct fv_sift_extreme *extreme,
                        struct fv_sift_orientation found[FV_SIFT_ORIENTATIONS_MAX]);
void fv_sift_describe(const struct fv_sift *sift, const struct fv_sift_extreme *extreme,
                      float angle_rad, uint8_t descriptor[FV_SIFT_BYTES]);
/* Sigma of an extreme in pixels of its octave. */
double fv_sift_sigma(const struct fv_sift_extreme *extreme);

#endif

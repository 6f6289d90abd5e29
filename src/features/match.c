/* Matching of features by their descriptors and by geometry (fovea/match.h). */
#include <stdbool.h>
#include <string.h>

#include "base/arena.h"
#include "features/bounded.h"
#include "features/nearest.h"
#include "features/patch.h"
#include "features/sift_basis.h"
#include "fovea/match.h"
#include "geometry/homography.h"
#include "geometry/two_views.h"
#include "geometry/vec.h"

enum {
    SEED = 20,
    BOUNDED_BYTES = 33, /* fewer bytes, or features, are all compared */
    BOUNDED_COUNT = 128
};

/* The two nearest of each feature of one image in the other: squared distances, or Hamming's. */
struct found {
    int32_t *distance, *second;
    uint32_t *index;
};

struct fovea_matcher {
    struct fv_kernels kernels;
    struct fovea_match_config config;
    struct fv_nearest nearest;
    struct fv_packed packed[2];
    struct fv_bounded bounded;
    struct found there, back;
    uint32_t *asked; /* of the cross check: features of the other image */
    struct fovea_match *matches;
    struct fv_pair *pairs;
    uint8_t *inlier, *work;
};

static const char *const names[FOVEA_MATCH_GEOMETRY_COUNT] = {
    [FOVEA_MATCH_ANY] = "any",
    [FOVEA_MATCH_HOMOGRAPHY] = "homography",
    [FOVEA_MATCH_ESSENTIAL] = "essential",
    [FOVEA_MATCH_FUNDAMENTAL] = "fundamental",
};

const char *fovea_match_geometry_name(enum fovea_match_geometry geometry)
{
    return (unsigned)geometry < FOVEA_MATCH_GEOMETRY_COUNT ? names[geometry] : "unknown";
}

void fovea_match_config_default(struct fovea_match_config *config, enum fovea_descriptor descriptor)
{
    *config = (struct fovea_match_config){
        .descriptor = descriptor,
        .descriptor_bytes = descriptor == FOVEA_DESCRIPTOR_BINARY  ? FV_DESCRIPTOR_BYTES
                            : descriptor == FOVEA_DESCRIPTOR_PATCH ? FV_PATCH_BYTES
                                                                   : 4 * FV_SQUARES_WORDS_MAX,
        .count_max = 1000,
        .ratio = .8f,
        .cross_check = 1,
        .threshold_px = 3,
        .samples_max = 2000,
        .focal_px = 500,
    };
}

static enum fovea_status check(const struct fovea_match_config *config, struct fovea_error *error)
{
    const bool binary = config->descriptor == FOVEA_DESCRIPTOR_BINARY;
    const struct {
        const char *name;
        double value, low, high;
    } ranges[] = {
        {"descriptor", config->descriptor, 0, FOVEA_DESCRIPTOR_COUNT - 1},
        {"descriptor_bytes", config->descriptor_bytes, binary ? FV_DESCRIPTOR_BYTES : 1,
         binary ? FV_DESCRIPTOR_BYTES : 4 * FV_SQUARES_WORDS_MAX},
        {"count_max", config->count_max, 1, FOVEA_EXTRACT_COUNT_MAX},
        {"ratio", (double)config->ratio, 1e-3, 1},
        {"cross_check", config->cross_check, 0, 1},
        {"geometry", config->geometry, 0, FOVEA_MATCH_GEOMETRY_COUNT - 1},
        {"threshold_px", (double)config->threshold_px, .1f, 50},
        {"samples_max", config->samples_max, 1, 100000},
        {"focal_px", (double)config->focal_px, 1, 100000},
        {"centre_px[0]", (double)config->centre_px[0], -100000, 100000},
        {"centre_px[1]", (double)config->centre_px[1], -100000, 100000},
    };
    for (size_t i = 0; i < sizeof ranges / sizeof ranges[0]; i++)
        if (!(ranges[i].value >= ranges[i].low && ranges[i].value <= ranges[i].high))
            return fovea_error_set(error, FOVEA_ERROR_ARGUMENT, "%s: found %g, expected %g to %g",
                                   ranges[i].name, ranges[i].value, ranges[i].low, ranges[i].high);
    return FOVEA_OK;
}

static void carve_found(struct found *found, uint32_t count, struct fv_arena *arena)
{
    found->distance = fv_arena_take(arena, count, sizeof *found->distance);
    found->second = fv_arena_take(arena, count, sizeof *found->second);
    found->index = fv_arena_take(arena, count, sizeof *found->index);
}

static struct fovea_matcher *carve(const struct fovea_match_config *config, struct fv_arena *arena)
{
    struct fovea_matcher counted = {0};
    struct fovea_matcher *made = fv_arena_take(arena, 1, sizeof *made);
    struct fovea_matcher *matcher = made == NULL ? &counted : made;
    const uint32_t count = config->count_max;
    matcher->config = *config;
    if (config->descriptor != FOVEA_DESCRIPTOR_BINARY) {
        fv_nearest_carve(&matcher->nearest, count, config->descriptor_bytes, matcher->packed, 2,
                         arena);
        if (config->descriptor_bytes >= BOUNDED_BYTES)
            fv_bounded_carve(&matcher->bounded, count, config->descriptor_bytes,
                             config->descriptor_bytes == FV_SIFT_BASIS_BYTES ? FV_BOUNDED_BY_SIFT
                                                                             : FV_BOUNDED_BY_WALSH,
                             arena);
    }
    matcher->asked = fv_arena_take(arena, count, sizeof *matcher->asked);
    carve_found(&matcher->there, count, arena);
    carve_found(&matcher->back, count, arena);
    matcher->matches = fv_arena_take(arena, count, sizeof *matcher->matches);
    if (config->geometry != FOVEA_MATCH_ANY) {
        matcher->pairs = fv_arena_take(arena, count, sizeof *matcher->pairs);
        matcher->inlier = fv_arena_take(arena, count, sizeof *matcher->inlier);
        matcher->work = fv_arena_take(arena, count, sizeof *matcher->work);
    }
    return made;
}

size_t fovea_match_size(const struct fovea_match_config *config, struct fovea_error *error)
{
    struct fv_arena arena;
    if (check(config, error) != FOVEA_OK) return 0;
    fv_arena_count(&arena);
    carve(config, &arena);
    return arena.used;
}

enum fovea_status fovea_match_init(struct fovea_matcher **matcher,
                                   const struct fovea_match_config *config, void *memory,
                                   size_t bytes, struct fovea_error *error)
{
    enum fv_cpu_set set;
    enum fovea_status status = check(config, error);
    if (status == FOVEA_OK) status = fv_cpu_from_environment(&set, error);
    if (status != FOVEA_OK) return status;
    const size_t needed = fovea_match_size(config, error);
    status = fv_arena_check_block(memory, bytes, needed, error);
    if (status != FOVEA_OK) return status;
    struct fv_arena arena;
    fv_arena_init(&arena, memory, bytes);
    *matcher = carve(config, &arena);
    fv_kernels_init(&(*matcher)->kernels, set);
    return FOVEA_OK;
}

/* Distance and index of what the kernel for binary descriptors packs into one number. */
static void unpack(struct found *found, uint32_t count)
{
    for (uint32_t i = 0; i < count; i++) {
        const uint32_t nearest = (uint32_t)found->distance[i], second = (uint32_t)found->second[i];
        found->index[i] = nearest & ((1u << FV_MATCH_INDEX_BITS) - 1);
        found->distance[i] = (int32_t)(nearest >> FV_MATCH_INDEX_BITS);
        found->second[i] =
            second == FV_MATCH_NONE ? FV_SQUARES_NONE : (int32_t)(second >> FV_MATCH_INDEX_BITS);
    }
}

static void search_binary(struct fovea_matcher *matcher, const struct fovea_extracted *a,
                          const struct fovea_extracted *b, struct found *found)
{
    matcher->kernels.hamming_two_u8((uint32_t *)found->distance, (uint32_t *)found->second,
                                    a->descriptors, (int32_t)a->count, b->descriptors,
                                    (int32_t)b->count);
    unpack(found, a->count);
}

/* Distance of a feature that the search gave: bits, or the root of squares. */
static float distance_of(const struct fovea_matcher *matcher, int32_t found)
{
    if (found >= FV_SQUARES_NONE) return __builtin_inff();
    return matcher->config.descriptor == FOVEA_DESCRIPTOR_BINARY ? (float)found
                                                                 : __builtin_sqrtf((float)found);
}

static bool passes(const struct fovea_matcher *matcher, uint32_t i)
{
    const float distance = distance_of(matcher, matcher->there.distance[i]);
    const float second = distance_of(matcher, matcher->there.second[i]);
    return matcher->config.ratio >= 1 || distance < matcher->config.ratio * second;
}

/* Whether most distances need not be computed: where vectors do what is needed for that, and do not
 * compute products of 64 bytes at once, which gives all distances faster. */
static bool bounds_pay(const struct fovea_matcher *matcher, const struct fovea_extracted *a,
                       const struct fovea_extracted *b)
{
    return matcher->config.descriptor_bytes >= BOUNDED_BYTES && a->count >= BOUNDED_COUNT &&
           b->count >= BOUNDED_COUNT &&
           (matcher->kernels.isas & (FV_ISA_SSE4 | FV_ISA_NEON)) != 0 &&
           (matcher->kernels.isas & FV_ISA_AVX512VNNI) == 0;
}

/* False: nothing is found so. */
static bool search_bounded(struct fovea_matcher *matcher, const struct fovea_extracted *a,
                           const struct fovea_extracted *b)
{
    struct fv_bounded *bounded = &matcher->bounded;
    struct found *there = &matcher->there, *back = &matcher->back;
    const uint8_t *const descriptors[2] = {a->descriptors, b->descriptors};
    const uint32_t counts[2] = {a->count, b->count};
    if (!fv_bounded_pack(bounded, descriptors, counts)) return false;
    fv_bounded_two(bounded, &matcher->kernels, matcher->config.ratio, there->distance,
                   there->second, there->index);
    if (!matcher->config.cross_check) return true;
    /* back only from what passed, whose distance is known */
    uint32_t count = 0;
    for (uint32_t i = 0; i < a->count; i++)
        if (passes(matcher, i)) {
            matcher->asked[count] = there->index[i];
            back->distance[count++] = there->distance[i];
        }
    fv_bounded_back(bounded, &matcher->kernels, matcher->asked, back->distance, count,
                    (uint32_t *)back->second);
    for (uint32_t k = 0; k < count; k++)
        back->index[matcher->asked[k]] = (uint32_t)back->second[k];
    return true;
}

static void search_all(struct fovea_matcher *matcher, const struct fovea_extracted *a,
                       const struct fovea_extracted *b)
{
    const struct fv_nearest *nearest = &matcher->nearest;
    struct fv_packed *packed = matcher->packed;
    fv_nearest_pack(nearest, &packed[0], a->descriptors, a->count);
    fv_nearest_pack(nearest, &packed[1], b->descriptors, b->count);
    fv_nearest_find(nearest, &matcher->kernels, &packed[0], &packed[1], matcher->there.distance,
                    matcher->there.second, matcher->there.index);
    if (matcher->config.cross_check)
        fv_nearest_find(nearest, &matcher->kernels, &packed[1], &packed[0], matcher->back.distance,
                        matcher->back.second, matcher->back.index);
}

static void search(struct fovea_matcher *matcher, const struct fovea_extracted *a,
                   const struct fovea_extracted *b)
{
    if (matcher->config.descriptor == FOVEA_DESCRIPTOR_BINARY) {
        search_binary(matcher, a, b, &matcher->there);
        if (matcher->config.cross_check) search_binary(matcher, b, a, &matcher->back);
    } else if (!bounds_pay(matcher, a, b) || !search_bounded(matcher, a, b)) {
        search_all(matcher, a, b);
    }
}

/* Ratio test and cross check; returns the number of matches. */
static uint32_t keep(struct fovea_matcher *matcher, uint32_t count)
{
    const struct found *there = &matcher->there;
    uint32_t kept = 0;
    for (uint32_t i = 0; i < count; i++) {
        if (!passes(matcher, i)) continue;
        if (matcher->config.cross_check && matcher->back.index[there->index[i]] != i) continue;
        matcher->matches[kept++] =
            (struct fovea_match){i, there->index[i], distance_of(matcher, there->distance[i]),
                                 distance_of(matcher, there->second[i]), 1};
    }
    return kept;
}

/* A pinhole camera of both images: its own with ESSENTIAL, otherwise one that sees all features. */
struct view {
    double focal, x, y;
};

static struct view view_of(const struct fovea_extracted *a, const struct fovea_extracted *b)
{
    double most = 64;
    for (int k = 0; k < 2; k++) {
        const struct fovea_extracted *of = k == 0 ? a : b;
        for (uint32_t i = 0; i < of->count; i++) {
            if ((double)of->features[i].x_px > most) most = (double)of->features[i].x_px;
            if ((double)of->features[i].y_px > most) most = (double)of->features[i].y_px;
        }
    }
    return (struct view){2 * most, most / 2, most / 2};
}

static void bearing(const struct view *view, const struct fovea_local_feature *feature, double x[3])
{
    x[0] = ((double)feature->x_px - view->x) / view->focal;
    x[1] = ((double)feature->y_px - view->y) / view->focal;
    x[2] = 1;
    (void)fv_normalise3(x);
}

static void inverse_of(const struct view *view, double inverse[9])
{
    const double f = 1 / view->focal;
    const double of[9] = {f, 0, -view->x * f, 0, f, -view->y * f, 0, 0, 1};
    memcpy(inverse, of, sizeof of);
}

/* H of the plane at depth 1 to pixels: K H K^-1, its last element 1. */
static void homography_to_pixels(const struct view *view, const double H[9], double out[9])
{
    const double K[9] = {view->focal, 0, view->x, 0, view->focal, view->y, 0, 0, 1};
    double half[9], inverse[9];
    inverse_of(view, inverse);
    fv_multiply33(K, H, half);
    fv_multiply33(half, inverse, out);
    const double scale = out[8] != 0 ? 1 / out[8] : 1;
    for (int i = 0; i < 9; i++)
        out[i] *= scale;
}

/* F of the plane at depth 1 to pixels: K^-T F K^-1, its norm 1. */
static void fundamental_to_pixels(const struct view *view, const double F[9], double out[9])
{
    double half[9], inverse[9], transposed[9], square = 0;
    inverse_of(view, inverse);
    for (int i = 0; i < 9; i++)
        transposed[i] = inverse[3 * (i % 3) + i / 3];
    fv_multiply33(transposed, F, half);
    fv_multiply33(half, inverse, out);
    for (int i = 0; i < 9; i++)
        square += out[i] * out[i];
    const double scale = 1 / __builtin_sqrt(square);
    for (int i = 0; i < 9; i++)
        out[i] *= scale;
}

/* The model that most pairs agree on, on bearings. */
static void estimate(struct fovea_matcher *matcher, uint32_t count, const struct view *view,
                     struct fv_two_views *found)
{
    const struct fovea_match_config *config = &matcher->config;
    const struct fv_sampling sampling = {(double)config->threshold_px / view->focal, .999,
                                         config->samples_max};
    const struct fv_pair *pairs = matcher->pairs;
    struct fv_random random;
    fv_random_seed(&random, SEED);
    if (config->geometry == FOVEA_MATCH_ESSENTIAL) {
        fv_two_views_essential(pairs, count, &sampling, &random, matcher->inlier, matcher->work,
                               found);
    } else if (config->geometry == FOVEA_MATCH_FUNDAMENTAL) {
        fv_two_views_fundamental(pairs, count, &sampling, &random, matcher->inlier, matcher->work,
                                 found);
    } else {
        *found = (struct fv_two_views){.simple = true};
        found->inliers =
            fv_homography_estimate(pairs, count, &sampling, &random, found->model, matcher->inlier);
    }
}

static void verify(struct fovea_matcher *matcher, const struct fovea_extracted *a,
                   const struct fovea_extracted *b, struct fovea_matched *matched)
{
    const struct fovea_match_config *config = &matcher->config;
    const struct view own = {(double)config->focal_px, (double)config->centre_px[0],
                             (double)config->centre_px[1]};
    const struct view view = config->geometry == FOVEA_MATCH_ESSENTIAL ? own : view_of(a, b);
    struct fv_two_views found;
    for (uint32_t i = 0; i < matched->count; i++) {
        bearing(&view, &a->features[matcher->matches[i].a], matcher->pairs[i].x1);
        bearing(&view, &b->features[matcher->matches[i].b], matcher->pairs[i].x2);
    }
    estimate(matcher, matched->count, &view, &found);
    matched->inlier_count = found.inliers;
    for (uint32_t i = 0; i < matched->count; i++)
        matcher->matches[i].inlier = found.inliers > 0 && matcher->inlier[i] != 0;
    if (found.inliers == 0) return;
    if (found.simple) {
        matched->geometry = FOVEA_MATCH_HOMOGRAPHY;
        homography_to_pixels(&view, found.model, matched->model);
    } else if (config->geometry == FOVEA_MATCH_FUNDAMENTAL) {
        fundamental_to_pixels(&view, found.model, matched->model);
    } else {
        memcpy(matched->model, found.model, sizeof matched->model);
    }
}

enum fovea_status fovea_match_run(struct fovea_matcher *matcher, const struct fovea_extracted *a,
                                  const struct fovea_extracted *b, struct fovea_matched *matched)
{
    const struct fovea_match_config *config = &matcher->config;
    for (int k = 0; k < 2; k++) {
        const struct fovea_extracted *of = k == 0 ? a : b;
        if (of->count > config->count_max ||
            (of->count > 0 && of->descriptor_bytes != config->descriptor_bytes))
            return FOVEA_ERROR_ARGUMENT;
    }
    *matched = (struct fovea_matched){.matches = matcher->matches, .geometry = config->geometry};
    if (a->count == 0 || b->count == 0) return FOVEA_OK;
    search(matcher, a, b);
    matched->count = matched->inlier_count = keep(matcher, a->count);
    if (config->geometry != FOVEA_MATCH_ANY) verify(matcher, a, b, matched);
    return FOVEA_OK;
}

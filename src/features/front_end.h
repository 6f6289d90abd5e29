/* The front end of one camera: preprocessing, pyramid, features and descriptors of its images. Each
 * camera that is looked at has an instance of its own; the runtime has one, for the first camera.
 *
 * Everything in it follows from the last image, except a table of the descriptors that the first
 * image fills. Carving fills sizes and addresses only. */
#ifndef FOVEA_FEATURES_FRONT_END_H
#define FOVEA_FEATURES_FRONT_END_H

#include "features/features.h"
#include "features/orb.h"
#include "image/seen.h"

#ifdef __cplusplus
extern "C" {
#endif

struct fv_front_end {
    struct fv_seen images;
    struct fv_features features;
    struct fv_orb orb;
    bool describes; /* features get descriptors: fv_front_end_carve_descriptors was called */
};

/* What the last image shows; valid until the next one. */
struct fv_front_end_found {
    uint32_t count;
    const struct fovea_feature *features;
    const uint8_t *descriptors; /* FV_DESCRIPTOR_BYTES each; NULL: none */
};

/* Take memory for images of width x height, in this order; without the third there are no
 * descriptors. Three functions, so that the memory table has a row for each. Init-only. */
void fv_front_end_carve_images(struct fv_front_end *front_end,
                               const struct fovea_preprocess_config *chain, uint32_t seen_by,
                               const uint32_t looked_at[FV_VIEWER_COUNT], int32_t width,
                               int32_t height, uint32_t levels, struct fv_arena *frame);
void fv_front_end_carve_features(struct fv_front_end *front_end,
                                 const struct fovea_features_config *config,
                                 struct fv_arena *frame);
void fv_front_end_carve_descriptors(struct fv_front_end *front_end, struct fv_arena *frame);

/* Features stay at whole pixels of their levels, for a user who aligns them by the pixels himself.
 * After carving. Init-only. */
static inline void fv_front_end_keep_whole_pixels(struct fv_front_end *front_end)
{
    front_end->features.whole_pixels = true;
}

/* Take an image of the carved size, in any uncompressed format, checked with fovea_image_check:
 * run the preprocessing chain and build its pyramids. Real-time safe; cost proportional to the
 * pixels. */
void fv_front_end_take(struct fv_front_end *front_end, const struct fv_kernels *kernels,
                       const struct fovea_image *image);

/* Find at most `count_asked` features of the image taken and describe them; `mask` as
 * fv_features_find has it. Returns their count. Real-time safe; cost bounded by the number of
 * pixels and of features. */
uint32_t fv_front_end_find(struct fv_front_end *front_end, const struct fv_kernels *kernels,
                           const struct fv_plane *mask, uint32_t count_asked);

/* Noise of the image taken, as features see it (image/noise.h). Real-time safe. */
uint32_t fv_front_end_noise(const struct fv_front_end *front_end);

struct fv_front_end_found fv_front_end_found(const struct fv_front_end *front_end);

/* Set what fv_seen_set and fv_features_set set: once after carving on memory, and for every change
 * after that. Real-time safe. */
void fv_front_end_set(struct fv_front_end *front_end, const struct fovea_preprocess_config *chain,
                      const struct fovea_features_config *features);

/* The image taken, as grey levels, for those who show it or look for something else in it. */
static inline const struct fv_seen *fv_front_end_images(const struct fv_front_end *front_end)
{
    return &front_end->images;
}

#ifdef __cplusplus
}
#endif
#endif

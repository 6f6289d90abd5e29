#include "features/front_end.h"

#include "image/noise.h"

void fv_front_end_carve_images(struct fv_front_end *f, const struct fovea_preprocess_config *chain,
                               uint32_t seen_by, const uint32_t looked_at[FV_VIEWER_COUNT],
                               int32_t width, int32_t height, uint32_t levels,
                               struct fv_arena *frame)
{
    fv_seen_carve(&f->images, chain, seen_by, looked_at, width, height, levels, frame);
}

void fv_front_end_set(struct fv_front_end *f, const struct fovea_preprocess_config *chain,
                      const struct fovea_features_config *features)
{
    fv_seen_set(&f->images, chain);
    fv_features_set(&f->features, features);
}

void fv_front_end_carve_features(struct fv_front_end *f, const struct fovea_features_config *config,
                                 struct fv_arena *frame)
{
    fv_features_carve(&f->features, config, &f->images.main, frame);
}

void fv_front_end_carve_descriptors(struct fv_front_end *f, struct fv_arena *frame)
{
    fv_orb_carve(&f->orb, f->features.config.count_max, &f->images.main, frame);
    f->describes = true;
}

void fv_front_end_take(struct fv_front_end *f, const struct fv_kernels *kernels,
                       const struct fovea_image *image)
{
    fv_seen_build(&f->images, kernels, image);
}

uint32_t fv_front_end_find(struct fv_front_end *f, const struct fv_kernels *kernels,
                           const struct fv_plane *mask, uint32_t count_asked)
{
    const uint32_t count =
        fv_features_find(&f->features, kernels, &f->images.main, mask, count_asked);
    if (f->describes)
        fv_orb_describe(&f->orb, kernels, &f->images.main, f->features.corners, count);
    return count;
}

uint32_t fv_front_end_noise(const struct fv_front_end *f)
{
    return fv_noise(fv_pyramid_level(&f->images.main, 0));
}

struct fv_front_end_found fv_front_end_found(const struct fv_front_end *f)
{
    return (struct fv_front_end_found){.count = f->features.count,
                                       .features = f->features.list,
                                       .descriptors = f->describes ? f->orb.descriptors : NULL};
}

#include "image/seen.h"

#include "image/grey.h"

static bool sees(const struct fv_seen *seen, enum fv_viewer viewer)
{
    return seen->changes && (seen->seen_by >> viewer & 1) != 0;
}

/* Levels of the second pyramid: of those who see the image otherwise than features do. Networks
 * have a copy of the frame, and need both images where they see the result. */
static uint32_t other_levels(const struct fv_seen *seen, const uint32_t looked_at[FV_VIEWER_COUNT])
{
    uint32_t levels = 0;
    for (int i = 0; i < FV_VIEWER_COUNT; i++) {
        const enum fv_viewer viewer = (enum fv_viewer)i;
        const bool needs = viewer == FV_VIEWER_NETWORKS
                               ? sees(seen, viewer)
                               : sees(seen, viewer) != sees(seen, FV_VIEWER_FEATURES);
        if (needs && looked_at[i] > levels) levels = looked_at[i];
    }
    return levels;
}

static bool anybody_sees(uint32_t seen_by, const uint32_t looked_at[FV_VIEWER_COUNT])
{
    for (int i = 0; i < FV_VIEWER_COUNT; i++)
        if ((seen_by >> i & 1) != 0 && looked_at[i] > 0) return true;
    return false;
}

void fv_seen_carve(struct fv_seen *seen, const struct fovea_preprocess_config *chain,
                   uint32_t seen_by, const uint32_t looked_at[FV_VIEWER_COUNT], int32_t width,
                   int32_t height, uint32_t levels, struct fv_arena *frame)
{
    struct fovea_preprocess_config grey;
    fv_preprocess_grey(chain, &grey);
    fv_pyramid_carve(&seen->main, width, height, levels, frame);
    seen->seen_by = seen_by;
    seen->changes = grey.operations.count > 0 && anybody_sees(seen_by, looked_at);
    seen->other.levels = 0;
    if (!seen->changes) return;
    fv_preprocess_carve(&seen->chain, &grey, width, height, frame);
    const uint32_t others = other_levels(seen, looked_at);
    if (others > 0) fv_pyramid_carve(&seen->other, width, height, others, frame);
}

void fv_seen_set(struct fv_seen *seen, const struct fovea_preprocess_config *chain)
{
    struct fovea_preprocess_config grey;
    fv_preprocess_grey(chain, &grey);
    if (seen->changes) fv_preprocess_set(&seen->chain, &grey);
}

void fv_seen_build(struct fv_seen *seen, const struct fv_kernels *kernels,
                   const struct fovea_image *image)
{
    if (!seen->changes) {
        fv_pyramid_build(&seen->main, kernels, image);
        return;
    }
    const struct fv_plane *main = &seen->main.level[0],
                          *other = seen->other.levels > 0 ? &seen->other.level[0] : main;
    const bool main_sees = sees(seen, FV_VIEWER_FEATURES);
    const struct fv_plane *before = main_sees ? other : main, *after = main_sees ? main : other;
    fv_grey_convert(before, kernels, image);
    fv_preprocess_run(&seen->chain, kernels, before, after);
    fv_pyramid_shrink(&seen->main, kernels);
    fv_pyramid_shrink(&seen->other, kernels);
}

const struct fv_pyramid *fv_seen_pyramid(const struct fv_seen *seen, enum fv_viewer viewer)
{
    const bool same = sees(seen, viewer) == sees(seen, FV_VIEWER_FEATURES);
    return same || seen->other.levels == 0 ? &seen->main : &seen->other;
}

static struct fovea_image grey_of(const struct fv_plane *plane)
{
    return (struct fovea_image){.data = plane->pixels,
                                .width = plane->width,
                                .height = plane->height,
                                .stride_bytes = plane->stride,
                                .format = FOVEA_PIXEL_GREY8,
                                .size_bytes = (size_t)plane->stride * (size_t)plane->height};
}

bool fv_seen_luma(const struct fv_seen *seen, enum fv_viewer viewer, struct fovea_image *before,
                  struct fovea_image *after)
{
    if (!sees(seen, viewer)) return false;
    const bool main_sees = sees(seen, FV_VIEWER_FEATURES);
    *before = grey_of(main_sees ? &seen->other.level[0] : &seen->main.level[0]);
    *after = grey_of(main_sees ? &seen->main.level[0] : &seen->other.level[0]);
    return true;
}

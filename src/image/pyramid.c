#include "image/pyramid.h"

#include "image/grey.h"

float fv_pyramid_scale(uint32_t level)
{
    static const float scale[FOVEA_PYRAMID_LEVELS_MAX] = {1.0f,    1.2f,     1.44f,     1.728f,
                                                          2.0736f, 2.48832f, 2.985984f, 3.5831808f};
    return scale[level < FOVEA_PYRAMID_LEVELS_MAX ? level : FOVEA_PYRAMID_LEVELS_MAX - 1];
}

int32_t fv_pyramid_scale_q16(uint32_t level)
{
    static const int32_t scale[FOVEA_PYRAMID_LEVELS_MAX] = {65536,  78643,  94372,  113246,
                                                            135895, 163074, 195689, 234827};
    return scale[level];
}

int32_t fv_pyramid_next(int32_t pixels)
{
    const int32_t rest = pixels % 6;
    return pixels / 6 * 5 + (rest > 0 ? rest - 1 : 0);
}

void fv_pyramid_carve(struct fv_pyramid *pyramid, int32_t width, int32_t height, uint32_t levels,
                      struct fv_arena *frame)
{
    const int32_t line = FV_CACHE_LINE_BYTES;
    pyramid->levels = levels;
    for (uint32_t i = 0; i < levels; i++) {
        struct fv_plane *level = &pyramid->level[i];
        level->width = i == 0 ? width : fv_pyramid_next(level[-1].width);
        level->height = i == 0 ? height : fv_pyramid_next(level[-1].height);
        level->stride = (level->width + FV_LEVEL_SLACK_BYTES + line - 1) / line * line;
        level->pixels = fv_arena_take(frame, (size_t)level->height, (size_t)level->stride);
    }
    pyramid->row = fv_arena_take(frame, 1, (size_t)pyramid->level[0].stride + FV_LEVEL_SLACK_BYTES);
}

static void shrink(const struct fv_kernels *kernels, const struct fv_plane *from,
                   const struct fv_plane *to, uint8_t *row)
{
    static const uint8_t weight[5] = {13, 38, 64, 90, 115};
    for (int32_t y = 0; y < to->height; y++) {
        const uint8_t *above = from->pixels + (ptrdiff_t)(y + y / 5) * from->stride;
        kernels->blend_rows_u8(row, above, above + from->stride, from->width, weight[y % 5]);
        kernels->shrink_row_u8(to->pixels + (ptrdiff_t)y * to->stride, row, to->width);
    }
}

void fv_pyramid_build(struct fv_pyramid *pyramid, const struct fv_kernels *kernels,
                      const struct fovea_image *frame)
{
    fv_grey_convert(&pyramid->level[0], kernels, frame);
    fv_pyramid_shrink(pyramid, kernels);
}

void fv_pyramid_shrink(struct fv_pyramid *pyramid, const struct fv_kernels *kernels)
{
    for (uint32_t i = 1; i < pyramid->levels; i++)
        shrink(kernels, &pyramid->level[i - 1], &pyramid->level[i], pyramid->row);
}

#include "image/rectify.h"

#include <string.h>

#include "base/elementary.h"

enum { FRACTION = 64, COLUMN_MAX = 14, ROW_MAX = 2 };

bool fv_rectified_to_raw(const struct fv_rectified *rectified, const struct fovea_camera *camera,
                         double x_px, double y_px, double raw_px[2])
{
    const double x = (x_px - rectified->cx) / rectified->fx,
                 y = (y_px - rectified->cy) / rectified->fy;
    const double pinhole[3] = {x, y, 1.0};
    if (rectified->shape == FV_RECTIFIED_PINHOLE)
        return fovea_camera_project(camera, pinhole, raw_px, NULL) == FOVEA_OK;
    if (x < -FV_PI || x > FV_PI) return false;
    const double cylinder[3] = {fv_sin(x), y, fv_cos(x)};
    return fovea_camera_project(camera, cylinder, raw_px, NULL) == FOVEA_OK;
}

/* One output pixel's position in the raw image in 1/64 pixel. False: outside. The image reaches
 * half a pixel beyond the outermost pixel centres; there the outermost pixels are repeated. */
static bool position_of(const struct fv_rectified *rectified, const struct fovea_camera *camera,
                        int32_t x, int32_t y, int32_t position[2])
{
    double raw[2];
    const int32_t size[2] = {camera->width, camera->height};
    if (x >= rectified->width || !fv_rectified_to_raw(rectified, camera, x, y, raw)) return false;
    for (int i = 0; i < 2; i++) {
        const double at = raw[i] * FRACTION + 0.5;
        if (!(at >= -0.5 * FRACTION && at <= (size[i] - 0.5) * FRACTION)) return false;
        const int32_t whole = (int32_t)fv_floor(at), last = (size[i] - 1) * FRACTION - 1;
        position[i] = whole < 0 ? 0 : whole > last ? last : whole;
    }
    return true;
}

struct fv_positions {
    bool inside[FV_REMAP_BLOCK];
    int32_t at[FV_REMAP_BLOCK][2]; /* 1/64 pixels */
};

static void block_positions(const struct fv_rectified *rectified, const struct fovea_camera *camera,
                            int32_t x, int32_t y, struct fv_positions *positions)
{
    for (int i = 0; i < FV_REMAP_BLOCK; i++)
        positions->inside[i] = position_of(rectified, camera, x + i, y, positions->at[i]);
}

/* Fit the positions into a window. False: they do not. */
static bool fill_window(const struct fovea_camera *camera, const struct fv_positions *positions,
                        struct fv_remap_block *block)
{
    int32_t low[2] = {camera->width - FV_REMAP_WINDOW_COLUMNS,
                      camera->height - FV_REMAP_WINDOW_ROWS};
    for (int i = 0; i < FV_REMAP_BLOCK; i++)
        for (int k = 0; k < 2; k++)
            if (positions->inside[i] && positions->at[i][k] / FRACTION < low[k])
                low[k] = positions->at[i][k] / FRACTION;
    memset(block, 0, sizeof *block);
    block->x = (int16_t)low[0];
    block->y = (int16_t)low[1];
    for (int i = 0; i < FV_REMAP_BLOCK; i++) {
        static const uint8_t row_bits[ROW_MAX + 1] = {0, FV_REMAP_ROW_1,
                                                      FV_REMAP_ROW_1 | FV_REMAP_ROW_2};
        if (!positions->inside[i]) {
            block->at[i] = FV_REMAP_OUTSIDE;
            continue;
        }
        const int32_t column = positions->at[i][0] / FRACTION - low[0],
                      row = positions->at[i][1] / FRACTION - low[1];
        if (column > COLUMN_MAX || row > ROW_MAX) return false;
        block->at[i] = (uint8_t)(column | row_bits[row]);
        block->fx[i] = (uint8_t)(positions->at[i][0] % FRACTION);
        block->fy[i] = (uint8_t)(positions->at[i][1] % FRACTION);
    }
    return true;
}

static void fill_scattered(const struct fv_positions *positions, struct fv_remap_pixel *pixels)
{
    for (int i = 0; i < FV_REMAP_BLOCK; i++) {
        const struct fv_remap_pixel outside = {-1, 0, 0, 0};
        pixels[i] = outside;
        if (!positions->inside[i]) continue;
        pixels[i].x = (int16_t)(positions->at[i][0] / FRACTION);
        pixels[i].y = (int16_t)(positions->at[i][1] / FRACTION);
        pixels[i].fx = (uint8_t)(positions->at[i][0] % FRACTION);
        pixels[i].fy = (uint8_t)(positions->at[i][1] % FRACTION);
    }
}

/* Go through the map: count the scattered pixels, and fill in what has memory. */
static uint32_t fill_map(const struct fv_rectify *rectify, const struct fovea_camera *camera)
{
    uint32_t scattered = 0;
    for (int32_t y = 0; y < rectify->rectified.height; y++) {
        for (int32_t k = 0; k < rectify->blocks_per_row; k++) {
            struct fv_positions positions;
            struct fv_remap_block block;
            block_positions(&rectify->rectified, camera, k * FV_REMAP_BLOCK, y, &positions);
            if (!fill_window(camera, &positions, &block)) {
                memset(&block, 0, sizeof block);
                block.first = scattered;
                block.y = FV_REMAP_SCATTERED;
                if (rectify->scattered != NULL)
                    fill_scattered(&positions, rectify->scattered + scattered);
                scattered += FV_REMAP_BLOCK;
            }
            if (rectify->blocks != NULL)
                rectify->blocks[(size_t)y * (size_t)rectify->blocks_per_row + (size_t)k] = block;
        }
    }
    return scattered;
}

void fv_rectify_carve(struct fv_rectify *rectify, const struct fovea_camera *camera,
                      const struct fv_rectified *rectified, struct fv_arena *persistent)
{
    *rectify = (struct fv_rectify){.rectified = *rectified};
    rectify->blocks_per_row = (rectified->width + FV_REMAP_BLOCK - 1) / FV_REMAP_BLOCK;
    rectify->stride_bytes =
        (rectified->width + FV_CACHE_LINE_BYTES - 1) / FV_CACHE_LINE_BYTES * FV_CACHE_LINE_BYTES;
    rectify->scattered_count = fill_map(rectify, camera);
    rectify->blocks =
        fv_arena_take_raw(persistent, (size_t)rectified->height * (size_t)rectify->blocks_per_row,
                          sizeof *rectify->blocks);
    rectify->scattered =
        fv_arena_take_raw(persistent, rectify->scattered_count, sizeof *rectify->scattered);
    if (rectify->blocks != NULL) fill_map(rectify, camera);
}

void fv_rectify_run(const struct fv_rectify *rectify, const struct fv_kernels *kernels,
                    const struct fv_plane *source, const struct fv_plane *out)
{
    for (int32_t y = 0; y < rectify->rectified.height; y++)
        kernels->remap_row_u8(fv_plane_row(out, y), source->pixels, source->stride,
                              rectify->blocks + (ptrdiff_t)y * rectify->blocks_per_row,
                              rectify->blocks_per_row, rectify->scattered);
}

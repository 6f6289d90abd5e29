#include "features/orb.h"

#include <string.h>

#include "fovea/elementary.h"

enum { REACH_PX = 18 }; /* of the samples: 13 sqrt(2), rounded */

void fv_orb_carve(struct fv_orb *orb, uint32_t count_max, const struct fv_pyramid *pyramid,
                  struct fv_arena *frame)
{
    const struct fv_level *largest = &pyramid->level[0];
    orb->count_max = count_max;
    orb->angle_rad = fv_arena_take(frame, count_max, sizeof *orb->angle_rad);
    orb->descriptors = fv_arena_take(frame, count_max, FV_DESCRIPTOR_BYTES);
    orb->smooth = fv_arena_take_raw(frame, (size_t)largest->height, (size_t)largest->stride_bytes);
    orb->row_needed = fv_arena_take(frame, (size_t)largest->height, 1);
    orb->row = fv_arena_take_raw(frame, (size_t)largest->width + FV_BLUR7_PAD, sizeof *orb->row);
    orb->centres = fv_arena_take(frame, count_max, sizeof *orb->centres);
    orb->moments = fv_arena_take(frame, 2 * (size_t)count_max, sizeof *orb->moments);
}

float fv_orb_angle(int32_t m10, int32_t m01)
{
    return (float)fovea_atan2(m01, m10);
}

void fv_orb_steer(float angle_rad, int32_t stride_bytes, int32_t offsets[FV_ORB_SAMPLES])
{
    /* Adding and subtracting 1.5 x 2^23 rounds to the nearest whole number, ties to even. */
    const float rounder = 12582912.0f, stride = (float)stride_bytes;
    const float c = (float)fovea_cos(angle_rad), s = (float)fovea_sin(angle_rad);
    const float *px = fv_orb_pattern[0], *py = fv_orb_pattern[1];
    for (int i = 0; i < FV_ORB_SAMPLES; i++) {
        const float x = (px[i] * c - py[i] * s + rounder) - rounder;
        const float y = (px[i] * s + py[i] * c + rounder) - rounder;
        offsets[i] = (int32_t)(y * stride + x); /* exact: below 2^24 */
    }
}

/* Row y of a level with rows outside reflected at the border, the edge not repeated. */
static const uint8_t *reflected_row(const struct fv_level *level, int32_t y)
{
    if (y < 0) y = -y;
    if (y >= level->height) y = 2 * level->height - 2 - y;
    return level->pixels + (ptrdiff_t)y * level->stride_bytes;
}

static void smooth_needed(struct fv_orb *orb, const struct fv_kernels *kernels, const struct fv_level *level,
                          const struct fv_corner *corners, uint32_t count)
{
    memset(orb->row_needed, 0, (size_t)level->height);
    for (uint32_t i = 0; i < count; i++)
        memset(orb->row_needed + corners[i].y - REACH_PX, 1, 2 * REACH_PX + 1);
    for (int32_t y = 0; y < level->height; y++) {
        if (!orb->row_needed[y]) continue;
        const uint8_t *rows[2 * FV_BLUR7_RADIUS + 1];
        for (int i = 0; i <= 2 * FV_BLUR7_RADIUS; i++)
            rows[i] = reflected_row(level, y + i - FV_BLUR7_RADIUS);
        kernels->blur7_row_u8(orb->smooth + (ptrdiff_t)y * level->stride_bytes, rows, level->width, orb->row);
    }
}

/* Corners of one level, whose results go to the same places of `angle_rad` and `descriptors`. */
static void describe_level(struct fv_orb *orb, const struct fv_kernels *kernels, const struct fv_level *level,
                           const struct fv_corner *corners, uint32_t count, float *angle_rad,
                           uint8_t *descriptors)
{
    int32_t offsets[FV_ORB_SAMPLES];
    for (uint32_t i = 0; i < count; i++)
        orb->centres[i] = corners[i].y * level->stride_bytes + corners[i].x;
    kernels->moments_u8(orb->moments, level->pixels, level->stride_bytes, orb->centres, (int32_t)count);
    smooth_needed(orb, kernels, level, corners, count);
    for (uint32_t i = 0; i < count; i++) {
        angle_rad[i] = fv_orb_angle(orb->moments[2 * i], orb->moments[2 * i + 1]);
        fv_orb_steer(angle_rad[i], level->stride_bytes, offsets);
        kernels->brief_u8(descriptors + (size_t)i * FV_DESCRIPTOR_BYTES, orb->smooth + orb->centres[i],
                          offsets, offsets + FV_BRIEF_BITS);
    }
}

void fv_orb_describe(struct fv_orb *orb, const struct fv_kernels *kernels, const struct fv_pyramid *pyramid,
                     const struct fv_corner *corners, uint32_t count)
{
    for (uint32_t start = 0, end; start < count; start = end) {
        const uint8_t level = corners[start].level;
        for (end = start + 1; end < count && corners[end].level == level;)
            end++;
        describe_level(orb, kernels, &pyramid->level[level], corners + start, end - start,
                       orb->angle_rad + start, orb->descriptors + (size_t)start * FV_DESCRIPTOR_BYTES);
    }
}

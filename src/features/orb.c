#include "features/orb.h"

#include <string.h>

#include "base/elementary.h"

enum {
    REACH_PX = 18, /* of the samples: 13 sqrt(2), rounded */
    GROUP = 32     /* corners at a time */
};

void fv_orb_carve(struct fv_orb *orb, uint32_t count_max, const struct fv_pyramid *pyramid,
                  struct fv_arena *frame)
{
    const struct fv_plane *largest = &pyramid->level[0];
    orb->count_max = count_max;
    orb->angle_rad = fv_arena_take(frame, count_max, sizeof *orb->angle_rad);
    orb->descriptors = fv_arena_take(frame, count_max, FV_DESCRIPTOR_BYTES);
    orb->turned = fv_arena_take_raw(frame, FV_ORB_QUARTER, sizeof *orb->turned);
    orb->turned_ready = false;
    orb->upright = false;
    orb->smooth = fv_arena_take_raw(frame, (size_t)largest->height, (size_t)largest->stride);
    orb->row_needed = fv_arena_take(frame, (size_t)largest->height, 1);
    orb->row = fv_arena_take_raw(frame, (size_t)largest->width + FV_BLUR7_PAD, sizeof *orb->row);
}

uint8_t fv_orb_direction(int32_t m10, int32_t m01)
{
    /* 2^30 tan((j + 1/2) 2 pi / 256): where direction j of the first octant gives way to j + 1. */
    static const int32_t bounds[FV_ORB_DIRECTIONS / 8] = {
        13177456,  39548253,  65966781,  92465117,  119075726, 145831619, 172766522, 199915050,
        227312888, 254996985, 283005767, 311379359, 340159828, 369391456, 399121027, 429398159,
        460275657, 491809923, 524061402, 557095091, 590981117, 625795381, 661620305, 698545681,
        736669642, 776099788, 816954487, 859364383, 903474163, 949444628, 997455123, 1047706430,
    };
    const int64_t x = m10 < 0 ? -(int64_t)m10 : m10, y = m01 < 0 ? -(int64_t)m01 : m01;
    const int64_t large = x > y ? x : y, small = x > y ? y : x;
    int direction = 0; /* how many bounds lie below small / large */
    for (int step = FV_ORB_DIRECTIONS / 16; step > 0; step /= 2)
        if (small << 30 > bounds[direction + step - 1] * large) direction += step;
    if (direction == FV_ORB_DIRECTIONS / 8 - 1 && small << 30 > bounds[direction] * large)
        direction++;
    if (y > x) direction = FV_ORB_QUARTER - direction;
    if (m10 < 0) direction = 2 * FV_ORB_QUARTER - direction;
    return (uint8_t)(m01 < 0 ? -direction : direction);
}

float fv_orb_angle(uint8_t direction)
{
    const int turned =
        direction > FV_ORB_DIRECTIONS / 2 ? direction - FV_ORB_DIRECTIONS : direction;
    return (float)(turned * (2.0 * FV_PI / FV_ORB_DIRECTIONS));
}

void fv_orb_turn(float angle_rad, struct fv_orb_pattern *turned)
{
    /* Adding and subtracting 1.5 x 2^23 rounds to the nearest whole number, ties to even. */
    const float rounder = 12582912.0f;
    const float c = (float)fv_cos(angle_rad), s = (float)fv_sin(angle_rad);
    for (int i = 0; i < FV_ORB_SAMPLES; i++) {
        const float x = fv_orb_places[0][i], y = fv_orb_places[1][i];
        turned->xy[2 * i] = (int8_t)((x * c - y * s + rounder) - rounder);
        turned->xy[2 * i + 1] = (int8_t)((x * s + y * c + rounder) - rounder);
    }
}

static void fill_turned(struct fv_orb *orb)
{
    for (int i = 0; i < FV_ORB_QUARTER; i++)
        fv_orb_turn(fv_orb_angle((uint8_t)i), &orb->turned[i]);
    orb->turned_ready = true;
}

/* Row y of a level with rows outside reflected at the border, the edge not repeated. */
static const uint8_t *reflected_row(const struct fv_plane *level, int32_t y)
{
    if (y < 0) y = -y;
    if (y >= level->height) y = 2 * level->height - 2 - y;
    return level->pixels + (ptrdiff_t)y * level->stride;
}

/* Flag the rows that descriptors will sample. */
static void mark_rows(struct fv_orb *orb, const struct fv_plane *level,
                      const struct fv_corner *corners, uint32_t count)
{
    memset(orb->row_needed, 0, (size_t)level->height);
    for (uint32_t i = 0; i < count; i++)
        memset(orb->row_needed + corners[i].y - REACH_PX, 1, 2 * REACH_PX + 1);
}

/* Smooth the flagged ones of the rows [from, to). */
static void smooth_rows(struct fv_orb *orb, const struct fv_kernels *kernels,
                        const struct fv_plane *level, int32_t from, int32_t to)
{
    for (int32_t y = from; y < to; y++) {
        if (!orb->row_needed[y]) continue;
        const uint8_t *rows[2 * FV_BLUR7_RADIUS + 1];
        for (int i = 0; i <= 2 * FV_BLUR7_RADIUS; i++)
            rows[i] = reflected_row(level, y + i - FV_BLUR7_RADIUS);
        kernels->blur7_row_u8(orb->smooth + (ptrdiff_t)y * level->stride, rows, level->width,
                              orb->row);
    }
}

/* Further quarter turns take (x, y) to (-y, x), so they change what a step in x and in y means. */
static void describe_one(const struct fv_orb *orb, const struct fv_kernels *kernels,
                         const uint8_t *centre, int32_t stride, uint8_t direction,
                         uint8_t *descriptor)
{
    const int32_t along[4] = {1, stride, -1, -stride}, across[4] = {stride, -1, -stride, 1};
    const int quarter = direction / FV_ORB_QUARTER;
    kernels->brief_u8(descriptor, centre, orb->turned[direction % FV_ORB_QUARTER].xy,
                      along[quarter], across[quarter]);
}

/* Corners of one level, whose results go to the same positions of `angle_rad` and `descriptors`.
 * They come roughly from top to bottom: in small groups, and with no more smoothed than the group
 * needs, all stays in the nearest cache. */
static void describe_level(struct fv_orb *orb, const struct fv_kernels *kernels,
                           const struct fv_plane *level, const struct fv_corner *corners,
                           uint32_t count, float *angle_rad, uint8_t *descriptors)
{
    int32_t centres[GROUP], moments[2 * GROUP], smoothed = 0;
    mark_rows(orb, level, corners, count);
    for (uint32_t start = 0; start < count; start += GROUP) {
        const int group = count - start < GROUP ? (int)(count - start) : GROUP;
        int32_t end = smoothed;
        for (int i = 0; i < group; i++) {
            const struct fv_corner *corner = &corners[start + (uint32_t)i];
            centres[i] = corner->y * level->stride + corner->x;
            if (end < corner->y + REACH_PX + 1) end = corner->y + REACH_PX + 1;
        }
        smooth_rows(orb, kernels, level, smoothed, end);
        smoothed = end;
        kernels->moments_u8(moments, level->pixels, level->stride, centres, group);
        for (int i = 0; i < group; i++) {
            const uint32_t k = start + (uint32_t)i;
            const uint8_t direction =
                orb->upright ? 0 : fv_orb_direction(moments[2 * i], moments[2 * i + 1]);
            angle_rad[k] = fv_orb_angle(direction);
            describe_one(orb, kernels, orb->smooth + centres[i], level->stride, direction,
                         descriptors + (size_t)k * FV_DESCRIPTOR_BYTES);
        }
    }
}

void fv_orb_describe(struct fv_orb *orb, const struct fv_kernels *kernels,
                     const struct fv_pyramid *pyramid, const struct fv_corner *corners,
                     uint32_t count)
{
    if (!orb->turned_ready) fill_turned(orb);
    for (uint32_t start = 0, end; start < count; start = end) {
        const uint8_t level = corners[start].level;
        for (end = start + 1; end < count && corners[end].level == level;)
            end++;
        describe_level(orb, kernels, &pyramid->level[level], corners + start, end - start,
                       orb->angle_rad + start,
                       orb->descriptors + (size_t)start * FV_DESCRIPTOR_BYTES);
    }
}

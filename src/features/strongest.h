/* The strongest of many corners: a heap of fixed size. Corners are ordered by response, of equals
 * the earlier in raster order comes first. */
#ifndef FOVEA_FEATURES_STRONGEST_H
#define FOVEA_FEATURES_STRONGEST_H

#include <stdint.h>

#include "base/arena.h"

struct fv_strongest {
    uint64_t *keys; /* the weakest first, until they are sorted */
    uint32_t room, count;
};

/* Take memory for `room` corners. Init-only. */
void fv_strongest_carve(struct fv_strongest *strongest, uint32_t room, struct fv_arena *arena);

void fv_strongest_begin(struct fv_strongest *strongest);

/* Offer a corner, x and y in [0, 65535], response above 0. Time: at most the logarithm of the room.
 */
void fv_strongest_offer(struct fv_strongest *strongest, uint32_t response, int32_t x, int32_t y);

/* Sort, the strongest first; then fv_strongest_x and _y say where corner i < count is. */
void fv_strongest_sort(struct fv_strongest *strongest);

static inline int32_t fv_strongest_x(const struct fv_strongest *strongest, uint32_t i)
{
    return (int32_t)(~(uint32_t)strongest->keys[i] & 65535);
}

static inline int32_t fv_strongest_y(const struct fv_strongest *strongest, uint32_t i)
{
    return (int32_t)(~(uint32_t)strongest->keys[i] >> 16);
}

static inline uint32_t fv_strongest_response(const struct fv_strongest *strongest, uint32_t i)
{
    return (uint32_t)(strongest->keys[i] >> 32);
}

#endif

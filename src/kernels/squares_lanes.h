/* The last step of fv_k_squares_two_u8 for variants that keep the nearest and the second of every
 * lane: of all lanes. */
#ifndef FOVEA_KERNELS_SQUARES_LANES_H
#define FOVEA_KERNELS_SQUARES_LANES_H

#include <stdint.h>

static inline void squares_finish(const int32_t *best, const int32_t *next, const int32_t *at,
                                  int32_t lanes, int32_t *nearest, int32_t *second, uint32_t *index)
{
    int32_t chosen = 0;
    for (int32_t i = 1; i < lanes; i++)
        if (best[i] < best[chosen] || (best[i] == best[chosen] && at[i] < at[chosen])) chosen = i;
    int32_t other = next[chosen];
    for (int32_t i = 0; i < lanes; i++)
        if (i != chosen && best[i] < other) other = best[i];
    *nearest = best[chosen];
    *second = other;
    *index = (uint32_t)at[chosen];
}

#endif

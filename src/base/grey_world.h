/* White balance by the grey world assumption (Buchsbaum, A spatial processor model for object
 * colour perception, Journal of the Franklin Institute 310, 1980): the mean colour of an image is
 * taken to be grey. Integer arithmetic only. */
#ifndef FOVEA_BASE_GREY_WORLD_H
#define FOVEA_BASE_GREY_WORLD_H

#include <stdint.h>

/* A level of a channel after balancing: level times mean of all channels / mean of the channel,
 * rounded half up, at most 255. `own`: sum of the channel; `all`: of the three, at most 2^52. A
 * channel that is black stays so. */
static inline uint8_t fv_grey_world(uint32_t level, uint64_t own, uint64_t all)
{
    const uint64_t balanced = own == 0 ? level : (2 * level * all + 3 * own) / (6 * own);
    return (uint8_t)(balanced > 255 ? 255 : balanced);
}

#endif

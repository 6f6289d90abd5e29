/* Helpers of robust sampling (M. Fischler and R. Bolles, "Random sample consensus", 1981).
 * Real-time safe. */
#ifndef FOVEA_GEOMETRY_SAMPLE_H
#define FOVEA_GEOMETRY_SAMPLE_H

#include <stdint.h>

#include "base/elementary.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { FV_SAMPLE_SIZE_MAX = 8 };

/* `size` different numbers below `count` (count >= size), in random order. */
void fv_sample_distinct(struct fv_random *random, uint32_t count, uint32_t size, uint32_t *index);

/* Probability that one sample holds inliers only, of every search for a first map or a closure. */
#define FV_SAMPLE_CONFIDENCE 0.999

/* Samples needed so that, with probability `confidence`, one holds inliers only; at least 4, at
 * most 1000000.
 */
uint32_t fv_sample_bound(double inlier_fraction, uint32_t size, double confidence);

#ifdef __cplusplus
}
#endif
#endif

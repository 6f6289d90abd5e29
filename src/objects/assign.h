/* Optimal assignment in fixed memory: rows to columns at least total cost, each at most once; a
 * pair may be forbidden.
 *
 * The Hungarian method with shortest augmenting paths and potentials (Jonker and Volgenant,
 * Computing 38, 1987, without their starting heuristics): O(rows^2 columns) at most, near rows x
 * columns when most rows have a column of their own. A pair of cost 1 or more is as good as none,
 * so the result maximises the sum of (1 - cost) over the pairs that it makes. */
#ifndef FOVEA_OBJECTS_ASSIGN_H
#define FOVEA_OBJECTS_ASSIGN_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum { FV_ASSIGN_MAX = 300 }; /* rows and columns */

struct fv_assign_scratch {
    double row_potential[FV_ASSIGN_MAX + 1], column_potential[FV_ASSIGN_MAX + 1],
        least[FV_ASSIGN_MAX + 1];
    int32_t row_of[FV_ASSIGN_MAX + 1], way[FV_ASSIGN_MAX + 1];
    uint8_t used[FV_ASSIGN_MAX + 1];
};

/* cost[r stride + c] in [0, 1], r < rows, c < columns, both at most FV_ASSIGN_MAX; 1: forbidden.
 * column_of[r] takes the row's column, or -1. Ties go to the lower numbers. Real-time safe. */
void fv_assign(const float *cost, int32_t stride, int32_t rows, int32_t columns,
               struct fv_assign_scratch *scratch, int32_t *column_of);

#ifdef __cplusplus
}
#endif
#endif

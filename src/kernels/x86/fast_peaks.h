/* Columns of peaks for a set whose file defines FAST_LANES pixels of a group, of which peaks()
 * gives those that are greater than their neighbours, a bit each, and has_scores() whether any is
 * not 0. */
#ifndef FOVEA_KERNELS_X86_FAST_PEAKS_H
#define FOVEA_KERNELS_X86_FAST_PEAKS_H

#include <stdint.h>

enum { PEAKS_STRETCH = 1024 }; /* pixels whose groups are listed at once */

static inline uint32_t peaks(const uint8_t *above, const uint8_t *row, const uint8_t *below);
static inline int has_scores(const uint8_t *row);

/* Lists of groups instead of branches: of those with scores, then of those with peaks. */
static int32_t peaks_of_stretch(uint16_t *columns, const uint8_t *above, const uint8_t *row,
                                const uint8_t *below, int32_t from, int32_t to)
{
    int32_t groups[PEAKS_STRETCH / FAST_LANES + 1], scored = 0, peaked = 0, found = 0;
    uint32_t of_group[PEAKS_STRETCH / FAST_LANES + 1];
    for (int32_t i = from; i < to; i += FAST_LANES) {
        groups[scored] = i;
        scored += has_scores(row + i);
    }
    for (int32_t k = 0; k < scored; k++) {
        const int32_t i = groups[k];
        const uint32_t within = to - i < FAST_LANES ? (1u << (to - i)) - 1u : UINT32_MAX;
        groups[peaked] = i;
        of_group[peaked] = peaks(above + i, row + i, below + i) & within;
        peaked += of_group[peaked] != 0;
    }
    for (int32_t k = 0; k < peaked; k++)
        for (uint32_t left = of_group[k]; left != 0; left &= left - 1)
            columns[found++] = (uint16_t)(groups[k] + __builtin_ctz(left));
    return found;
}

static inline int32_t peaks_of_row(uint16_t *columns, const uint8_t *above, const uint8_t *row,
                                   const uint8_t *below, int32_t from, int32_t to)
{
    int32_t found = 0;
    for (int32_t i = from; i < to; i += PEAKS_STRETCH)
        found += peaks_of_stretch(columns + found, above, row, below, i,
                                  to - i < PEAKS_STRETCH ? to : i + PEAKS_STRETCH);
    return found;
}

#endif

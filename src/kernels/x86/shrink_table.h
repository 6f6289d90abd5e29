/* Shared by the x86 variants of shrink_row_u8: eight outputs, as eight pairs of neighbouring inputs
 * for pshufb and their weights for pmaddubsw. Row r serves outputs that start at 8 r (mod 40); rows
 * 5 to 7 repeat 0 to 2, so that up to four rows from any of the first five can be loaded at once.
 * Input indices count from that of the first output. */
#ifndef FOVEA_KERNELS_X86_SHRINK_TABLE_H
#define FOVEA_KERNELS_X86_SHRINK_TABLE_H

#include <stdint.h>

/* Start phases (first output mod 5) of rows 0 to 4: 0, 3, 1, 4, 2. After an output of phase 4 one
 * input is passed over. */
#define PAIRS_0 0, 1, 1, 2, 2, 3, 3, 4, 4, 5, 6, 7, 7, 8, 8, 9
#define PAIRS_3 0, 1, 1, 2, 3, 4, 4, 5, 5, 6, 6, 7, 7, 8, 9, 10
#define PAIRS_1 0, 1, 1, 2, 2, 3, 3, 4, 5, 6, 6, 7, 7, 8, 8, 9
#define PAIRS_4 0, 1, 2, 3, 3, 4, 4, 5, 5, 6, 6, 7, 8, 9, 9, 10
#define PAIRS_2 0, 1, 1, 2, 2, 3, 4, 5, 5, 6, 6, 7, 7, 8, 8, 9
static const uint8_t shrink_pairs[8][16] = {{PAIRS_0}, {PAIRS_3}, {PAIRS_1}, {PAIRS_4},
                                            {PAIRS_2}, {PAIRS_0}, {PAIRS_3}, {PAIRS_1}};

#define W0 115, 13
#define W1 90, 38
#define W2 64, 64
#define W3 38, 90
#define W4 13, 115
static const int8_t shrink_weights[8][16] = {
    {W0, W1, W2, W3, W4, W0, W1, W2}, {W3, W4, W0, W1, W2, W3, W4, W0},
    {W1, W2, W3, W4, W0, W1, W2, W3}, {W4, W0, W1, W2, W3, W4, W0, W1},
    {W2, W3, W4, W0, W1, W2, W3, W4}, {W0, W1, W2, W3, W4, W0, W1, W2},
    {W3, W4, W0, W1, W2, W3, W4, W0}, {W1, W2, W3, W4, W0, W1, W2, W3}};

#endif

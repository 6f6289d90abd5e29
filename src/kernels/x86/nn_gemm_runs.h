/* The matrix product on bytes with sums of 16 bits: which groups of four k run together. pmaddubsw
 * multiplies four neighbouring inputs by the weights of a channel and adds pairs of products in 16
 * bits, which saturate. These sums are added in 16 bits over the groups of a run, and pmaddwd
 * widens them once for the run. A group that saturates alone is multiplied as 16-bit values, even
 * and odd k apart, into sums of 32 bits.
 *
 * How far a run may go is found for each block of 16 channels and chunk of rows, from the largest
 * value that each k has in these rows. For each sum there are two bounds: `above`, the sum of the
 * products of the largest values with the positive weights, and `below`, with the negative ones.
 * Inputs are not negative, so a product with a positive weight lies between 0 and its part of
 * `above`, one with a negative weight between its part of `below` and 0. Therefore the sum of any
 * of the run's products, in any order and for any of these rows, lies between `below` and `above`:
 * where both fit 16 bits, no pair and no partial sum saturates or wraps, and the result is exact.
 * The bounds are added with saturation; one that is at an end of the range counts as full. To find
 * the runs costs as much as three or four rows of the product.
 *
 * The file that includes this page defines VECTOR, OP(name), the intrinsic of that name for it, and
 * WHOLE(name), one for all its bits. */
#ifndef FOVEA_KERNELS_X86_NN_GEMM_RUNS_H
#define FOVEA_KERNELS_X86_NN_GEMM_RUNS_H

#include "kernels/kernels.h"

enum {
    ROWS = 4, /* of a tile */
    CHUNK_ROWS = 128,
    CHUNK_ROWS_MAX = CHUNK_ROWS + ROWS,
    GROUPS_MAX = 3072,
    VECTOR_BYTES = sizeof(VECTOR),
    PARTS = 64 / VECTOR_BYTES /* vectors that hold the weights of a group */
};

/* The weights of 16 channels, and their groups of four k: from the front those that run together,
 * with the end of each run; from the back those that are multiplied as 16-bit values. */
struct panel {
    const int8_t *weights;
    int32_t run_count, wide_count;
    uint16_t groups[GROUPS_MAX], end[GROUPS_MAX];
};

/* The largest value of each k over some rows. */
struct maxima {
    uint8_t of[4 * GROUPS_MAX + VECTOR_BYTES];
};

static void init_maxima(struct maxima *most, int32_t k, const uint8_t *a, ptrdiff_t lda,
                        int32_t rows)
{
    for (int32_t i = 0; i < k; i += VECTOR_BYTES) {
        const uint8_t *from = a + i;
        VECTOR v = WHOLE(setzero)();
        for (int32_t r = 0; r < rows; r++, from += lda)
            v = OP(max_epu8)(v, WHOLE(loadu)((const VECTOR *)(const void *)from));
        WHOLE(storeu)((VECTOR *)(void *)(most->of + i), v);
    }
}

/* The sums of the positive products of a run, and of its negative ones, as far as they can go. */
struct reach {
    VECTOR above[PARTS], below[PARTS];
};

FV_INLINE void clear(struct reach *r)
{
    for (int i = 0; i < PARTS; i++)
        r->above[i] = r->below[i] = WHOLE(setzero)();
}

FV_INLINE void reach_of(struct reach *r, VECTOR most, const int8_t *weights)
{
    const VECTOR zero = WHOLE(setzero)();
    for (int i = 0; i < PARTS; i++) {
        const void *from = weights + i * VECTOR_BYTES;
        const VECTOR w = WHOLE(loadu)((const VECTOR *)from);
        r->above[i] = OP(maddubs_epi16)(most, OP(max_epi8)(w, zero));
        r->below[i] = OP(maddubs_epi16)(most, OP(min_epi8)(w, zero));
    }
}

FV_INLINE void extend(struct reach *r, const struct reach *by)
{
    for (int i = 0; i < PARTS; i++) {
        r->above[i] = OP(adds_epi16)(r->above[i], by->above[i]);
        r->below[i] = OP(adds_epi16)(r->below[i], by->below[i]);
    }
}

/* Whether one of the sums may have saturated. */
FV_INLINE int is_full(const struct reach *r)
{
    VECTOR top = r->above[0], bottom = r->below[0];
    for (int i = 1; i < PARTS; i++) {
        top = OP(max_epi16)(top, r->above[i]);
        bottom = OP(min_epi16)(bottom, r->below[i]);
    }
    const VECTOR full = WHOLE(or)(OP(cmpeq_epi16)(top, OP(set1_epi16)(INT16_MAX)),
                                  OP(cmpeq_epi16)(bottom, OP(set1_epi16)(INT16_MIN)));
    return !WHOLE(testz)(full, full);
}

static void init_panel(struct panel *p, const int8_t *weights, int32_t k4,
                       const struct maxima *most)
{
    struct reach run;
    int32_t count = 0, begin = 0;
    clear(&run);
    p->weights = weights;
    p->run_count = p->wide_count = 0;
    for (int32_t i = 0; i < k4; i++, weights += 64) {
        struct reach own;
        reach_of(&own, four_inputs(most->of + 4 * (ptrdiff_t)i), weights);
        extend(&run, &own);
        if (is_full(&run)) {
            if (count > begin) p->end[p->run_count++] = (uint16_t)count;
            begin = count;
            run = own;
            if (is_full(&own)) {
                p->groups[GROUPS_MAX - ++p->wide_count] = (uint16_t)i;
                clear(&run);
                continue;
            }
        }
        p->groups[count++] = (uint16_t)i;
    }
    if (count > begin) p->end[p->run_count++] = (uint16_t)count;
}

/* Rows that run together, at most CHUNK_ROWS_MAX: all, or fewer that leave a whole tile. */
static int32_t next_rows(int32_t left)
{
    return left <= CHUNK_ROWS_MAX ? left : CHUNK_ROWS;
}

/* Where the tile at `row` begins: the last one of `rows` overlaps the one before. */
FV_INLINE int32_t tile_row(int32_t row, int32_t rows)
{
    return row + ROWS > rows ? rows - ROWS : row;
}

#endif

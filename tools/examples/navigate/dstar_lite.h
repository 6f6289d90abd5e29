/* The cheapest way from a cell to the goal over a field whose prices change, by D* Lite
 * (S. Koenig and M. Likhachev, AAAI 2002): a search from the goal that looks at no more cells than
 * the way needs, and after changes only at those whose cost they change.
 *
 * The field wraps round at its edges, so that a window may move over the world without a cell being
 * copied: a cell is x modulo DSTAR_SIDE, y modulo DSTAR_SIDE. What no way may pass is closed. The
 * goal is a vertex beyond the field, which some cells have an exit to. Prices and costs are whole
 * numbers of any unit, so that sums compare exactly. */
#ifndef NAVIGATE_DSTAR_LITE_H
#define NAVIGATE_DSTAR_LITE_H

#include <stdint.h>

#define DSTAR_NO_WAY (INT64_MAX / 4)
enum { DSTAR_SIDE = 257, DSTAR_CELLS = DSTAR_SIDE * DSTAR_SIDE, DSTAR_CLOSED = 0 };

struct dstar_entry {
    int64_t key[2];
    int32_t cell;
};

struct dstar {
    int32_t price[DSTAR_CELLS]; /* of a straight step out of a cell */
    int64_t exit[DSTAR_CELLS];  /* cost of going to the goal from a cell at once */
    int64_t g[DSTAR_CELLS];     /* cost of the way to the goal; DSTAR_NO_WAY: there is none */
    int64_t rhs[DSTAR_CELLS];   /* the same by the cell's price and exit and its neighbours' g */
    int32_t place[DSTAR_CELLS]; /* in the heap; -1 where g and rhs agree */
    struct dstar_entry heap[DSTAR_CELLS];
    int32_t queued, from, least;
    int64_t km, looks; /* what moves have added to keys; cells that were looked at, ever */
};

/* Of a diagonal step: the square root of 2 times as much as a straight one. */
static inline int64_t dstar_diagonal(int32_t price)
{
    return (int64_t)price * 185364 / 131072;
}

/* Begin with a field that is closed everywhere. No price will be below `least`. */
void dstar_begin(struct dstar *d, int32_t from, int32_t least);
/* `out`: its exit, or DSTAR_NO_WAY. */
void dstar_change(struct dstar *d, int32_t cell, int32_t price, int64_t out);
/* Cost of the way from a cell. Up to `reach` steps from it, g is then right where it is not above
 * that, and above it elsewhere. */
int64_t dstar_find(struct dstar *d, int32_t from, int32_t reach);

#endif

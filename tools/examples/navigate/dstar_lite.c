/* D* Lite in its optimised version (figure 4 of the paper), in the words of the paper. */
#include "dstar_lite.h"

#include <stdbool.h>
#include <stdlib.h>

/* ---- the queue, a heap ----------------------------------------------------------------------- */

static int64_t lesser(int64_t a, int64_t b)
{
    return a < b ? a : b;
}

static int32_t apart(int32_t a, int32_t b) /* on a circle of DSTAR_SIDE */
{
    const int32_t way = abs(a - b);
    return way < DSTAR_SIDE - way ? way : DSTAR_SIDE - way;
}

/* The least that the way between two cells can cost. */
static int64_t heuristic(const struct dstar *d, int32_t a, int32_t b)
{
    const int32_t x = apart(a % DSTAR_SIDE, b % DSTAR_SIDE),
                  y = apart(a / DSTAR_SIDE, b / DSTAR_SIDE), both = x < y ? x : y;
    return (x + y - 2 * both) * (int64_t)d->least + both * dstar_diagonal(d->least);
}

static struct dstar_entry entry_of(const struct dstar *d, int32_t cell)
{
    const int64_t cost = lesser(d->g[cell], d->rhs[cell]);
    return (struct dstar_entry){{cost + heuristic(d, d->from, cell) + d->km, cost}, cell};
}

static bool before(const struct dstar_entry *a, const struct dstar_entry *b)
{
    return a->key[0] < b->key[0] || (a->key[0] == b->key[0] && a->key[1] < b->key[1]);
}

static void put(struct dstar *d, int32_t at, struct dstar_entry entry)
{
    d->heap[at] = entry;
    d->place[entry.cell] = at;
}

/* From a free place of the heap to where it belongs. */
static void sift(struct dstar *d, int32_t at, struct dstar_entry entry)
{
    for (; at > 0 && before(&entry, &d->heap[(at - 1) / 2]); at = (at - 1) / 2)
        put(d, at, d->heap[(at - 1) / 2]);
    for (int32_t child = 2 * at + 1; child < d->queued; child = 2 * at + 1) {
        if (child + 1 < d->queued && before(&d->heap[child + 1], &d->heap[child])) child++;
        if (!before(&d->heap[child], &entry)) break;
        put(d, at, d->heap[child]);
        at = child;
    }
    put(d, at, entry);
}

/* ---- the search ------------------------------------------------------------------------------ */

static int32_t next_to(int32_t cell, int32_t k) /* k: 0 to 3 straight on, 4 to 7 diagonally */
{
    static const int8_t dx[8] = {1, 0, -1, 0, 1, -1, -1, 1}, dy[8] = {0, 1, 0, -1, 1, 1, -1, -1};
    const int32_t x = cell % DSTAR_SIDE + DSTAR_SIDE + dx[k],
                  y = cell / DSTAR_SIDE + DSTAR_SIDE + dy[k];
    return y % DSTAR_SIDE * DSTAR_SIDE + x % DSTAR_SIDE;
}

static int64_t step_cost(int32_t price, int32_t k)
{
    return k < 4 ? price : dstar_diagonal(price);
}

/* Queued is what is not consistent. */
static void update_vertex(struct dstar *d, int32_t cell)
{
    const int32_t at = d->place[cell];
    if (d->g[cell] != d->rhs[cell]) {
        sift(d, at >= 0 ? at : d->queued++, entry_of(d, cell));
    } else if (at >= 0) {
        d->place[cell] = -1;
        if (at != --d->queued) sift(d, at, d->heap[d->queued]);
    }
}

static void find_rhs(struct dstar *d, int32_t cell)
{
    int64_t best = d->exit[cell];
    for (int32_t k = 0; k < 8 && d->price[cell] != DSTAR_CLOSED; k++)
        best = lesser(best, d->g[next_to(cell, k)] + step_cost(d->price[cell], k));
    d->rhs[cell] = lesser(best, DSTAR_NO_WAY);
}

/* Make a cell's g its rhs, or unknown where that was too low, and tell its neighbours. */
static void expand(struct dstar *d, int32_t cell)
{
    const bool lower = d->g[cell] > d->rhs[cell];
    const int64_t was = d->g[cell];
    d->looks++;
    d->g[cell] = lower ? d->rhs[cell] : DSTAR_NO_WAY;
    update_vertex(d, cell);
    for (int32_t k = 0; k < 8; k++) {
        const int32_t next = next_to(cell, k);
        const int64_t step = step_cost(d->price[next], k), rhs = d->rhs[next];
        if (d->price[next] == DSTAR_CLOSED) continue;
        if (lower)
            d->rhs[next] = lesser(rhs, d->g[cell] + step);
        else if (rhs == was + step)
            find_rhs(d, next);
        if (d->rhs[next] != rhs) update_vertex(d, next);
    }
}

void dstar_begin(struct dstar *d, int32_t from, int32_t least)
{
    for (int32_t i = 0; i < DSTAR_CELLS; i++) {
        d->price[i] = DSTAR_CLOSED;
        d->exit[i] = d->g[i] = d->rhs[i] = DSTAR_NO_WAY;
        d->place[i] = -1;
    }
    d->queued = 0;
    d->km = 0;
    d->from = from;
    d->least = least;
}

void dstar_change(struct dstar *d, int32_t cell, int32_t price, int64_t out)
{
    if (d->price[cell] == price && d->exit[cell] == out) return;
    d->price[cell] = price;
    d->exit[cell] = out;
    find_rhs(d, cell);
    update_vertex(d, cell);
}

int64_t dstar_find(struct dstar *d, int32_t from, int32_t reach)
{
    const int64_t margin = reach * dstar_diagonal(d->least);
    d->km += heuristic(d, d->from, from);
    d->from = from;
    while (d->queued > 0) {
        const struct dstar_entry first = d->heap[0], now = entry_of(d, first.cell);
        if (first.key[0] > entry_of(d, from).key[0] + margin) break;
        if (before(&first, &now))
            update_vertex(d, first.cell); /* queued when the robot was elsewhere */
        else
            expand(d, first.cell);
    }
    return d->g[from];
}

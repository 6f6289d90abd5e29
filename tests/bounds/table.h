/* What is measured of one piece of work, and the sums that bounds are made of.
 *
 * A *piece* is a function on its worst input, and what it costs there, or its cost for each item of
 * its loop. A *bound* of a stage or of a kind of unit is the sum of its terms: how often a piece
 * occurs at most, by the capacities, times what it costs. Terms of different ways exclude each
 * other (a frame is localised or relocalised): the dearest way counts, and what all ways share. */
#ifndef FOVEA_TESTS_BOUNDS_TABLE_H
#define FOVEA_TESTS_BOUNDS_TABLE_H

#include <stdbool.h>
#include <stdint.h>

#include "bounds/pieces.h"

enum {
    BOUND_TERMS_MAX = 160,
    BOUND_WAYS_MAX = 8,
    BOUNDS_MAX = 96,
    BOUND_OFTEN_BYTES = 400,
    BOUND_ALWAYS = 0
};

struct bound_term {
    uint32_t way; /* BOUND_ALWAYS: part of all */
    enum piece piece;
    char often[BOUND_OFTEN_BYTES]; /* the expressions of `count`, with + between them */
    double count;
};

struct bound {
    const char *name;
    const char *ways[BOUND_WAYS_MAX];
    uint32_t term_count;
    struct bound_term terms[BOUND_TERMS_MAX];
    uint64_t most; /* counted in runs; 0: never ran */
    uint64_t times;
    const char *most_in; /* the run */
};

struct bound *bound_of(const char *name);
/* Added to the term of the same way and piece, where there is one. */
void bound_add(struct bound *bound, uint32_t way, const char *often, double count,
               enum piece piece);
/* The sum of the dearest way and one reading of the clock, the way's number `way` gets unless NULL.
 */
double bound_sum(const struct bound *bound, uint32_t *way);
/* A count of a run. */
void bound_note(const char *name, const char *run, uint64_t instructions);
/* All of them, as they were first asked for; NULL after the last. */
struct bound *bound_at(uint32_t i);

/* bound, way, how often (an expression in plain words), piece */
#define TERM(bound, way, often, piece) bound_add(bound, way, #often, (double)(often), PIECE_##piece)

#endif

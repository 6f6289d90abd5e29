/* The hashes of two runs that are heard while they run: lockstep_t of one iteration of both are
 * compared as soon as both are there, in the order of iterations, up to the first difference. One
 * run may be behind the other: what it has not sent yet is waited for. Each run is taken to send in
 * its own order, so that what it left out is known when it sends a later iteration.
 *
 * On the heap, bounded by `bytes_max` per run: beyond that the earliest are kept and later ones are
 * not, so that no difference is called the first while earlier iterations were not compared. One
 * thread at a time. */
#ifndef FOVEA_APP_WATCH_PAIRS_H
#define FOVEA_APP_WATCH_PAIRS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "app/watch/compare.h"

struct fv_pairs;

/* Keep at most `bytes_max` bytes of each run, and end after `iterations` equal ones; 0: never.
 * NULL: no memory. */
struct fv_pairs *fv_pairs_open(size_t bytes_max, uint64_t iterations);
void fv_pairs_close(struct fv_pairs *pairs);

/* A message of run 0 or 1; left where it is no lockstep_t. */
void fv_pairs_take(struct fv_pairs *pairs, int run, const uint8_t *data, size_t bytes);

/* Whether nothing more will be compared: they differ, enough were equal, or a run began again. */
bool fv_pairs_done(const struct fv_pairs *pairs);

/* What was found so far. `names` of the runs, for its words. `silent`: nothing more will come; else
 * a run that is behind is none that ended. */
struct fv_compared fv_pairs_found(const struct fv_pairs *pairs, char *const names[2], bool silent);

#endif

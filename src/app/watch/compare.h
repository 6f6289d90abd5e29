/* Where two runs on the same inputs became different: the first iteration, and in it the inputs,
 * the stage by the hashes of lockstep_t, or the message. Runs are read from recordings, or heard
 * while they run. Init-only: on the heap, bounded by an iteration of each run. */
#ifndef FOVEA_APP_WATCH_COMPARE_H
#define FOVEA_APP_WATCH_COMPARE_H

#include <stdbool.h>
#include <stdint.h>

#include "fovea/status.h"

struct fv_compared {
    uint64_t iterations, hashed; /* equal ones, and those among them with hashes of the state */
    bool different;
    bool incomplete; /* not all was compared that was to be: `ended` says why */
    /* Iterations before the one that differs, since the last equal one, that were not seen of both:
     * with any, what became different first is not known, and what follows is about that one. */
    uint64_t unseen;
    /* Of the first iteration that differs; "" for what is equal or not known. */
    uint64_t iteration;
    int64_t sequence, stamp_ns; /* of its last frame */
    char inputs[256];           /* what of the inputs; then the rest is "" */
    char stage[64];             /* the first one whose features or state differ */
    char message[256];          /* the first one that differs, its field and both values */
    char ended[256];            /* where it ended before one of them: longer, cut off, behind */
};

/* Two lockstep_t of one iteration, encoded and well-formed: fills inputs, stage and message where
 * nothing stands there yet. True: they are equal. */
bool fv_compare_lockstep(const uint8_t *a, uint32_t a_bytes, const uint8_t *b, uint32_t b_bytes,
                         struct fv_compared *compared);

/* Two recordings, up to the first difference or the end of the shorter one. The end is also where
 * one is cut off, within an event or behind one: its last iteration may lack something and is left.
 * FOVEA_ERROR_INPUT: one is no recording, or damaged: `error` names file and byte, and
 * compared->iterations before that were equal. */
enum fovea_status fv_compare_recordings(const char *a, const char *b, struct fv_compared *compared,
                                        struct fovea_error *error);

#endif

/* How far a command has come: one status on a terminal, nothing elsewhere. Off the loop thread. */
#ifndef FOVEA_SUPPORT_PROGRESS_H
#define FOVEA_SUPPORT_PROGRESS_H

#include <stdbool.h>
#include <stdint.h>

struct fv_progress {
    const char *what; /* one word, for example "replay" */
    int64_t shown_ns; /* CLOCK_MONOTONIC; 0: not yet */
    uint64_t frames;  /* by then */
    bool terminal;
};

/* `what` must stay valid. */
void fv_progress_begin(struct fv_progress *progress, const char *what);
/* `frames` are done, and `fraction` of all in [0, 1]; negative: not known. Shown about five times a
 * second. */
void fv_progress_show(struct fv_progress *progress, uint64_t frames, double fraction);
/* Remove the status. */
void fv_progress_end(struct fv_progress *progress);

#endif

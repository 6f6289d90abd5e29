/* Jobs: work that may take several frames, done in granted units.
 *
 * A job is one row of fv_jobs, in order of priority, and one file job_NAME.c. The governor, the
 * stage clock, the statistics message and the names follow from the row. */
#ifndef FOVEA_RUNTIME_JOBS_H
#define FOVEA_RUNTIME_JOBS_H

#include "runtime/state.h"

typedef bool fv_job_waiting_fn(const struct fovea *rt);
/* Do up to `units` units; what they finish goes to the outputs. Returns the units done. */
typedef uint32_t fv_job_advance_fn(struct fovea *rt, uint32_t units, struct fovea_outputs *outputs);

struct fv_job {
    const char *name;   /* in messages; the job's stage has the same name */
    const char *key;    /* configuration key; with its value off, empty or 0 the job has no work */
    uint32_t units_min; /* per frame, however short the time: finishes it in bounded frames */
    uint32_t units_fixed; /* per frame of the fixed schedule */
    fv_job_waiting_fn *waiting;
    fv_job_advance_fn *advance;
};

extern const struct fv_job fv_jobs[FOVEA_JOB_COUNT];

fv_job_waiting_fn fv_job_map_waiting, fv_job_detect_waiting, fv_job_closure_waiting,
    fv_job_preview_waiting;
fv_job_advance_fn fv_job_map_advance, fv_job_detect_advance, fv_job_closure_advance,
    fv_job_preview_advance;

/* Bit per job that has units left to do. Real-time safe. */
uint32_t fv_jobs_waiting(const struct fovea *rt);

/* Put a message of `bytes` encoded bytes among the outputs; one of 0 bytes (it did not fit its
 * buffer) is left out. */
void fv_output_add(struct fovea *rt, enum fv_message_kind kind, uint32_t bytes,
                   struct fovea_outputs *outputs);

#endif

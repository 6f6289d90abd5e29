/* Jobs: work that may take several frames, done in granted units.
 *
 * A job is one row of FOVEA_JOBS (fovea/fovea.h), in order of priority, and one file job_NAME.c,
 * which defines fv_job_NAME. The governor, the stage clock, the statistics message, the memory
 * table and the names follow from them. */
#ifndef FOVEA_RUNTIME_JOBS_H
#define FOVEA_RUNTIME_JOBS_H

#include "runtime/state.h"

typedef bool fv_job_waiting_fn(const struct fovea *rt);
/* Do up to `units` units; what they finish goes to the outputs. Returns the units done. */
typedef uint32_t fv_job_advance_fn(struct fovea *rt, uint32_t units, struct fovea_outputs *outputs);
/* Take the job's pieces for rt->config, their addresses into rt->job_pieces or members of rt.
 * Assigns addresses and nothing else (base/arena.h); later jobs and messages are carved after it.
 */
typedef void fv_job_carve_fn(struct fovea *rt, struct fv_carving *carving);
/* A frame was processed, its pose is known, and its messages are not yet encoded. The image is gone
 * after the step, and the next one overwrites the pyramid. */
typedef void fv_job_frame_fn(struct fovea *rt, const struct fovea_frame *frame);
/* Forget what was learnt. */
typedef void fv_job_reset_fn(struct fovea *rt);

struct fv_job {
    const char *key;    /* configuration key; with its value off, empty or 0 the job has no work */
    uint32_t units_min; /* per frame, however short the time: finishes it in bounded frames */
    uint32_t units_fixed; /* per frame of the fixed schedule */
    fv_job_waiting_fn *waiting;
    fv_job_advance_fn *advance;
    fv_job_carve_fn *carve; /* this and what follows: NULL where there is nothing to do */
    fv_job_frame_fn *frame;
    fv_job_reset_fn *reset;
};

#define FV_JOB_DECLARED(NAME, name) extern const struct fv_job fv_job_##name;
FOVEA_JOBS(FV_JOB_DECLARED)
#undef FV_JOB_DECLARED

extern const struct fv_job *const fv_jobs[FOVEA_JOB_COUNT];

/* All jobs in their order. Real-time safe, except for the first. */
void fv_jobs_carve(struct fovea *rt, struct fv_carving *carving);
void fv_jobs_frame(struct fovea *rt, const struct fovea_frame *frame);
void fv_jobs_reset(struct fovea *rt);

/* Bit per job that has units left to do. Real-time safe. */
uint32_t fv_jobs_waiting(const struct fovea *rt);

/* Put a message of `bytes` encoded bytes among the outputs; one of 0 bytes (it did not fit its
 * buffer) is left out. A piece begins at byte `at` of the kind's buffer. */
void fv_output_add(struct fovea *rt, enum fv_message_kind kind, uint32_t bytes,
                   struct fovea_outputs *outputs);
void fv_output_add_piece(struct fovea *rt, enum fv_message_kind kind, size_t at, uint32_t bytes,
                         struct fovea_outputs *outputs);

#endif

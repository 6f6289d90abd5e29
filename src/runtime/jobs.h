/* Jobs: advancing them by granted units and handing out what they finish. */
#ifndef FOVEA_RUNTIME_JOBS_H
#define FOVEA_RUNTIME_JOBS_H

#include "runtime/state.h"

/* Bit per job that has units left to do. Real-time safe. */
uint32_t fv_jobs_waiting(const struct fovea *rt);

/* Do up to `units` units of a job; finished results become messages. Returns the units done.
 * Real-time safe. */
uint32_t fv_job_advance(struct fovea *rt, enum fovea_job job, uint32_t units,
                        struct fovea_outputs *outputs);

/* Put a message of `bytes` encoded bytes among the outputs; 0 bytes (it did not fit its buffer) is
 * passed over. */
void fv_output_add(struct fovea *rt, enum fv_message_kind kind, uint32_t bytes,
                   struct fovea_outputs *outputs);

#endif

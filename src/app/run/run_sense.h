/* What a step of `fovea run` gets beside its frame: changed parameters, samples of the source, of
 * the network and of IIO, and true boxes. Loop thread, wait-free. */
#ifndef FOVEA_APP_RUN_RUN_SENSE_H
#define FOVEA_APP_RUN_RUN_SENSE_H

#include <stdint.h>

#include "fovea/fovea.h"

/* The hook `sense` of the loop (loop.h); `context` is the run. */
void fv_run_sense(void *context, const struct fovea_frame *given, struct fovea_inputs *inputs);

/* Put a sample among `*count` that are in the order of their stamps, behind those of its own; there
 * is room for one more. */
void fv_run_sample_add(struct fovea_sample *samples, uint32_t *count,
                       const struct fovea_sample *sample);

#endif

/* The identity of a run: 64 random bits that the application draws at its start, so that a restart
 * and a second sender on the same prefix can be noticed. It is an input of the run, never made by
 * the runtime, and no part of results. Init-only. */
#ifndef FOVEA_APP_NETWORK_RUN_ID_H
#define FOVEA_APP_NETWORK_RUN_ID_H

#include <stdint.h>

#include "fovea/status.h"

/* Draw *run_id from the kernel's random numbers; it is never 0, which means "no run".
 * FOVEA_ERROR_SYSTEM: the kernel gives none. */
enum fovea_status fv_run_id_make(int64_t *run_id, struct fovea_error *error);

#endif

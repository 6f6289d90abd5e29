/* What kind of unit a job does next, by its state. */
#ifndef FOVEA_TESTS_BOUNDS_KINDS_H
#define FOVEA_TESTS_BOUNDS_KINDS_H

#include "runtime/state.h"

/* Name of the bound of the unit that the job would do now; NULL: it does not wait. */
const char *kind_of(const struct fovea *rt, enum fovea_job job);

#endif

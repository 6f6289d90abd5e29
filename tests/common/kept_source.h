/* The simulated camera for tests that take the same frames several times: each is rendered once and
 * kept until the program ends. Frames, stamps, samples and true poses are those of `sim:`, bit for
 * bit; of the truth there is the pose alone, and no robot can be driven. Failures end the test. */
#ifndef FOVEA_TESTS_COMMON_KEPT_SOURCE_H
#define FOVEA_TESTS_COMMON_KEPT_SOURCE_H

#include "fovea/source.h"

/* Of an address of `sim:`; of its selection start and frames, with a step of 1. */
extern const struct fovea_source_ops kept_sim;

#endif

/* Checks of the machine before a run: a processor, a compiler or a memory that computes otherwise
 * would give poses that nobody can replay. Init-only; some 30 ms; the heap is used. */
#ifndef FOVEA_APP_RUN_SELF_TEST_H
#define FOVEA_APP_RUN_SELF_TEST_H

#include "kernels/kernels.h"

enum { FV_SELF_TEST_REASON_BYTES = 128 };

/* Three frames of a painted scene through pyramid, features and odometry, with these kernels and
 * with those of plain C: the hash of all of the state is the same after each. The kernels of
 * networks are not among them. */
enum fv_self_test_result { FV_SELF_TEST_SAME, FV_SELF_TEST_DIFFERS, FV_SELF_TEST_NO_MEMORY };
enum fv_self_test_result fv_self_test_kernels(const struct fv_kernels *kernels);

/* Everything: the kernels of this processor; CLOCK_MONOTONIC, which goes on and tells microseconds
 * apart. "": all is right, else what is wrong. */
void fv_self_test(char reason[FV_SELF_TEST_REASON_BYTES]);

#endif

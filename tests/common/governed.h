/* For tests of what a run costs: heap calls while `counting`, and a frame by the governor as the
 * loop takes it. For one file of a program. */
#ifndef FOVEA_TESTS_COMMON_GOVERNED_H
#define FOVEA_TESTS_COMMON_GOVERNED_H

#include <stdbool.h>
#include <stdint.h>
#include <time.h>

#ifndef FOVEA_SANITIZED /* sanitizers bring their own heap */
#include "common/heap_calls.h"
#endif
#include "fovea/fovea.h"

static int heap_calls;
static bool counting;

#ifndef FOVEA_SANITIZED
static void on_heap_call(void)
{
    heap_calls += counting;
}
static void on_heap_free(void)
{
    heap_calls += counting;
}
#endif

static inline int64_t cpu_ns(void)
{
    struct timespec now;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

/* Step and work, granted by the governor; without one by inputs->grants. Returns the CPU time of
 * both. */
static inline int64_t govern(struct fovea *rt, const struct fovea_config *config,
                             struct fovea_governor *governor, struct fovea_inputs *inputs)
{
    struct fovea_outputs outputs;
    if (governor != NULL) fovea_governor_next(governor, config, &inputs->grants);
    struct fovea_grants grants = inputs->grants;
    counting = true;
    const int64_t begin = cpu_ns();
    fovea_step(rt, inputs, &outputs);
    const int64_t step = cpu_ns() - begin;
    if (governor != NULL) fovea_governor_work(governor, step, outputs.jobs_waiting, &grants);
    const int64_t middle = cpu_ns();
    fovea_work(rt, &grants, &outputs);
    const int64_t work = cpu_ns() - middle;
    counting = false;
    if (governor != NULL) fovea_governor_learn(governor, step, work, &outputs);
    return step + work;
}

#endif

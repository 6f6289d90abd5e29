/* The simulated camera as a source of tests. Include after cmocka. */
#ifndef FOVEA_TESTS_COMMON_SIM_SOURCE_H
#define FOVEA_TESTS_COMMON_SIM_SOURCE_H

#include "../../drivers/sim/sim.h"

/* Opened and started. */
static inline struct fovea_source *sim_source_open(const char *address,
                                                   const struct fovea_source_selection *selection)
{
    struct fovea_source *source = NULL;
    struct fovea_error error = {.text = ""};
    if (fv_source_sim.open(address, selection, &source, &error) != FOVEA_OK)
        fail_msg("%s", error.text);
    assert_int_equal(fv_source_sim.start(source, &error), FOVEA_OK);
    return source;
}

/* From frame `start` on. */
static inline struct fovea_source *sim_source_open_at(const char *address, uint64_t start)
{
    const struct fovea_source_selection selection = {.start = start, .step = 1};
    return sim_source_open(address, &selection);
}

static inline void sim_source_close(struct fovea_source *source)
{
    fv_source_sim.stop(source);
    fv_source_sim.close(source);
}

#endif

/* Memory of a stage for tests: the carving function run twice, to count and on memory of exactly
 * that size. */
#ifndef FOVEA_TESTS_COMMON_CARVED_H
#define FOVEA_TESTS_COMMON_CARVED_H

#include <stdlib.h>

#include "base/arena.h"

typedef void carve_function(void *context, struct fv_arena *arena);

/* Returns the memory, to be freed by the caller; aborts where the two runs disagree. */
static inline void *carved(carve_function *carve, void *context)
{
    struct fv_arena count, build;
    fv_arena_count(&count);
    carve(context, &count);
    void *memory = aligned_alloc(FV_CACHE_LINE_BYTES, count.used);
    if (memory == NULL) abort();
    fv_arena_init(&build, memory, count.used);
    carve(context, &build);
    if (build.exhausted || build.used != count.used) abort();
    return memory;
}

#endif

/* Memory from the heap at the start of a cache line, in whole lines: for models, arenas, and
 * structs whose members have lines of their own. NULL: none is left. To be given to free().
 * Init-only. */
#ifndef FOVEA_SUPPORT_ALIGNED_H
#define FOVEA_SUPPORT_ALIGNED_H

#include <stdlib.h>
#include <string.h>

#include "base/arena.h"

static inline void *fv_aligned_new(size_t bytes)
{
    const size_t line = FV_CACHE_LINE_BYTES;
    return aligned_alloc(line, (bytes + line - 1) / line * line);
}

static inline void *fv_aligned_zeroed(size_t bytes)
{
    void *memory = fv_aligned_new(bytes);
    if (memory != NULL) memset(memory, 0, bytes);
    return memory;
}

#endif

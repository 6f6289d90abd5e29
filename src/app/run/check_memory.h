/* The memory table of fovea check: what the runtime takes of its block by owner and part, and what
 * the program takes outside it. */
#ifndef FOVEA_APP_RUN_CHECK_MEMORY_H
#define FOVEA_APP_RUN_CHECK_MEMORY_H

#include <stddef.h>

#include "app/config/setup.h"

/* What the table is of, all in bytes. The source may be closed: its rows are then left out. */
struct fv_check_memory {
    const struct fv_settings *settings;
    const struct fv_setup *setup;
    size_t block;  /* of the runtime, by fovea_size() */
    size_t source; /* of the heap that opening the source took */
    size_t lcm;    /* likewise of LCM; 0: no row */
};

/* Print the table to the standard output. Init-only. FOVEA_ERROR_CONFIG as fovea_memory(). */
enum fovea_status fv_check_memory_print(const struct fv_check_memory *memory,
                                        struct fovea_error *error);

#endif

/* What the program is called with. */
#ifndef NAVIGATE_ARGUMENTS_H
#define NAVIGATE_ARGUMENTS_H

#include <stdbool.h>
#include <stdint.h>

#include "plan.h"

enum { NAVIGATE_PREFIX_BYTES_MAX = 31 };

struct navigate_arguments {
    const char *url, *prefix, *key_path; /* url NULL: LCM's default; key_path NULL: not signed */
    int64_t run_id, sender;              /* with a key; run_id 0: not given */
    double goal[2];
    struct navigate_robot robot;
    double patience_s; /* of silence, until whichever frame waits is answered */
};

/* What is not given stays as it is. False: one line on stderr says which argument is wrong, what
 * was found and what was expected. */
bool navigate_arguments_read(struct navigate_arguments *arguments, int argc, char **argv);

#endif

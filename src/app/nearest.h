/* The nearest known name to a mistyped one, for error messages. Init-only. */
#ifndef FOVEA_APP_NEAREST_H
#define FOVEA_APP_NEAREST_H

#include <stddef.h>

/* Edit distance (optimal string alignment: insertion, deletion, exchange, swap of neighbours; letter case
 * counts nothing), over the first 63 characters of both. */
int fv_edit_distance(const char *a, const char *b);

/* Running search: start with {0}, offer every known name, read `name` (NULL when nothing is near enough to be
 * worth naming: more than half of the word would have to change). Names are kept by address. */
struct fv_nearest {
    const char *wanted;
    const char *name;
    int distance;
};
void fv_nearest_offer(struct fv_nearest *nearest, const char *known);

#endif

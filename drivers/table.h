/* The drivers built in: of the programs, not in the library. Init-only. */
#ifndef FOVEA_DRIVERS_TABLE_H
#define FOVEA_DRIVERS_TABLE_H

#include "fovea/source.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Ended by NULL. */
extern const struct fovea_source_ops *const fv_source_table[];

/* The driver for a URI "name:address" and where its address starts; an error that lists the known
 * names otherwise. */
enum fovea_status fv_source_find(const char *uri, const struct fovea_source_ops **ops,
                                 const char **address, struct fovea_error *error);

#ifdef __cplusplus
}
#endif
#endif

/* Which kind of recording a path looks like, for the error line of a source of another kind.
 * Init-only. */
#ifndef FOVEA_RECORDED_KIND_H
#define FOVEA_RECORDED_KIND_H

#include "fovea/status.h"

/* Append "; this looks like KIND:PATH" to the error of a source `name` that could not open `path`,
 * where it looks like another kind. Returns the error's status. */
enum fovea_status fv_kind_hint(const char *name, const char *path, enum fovea_status status,
                               struct fovea_error *error);

#endif

/* The message types as text, which every recording carries, so that other programs and later
 * versions can read it: for each type a line
 *
 *     //! type fovea.pose_t 0123456789abcdef
 *
 * with its name and its hash (of 16 hexadecimal digits: the first 8 bytes of such a message), then
 * its definition. The whole is one file that lcm-gen reads. */
#ifndef FOVEA_APP_RECORD_RECORDING_TYPES_H
#define FOVEA_APP_RECORD_RECORDING_TYPES_H

#include <stddef.h>
#include <stdint.h>

#include "fovea/status.h"

/* Every type of this program. The caller frees it; NULL: no memory. Init-only. */
char *fv_recording_types_text(size_t *bytes);

/* Whether this program reads messages of the types described: each that it knows by name must have
 * its hash, and those that every recording holds must be there. Types that it does not know are
 * passed over, since later versions add some. On failure `error` names the file, the byte `offset`
 * (of the recording's header in the file), the line of the text, what was found and what was
 * expected. */
enum fovea_status fv_recording_types_check(const char *name, int64_t offset, const char *text,
                                           size_t bytes, struct fovea_error *error);

#endif

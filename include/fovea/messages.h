/* Messages as JSON, without decoding them: for programs that print, log or forward what Fovea
 * sends. Library libfovea-messages, which needs nothing of the runtime.
 *
 * A message that comes from a network is checked from end to end before anything of it is used. No
 * memory of its own. Any thread, after the first call of the process has returned. */
#ifndef FOVEA_MESSAGES_H
#define FOVEA_MESSAGES_H

#include <stddef.h>
#include <stdint.h>

#include "fovea/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Name of the type that a message begins with, for example "fovea.pose_t"; NULL: none of ours. */
const char *fovea_message_type(const uint8_t *data, size_t bytes);

/* Write a message as one JSON object on one line, its members named as the fields of its type,
 * after a member "type". Numbers keep their value; NaN and infinities, which JSON lacks, are null;
 * bytes of a string that are no UTF-8 become U+FFFD. `*length` is what the whole text takes,
 * without its zero, also when it does not fit `capacity` and is cut; call again with more room
 * then. FOVEA_ERROR_INPUT: the message is of no known type or not well-formed; `error` says where.
 */
enum fovea_status fovea_message_json(const uint8_t *data, size_t bytes, char *text, size_t capacity,
                                     size_t *length, struct fovea_error *error);

#ifdef __cplusplus
}
#endif
#endif

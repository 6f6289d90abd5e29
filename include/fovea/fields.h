/* The content of a message of Fovea, as JSON or field by field, without decoding it: for programs
 * that print, log or forward messages. Library libfovea-messages, which does not need the runtime.
 *
 * A message that comes from a network is checked before any part of it is used; the decoders that
 * lcm-gen makes allocate whatever size a message states, negative counts included. The fields of
 * every type are known from include/lcmtypes/. The functions use no memory of their own, and time
 * in proportion to the message's length. Any thread, after the first call of the process has
 * returned.
 */
#ifndef FOVEA_FIELDS_H
#define FOVEA_FIELDS_H

#include <stddef.h>
#include <stdint.h>

#include "fovea/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Name of the type that a message begins with, for example "fovea.pose_t"; NULL: none of ours. */
const char *fovea_message_type(const uint8_t *data, size_t bytes);

/* Write a message as one JSON object on one line, its members named as the fields of its type,
 * after a member "type". Numbers keep their value; NaN is null, and
 * infinity, which JSON lacks too, 1e999, which readers take for it; bytes of a string that are not
 * UTF-8 become U+FFFD. `*length` is the length of the whole text without its zero, also when the
 * text does not fit `capacity` and is cut; then call again with more room. FOVEA_ERROR_INPUT: the
 * type of the message is unknown, or the message is not well-formed; `error` names the byte. */
enum fovea_status fovea_message_json(const uint8_t *data, size_t bytes, char *text, size_t capacity,
                                     size_t *length, struct fovea_error *error);

/* How a field is written on LCM's wire; all numbers are big-endian. */
enum fovea_wire {
    FOVEA_WIRE_INT8,
    FOVEA_WIRE_BYTE,
    FOVEA_WIRE_BOOLEAN,
    FOVEA_WIRE_INT16,
    FOVEA_WIRE_INT32,
    FOVEA_WIRE_INT64,
    FOVEA_WIRE_FLOAT,
    FOVEA_WIRE_DOUBLE,
    FOVEA_WIRE_STRING,
    FOVEA_WIRE_STRUCT /* of types only: fovea_fields_next goes into it */
};

enum { FOVEA_FIELDS_MAX = 48, FOVEA_NESTING_MAX = 3, FOVEA_FIELD_PATH_BYTES = 96 };

/* One field, or one array of numbers, of a message. */
struct fovea_field {
    char path[FOVEA_FIELD_PATH_BYTES]; /* "stamp.time_ns", "parts[2].name" */
    enum fovea_wire wire;
    uint32_t count;      /* numbers, row after row; 1 for a string */
    uint32_t row;        /* numbers in each row; 0: the array has no rows */
    const uint8_t *data; /* in the message; a string's ends with its zero */
    uint32_t bytes;
    size_t offset; /* of `data` in the message */
};

struct fovea_type; /* internal */

/* A way through the fields of one message. */
struct fovea_fields {
    const uint8_t *data;
    size_t bytes, at;
    const char *problem; /* why it ended early; then `at` is the byte in the message */
    int32_t depth;
    struct {
        const struct fovea_type *type;
        int32_t field, element;           /* next to come */
        int32_t values[FOVEA_FIELDS_MAX]; /* of integer fields, for counts */
    } level[FOVEA_NESTING_MAX];
};

/* Begin with a message, which stays where it is. FOVEA_ERROR_INPUT: its type is unknown. */
enum fovea_status fovea_fields_begin(struct fovea_fields *fields, const uint8_t *data,
                                     size_t bytes);

/* FOVEA_OK: `field` is the next one. FOVEA_END: the message is whole and well-formed.
 * FOVEA_ERROR_INPUT: it is not, and fields->problem and fields->at say why and where. */
enum fovea_status fovea_fields_next(struct fovea_fields *fields, struct fovea_field *field);

/* Number `i` of a field, below its count: rounded to a double, or to an integer towards 0. A string
 * gives 0, and so does an integer that int64_t cannot hold. */
double fovea_field_number(const struct fovea_field *field, uint32_t i);
int64_t fovea_field_integer(const struct fovea_field *field, uint32_t i);

#ifdef __cplusplus
}
#endif
#endif

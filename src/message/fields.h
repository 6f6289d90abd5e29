/* The table of every type's fields, and what stands on it besides fovea/fields.h: checks and
 * comparison.
 *
 * The table is made from include/lcmtypes/ at build time (tools/lcm_fields.awk; a test holds it
 * against lcm-gen's type hashes). With it a message is checked before anything trusts its lengths,
 * and two messages are compared down to the first field that differs. LCM's wire format: the type's
 * hash (8 bytes), then the fields in order; a string is its length with the zero (4 bytes) and its
 * bytes.
 *
 * No memory of its own, bounded by the message's length, any thread. */
#ifndef FOVEA_MESSAGE_FIELDS_H
#define FOVEA_MESSAGE_FIELDS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "fovea/fields.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A field of a type. */
struct fv_field {
    const char *name;
    enum fovea_wire wire;
    bool array;
    int32_t count;       /* elements; 0: another field holds the count */
    int32_t row;         /* numbers in each element, as in p[count][3]; 0: one */
    int32_t count_field; /* the field of the same struct that holds the count, -1: none */
    int32_t nested;      /* number of the nested type, -1: none */
};

struct fovea_type {
    const char *name; /* "fovea.pose_t" */
    const struct fv_field *fields;
    int32_t field_count;
    int64_t (*hash)(void);
};

enum { FV_FIELD_VALUE_BYTES = 64 };

/* All types, `*count` of them. */
const struct fovea_type *fv_message_types(int32_t *count);

/* The type whose hash a message starts with; NULL: none of ours. */
const struct fovea_type *fv_message_type_of(const uint8_t *data, size_t bytes);

/* Whether a message is of the named type ("fovea.inputs_t") and well-formed from end to end, so
 * that the generated `_decode` may be let loose on it. On failure `*problem` and `*at` (byte within
 * the message) say why and where. */
bool fv_message_check(const char *type, const uint8_t *data, size_t bytes, const char **problem,
                      size_t *at);

struct fv_difference {
    char field[FOVEA_FIELD_PATH_BYTES]; /* "p_px[17][1]", or "" where the types differ */
    char expected[FV_FIELD_VALUE_BYTES], found[FV_FIELD_VALUE_BYTES];
};

/* Compare two messages bit for bit, all but the volatile fields. True: equal. False: the first
 * field that differs, and both values. */
bool fv_message_compare(const uint8_t *expected, size_t expected_bytes, const uint8_t *found,
                        size_t found_bytes, struct fv_difference *difference);

/* The same of two runs, of which each has clocks and a process of its own: what these measure is
 * left out, too, although it is recorded and replays have it again (latency_ns, utc_offset_ns,
 * utime, frames_late, resident_bytes, temperature_c). */
bool fv_message_compare_runs(const uint8_t *expected, size_t expected_bytes, const uint8_t *found,
                             size_t found_bytes, struct fv_difference *difference);

#ifdef __cplusplus
}
#endif
#endif

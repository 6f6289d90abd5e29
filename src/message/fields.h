/* What an encoded message holds, field by field, without decoding it.
 *
 * A table of every type's fields is made from include/lcmtypes/ at build time
 * (tools/lcm_fields.awk; a test holds it against lcm-gen's type hashes). With it a message is
 * checked before anything trusts its lengths (the generated `_decode` allocates what a message asks
 * for, negative counts included), and two messages are compared down to the first field that
 * differs. LCM's wire format: the type's hash (8 bytes), then the fields in order, all big-endian;
 * a string is its length with the zero (4 bytes) and its bytes.
 *
 * No memory of its own, bounded by the message's length, any thread. */
#ifndef FOVEA_MESSAGE_FIELDS_H
#define FOVEA_MESSAGE_FIELDS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "fovea/status.h"

#ifdef __cplusplus
extern "C" {
#endif

enum fv_wire {
    FV_WIRE_INT8,
    FV_WIRE_BYTE,
    FV_WIRE_BOOLEAN,
    FV_WIRE_INT16,
    FV_WIRE_INT32,
    FV_WIRE_INT64,
    FV_WIRE_FLOAT,
    FV_WIRE_DOUBLE,
    FV_WIRE_STRING,
    FV_WIRE_STRUCT
};

struct fv_field {
    const char *name;
    enum fv_wire wire;
    bool array;
    int32_t count;       /* elements; 0: another field holds the count */
    int32_t row;         /* numbers in each element, as in p[count][3]; 0: one */
    int32_t count_field; /* the field of the same struct that holds the count, -1: none */
    int32_t nested;      /* number of the nested type, -1: none */
};

struct fv_type {
    const char *name; /* "fovea.pose_t" */
    const struct fv_field *fields;
    int32_t field_count;
    int64_t (*hash)(void);
};

enum {
    FV_FIELDS_MAX = 48,
    FV_NESTING_MAX = 3,
    FV_FIELD_PATH_BYTES = 96,
    FV_FIELD_VALUE_BYTES = 64
};

/* All types, `*count` of them. */
const struct fv_type *fv_message_types(int32_t *count);

/* The type whose hash a message starts with; NULL: none of ours. */
const struct fv_type *fv_message_type_of(const uint8_t *data, size_t bytes);

/* One field, or one array of numbers, of a message. */
struct fv_leaf {
    char path[FV_FIELD_PATH_BYTES]; /* "stamp.time_ns", "parts[2].name" */
    enum fv_wire wire;
    uint32_t count;      /* numbers, row after row; 1 for a string */
    uint32_t row;        /* numbers in each row; 0: the array has no rows */
    const uint8_t *data; /* big-endian; strings: without the length */
    uint32_t bytes;
    size_t offset; /* of `data` in the message */
};

struct fv_walk {
    const uint8_t *data;
    size_t bytes, at;
    const char *problem; /* why the walk ended early; then `at` says where */
    int32_t depth;
    struct {
        const struct fv_type *type;
        int32_t field, element;        /* next to come */
        int32_t values[FV_FIELDS_MAX]; /* of integer fields, for counts */
    } level[FV_NESTING_MAX];
};

/* Begin with a message of this type (whose hash has been seen). */
void fv_message_walk(struct fv_walk *walk, const struct fv_type *type, const uint8_t *data,
                     size_t bytes);

/* FOVEA_OK: `leaf` is the next one. FOVEA_END: the message is whole and well-formed.
 * FOVEA_ERROR_INPUT: it is not, and walk->problem and walk->at say why and where. */
enum fovea_status fv_message_leaf(struct fv_walk *walk, struct fv_leaf *leaf);

/* Whether a message is of the named type ("fovea.inputs_t") and well-formed from end to end, so
 * that the generated `_decode` may be let loose on it. On failure `*problem` and `*at` (byte within
 * the message) say why and where. */
bool fv_message_check(const char *type, const uint8_t *data, size_t bytes, const char **problem,
                      size_t *at);

struct fv_difference {
    char field[FV_FIELD_PATH_BYTES]; /* "p_px[17][1]", or "" where the types differ */
    char expected[FV_FIELD_VALUE_BYTES], found[FV_FIELD_VALUE_BYTES];
};

/* Whether a field describes the moment or the machine, not the run, so that another run of the same
 * inputs fills it otherwise: the readings of clocks in fovea.statistics_t, its version and its
 * kernel set. `path` as in struct fv_leaf. */
bool fv_message_field_is_volatile(const struct fv_type *type, const char *path);

/* Compare two messages bit for bit, all but the volatile fields. True: equal. False: the first
 * field that differs, and both values. */
bool fv_message_compare(const uint8_t *expected, size_t expected_bytes, const uint8_t *found,
                        size_t found_bytes, struct fv_difference *difference);

#ifdef __cplusplus
}
#endif
#endif

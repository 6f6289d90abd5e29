/* Options in the address of a source, "name=value&name=value", described by a table. Init-only. */
#ifndef FOVEA_SUPPORT_URI_OPTIONS_H
#define FOVEA_SUPPORT_URI_OPTIONS_H

#include <stddef.h>
#include <stdint.h>

#include "fovea/status.h"

enum { FV_URI_WORD_BYTES = 256 }; /* longer names and values are cut, and then fit nothing */

/* How a value is read, and what it is stored as. */
enum fv_uri_kind {
    FV_URI_U64,  /* uint64_t */
    FV_URI_I32,  /* int32_t */
    FV_URI_REAL, /* double */
    FV_URI_FLAG, /* bool */
    FV_URI_WORD, /* int32_t (or an enum): index in `words` */
    FV_URI_SET,  /* uint32_t: bits 1 << index in `words`, of one word or several between commas */
    FV_URI_POSE, /* struct fv_uri_pose: X,Y,Z or X,Y,Z,RX,RY,RZ */
};

/* Where something is fixed: low to high of its option hold for the position; rotations about the x,
 * y and z axis, each at most 180 degrees either way, about fixed axes in this order. */
struct fv_uri_pose {
    double position_m[3], rotation_deg[3];
};

struct fv_uri_option {
    const char *name;
    enum fv_uri_kind kind;
    size_t offset; /* of the member in the options */
    double low, high;
    const char *unit;         /* for people; of a word or a set: the list of them */
    const char *const *words; /* ended by NULL */
};

struct fv_uri_table {
    const char *scheme; /* begins every error line */
    const struct fv_uri_option *options;
    size_t count; /* at most 64 */
    /* Takes options that begin with `other_prefix` (given without it); both NULL where there are
     * none. */
    const char *other_prefix;
    enum fovea_status (*other)(void *options, const char *name, const char *value,
                               struct fovea_error *error);
    const char *const (*renamed)[2]; /* {old, now}, ended by {NULL}; NULL where there are none */
};

/* Read all of `text` into `options`, which holds the defaults. Bit i of `*given` is set when row i
 * was given. FOVEA_ERROR_INPUT: `error` names the option, what was found and what is expected;
 * `options` is then partly filled. */
enum fovea_status fv_uri_options_parse(const struct fv_uri_table *table, const char *text,
                                       void *options, uint64_t *given, struct fovea_error *error);

/* The next piece of `*at` up to a character of `stops`, cut to fit `word`; `*at` moves behind it.
 */
void fv_uri_next_word(const char **at, const char *stops, char word[FV_URI_WORD_BYTES]);

/* The error for a name that is none of `names`: lists them, and the nearest. `what` is said of the
 * name. */
enum fovea_status fv_uri_unknown(const char *scheme, const char *what, const char *found,
                                 const char *const *names, size_t count, struct fovea_error *error);

#endif

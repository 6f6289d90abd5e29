/* Options of a command that set single members of a configuration, as a table: which option sets
 * what, and with which choices (an operation, a method) it does something. An option that would do
 * nothing is refused. */
#ifndef FOVEA_APP_LAB_MEMBER_OPTIONS_H
#define FOVEA_APP_LAB_MEMBER_OPTIONS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "app/config/options.h"
#include "fovea/status.h"

enum fv_member_kind {
    FV_MEMBER_REAL,  /* double */
    FV_MEMBER_FLOAT, /* float */
    FV_MEMBER_WHOLE, /* uint32_t */
    FV_MEMBER_SET_0, /* a flag: uint32_t gets 0 */
    FV_MEMBER_SET_1  /* a flag: uint32_t gets 1 */
};

struct fv_member_option {
    const char *option, *value, *help; /* as in struct fv_option */
    enum fv_member_kind kind;
    const char *member; /* of the configuration, as its errors name it */
    size_t offset;
    uint32_t with;      /* bits of the choices with which it does something */
    const char *needed; /* the same in words: "--method canny" */
};

/* A row that sets the member of that name of `type`. */
#define FV_MEMBER_ROW(type, option, value, kind, member, with, needed, help)                       \
    {                                                                                              \
        option, value, help, FV_MEMBER_##kind, #member, offsetof(type, member), with, needed       \
    }

/* What the command line says of an option. */
struct fv_member_given {
    const char *text; /* NULL: not given */
    bool flag;
};

enum { FV_MEMBER_OPTIONS_MAX = 16 };

/* A table that a row without a name ends, and what is given of it, in its order. */
struct fv_member_options {
    const struct fv_member_option *table;
    struct fv_member_given given[FV_MEMBER_OPTIONS_MAX];
};

/* Append options, whose end {0} marks, to a table of FV_OPTIONS_MAX + 1 of them. */
void fv_member_options_join(struct fv_option *options, const struct fv_option *more);

/* The same with the rows of a table. */
void fv_member_options_offer(struct fv_member_options *members, struct fv_option *options);

/* Set the members of `config` that are given; `choices`: the bits that are chosen. An error names
 * the option. Ranges are checked by whoever takes the configuration. */
enum fovea_status fv_member_options_read(const struct fv_member_options *members, uint32_t choices,
                                         void *config, struct fovea_error *error);

/* An error that begins with a member's name gets the option's. */
void fv_member_options_name(const struct fv_member_options *members, struct fovea_error *error);

/* The index of `text` in `count` names; an error lists them all. `text` NULL: `*found` stays. */
enum fovea_status fv_choice_read(const char *option, const char *text, const char *(*name)(int),
                                 int count, int *found, struct fovea_error *error);

#endif

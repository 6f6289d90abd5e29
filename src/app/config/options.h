/* Options of a command as a table: getopt_long does the parsing, this adds typed values, help and
 * one-line errors.
 *
 *     struct fv_option options[] = {
 *         {"frames", "N", FV_OPTION_POSITIVE, &frames, "stop after N frames"},
 *         {0},
 *     };
 *
 * Every command has `--help`, and `--man`, which prints its manual page from the same table.
 * Init-only. */
#ifndef FOVEA_APP_CONFIG_OPTIONS_H
#define FOVEA_APP_CONFIG_OPTIONS_H

#include <stdbool.h>
#include <stdint.h>

enum fv_option_kind {
    FV_OPTION_FLAG,     /* bool *: set to true; takes no value */
    FV_OPTION_TEXT,     /* const char **: points into argv */
    FV_OPTION_OPTIONAL, /* the same, and "" where no value is given: --name or --name=value */
    FV_OPTION_COUNT,    /* uint64_t *: decimal, 0 to 2^63 - 1 */
    FV_OPTION_POSITIVE, /* the same from 1 */
    FV_OPTION_LIST      /* struct fv_option_list *: may be given many times */
};

struct fv_option {
    const char *name;
    const char *value; /* what the help calls the value: "FILE", "N"; NULL for flags */
    enum fv_option_kind kind;
    void *target;
    const char *help;
};

enum { FV_OPTIONS_MAX = 40, FV_OPTION_LIST_MAX = 64 };

struct fv_option_list {
    int count;
    const char *values[FV_OPTION_LIST_MAX];
};

enum fv_options_result {
    FV_OPTIONS_READ, /* go on */
    FV_OPTIONS_HELP, /* help or manual page was printed: leave with FV_EXIT_OK */
    FV_OPTIONS_WRONG /* one line was printed to stderr: leave with FV_EXIT_WRONG */
};

/* Parse argv[1...]. `operands` says what may stand beside the options, for the help ("FILE", ""
 * for nothing); their number must be within [operands_min, operands_max]. After FV_OPTIONS_READ,
 * `*first` is the index in argv of the first operand (getopt_long moves operands behind the
 * options). */
enum fv_options_result fv_options_parse(const struct fv_option *options, const char *operands,
                                        int operands_min, int operands_max, int argc, char **argv,
                                        int *first);

/* What the manual page of the command that runs next says beside its options; a member that is NULL
 * is left out. */
struct fv_options_page {
    const char *help, *description;
    const char *program; /* NULL: a command of fovea; else a program of its own */
};
void fv_options_describe(const struct fv_options_page *page);

/* Whether the last FV_OPTIONS_HELP printed a manual page. The command may add sections to it
 * (support/man.h); fv_dispatch ends it with examples and references. */
bool fv_options_man_printed(void);

#endif

#include "app/config/options.h"

#include <errno.h>
#include <getopt.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "support/man.h"
#include "support/say.h"
#include "support/text.h"

static struct fv_options_page page;
static bool man_printed;

/* "fovea run", "fovea-web": what begins a line about a command, or a program of its own. */
static const char *title(const char *command)
{
    static char text[64];
    snprintf(text, sizeof text, "fovea %s", command);
    return page.program != NULL ? page.program : text;
}

static void help_print(const struct fv_option *options, const char *command, const char *operands)
{
    printf("usage: %s [OPTION]...%s%s\n\n", title(command), *operands ? " " : "", operands);
    for (const struct fv_option *option = options; option->name != NULL; option++) {
        const bool may = option->kind == FV_OPTION_OPTIONAL;
        int width = printf("  --%s%s%s%s", option->name,
                           may             ? "[="
                           : option->value ? " "
                                           : "",
                           option->value ? option->value : "", may ? "]" : "");
        printf("%*s %s\n", width < 26 ? 26 - width : 0, "", option->help);
    }
    printf("  --help                   this text\n"
           "  --man                    the manual page, for 'man -l'\n");
}

/* ---- the manual page ------------------------------------------------------------------------- */

void fv_options_describe(const struct fv_options_page *described)
{
    page = *described;
}

bool fv_options_man_printed(void)
{
    return man_printed;
}

static void man_print(const struct fv_option *options, const char *name, const char *operands)
{
    char rest[128];
    snprintf(rest, sizeof rest, "[OPTION]...%s%s", *operands ? " " : "", operands);
    const bool alone = page.program != NULL;
    const char *program = alone ? page.program : "fovea";
    fv_man_begin(program, alone ? NULL : name, page.help != NULL ? page.help : "");
    fv_man_synopsis(program, alone ? NULL : name, rest);
    if (page.description != NULL) {
        fv_man_section("DESCRIPTION");
        fv_man_text(page.description);
    }
    fv_man_section("OPTIONS");
    for (const struct fv_option *option = options; option->name != NULL; option++) {
        char term[64];
        snprintf(term, sizeof term, "--%s", option->name);
        const size_t used = strlen(term);
        const bool may = option->kind == FV_OPTION_OPTIONAL;
        if (may) snprintf(term + used, sizeof term - used, "[=%s]", option->value);
        fv_man_item(term, may ? NULL : option->value, option->help);
    }
    fv_man_item("--help", NULL, "list the options");
    fv_man_item("--man", NULL, "print this page");
    man_printed = true;
}

/* ---- reading --------------------------------------------------------------------------------- */

/* Every option of 0.1 that has another name now; CHANGELOG.md lists them. */
static const struct {
    const char *command, *old, *now;
} renamed[] = {
    {"map", "world", "map"},
    {"rectify", "view", "shape"},
    {"run", "tracks", "objects"},
};

static const char *name_now(const char *command, const char *name)
{
    for (size_t i = 0; i < sizeof renamed / sizeof renamed[0]; i++)
        if (strcmp(renamed[i].command, command) == 0 && strcmp(renamed[i].old, name) == 0)
            return renamed[i].now;
    return NULL;
}

static enum fv_options_result unknown(const struct fv_option *options, const char *command,
                                      const char *argument)
{
    char name[64];
    if (strncmp(argument, "--", 2) == 0) argument += 2;
    const size_t dash = argument[0] == '-'; /* "-frames" for "--frames" */
    size_t length = strcspn(argument, "=");
    snprintf(name, sizeof name, "%.*s", (int)(length < 63 ? length : 63), argument);
    const char *names[FV_OPTIONS_MAX], *now = name_now(command, name + dash);
    size_t count = 0;
    if (now != NULL) {
        fv_say("%s: --%s: found an option that Fovea 0.1 reads, expected its name now, '--%s'",
               title(command), name + dash, now);
        return FV_OPTIONS_WRONG;
    }
    for (; options[count].name != NULL && count < FV_OPTIONS_MAX; count++)
        names[count] = options[count].name;
    const char *nearest = fv_text_nearest(name + dash, names, count);
    fv_say("%s: unknown option '%s%s'%s%s%s ('%s --help' lists all)", title(command),
           argument[0] == '-' ? "" : "--", name, nearest ? ", nearest is '--" : "",
           nearest ? nearest : "", nearest ? "'" : "", title(command));
    return FV_OPTIONS_WRONG;
}

static bool count_read(const char *text, uint64_t least, uint64_t *value)
{
    char *end;
    if (*text < '0' || *text > '9') return false;
    errno = 0;
    unsigned long long number = strtoull(text, &end, 10);
    if (errno != 0 || *end != '\0' || number < least || number > INT64_MAX) return false;
    *value = number;
    return true;
}

static enum fv_options_result store(const struct fv_option *option, const char *command,
                                    const char *text)
{
    struct fv_option_list *list = option->target;
    switch (option->kind) {
    case FV_OPTION_FLAG:
        *(bool *)option->target = true;
        return FV_OPTIONS_READ;
    case FV_OPTION_TEXT:
        *(const char **)option->target = text;
        return FV_OPTIONS_READ;
    case FV_OPTION_OPTIONAL:
        *(const char **)option->target = text != NULL ? text : "";
        return FV_OPTIONS_READ;
    case FV_OPTION_COUNT:
    case FV_OPTION_POSITIVE:
        if (count_read(text, option->kind == FV_OPTION_POSITIVE, option->target))
            return FV_OPTIONS_READ;
        fv_say("%s: --%s: found '%s', expected a whole number from %d", title(command),
               option->name, text, option->kind == FV_OPTION_POSITIVE);
        return FV_OPTIONS_WRONG;
    case FV_OPTION_LIST:
        if (list->count < FV_OPTION_LIST_MAX) {
            list->values[list->count++] = text;
            return FV_OPTIONS_READ;
        }
        fv_say("%s: --%s: given more than %d times", title(command), option->name,
               FV_OPTION_LIST_MAX);
        return FV_OPTIONS_WRONG;
    }
    return FV_OPTIONS_WRONG;
}

enum { CODE_HELP = 1000, CODE_MAN = 1001, CODE_FIRST = 1002 };

static void table_fill(const struct fv_option *options, struct option *table)
{
    int count = 0;
    for (; options[count].name != NULL && count < FV_OPTIONS_MAX; count++) {
        const int argument = options[count].kind == FV_OPTION_FLAG       ? no_argument
                             : options[count].kind == FV_OPTION_OPTIONAL ? optional_argument
                                                                         : required_argument;
        table[count] = (struct option){options[count].name, argument, NULL, CODE_FIRST + count};
    }
    table[count] = (struct option){"help", no_argument, NULL, CODE_HELP};
    table[count + 1] = (struct option){"man", no_argument, NULL, CODE_MAN};
    table[count + 2] = (struct option){0};
}

static enum fv_options_result operands_check(const char *command, const char *operands, int minimum,
                                             int maximum, int argc, char **argv)
{
    if (argc - optind > maximum) {
        fv_say("%s: unexpected argument '%s', expected %s%s beside the options", title(command),
               argv[optind + maximum], maximum == 0 ? "nothing" : "only ",
               maximum == 0 ? "" : operands);
        return FV_OPTIONS_WRONG;
    }
    if (argc - optind < minimum) {
        fv_say("%s: argument missing, expected %s", title(command), operands);
        return FV_OPTIONS_WRONG;
    }
    return FV_OPTIONS_READ;
}

enum fv_options_result fv_options_parse(const struct fv_option *options, const char *operands,
                                        int operands_min, int operands_max, int argc, char **argv,
                                        int *first)
{
    struct option table[FV_OPTIONS_MAX + 3];
    const char *command = argv[0];
    table_fill(options, table);
    man_printed = false;
    opterr = 0;
    optind = 0; /* glibc: start afresh, so that one process may parse many times */
    for (;;) {
        int code = getopt_long(argc, argv, ":", table, NULL);
        if (code == -1) break;
        const char *argument = optind > 0 && optind <= argc ? argv[optind - 1] : "";
        /* Of "-frames" getopt_long has read the "f", and stays at the word. */
        const bool single = code == '?' && optopt > 0 && optopt < CODE_HELP;
        if (single && (argument[0] != '-' || argument[1] != optopt) && optind < argc)
            argument = argv[optind];
        if (code == CODE_HELP || (single && strcmp(argument, "-h") == 0)) {
            help_print(options, command, operands);
            return FV_OPTIONS_HELP;
        }
        if (code == CODE_MAN) {
            man_print(options, command, operands);
            return FV_OPTIONS_HELP;
        }
        if (code == ':') {
            const struct fv_option *option = &options[optopt - CODE_FIRST];
            fv_say("%s: --%s: value missing, expected %s", title(command), option->name,
                   option->value);
            return FV_OPTIONS_WRONG;
        }
        if (code == '?' && optopt >= CODE_HELP) {
            fv_say("%s: '%s': this option takes no value", title(command), argument);
            return FV_OPTIONS_WRONG;
        }
        if (code == '?') return unknown(options, command, argument);
        enum fv_options_result result = store(&options[code - CODE_FIRST], command, optarg);
        if (result != FV_OPTIONS_READ) return result;
    }
    *first = optind;
    return operands_check(command, operands, operands_min, operands_max, argc, argv);
}

/* Manual pages: made from the tables of the commands' options, complete, and free of accidental
 * macros. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#include "app/command.h"
#include "app/config/settings.h"

enum { TEXT_MAX = 1 << 18 };

static char help[TEXT_MAX], page[TEXT_MAX];

/* What "fovea COMMAND OPTION" prints; `command` NULL: "fovea OPTION". */
static void printed(const char *command, const char *option, char *text)
{
    int ends[2], status = -1;
    size_t used = 0;
    ssize_t got;
    assert_int_equal(pipe(ends), 0);
    fflush(NULL);
    const pid_t child = fork();
    if (child == 0) {
        char words[3][32], *arguments[4] = {words[0], words[1], words[2], NULL};
        const int count = command != NULL ? 3 : 2;
        snprintf(words[0], sizeof words[0], "fovea");
        snprintf(words[1], sizeof words[1], "%s", command != NULL ? command : option);
        snprintf(words[2], sizeof words[2], "%s", option);
        arguments[count] = NULL;
        dup2(ends[1], STDOUT_FILENO);
        close(ends[0]);
        close(ends[1]);
        exit(fv_dispatch(count, arguments));
    }
    close(ends[1]);
    while ((got = read(ends[0], text + used, TEXT_MAX - 1 - used)) > 0)
        used += (size_t)got;
    close(ends[0]);
    text[used] = '\0';
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_int_equal(status, 0);
}

/* `name` as the page prints it: bold, with its dashes escaped. */
static void assert_item(const char *command, const char *name, size_t length)
{
    char item[160];
    size_t used = (size_t)snprintf(item, sizeof item, "\n.TP\n\\fB");
    for (size_t i = 0; i < length && used + 8 < sizeof item; i++) {
        if (name[i] == '-') item[used++] = '\\';
        item[used++] = name[i];
    }
    snprintf(item + used, sizeof item - used, "\\fR");
    if (strstr(page, item) == NULL)
        fail_msg("fovea %s --man: no item '%.*s'", command, (int)length, name);
}

static void every_option_of_the_help_is_in_the_page(void **state)
{
    (void)state;
    for (const struct fv_command *command = fv_commands; command->name != NULL; command++) {
        int options = 0;
        printed(command->name, "--help", help);
        printed(command->name, "--man", page);
        for (const char *at = help; (at = strstr(at, "\n  --")) != NULL; options++) {
            at += 3;
            assert_item(command->name, at, strcspn(at, " \n"));
        }
        assert_true(options >= 2); /* --help and --man */
        assert_non_null(strstr(page, command->description == NULL ? "?" : ".SH DESCRIPTION\n"));
        assert_non_null(strstr(page, ".SH EXAMPLES\n"));
        const bool sources = strstr(help, "\nsources:\n") != NULL;
        assert_int_equal(sources, strstr(page, "\n.SH SOURCES\n") != NULL);
        if (sources) assert_item(command->name, "sim:", 4);
    }
}

static void the_help_of_help_is_the_list_of_commands(void **state)
{
    (void)state;
    printed(NULL, "help", help);
    for (const struct fv_command *command = fv_commands; command->name != NULL; command++)
        assert_non_null(strstr(help, command->help));
    printed("help", "--help", page);
    assert_string_equal(page, help);
}

static void the_page_of_the_program_lists_every_command(void **state)
{
    (void)state;
    printed(NULL, "--man", page);
    for (const struct fv_command *command = fv_commands; command->name != NULL; command++)
        assert_item("", command->name, strlen(command->name));
    assert_item("", "--version", 9);
}

static void the_page_of_config_lists_every_key(void **state)
{
    (void)state;
    printed("config", "--man", page);
    for (size_t i = 0; i < fv_settings_key_count; i++)
        assert_item("config", fv_settings_keys[i].name, strlen(fv_settings_keys[i].name));
}

/* A line of text that begins with a dot or a quote would be taken for a macro and vanish. */
static void lines_begin_with_no_macro_but_ours(void **state)
{
    static const char *const macros[] = {".TH FOVEA", ".SH ",  ".TP\n", ".PP\n",
                                         ".nf\n",     ".fi\n", ".br\n"};
    (void)state;
    for (const struct fv_command *command = fv_commands;; command++) {
        printed(command->name, "--man", page);
        assert_true(strncmp(page, ".TH FOVEA", 9) == 0);
        for (const char *line = page; *line != '\0'; line = strchr(line, '\n') + 1) {
            bool known = *line != '.' && *line != '\'';
            for (size_t i = 0; i < sizeof macros / sizeof macros[0]; i++)
                known = known || strncmp(line, macros[i], strlen(macros[i])) == 0;
            if (!known) fail_msg("%.*s", (int)strcspn(line, "\n"), line);
        }
        if (command->name == NULL) break;
    }
}

static void man_renders_the_pages_without_a_warning(void **state)
{
    (void)state;
    if (system("command -v man >/dev/null && command -v groff >/dev/null") != 0) {
        printf("SKIPPED: man and groff are not installed\n");
        skip();
    }
    for (const struct fv_command *command = fv_commands;; command++) {
        char name[] = "/tmp/fovea-man-XXXXXX", line[256];
        printed(command->name, "--man", page);
        const int fd = mkstemp(name);
        assert_true(fd >= 0);
        assert_int_equal(write(fd, page, strlen(page)), strlen(page));
        close(fd);
        snprintf(line, sizeof line,
                 "LC_ALL=C.UTF-8 man --warnings -E UTF-8 -l -Tutf8 -Z %s 2>&1 >/dev/null | head -5",
                 name);
        FILE *warnings = popen(line, "r");
        assert_non_null(warnings);
        line[fread(line, 1, sizeof line - 1, warnings)] = '\0';
        pclose(warnings);
        unlink(name);
        if (line[0] != '\0') fail_msg("%s: %s", command->name ? command->name : "fovea", line);
        if (command->name == NULL) break;
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_option_of_the_help_is_in_the_page),
        cmocka_unit_test(the_help_of_help_is_the_list_of_commands),
        cmocka_unit_test(the_page_of_the_program_lists_every_command),
        cmocka_unit_test(the_page_of_config_lists_every_key),
        cmocka_unit_test(lines_begin_with_no_macro_but_ours),
        cmocka_unit_test(man_renders_the_pages_without_a_warning),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

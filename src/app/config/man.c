#include "app/config/man.h"

#include <ctype.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

#include "app/command.h"
#include "fovea/fovea.h"

/* One character of a text, as groff takes it literally. */
static void put(char c)
{
    static const struct {
        char c;
        const char *escape;
    } escapes[] = {{'\\', "\\e"},  {'-', "\\-"},   {'`', "\\(ga"}, {'\'', "\\(aq"},
                   {'"', "\\(dq"}, {'^', "\\(ha"}, {'~', "\\(ti"}};
    for (size_t i = 0; i < sizeof escapes / sizeof escapes[0]; i++) {
        if (escapes[i].c != c) continue;
        fputs(escapes[i].escape, stdout);
        return;
    }
    putchar(c);
}

/* A dot at the start of a line would be a macro. */
static void put_words(const char *text)
{
    if (*text == '.') fputs("\\&", stdout);
    for (; *text != '\0'; text++)
        put(*text);
}

void fv_man_begin(const char *command, const char *help)
{
    /* No date: the same sources give the same page. */
    fputs(".TH FOVEA", stdout);
    if (command != NULL) fputs("\\-", stdout);
    for (const char *c = command; c != NULL && *c != '\0'; c++)
        putchar(toupper((unsigned char)*c));
    printf(" 1 \"\" \"Fovea %s\" \"Fovea Manual\"\n", FOVEA_VERSION);
    fv_man_section("NAME");
    printf("fovea%s%s \\- ", command != NULL ? "\\-" : "", command != NULL ? command : "");
    put_words(help);
    putchar('\n');
}

void fv_man_section(const char *title)
{
    printf(".SH %s\n", title);
}

void fv_man_text(const char *text)
{
    bool line_start = true;
    for (; *text != '\0'; text++) {
        if (*text == '\n') {
            fputs(text[1] == '\n' ? "\n.PP\n" : "\n", stdout);
            text += text[1] == '\n';
            line_start = true;
            continue;
        }
        if (line_start && *text == '.') fputs("\\&", stdout);
        line_start = false;
        put(*text);
    }
    putchar('\n');
}

void fv_man_item(const char *term, const char *value, const char *text)
{
    fputs(".TP\n\\fB", stdout);
    put_words(term);
    fputs("\\fR", stdout);
    if (value != NULL) {
        fputs(" \\fI", stdout);
        put_words(value);
        fputs("\\fR", stdout);
    }
    putchar('\n');
    fv_man_text(text);
}

void fv_man_line(const char *label, const char *text)
{
    fputs(".br\n", stdout);
    put_words(label);
    fv_man_text(text);
}

void fv_man_example(const char *lines)
{
    fputs(".nf\n", stdout);
    fv_man_text(lines);
    fputs(".fi\n", stdout);
}

void fv_man_synopsis(const char *command, const char *rest)
{
    fv_man_section("SYNOPSIS");
    fputs("\\fBfovea", stdout);
    if (command != NULL) printf(" %s", command);
    fputs("\\fR ", stdout);
    fv_man_text(rest);
}

void fv_man_see_also(const char *command)
{
    const char *before = "";
    fv_man_section("SEE ALSO");
    if (command != NULL) {
        printf("\\fBfovea\\fR(1)");
        before = ",\n";
    }
    for (const struct fv_command *other = fv_commands; other->name != NULL; other++) {
        if (command != NULL && strcmp(other->name, command) == 0) continue;
        printf("%s\\fBfovea\\-%s\\fR(1)", before, other->name);
        before = ",\n";
    }
    putchar('\n');
}

/* ---- the program ----------------------------------------------------------------------------- */

void fv_man_program(void)
{
    fv_man_begin(NULL, "fixed-memory vision runtime for robots");
    fv_man_synopsis(NULL, "COMMAND [OPTION]...\n\nfovea --version\n\nfovea --man");
    fv_man_section("DESCRIPTION");
    fv_man_text(
        "Takes the frames of a camera and sends poses, maps, detections, objects and features as "
        "LCM messages, every frame, from one real-time loop in one block of memory. A run can be "
        "recorded and replayed bit for bit.");
    fv_man_section("COMMANDS");
    for (const struct fv_command *command = fv_commands; command->name != NULL; command++)
        fv_man_item(command->name, NULL, command->help);
    fv_man_item("help", NULL, "list the commands");
    fv_man_section("OPTIONS");
    fv_man_item("--version", NULL, "print the version");
    fv_man_item("--help", NULL, "list the commands; of a command: list its options");
    fv_man_item("--man", NULL, "print this page; of a command: print its page");
    fv_man_section("EXIT STATUS");
    fv_man_item("0", NULL, "success");
    fv_man_item("1", NULL, "failed while running: the machine, a full disk, a replay that differs");
    fv_man_item("2", NULL,
                "wrong input: arguments, configuration, calibration, recording, model or map. One "
                "line names the file, the key or byte, what was found and what was expected");
    fv_man_section("ENVIRONMENT");
    fv_man_item("FOVEA_CPU", NULL,
                "highest kernel set that is used: c, sse4, avx2, avx512, neon, dotprod or i8mm "
                "(default: the best that the processor has; results are the same)");
    fv_man_item("FOVEA_PLUGINS", NULL,
                "folder of fovea-video.so and fovea-libcamera, instead of the installed one");
    fv_man_item("NO_COLOR", NULL, "when it is set and not empty, the terminal shows no colours");
    fv_man_see_also(NULL);
}

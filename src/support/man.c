#include "support/man.h"

#include <ctype.h>
#include <stdio.h>

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

/* "program" or "program-command". */
static void put_name(const char *program, const char *command, bool capitals)
{
    char name[64];
    snprintf(name, sizeof name, "%s%s%s", program, command != NULL ? "-" : "",
             command != NULL ? command : "");
    for (const char *c = name; *c != '\0'; c++)
        put(capitals ? (char)toupper((unsigned char)*c) : *c);
}

void fv_man_begin(const char *program, const char *command, const char *help)
{
    /* No date: the same sources give the same page. */
    fputs(".TH ", stdout);
    put_name(program, command, true);
    printf(" 1 \"\" \"Fovea %s\" \"Fovea Manual\"\n", FOVEA_VERSION);
    fv_man_section("NAME");
    put_name(program, command, false);
    fputs(" \\- ", stdout);
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

void fv_man_synopsis(const char *program, const char *command, const char *rest)
{
    fv_man_section("SYNOPSIS");
    fputs("\\fB", stdout);
    put_words(program);
    if (command != NULL) printf(" %s", command);
    fputs("\\fR ", stdout);
    fv_man_text(rest);
}

void fv_man_reference(const char *program, const char *command, bool first)
{
    if (first)
        fv_man_section("SEE ALSO");
    else
        fputs(",\n", stdout);
    fputs("\\fB", stdout);
    put_name(program, command, false);
    fputs("\\fR(1)", stdout);
}

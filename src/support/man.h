/* Manual pages in the man(7) macros, on stdout: every text is escaped, so that dashes, quotes and
 * leading dots stay themselves. Of the programs: not in the library. Init-only. */
#ifndef FOVEA_SUPPORT_MAN_H
#define FOVEA_SUPPORT_MAN_H

#include <stdbool.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Title and NAME section: of `program`, or of "program command" where `command` is not NULL. */
void fv_man_begin(const char *program, const char *command, const char *help);
void fv_man_section(const char *title);
/* Running text; an empty line in it begins a new paragraph. */
void fv_man_text(const char *text);
/* A term in bold with its value in italics (NULL: none), and what it means; fv_man_line adds a line
 * to that. */
void fv_man_item(const char *term, const char *value, const char *text);
void fv_man_line(const char *label, const char *text);
/* Lines as they stand. */
void fv_man_example(const char *lines);
/* The usage line: "program command" in bold, the rest behind it. */
void fv_man_synopsis(const char *program, const char *command, const char *rest);
/* One page of the section SEE ALSO, which the first begins; the caller ends it with a new line. */
void fv_man_reference(const char *program, const char *command, bool first);

#ifdef __cplusplus
}
#endif
#endif
